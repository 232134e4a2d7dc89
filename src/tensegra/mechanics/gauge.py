"""What acts on a run at a point of its way, and what the tangent stiffness is there."""

from functools import cached_property

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.law import plain
from tensegra.mechanics.rigid import RigidMotions
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.tangent import Tangent


class Gauge:
    """Measures runs of a stage one by one, at whatever positions and λ are asked for.

    Parameters
    ----------
    solver
        Of the structure.
    stage
        Inputs along the stage, with or without a leading axis of runs.
    stiffness
        EA, with or without a leading axis of runs.
    """

    def __init__(self, solver: Solver, stage: StageInputs, stiffness: FloatArray) -> None:
        self.solver, self.stage = solver, stage
        self.stiffness = stiffness.reshape(-1, stiffness.shape[-1])

    @cached_property
    def tangent(self) -> Tangent:
        """The tangent stiffness where it was measured last."""
        return Tangent(self.solver.given, self.solver.pattern, self.motions, self.solver.arrays)

    @cached_property
    def motions(self) -> RigidMotions:
        """The neutral motions."""
        none = np.zeros((0, self.solver.arrays.n_nodes, 3))
        return self.solver.motions if self.solver.motions is not None else RigidMotions((), none, none)

    def stiffness_of(self, run: int) -> FloatArray:
        """Return EA of a run, ``(n_members,)``."""
        row: FloatArray = self.stiffness[run if len(self.stiffness) > 1 else 0]
        return row

    def load(self, run: int, parameter: float) -> Load:
        """Return what acts on a run at a point of its way."""
        alone = self.stage.of_run(run)
        rest_length = np.ascontiguousarray(alone.rest_length_at(parameter))
        tolerance = self.solver.settings.residual
        return Load(rest_length, self.stiffness_of(run), alone.loads_at(parameter), tolerance)

    def measured(self, run: int, nodes: FloatArray, parameter: float) -> Tangent:
        """Return the tangent of a run, measured at some positions under the inputs at λ."""
        self.tangent.measure(nodes.reshape(-1, 3), self.load(run, parameter))
        return self.tangent

    def is_neutral(self, run: int, nodes: FloatArray, parameter: float) -> bool:
        """Whether K of a run is singular, but not negative."""
        tangent = self.measured(run, nodes, parameter)
        return abs(tangent.lowest_eigenvalue()) <= tangent.zero_eigenvalue

    def stiffest(self, n_runs: int) -> FloatArray:
        """Return the largest EA/l₀ of each run at the end of its way, ``(n_runs,)``."""
        rest_length = np.abs(self.stage.rest_length_at(1.0))
        stiffest = plain.by_length(1.0, rest_length, self.stiffness).max(axis=-1, initial=0.0)
        return np.full(n_runs, stiffest)
