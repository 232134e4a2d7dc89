"""Where the runs of a stage ended, and what is known of them there."""

from dataclasses import dataclass, field, replace

import numpy as np

from tensegra.errors import SolverError
from tensegra.mechanics.arrays import FloatArray, IndexArray
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.status import CriticalPoint, PathPoint, SlackEvent, Status


@dataclass(eq=False)
class StageEnd:
    """Where the runs of a stage ended, and what is known of them there; the first axis is the run.

    Attributes
    ----------
    name
        Of the stage.
    nodes, tensions, parameter
        Positions ``(n_runs, n_nodes, 3)``, tensions ``(n_runs, n_members)`` and λ.
    status, reason
        What they are called, and why.
    residual, lowest_eigenvalue, n_negative, strain_energy
        The certificate.
    steps, iterations
        Counts within the stage.
    critical_points
        Of each run, in order.
    slack_events, history
        Of a single run; empty for many.
    nodes_by, tensions_by
        Derivatives by the directions asked for, ``(n_runs, n_directions, …)``.
    free_motions
        Names of the rigid motions that nothing holds at the end.
    last_load
        What acts on a single run at its end.
    """

    name: str
    nodes: FloatArray
    tensions: FloatArray
    parameter: FloatArray
    status: np.ndarray
    reason: np.ndarray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    n_negative: IndexArray
    strain_energy: FloatArray
    steps: IndexArray
    iterations: IndexArray
    nodes_by: FloatArray
    tensions_by: FloatArray
    critical_points: list[list[CriticalPoint]]
    slack_events: list[SlackEvent] = field(default_factory=list)
    history: list[PathPoint] = field(default_factory=list)
    free_motions: tuple[str, ...] = ()
    last_load: Load | None = None

    @property
    def load(self) -> Load:
        """What acts on a single run at its end."""
        if self.last_load is None:
            raise SolverError("the end of many runs has no load of its own")
        return self.last_load

    def give_up(self, run: int, reason: str) -> None:
        """Report no number of a run."""
        self.status[run], self.reason[run], self.critical_points[run] = Status.FAILED, reason, []
        for column in (self.nodes, self.tensions, self.nodes_by, self.tensions_by):
            column[run] = np.nan
        for column in (self.residual, self.lowest_eigenvalue, self.strain_energy):
            column[run] = np.nan
        self.n_negative[run] = self.steps[run] = self.iterations[run] = 0

    def put(self, run: int, other: "StageEnd", row: int = 0) -> None:
        """Put the end of a run, of which another tells in some row, in its place."""
        for column in (
            *("nodes", "tensions", "parameter", "status", "reason", "residual", "lowest_eigenvalue"),
            *("n_negative", "strain_energy", "steps", "iterations", "nodes_by", "tensions_by"),
        ):
            getattr(self, column)[run] = getattr(other, column)[row]
        self.critical_points[run] = other.critical_points[row]
        if len(self.status) == 1:
            self.slack_events, self.history, self.last_load = (
                other.slack_events,
                other.history,
                other.last_load,
            )

    def of_all(self, n_runs: int) -> "StageEnd":
        """Return the end of one run as the start of many: its name, its status and how far it came."""
        if len(self.status) == n_runs:
            return self
        return replace(
            self, status=np.repeat(self.status, n_runs), parameter=np.repeat(self.parameter, n_runs)
        )
