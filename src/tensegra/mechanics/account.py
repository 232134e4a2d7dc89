"""The account of the runs of a stage: their words, and what happened on the way."""

from dataclasses import replace

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray
from tensegra.mechanics.gauge import Gauge
from tensegra.mechanics.state import Outcome
from tensegra.mechanics.status import CriticalPoint, PathPoint, SlackEvent, Status, most_moved
from tensegra.mechanics.tangent import lowest_of

SNAP = 1e-4
"""A fall that moves no node by this share of the structure's size has not left the branch."""

SAME_POINT = 1e-5
"""Increment within which two ends of a branch are one, the first of which was told too early."""


class Account:
    """What is told of the runs of a stage.

    Parameters
    ----------
    name
        Of the stage.
    gauge
        Measures the runs.
    n_runs
        Number of runs.
    recorded
        Whether points and events on the way are wanted, for a single run.

    Attributes
    ----------
    status, reason
        What is known of each run so far, ``(n_runs,)``.
    critical_points
        Of each run, in order.
    slack_events, history
        Of a single run.
    record
        What the kernels write points and events into; None where they are not wanted.
    """

    def __init__(self, name: str, gauge: Gauge, n_runs: int, *, recorded: bool) -> None:
        self.name, self.gauge = name, gauge
        self.arrays = gauge.solver.arrays
        self.status = np.array([Status.STABLE] * n_runs + [None], dtype=np.object_)[:-1]
        self.reason = np.full(n_runs, "", dtype=np.object_)
        self.critical_points: list[list[CriticalPoint]] = [[] for _ in range(n_runs)]
        self.slack_events: list[SlackEvent] = []
        self.history: list[PathPoint] = []
        self.record = gauge.solver.record() if recorded else None

    # -- words -----------------------------------------------------------------------------------

    def has(self, *status: Status) -> BoolArray:
        """Which runs have one of some words, ``(n_runs,)``."""
        return np.array([one in status for one in self.status], dtype=np.bool_)

    def set(self, run: int, status: Status, reason: str) -> None:
        """Give a run a word, with the snaps before it and the reason for it."""
        snaps = [str(point) for point in self.critical_points[run] if self.is_snap(point)]
        self.status[run], self.reason[run] = status, "; ".join([*snaps, reason])

    def fail(self, run: int, reason: str) -> None:
        """Give a run up."""
        self.set(run, Status.FAILED, reason)

    def is_snap(self, point: CriticalPoint) -> bool:
        """Whether the structure leapt at a critical point."""
        return point.snap > SNAP * self.arrays.size

    # -- from one to another ---------------------------------------------------------------------

    def go_on_from(self, first: "Account") -> None:
        """Go on with the account of an earlier part of the same stage."""
        self.status, self.reason, self.critical_points = first.status, first.reason, first.critical_points
        self.slack_events, self.history = first.slack_events, first.history

    def take_over(self, whole: "Account", run: int) -> None:
        """Begin, for a single run, with what another account tells of one of its runs."""
        self.status[0], self.reason[0] = whole.status[run], whole.reason[run]
        self.critical_points = [whole.critical_points[run]]
        self.slack_events, self.history = whole.slack_events, whole.history

    def give_back(self, whole: "Account", run: int) -> None:
        """Tell another account of one of its runs what this one tells of its single run."""
        whole.status[run], whole.reason[run] = self.status[0], self.reason[0]
        whole.critical_points[run] = self.critical_points[0]

    # -- the way ---------------------------------------------------------------------------------

    def note_critical(
        self, run: int, kind: str, outcome: Outcome, after: FloatArray | None = None, snap: float = 0.0
    ) -> None:
        """Record the end of a branch and the fall from it; its mode and energy for a single run alone.

        Parameters
        ----------
        run
            The run.
        kind
            As in `CriticalPoint`.
        outcome
            Says where the branch ended.
        after, snap
            Where the run has fallen to, ``(n_nodes, 3)``, and how far from the branch that is.
        """
        parameter, lowest, released = float(outcome.parameter[run]), np.nan, 0.0
        moved: tuple[str, ...] = ()
        if self.record is not None:
            load, tangent = self.gauge.load(run, parameter), self.gauge.tangent
            if after is not None:
                tangent.measure(after, load)
                released = -tangent.potential(load)
            tangent.measure(outcome.nodes[run].reshape(-1, 3), load)
            if after is not None:
                released += tangent.potential(load)
            spectrum = tangent.spectrum(1)
            if len(spectrum.values):
                moved = most_moved(self.arrays.node_ids, np.linalg.norm(spectrum.vectors[0], axis=1))
            lowest = lowest_of(spectrum)
        points = self.critical_points[run]
        if points and not self.is_snap(points[-1]) and parameter - points[-1].parameter < SAME_POINT:
            # The branch had not ended there after all, but hardly farther on.
            points.pop()
        points.append(CriticalPoint(self.name, parameter, kind, lowest, moved, snap, max(0.0, released)))

    def note_events(self, before: BoolArray, after: BoolArray, parameter: float) -> None:
        """Add the cables that have changed between slack and taut."""
        for e in np.flatnonzero(before != after):
            becomes = "taut" if after[e] else "slack"
            self.slack_events.append(SlackEvent(self.name, parameter, self.arrays.member_ids[e], becomes))

    def note_point(self, nodes: FloatArray, parameter: float, iterations: int) -> None:
        """Add where a single run is to its history."""
        if self.record is None:
            return
        tangent = self.gauge.measured(0, nodes, parameter)
        self.history.append(
            PathPoint(self.name, parameter, nodes.reshape(-1, 3).copy(), tangent.tension, iterations)
        )

    def correct_last_point(self, nodes: FloatArray, tensions: FloatArray, parameter: float) -> None:
        """Put what is measured of the end of a single run in place of what its last point was told by."""
        if self.history and self.history[-1].parameter == parameter:
            self.history[-1] = replace(self.history[-1], nodes=nodes.copy(), tensions=tensions.copy())

    def drain(self) -> None:
        """Take what the kernels recorded of a single run."""
        record = self.record
        if record is None:
            return
        n_points, n_events = map(int, record.counts)
        for i in range(n_points):
            nodes, parameter = record.nodes[i].reshape(-1, 3).copy(), float(record.parameter[i])
            last = self.history[-1] if self.history else None
            if last is not None and last.parameter == parameter and np.array_equal(last.nodes, nodes):
                continue  # where it was taken up again
            tensions, iterations = record.tensions[i].copy(), int(record.iterations[i])
            self.history.append(PathPoint(self.name, parameter, nodes, tensions, iterations))
        for i in range(n_events):
            becomes = "taut" if record.event_taut[i] else "slack"
            member = self.arrays.member_ids[int(record.event_member[i])]
            self.slack_events.append(SlackEvent(self.name, float(record.event_parameter[i]), member, becomes))
        record.counts[:] = 0
