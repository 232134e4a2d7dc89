"""Take runs through a stage: let the follower go, say what stopped it, and do what the policy wants.

The follower (`tensegra.mechanics.follow`) leaves a run where its stable branch ends. Here the end is named,
and by the policy the path stops, is traced through the unstable branch, or settles: the structure falls
(`tensegra.mechanics.falls`) into the stable equilibrium below, and is followed on from there. All of it is
done for all the runs at once that need it; one run is the case of one. What is known of the runs where they
end is found by `tensegra.mechanics.conclude`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tensegra.mechanics import descend, follow, stepped
from tensegra.mechanics.account import SNAP, Account
from tensegra.mechanics.arc import Branch
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray
from tensegra.mechanics.bridge import leads_back
from tensegra.mechanics.falls import Falls
from tensegra.mechanics.gauge import Gauge
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.rigid import align
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import Outcome, Runs
from tensegra.mechanics.status import Status
from tensegra.mechanics.tangent import Tangent

_UNDER_WAY = 0  # `Outcome.end` of a run that nothing has stopped yet

NO_LEAP = 1e-8
"""A fall that moves no node by this share of the size beside what the branch moves is none: it goes on."""

FARTHEST_BEND = 0.05
"""Share of the size that no branch moves by within the increment of a fall: beyond it is a leap."""

STILL_STIFF = 0.02
"""Share of the first lowest eigenvalue that a smooth loss of stability is far below when located."""

ALONG_MODE = 1e-4
"""Share of a change of the loads along the critical mode from which on it is a fold."""

FARTHEST_FALL = 0.02
"""Increment beyond a critical point within which a structure that falls has to find a stable place."""

FREE_START = 0.25
"""Increment by which the inputs take hold of a structure that nothing holds where it starts."""

PRESTRESS_GONE = 1e-3
"""Where the branch ends with less than this share of the reference tension left, it is a collapse."""

MOST_EVENTS = 2000
"""Times that one run of a stage is taken up again before it is given up."""


@dataclass(frozen=True, eq=False)
class Task:
    """A part of a history, of one run or of many, as a supervisor takes it on.

    Attributes
    ----------
    name
        Of the stage.
    stage
        Its inputs, with or without a leading axis of runs.
    stiffness
        EA, with or without one.
    start
        Positions at λ = 0, ``(n_runs | 1, n_nodes, 3)``.
    reference
        What counts as a tension of the structure, ``(n_runs | 1,)``.
    n_runs
        Number of runs.
    recorded
        Whether points and events on the way are wanted, for a single run.
    """

    name: str
    stage: StageInputs
    stiffness: FloatArray
    start: FloatArray
    reference: FloatArray
    n_runs: int = 1
    recorded: bool = False


class Supervisor:
    """Takes runs of one structure through one stage.

    Parameters
    ----------
    solver
        Of the structure, with its settings.
    task
        What to do.

    Attributes
    ----------
    outcome
        Where the runs stand.
    account
        What is told of them.
    handed_on
        Who has taken a run on, where what the solver holds for neutral motions was worn.
    """

    def __init__(self, solver: Solver, task: Task) -> None:
        self.solver, self.task, self.n_runs = solver, task, task.n_runs
        self.arrays, self.settings = solver.arrays, solver.settings
        self.reference = np.full(task.n_runs, task.reference)
        self.runs: Runs = solver.runs(task.stage, task.stiffness, task.start, task.n_runs, self.reference)
        self.outcome: Outcome = solver.outcome(task.start, task.n_runs)
        self.gauge = Gauge(solver, task.stage, task.stiffness)
        self.account = Account(task.name, self.gauge, task.n_runs, recorded=task.recorded)
        self.handed_on: dict[int, Supervisor] = {}
        self._falls = Falls(self.gauge, self.runs, self.reference)

    # -- the way ---------------------------------------------------------------------------------

    def follow(self) -> None:
        """Follow all runs from where they stand to the end of the stage."""
        active, rounds = np.flatnonzero(self.outcome.end == _UNDER_WAY), 0
        while len(active):
            active = self._without_worn(active)
            whole = len(active) == self.n_runs
            part = self.outcome if whole else self.outcome.take(active)
            self.solver.follow(self.runs if whole else self.runs.take(active), part, self.account.record)
            if not whole:
                self.outcome.put(active, part)
            self.account.drain()
            end, rounds = part.end, rounds + 1
            for run in map(int, active[end == follow.OUT_OF_STEPS]):
                self.account.fail(
                    run, f"{self.outcome.steps[run]} steps end at {self._percent(run)} of the stage"
                )
            # What was held for a body that has turned too far says nothing of it: others go on from there.
            worn = self.solver.grip.is_worn(part.nodes) & (end != follow.OUT_OF_STEPS)
            ended = active[~worn & (end >= follow.BRANCH_ENDS) & (end <= follow.UNSTABLE_START)]
            resumed = active[worn | (end == follow.PAUSED)]
            if rounds > MOST_EVENTS:
                for run in map(int, np.concatenate([ended, resumed])):
                    self.account.fail(
                        run, f"{MOST_EVENTS} critical points end at {self._percent(run)} of the stage"
                    )
                return
            active = np.sort(np.concatenate([resumed, self._end_of_branch(ended)]))

    def _without_worn(self, active: IndexArray) -> IndexArray:
        """Let others take the runs on for which other coordinates have to be held; return the rest."""
        if not len(self.gauge.motions) and not self._falls.handed:
            return active
        goes = self.is_handed
        goes[active] |= self.solver.grip.is_worn(self.outcome.nodes[active])
        for run in map(int, active[goes[active]]):
            other = self.hand_on(run)
            other.outcome.end[:] = _UNDER_WAY
            other.follow()
            self.outcome.put(np.array([run]), other.outcome)
            other.account.give_back(self.account, run)
        return active[~goes[active]]

    @property
    def flat_below(self) -> FloatArray:
        """Tensions that count as none, ``(n_runs,)``."""
        return self._falls.flat_below

    @property
    def is_handed(self) -> BoolArray:
        """Which runs are where only others can take them on, ``(n_runs,)``."""
        handed = np.zeros(self.n_runs, dtype=np.bool_)
        handed[list(self._falls.handed)] = True
        return handed

    def hand_on(self, run: int) -> "Supervisor":
        """Return who takes a run on from where it stands, with coordinates held that are chosen there."""
        new = self._falls.handed.get(run) or self._falls.hand_on(run, self.outcome.nodes[run])
        task = Task(
            self.task.name,
            new.stage,
            self.gauge.stiffness_of(run),
            new.start,
            self.reference[[run]],
            recorded=self.task.recorded,
        )
        other = Supervisor(new.solver, task)
        other.outcome.put(np.zeros(1, dtype=np.int64), self.outcome.take(np.array([run])))
        other.account.take_over(self.account, run)
        self.handed_on[run] = other
        return other

    def step(self) -> None:
        """Take all runs through the stage by the plain procedure of fixed increments."""
        number = stepped.n_increments(self.task.stage, self.settings.increment)
        self.solver.step(self.runs, self.outcome, number, self.flat_below, self.account.record)
        self.account.drain()
        number = np.broadcast_to(number, (self.n_runs,))
        for run in map(int, np.flatnonzero(self.outcome.end != stepped.ARRIVED)):
            increment, n = int(self.outcome.steps[run]) + 1, int(number[run])
            if self.outcome.end[run] == stepped.DIVERGED:
                self.account.fail(run, f"increment {increment} of {n} did not converge")
            elif self.outcome.end[run] == stepped.FLAT:
                self.account.set(run, Status.COLLAPSED, f"prestress lost at increment {increment} of {n}")

    def fall_into_place(self, which: BoolArray) -> None:
        """Let some runs fall from the coordinates where they are under the inputs at the end of the stage."""
        runs = np.flatnonzero(which & (self.outcome.end == _UNDER_WAY))
        if not len(runs):
            return
        self.outcome.steps[runs], self.outcome.end[runs] = 1, follow.ARRIVED
        fallen = self._fall(runs, self.outcome.nodes[runs], np.ones(len(runs)))
        self.outcome.nodes[runs], self.outcome.parameter[runs] = fallen.nodes, 1.0
        for row, run in enumerate(runs.tolist()):
            if fallen.end[row] == descend.LOST:
                residual = f"residual {fallen.residual[row]:.3g}"
                self.account.fail(run, f"no equilibrium found from the given coordinates: {residual}")
            elif fallen.end[row] != descend.STANDS:
                self.account.set(
                    run, Status.COLLAPSED, "the structure does not stand: nothing holds it in its position"
                )
        self.account.note_point(fallen.nodes[0], 1.0, int(fallen.iterations[0]))

    def stay(self, run: int, nodes: FloatArray, iterations: int, reason: str) -> None:
        """Leave a run at an equilibrium that does not stand, under the inputs at the end of the stage."""
        self.outcome.nodes[run], self.outcome.parameter[run] = nodes.ravel(), 1.0
        self.outcome.steps[run], self.outcome.iterations[run] = 1, iterations
        self.outcome.end[run] = follow.UNSTABLE_START
        self.account.set(run, Status.UNSTABLE, reason)
        self.account.note_point(nodes, 1.0, iterations)

    def fail_all(self, reason: str) -> None:
        """Give all runs up."""
        for run in range(self.n_runs):
            self.account.fail(run, reason)

    def go_on_from(self, first: "Supervisor") -> None:
        """Follow on where another one, of an earlier part of the same stage, has brought the runs.

        What has collapsed there lies down under the inputs at the end, as it does within one part; what has
        stopped there for another reason is not touched.
        """
        self.account.go_on_from(first.account)
        self.outcome.steps[:], self.outcome.iterations[:] = first.outcome.steps, first.outcome.iterations
        self.outcome.end[:] = np.where(first.outcome.end == follow.ARRIVED, _UNDER_WAY, first.outcome.end)
        lies = np.flatnonzero(self.account.has(Status.COLLAPSED))
        if len(lies):
            before = self.outcome.nodes[lies]
            fallen = self._fall(lies, before, np.ones(len(lies)))
            for row in np.flatnonzero(fallen.end == descend.STANDS).tolist():
                self._land(int(lies[row]), "collapse", before[row], fallen, row, 0.0)
            self.outcome.nodes[lies], self.outcome.parameter[lies] = fallen.nodes, 1.0
        self.follow()

    # -- ends of branches ------------------------------------------------------------------------

    def _end_of_branch(self, ended: IndexArray) -> IndexArray:
        """Name where the branches of some runs end and do what the policy says; return which go on."""
        if not len(ended):
            return ended
        kinds = [self._kind(int(run)) for run in ended]
        if self.settings.policy == "settle":
            return self._settle(ended, kinds)
        for run, kind in zip(map(int, ended), kinds, strict=True):
            if kind == "unstable start":
                continue
            self.account.note_critical(run, kind, self.outcome)
            where = self.account.critical_points[run][-1]
            self.account.set(run, Status.UNSTABLE, f"the stable path ends: {where}")
        unstable = [kind == "unstable start" for kind in kinds]
        return self._settle(ended[unstable], ["unstable start"] * sum(unstable))

    def _kind(self, run: int) -> str:
        """Tell a collapse, a cable gone slack, a bifurcation and a fold apart.

        K goes to zero along a mode φ at a fold and at a bifurcation, but only at a fold does what is
        being changed push along φ; where K was still stiff the next step, a cable took it away.
        """
        end, parameter = self.outcome.end[run], float(self.outcome.parameter[run])
        if end in (follow.NO_START, follow.UNSTABLE_START):
            return "unstable start"
        loaded = np.any(self.gauge.load(run, parameter).force[self.arrays.free] != 0.0)
        carried = np.abs(self.outcome.tensions[run][self.arrays.moving]).max(initial=0.0)
        if not loaded and carried < PRESTRESS_GONE * self.reference[run]:
            return "collapse"
        if end == follow.EVENT_ENDS:
            return "slack"
        row = run if len(self.runs.start) > 1 else 0
        self.gauge.measured(run, self.runs.start[row].reshape(-1, 3), 0.0)
        at_start = self.gauge.tangent.lowest_eigenvalue()
        spectrum = self.gauge.measured(run, self.outcome.nodes[run].reshape(-1, 3), parameter).spectrum(1)
        if spectrum.values[0] > STILL_STIFF * abs(at_start):
            return "slack"
        motion = np.where(self.arrays.free, self.outcome.velocity[run].reshape(-1, 3), 0.0)
        push = np.where(self.arrays.free, self.gauge.tangent.force_rate(motion), 0.0)
        along = abs(float(np.sum(push * spectrum.vectors[0])))
        return "limit point" if along > ALONG_MODE * float(np.linalg.norm(push)) else "bifurcation"

    def _settle(self, runs: IndexArray, kinds: Sequence[str]) -> IndexArray:
        """Let runs fall just beyond the ends of their branches; return which can go on from there."""
        if not len(runs):
            return runs
        kind = dict(zip(runs.tolist(), kinds, strict=True))
        before, start = self.outcome.nodes[runs].copy(), self.outcome.parameter[runs]
        taut = self._taut_before(int(runs[0]), before[0]) if self.account.record is not None else None
        fallen = self._fall_beyond(runs, kind)
        goes_on = np.zeros(len(runs), dtype=np.bool_)
        for row, run in enumerate(runs.tolist()):
            ahead = float(fallen.parameter[row] - start[row])
            goes_on[row] = self._land(run, kind[run], before[row], fallen, row, ahead)
            self.outcome.nodes[run], self.outcome.parameter[run] = fallen.nodes[row], fallen.parameter[row]
        if taut is not None:
            run, parameter = int(runs[0]), float(fallen.parameter[0])
            self.account.note_events(taut, self._taut(run, fallen.nodes[0]), parameter)
            if not goes_on[0]:
                self.account.note_point(fallen.nodes[0], parameter, int(fallen.iterations[0]))
        return runs[goes_on]

    def _fall_beyond(self, runs: IndexArray, kind: dict[int, str]) -> Outcome:
        """Let runs fall beyond the ends of their branches, as far on as they have to; name collapses."""
        before, start = self.outcome.nodes[runs].copy(), self.outcome.parameter[runs]
        ahead = np.full(len(runs), 2.0 * self.settings.smallest_step)
        for row, run in enumerate(runs.tolist()):
            # Where nothing holds the start there is nothing to fall from: let the inputs take hold first.
            if kind[run] == "unstable start" and self.gauge.is_neutral(
                run, self.outcome.nodes[run], float(start[row])
            ):
                ahead[row] = FREE_START
        fallen = self._fall(runs, before, np.minimum(1.0, start + ahead))
        while True:
            # Just beyond a critical point K is not told from a singular one: fall farther on.
            open_end = np.isin(fallen.end, (descend.NEUTRAL, descend.LOST))
            again = np.flatnonzero(open_end & (ahead < FARTHEST_FALL))
            if not len(again):
                break
            # Without prestress there is none to be had in between.
            gone = np.array([kind[run] == "collapse" for run in runs[again].tolist()])
            ahead[again] = np.where(gone, FARTHEST_FALL, 10.0 * ahead[again])
            fallen.put(again, self._fall(runs[again], before[again], np.minimum(1.0, start + ahead)[again]))
        gone = np.flatnonzero(np.isin(fallen.end, (descend.FLAT, descend.NEUTRAL)))
        if len(gone):
            # Nothing holds the structure here. What follows may tighten it again.
            kind.update(dict.fromkeys(runs[gone].tolist(), "collapse"))
            fallen.put(gone, self._fall(runs[gone], fallen.nodes[gone], np.ones(len(gone))))
        return fallen

    def _land(self, run: int, kind: str, before: FloatArray, fallen: Outcome, row: int, ahead: float) -> bool:
        """Tell the fall of a run; return whether its path goes on from where it has landed."""
        start = before.reshape(-1, 3)
        after = align(fallen.nodes[row].reshape(-1, 3), start, self.gauge.motions)
        if fallen.end[row] == descend.STANDS:
            starts = kind == "unstable start"
            # What the branch itself would have moved by is no part of a leap.
            along = 0.0 if starts else ahead * self.outcome.velocity[run].reshape(-1, 3)
            snap = float(np.linalg.norm(after - start - along, axis=1).max(initial=0.0))
            leaps = snap > NO_LEAP * self.arrays.size
            # It makes no word which of the leaps too short for a snap are none: only a list is the shorter.
            asked = leaps and not starts
            asked &= snap > SNAP * self.arrays.size or self.account.record is not None
            if asked and not self._has_leapt(run, start, after, float(fallen.parameter[row])):
                leaps, snap = False, 0.0
            if leaps or kind == "bifurcation":
                self.account.note_critical(run, kind, self.outcome, after, snap)
            if snap > SNAP * self.arrays.size:
                self.account.status[run] = Status.SNAPPED
            return True
        self.account.note_critical(run, kind, self.outcome)
        where = self.account.critical_points[run][-1]
        if fallen.end[row] in (descend.FLAT, descend.NEUTRAL):
            self.account.set(run, Status.COLLAPSED, f"prestress lost: {where}")
        else:
            self.account.fail(run, f"the fall beyond {where} found no equilibrium")
        return False

    def _fall(self, runs: IndexArray, nodes: FloatArray, parameter: FloatArray) -> Outcome:
        fallen = self._falls.fall(runs, nodes, parameter)
        self.outcome.iterations[runs] += fallen.iterations
        return fallen

    def _has_leapt(self, run: int, before: FloatArray, after: FloatArray, parameter: float) -> bool:
        """Whether no branch leads back from where a run has landed, under the inputs at λ."""
        if np.abs(after - before).max() > FARTHEST_BEND * self.arrays.size:
            return True
        stage, stiffness = self.task.stage.of_run(run), self.gauge.stiffness_of(run)
        tangent = self.gauge.tangent
        if len(self.gauge.motions):
            tangent = Tangent(self.solver.given, motions=self.gauge.motions, nodes=after)
        branch = Branch(tangent, stage, stiffness, self.settings.residual)
        left = before, float(self.outcome.parameter[run])
        return not leads_back(branch, self.gauge.motions, (after, parameter), left)

    def _taut_before(self, run: int, nodes: FloatArray) -> BoolArray:
        """Which members carried force where the branch ended, as the follower kept them."""
        if self.outcome.end[run] in (follow.BRANCH_ENDS, follow.EVENT_ENDS):
            taut: BoolArray = ~self.arrays.is_cable | (self.outcome.tensions[run] != 0.0)
            return taut
        return self._taut(run, nodes)

    def _taut(self, run: int, nodes: FloatArray) -> BoolArray:
        return self.gauge.measured(run, nodes, float(self.outcome.parameter[run])).taut.copy()

    def _percent(self, run: int) -> str:
        return f"{100.0 * self.outcome.parameter[run]:.4g} %"
