"""How well the coordinates that are held for neutral motions tell them apart, and holding others in time.

Coordinates that are held for the rigid motions of a body carry nothing and change nothing, as long as no
neutral motion leaves them all where they are. A body that turns can bring them there: two nodes that are held
against a turn come to lie beside each other, and what is held then is a motion that is not rigid. Long before
that the run is handed on to a solver that holds others, chosen where the run is.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray
from tensegra.mechanics.gauge import Gauge
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import Runs

WORN = 0.1
"""Share of the volume that the held rows of the neutral motions span at first, from which on down others are
held."""


class Handed(NamedTuple):
    """What takes a run on from where it is, with other coordinates held.

    `solver` holds coordinates that are chosen there; `stage` are the inputs of the run alone; from `start`,
    positions at λ = 0, ``(1, n_nodes, 3)``, supports move on as before, while what is held for neutral
    motions rests where the run is.
    """

    solver: Solver
    stage: StageInputs
    start: FloatArray


class Grip:
    """Watches what a solver holds for the neutral motions of runs.

    Parameters
    ----------
    gauge
        Of the runs.
    runs
        As the solver takes them.

    Attributes
    ----------
    held
        Coordinates that are held for neutral motions, ``(n_nodes, 3)``.
    """

    def __init__(self, gauge: Gauge, runs: Runs) -> None:
        self.gauge, self.runs, self.motions = gauge, runs, gauge.motions
        solver = gauge.solver
        self.held = solver.given.free & ~solver.arrays.free
        self._at_first = self._volume(solver.held_at.reshape(1, -1))[0] if len(self.motions) else 1.0

    def _volume(self, nodes: FloatArray) -> FloatArray:
        """Volume that the rows of the motions at the held coordinates span, ``(n,)``."""
        fields = self.motions.fields(nodes.reshape(len(nodes), -1, 3))
        volume: FloatArray = np.abs(np.linalg.det(fields[..., self.held]))
        return volume

    def is_worn(self, nodes: FloatArray) -> BoolArray:
        """Whether others have to be held at some positions ``(n, 3 n_nodes)``."""
        if not len(self.motions) or not len(nodes):
            return np.zeros(len(nodes), dtype=np.bool_)
        return ~(self._volume(nodes) >= WORN * self._at_first)

    def anew(self, run: int, nodes: FloatArray) -> Handed:
        """Return what takes a run on from some positions, ``(3 n_nodes,)``, with others held."""
        shared, at = self.gauge.solver, nodes.reshape(-1, 3)
        given = shared.given
        solver = Solver(given, shared.settings, 1, self.motions, at, turning=shared.turning)
        row = self.runs.start[run if len(self.runs.start) > 1 else 0].reshape(-1, 3)
        return Handed(solver, self.gauge.stage.of_run(run), np.where(given.free, at, row)[None])
