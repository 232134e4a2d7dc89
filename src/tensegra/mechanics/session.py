"""A structure under one's hand: solved once, then moved from where it stands, certified at every move."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tensegra.mechanics.derivatives import Given
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import Actuation, Inputs, inputs_under, stage_inputs
from tensegra.mechanics.path import ACTUATION, Prepared, equilibrium_of, missing_start, prepare, softest_modes
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.stages import Leg, follow_leg, reference_tensions
from tensegra.mechanics.status import CriticalPoint
from tensegra.structure import Structure

IN_ONE_STEP = PathSettings(first_step=1.0)
"""A move under one's hand is short: it is tried as a whole first."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Where a session stands: what `Session.stand` goes back to.

    Attributes
    ----------
    run
        What acts after the stages.
    inputs
        All that is prescribed, as arrays; positions about the arrays' own origin.
    """

    run: Actuation
    inputs: Inputs = field(repr=False)
    end: StageEnd = field(repr=False)


class Session:
    """A structure that stands somewhere and is moved on from there.

    A move goes along the straight way from the inputs where the structure stands to the new ones, so it ends
    where the history leads, not where the same inputs would lead from the beginning: that is what a motor
    does too. A move that fails leaves the structure where it was.

    Parameters
    ----------
    structure
        The structure; its stages are solved at once.
    settings
        How paths are followed; moves are tried in one step where nothing else is said.

    Raises
    ------
    SolverError
        Where the stages do not end in a stable equilibrium.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> session = Session(library.paper_beam())
    >>> moved = session.move({"A14": 0.05})
    >>> str(moved.status), moved.status == session.equilibrium.status
    ('stable', True)
    """

    def __init__(self, structure: Structure, settings: PathSettings | None = None) -> None:
        self._prepared: Prepared = prepare(structure, settings=settings or IN_ONE_STEP)
        self._prepared.equilibria[-1].raise_for_status()
        self._modes = softest_modes(self._prepared)
        self.reset()

    @property
    def structure(self) -> Structure:
        """The structure."""
        return self._prepared.structure

    @property
    def equilibrium(self) -> Equilibrium:
        """Where the structure stands."""
        return equilibrium_of(self.structure, self._prepared.ground, self._end)

    @property
    def reference(self) -> Equilibrium:
        """Where the stages end: displacements are measured from there."""
        return self._prepared.equilibria[-1]

    @property
    def base(self) -> Inputs:
        """What is prescribed where the stages end."""
        return self._prepared.inputs

    @property
    def critical_points(self) -> tuple[CriticalPoint, ...]:
        """Where the last move lost its stability, if it did."""
        return tuple(self._end.critical_points[0])

    @property
    def standing(self) -> Standing:
        """Where the structure stands, to come back to."""
        return Standing(self._run, self._inputs, self._end)

    def stand(self, standing: Standing) -> Equilibrium:
        """Go back to where this session stood before, without a way there.

        What was found is never changed, so it is the same equilibrium to the last bit, on the same branch,
        which a move back need not be.

        Parameters
        ----------
        standing
            What `standing` was then.
        """
        self._run, self._inputs, self._end = standing.run, standing.inputs, standing.end
        return self.equilibrium

    def reset(self) -> None:
        """Go back to where the stages end."""
        self.stand(Standing(Actuation({}, {}, {}, {}), self._prepared.inputs, self._prepared.ends[-1]))

    def move(
        self,
        actuation: Mapping[str, float] | None = None,
        temperature: Mapping[str, float] | None = None,
        *,
        loads: Mapping[tuple[str, str], float] | None = None,
        positions: Mapping[tuple[str, str], float] | None = None,
    ) -> Equilibrium:
        """Move to new inputs; what is not named stays as it is.

        Parameters
        ----------
        actuation, temperature, loads, positions
            As in `solve_path`: values after the stages, not changes since the last move.

        Returns
        -------
        Equilibrium
            Where the structure stands, or why it could not be moved (the session stays where it was).

        Raises
        ------
        ModelError
            For an input that names nothing in the structure or cannot be.
        """
        given: tuple[Mapping[Any, float], ...] = (
            actuation or {},
            temperature or {},
            loads or {},
            positions or {},
        )
        run = Actuation(
            *({**dict(old), **dict(new)} for old, new in zip(self._run.groups(), given, strict=True))
        )
        prepared, arrays = self._prepared, self._prepared.arrays
        inputs = inputs_under(prepared.structure, arrays, prepared.inputs, run)
        way = stage_inputs(arrays, self._inputs, inputs)
        leg = Leg(
            ACTUATION,
            way,
            arrays.stiffness,
            self._end.nodes,
            reference_tensions([prepared.ends[-1].tensions, self._end.tensions], arrays.stiffness),
            modes=self._modes,
        )
        end = follow_leg(prepared.ground, leg)
        found = equilibrium_of(prepared.structure, prepared.ground, end)
        if missing_start(end, 0) is None:
            self._end, self._inputs, self._run = end, inputs, run
        return found

    def path(self) -> EquilibriumPath:
        """Return where the structure stands as a path, with its derivatives, displacements and plot."""
        prepared, arrays = self._prepared, self._prepared.arrays
        load = self._end.load
        ground = prepared.ground
        return EquilibriumPath(
            structure=prepared.structure,
            stages=prepared.equilibria,
            actuation=self.equilibrium if self._run.acts else None,
            given=Given(prepared.structure, arrays, self._inputs, self._run),
            load=load,
            freedom=ground.freedom(load.force),
            critical_points=tuple(self._end.critical_points[0]),
        )
