"""Falls of runs of a stage: descents, off every saddle, until the structure stands or nothing holds it."""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import descend, follow
from tensegra.mechanics.arrays import FloatArray, IndexArray
from tensegra.mechanics.gauge import Gauge
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import Outcome, Runs
from tensegra.mechanics.turn import turned_by

FLAT_TENSION = 1e-11
"""Tensions below this share of the reference tension are none: the prestress is lost."""

PUSH = 1e-3
"""Largest move of a node, as a share of the size, by which a fall is pushed off a saddle."""

NEARLY_NEUTRAL = 1e-9
"""Share of the largest EA/l₀ that a negative eigenvalue has to have for a fall to leave its saddle."""

NEARLY_BALANCED, NEAR_BALANCE = 1e-5, 1e-2
"""Residual from which on a fall that creeps is brought into balance by Newton's method, and how far from
there, as a share of the size, the equilibrium may lie."""

MOST_SADDLES = 40
"""Saddles that one fall is pushed off before it is given up."""

MOST_GRIPS = 8
"""Times that other coordinates are held for the neutral motions in one fall."""


class Handed(NamedTuple):
    """What takes a run on from where it is, with other coordinates held for its neutral motions.

    `solver` holds coordinates that are good there; `stage` are the inputs of the run alone; from `start`,
    positions at λ = 0, ``(1, n_nodes, 3)``, supports move on as before, while what is held for neutral
    motions rests where the run is.
    """

    solver: Solver
    stage: StageInputs
    start: FloatArray


class Falls:
    """Lets runs of a stage fall.

    Parameters
    ----------
    gauge, runs
        The runs.
    reference
        What counts as a tension of the structure, ``(n_runs,)``.

    Attributes
    ----------
    handed
        Who takes a run on, once what the solver holds was worn.
    """

    def __init__(self, gauge: Gauge, runs: Runs, reference: FloatArray) -> None:
        self.gauge, self.runs, self.solver = gauge, runs, gauge.solver
        self.flat_below = FLAT_TENSION * reference
        self.handed: dict[int, Handed] = {}

    def fall(self, runs: IndexArray, nodes: FloatArray, parameter: FloatArray) -> Outcome:
        """Descend from positions ``(n, 3 n_nodes)`` under the inputs at `parameter`, ``(n,)``."""
        nodes = self._turned(runs, nodes, parameter)
        fallen = self.solver.outcome(nodes.reshape(len(runs), -1, 3), len(runs), parameter)
        self._descend(runs, fallen)
        for _ in range(MOST_SADDLES):
            for row in np.flatnonzero(fallen.end == descend.SADDLE).tolist():
                push = self._off_saddle(int(runs[row]), fallen.nodes[row], float(fallen.parameter[row]))
                if push is None:
                    fallen.end[row] = descend.NEUTRAL
                else:
                    fallen.nodes[row] += push
            stuck = np.flatnonzero(fallen.end == descend.SADDLE)
            if not len(stuck):
                break
            again = fallen.take(stuck)
            self._descend(runs[stuck], again)
            fallen.put(stuck, again)
        fallen.end[fallen.end == descend.SADDLE] = descend.LOST
        self._polish(runs, fallen)
        return fallen

    def _turned(self, runs: IndexArray, nodes: FloatArray, parameter: FloatArray) -> FloatArray:
        """Turn bodies first as their loads do."""
        turning = self.solver.turning
        if turning is None or len(turning) == len(self.gauge.motions):
            return nodes
        turned = nodes.copy()
        for row, run in enumerate(runs.tolist()):
            force = np.where(self.solver.given.free, self.gauge.load(run, float(parameter[row])).force, 0.0)
            turned[row] = turned_by(nodes[row].reshape(-1, 3), force, turning).ravel()
            if len(self.gauge.motions) and np.abs(turned[row] - nodes[row]).max() > 0.0:
                # What is held for neutral motions was held where the body is no more.
                self.hand_on(run, turned[row])
        return turned

    def _descend(self, runs: IndexArray, fallen: Outcome) -> None:
        """Descend, and go on with other coordinates held where those that are held are worn."""
        handed = np.array([run in self.handed for run in runs.tolist()], dtype=np.bool_)
        shared = np.flatnonzero(~handed)
        part = fallen.take(shared)
        self.solver.fall(self.runs, runs[shared], part, self.flat_below[runs[shared]])
        fallen.put(shared, part)
        worn = handed.copy()
        worn[shared] = self.solver.grip.is_worn(part.nodes)
        for row in np.flatnonzero(worn).tolist():
            self._descend_alone(int(runs[row]), row, fallen)

    def _descend_alone(self, run: int, row: int, fallen: Outcome) -> None:
        one = fallen.take(np.array([row]))
        for _ in range(MOST_GRIPS):
            worn = run not in self.handed or self.handed[run].solver.grip.is_worn(one.nodes)[0]
            solver, stage, start = self.hand_on(run, one.nodes[0]) if worn else self.handed[run]
            alone = solver.runs(stage, self.gauge.stiffness_of(run), start, 1)
            solver.fall(alone, np.zeros(1, dtype=np.int64), one, self.flat_below[[run]])
            if not solver.grip.is_worn(one.nodes)[0]:
                break
        fallen.put(np.array([row]), one)

    def hand_on(self, run: int, nodes: FloatArray) -> Handed:
        """Let others take a run on from some positions, ``(3 n_nodes,)``, with coordinates held there."""
        given, at = self.solver.given, nodes.reshape(-1, 3)
        row = self.runs.start[run if len(self.runs.start) > 1 else 0].reshape(-1, 3)
        start = np.where(given.free, at, row)[None]
        self.handed[run] = Handed(self.solver.held_anew(at), self.gauge.stage.of_run(run), start)
        return self.handed[run]

    def _polish(self, runs: IndexArray, fallen: Outcome) -> None:
        """Bring falls into balance that have come near to it, and creep along too soft a valley."""
        creeping = np.flatnonzero((fallen.end == descend.LOST) & (fallen.residual <= NEARLY_BALANCED))
        creeping = creeping[fallen.parameter[creeping] < 1.0]
        creeping = creeping[[run not in self.handed for run in runs[creeping].tolist()]]
        if not len(creeping):
            return
        part = fallen.take(creeping)
        self.solver.stand(self.runs.take(runs[creeping]), part)
        away = np.abs(part.nodes - fallen.nodes[creeping]).max(axis=1, initial=0.0)
        stands = (part.end == follow.OUT_OF_STEPS) & (away <= NEAR_BALANCE * self.solver.arrays.size)
        part.end[:] = np.where(stands, descend.STANDS, descend.LOST)
        fallen.put(creeping[stands], part.take(np.flatnonzero(stands)))

    def _off_saddle(self, run: int, nodes: FloatArray, parameter: float) -> FloatArray | None:
        """Return a small move along the lowest mode, to the side that a fixed vector without symmetry says.

        None where the eigenvalue is so near zero that the energy does not tell one side from the other.
        """
        tangent = self.gauge.measured(run, nodes, parameter)
        spectrum = tangent.spectrum(1)
        if spectrum.values[0] > -NEARLY_NEUTRAL * tangent.stiffness_scale:
            return None
        mode = spectrum.vectors[0].ravel()
        side = np.sign(np.random.default_rng(0).standard_normal(mode.size) @ mode) or 1.0
        move: FloatArray = side * PUSH * self.solver.arrays.size / np.abs(mode).max() * mode
        return move
