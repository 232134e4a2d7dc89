"""What one page has before it: a structure that stands somewhere, its knobs, and the way back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics import Equilibrium, Session, Status
from tensegra.mechanics.session import Standing
from tensegra.mechanics.status import axis_index, index_of
from tensegra.structure import Structure
from tensegra.studio.knobs import ALTERING, Knob, actuation_of, checked, load_knob, varied

__all__ = ["Answer", "Desk"]

FloatArray = NDArray[np.float64]

MOST_UNDONE = 200
"""Gestures that can be taken back."""

MOST_SLACK = 200
"""Slack cables that are named; of more, their number is told."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Where the structure stands, or why it could not be moved.

    Attributes
    ----------
    found
        The equilibrium, or the one that was not reached.
    moved
        Whether the structure stands there now.
    before
        Where it stood before, of a snap; else None.
    seconds
        Time of the solve.
    """

    found: Equilibrium
    moved: bool
    before: FloatArray | None
    seconds: float


@dataclass(frozen=True)
class _Place:
    """A place on the way of a page: what its knobs said, the structure so altered, where it stood."""

    values: dict[str, float]
    session: Session
    standing: Standing


@dataclass(eq=False)
class Desk:
    """A structure under one page's hand.

    Nothing of it is shared: the structure is copied, since a structure keeps its solvers with itself.

    Parameters
    ----------
    structure
        What is moved.
    knobs
        What may be set.

    Raises
    ------
    SolverError
        Where the stages do not end in a stable equilibrium.
    """

    structure: Structure
    knobs: dict[str, Knob]
    values: dict[str, float] = field(init=False)
    session: Session = field(init=False)
    snaps: list[str] = field(init=False, default_factory=list)
    _undo: list[_Place] = field(init=False, default_factory=list)
    _gesture: object = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.structure = self.structure.replace()
        self.values = {knob.key: knob.value for knob in self.knobs.values()}
        self.session = Session(varied(self.structure, self.knobs, self.values))
        self._start()

    def _start(self) -> Answer:
        """Take the structure to the knobs' first values, or leave it where its stages end."""
        answer = self._move({knob.key: knob.value for knob in self.knobs.values()})
        if not answer.moved:
            self.values = {key: knob.at_rest for key, knob in self.knobs.items()}
            run = actuation_of(self.session.structure, self.knobs, self.values)
            self.session.move(run.actuation, run.temperature, loads=run.loads, positions=run.positions)  # type: ignore[arg-type]
        return answer

    @property
    def found(self) -> Equilibrium:
        """Where the structure stands."""
        return self.session.equilibrium

    @property
    def reference(self) -> FloatArray:
        """From where displacements are measured, ``(n_nodes, 3)``."""
        return self.session.reference.nodes

    def move(self, values: object, gesture: object = None) -> Answer:
        """Set some knobs and move there from where the structure stands.

        Parameters
        ----------
        values
            By the names of knobs; the others stay.
        gesture
            Moves of one gesture (a drag) are taken back together.

        Raises
        ------
        ModelError
            For a value that cannot be; the structure stays where it is.
        """
        wanted = self.values | checked(self.knobs, values)
        place = _Place(self.values, self.session, self.session.standing)
        answer = self._move(wanted)
        if answer.moved and (gesture is None or gesture != self._gesture):
            self._undo = [*self._undo, place][-MOST_UNDONE:]
        if answer.moved:
            self._gesture = gesture
        return answer

    def _move(self, wanted: Mapping[str, float]) -> Answer:
        before, start = self.session.equilibrium.nodes, perf_counter()
        session = self.session
        if any(
            self.knobs[key].quantity in ALTERING and value != self.values.get(key)
            for key, value in wanted.items()
        ):
            try:
                session = Session(varied(self.structure, self.knobs, wanted))
            except SolverError as error:
                raise ModelError(f"the structure so altered does not stand: {error}") from None
        run = actuation_of(session.structure, self.knobs, wanted)
        found = session.move(run.actuation, run.temperature, loads=run.loads, positions=run.positions)  # type: ignore[arg-type]
        seconds = perf_counter() - start
        # A session stays where it was if it could not be moved to the end.
        moved = found.status is not Status.FAILED and session.standing.run == run
        if moved:
            self.values, self.session = dict(wanted), session
        snapped = moved and found.status is Status.SNAPPED
        if snapped:
            self.snaps.extend(str(point) for point in session.critical_points)
        return Answer(found, moved, before if snapped else None, seconds)

    def undo(self) -> Answer:
        """Go back to where the structure stood before the last gesture, exactly.

        Raises
        ------
        ModelError
            There is nothing to take back.
        """
        if not self._undo:
            raise ModelError("undo: nothing is left to take back")
        place = self._undo.pop()
        self.values, self.session, self._gesture = place.values, place.session, None
        found = self.session.stand(place.standing)
        return Answer(found, moved=True, before=None, seconds=0.0)

    def reset(self) -> Answer:
        """Go back to the beginning, from which the knobs' first values are reached anew."""
        place = _Place(self.values, self.session, self.session.standing)
        first = {knob.key: knob.value for knob in self.knobs.values()}
        self.session = Session(varied(self.structure, self.knobs, first))
        self.values = first
        answer = self._start()
        self._undo, self._gesture, self.snaps = [*self._undo, place][-MOST_UNDONE:], None, []
        return answer

    def add_load(self, node: object, axis: object) -> Knob:
        """Offer a force on a node along an axis, of the size of the tensions.

        Raises
        ------
        ModelError
            There is no such node or axis, or it is offered already.
        """
        most = float(np.nanmax(np.abs(self.found.tensions), initial=0.0)) or 1.0
        knob = load_knob(self.structure, str(node), str(axis), _round(most / 10.0))
        if knob.key in self.knobs:
            raise ModelError(f"load: {knob.target} is among the inputs already")
        self.knobs[knob.key] = knob
        self.values[knob.key] = 0.0
        return knob

    def displacement(self, nodes: list[str], axis: str) -> float:
        """Return the mean displacement of some nodes along an axis from where the stages end.

        Raises
        ------
        ModelError
            For an unknown node or axis, or none.
        """
        if not nodes:
            raise ModelError.at("nodes", nodes, "one node or more")
        rows = [index_of(self.structure.nodes, node, "node") for node in nodes]
        return float((self.found.nodes - self.reference)[rows, axis_index(axis)].mean())

    def told(self, answer: Answer) -> dict[str, Any]:
        """Return what the page writes beside the picture."""
        found = self.found if not answer.moved else answer.found
        names = self.structure.member_ids
        tensions = found.tensions
        most = int(np.nanargmax(tensions)) if len(tensions) else 0
        held = np.flatnonzero(np.any(found.reactions != 0.0, axis=1))
        slack = found.slack_members
        return {
            "status": str(answer.found.status),
            "reason": answer.found.reason,
            "moved": answer.moved,
            "values": self.values,
            "lowest_eigenvalue": _finite(found.lowest_eigenvalue),
            "residual": _finite(found.residual),
            "strain_energy": _finite(found.strain_energy),
            "size": found.arrays.size,
            "largest_force": float(np.nanmax(np.abs(tensions), initial=0.0)),
            "largest_tension": [names[most], float(tensions[most])],
            "slack": list(slack[:MOST_SLACK]),
            "n_slack": len(slack),
            "reactions": {self.structure.node_ids[n]: found.reactions[n].tolist() for n in held[:MOST_SLACK]},
            "rigid_motions": list(found.rigid_motions),
            "mechanisms": [list(nodes) for nodes in found.mechanisms],
            "snaps": self.snaps[-5:],
            "milliseconds": 1e3 * answer.seconds,
            "undo": len(self._undo),
        }


def _round(value: float) -> float:
    """Return a value with one digit, for the end of a slider."""
    return float(f"{value:.0e}")


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
