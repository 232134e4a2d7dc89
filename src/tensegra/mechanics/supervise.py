"""Take runs through a stage: let the follower go, say what stopped it, and do what the policy wants.

The follower (`tensegra.mechanics.follow`) leaves a run where its stable branch ends. Here the end is named,
and by the policy the path stops, is traced through the unstable branch, or settles: the structure falls
(`tensegra.mechanics.descend`) into the stable equilibrium below, and is followed on from there. All of it is
done for all the runs at once that need it; one run is the case of one. At the end every run is certified
where it stands, under the inputs that act there, and its status is made of that and of what happened before.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tensegra.mechanics import descend, follow, stepped
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray
from tensegra.mechanics.certify import PROVED
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.law import plain
from tensegra.mechanics.reactions import internal_forces
from tensegra.mechanics.rigid import RigidMotions, align
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import N_VECTORS, Outcome, Runs
from tensegra.mechanics.status import CriticalPoint, PathPoint, SlackEvent, Status, most_moved
from tensegra.mechanics.tangent import Tangent, lowest_of

_UNDER_WAY = 0  # `Outcome.end` of a run that nothing has stopped yet

SNAP = 1e-4
"""A fall that moves no node by this share of the structure's size has not left the branch."""

SAME_POINT = 1e-5
"""Increment within which two ends of a branch are one, the first of which was told too early."""

NO_LEAP = 1e-8
"""A fall that moves no node by this share of the size beside what the branch moves is none: it goes on."""

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

FLAT_TENSION = 1e-11
"""Tensions below this share of the reference tension are none: the prestress is lost."""

PUSH = 1e-3
"""Largest move of a node, as a share of the size, by which a fall is pushed off a saddle."""

NEARLY_NEUTRAL = 1e-9
"""Share of the largest EA/l₀ that a negative eigenvalue has to have for a fall to leave its saddle."""

PINNED = 1e4
"""Residuals that a coordinate held for a rigid motion may carry: the others' come to it by long levers."""

NEARLY_BALANCED, NEAR_BALANCE = 1e-5, 1e-2
"""Residual from which on a fall that creeps is brought into balance by Newton's method, and how far from
there, as a share of the size, the equilibrium may lie."""

MOST_SADDLES = 40
"""Saddles that one fall is pushed off before it is given up."""

MOST_EVENTS = 2000
"""Times that one run of a stage is taken up again before it is given up."""


class Supervisor:
    """Takes runs of one structure through one stage.

    Parameters
    ----------
    solver
        Of the structure, with its settings.
    name
        Of the stage.
    stage
        Its inputs.
    stiffness
        EA, with or without a leading axis of runs.
    start
        Positions at λ = 0, ``(n_runs | 1, n_nodes, 3)``.
    reference
        What counts as a tension of the structure, ``(n_runs | 1,)``.
    n_runs
        Number of runs.
    recorded
        Whether points and events on the way are wanted, for a single run.
    """

    def __init__(
        self,
        solver: Solver,
        name: str,
        stage: StageInputs,
        stiffness: FloatArray,
        start: FloatArray,
        reference: FloatArray,
        n_runs: int = 1,
        *,
        recorded: bool = False,
    ) -> None:
        self.solver, self.name, self.stage, self.stiffness = solver, name, stage, stiffness
        self.arrays, self.settings, self.n_runs = solver.arrays, solver.settings, n_runs
        self.reference = np.array(np.broadcast_to(reference, (n_runs,)))
        self.runs: Runs = solver.runs(stage, stiffness, start, n_runs)
        self.outcome: Outcome = solver.outcome(start, n_runs)
        self.status = np.array([Status.STABLE] * n_runs + [None], dtype=np.object_)[:-1]
        self.reason = np.full(n_runs, "", dtype=np.object_)
        self.critical_points: list[list[CriticalPoint]] = [[] for _ in range(n_runs)]
        self.slack_events: list[SlackEvent] = []
        self.history: list[PathPoint] = []
        self._record = solver.record() if recorded else None
        self._one: Tangent | None = None

    # -- the way ---------------------------------------------------------------------------------

    def follow(self) -> None:
        """Follow all runs from where they stand to the end of the stage."""
        active, rounds = np.flatnonzero(self.outcome.end == _UNDER_WAY), 0
        while len(active):
            whole = len(active) == self.n_runs
            part = self.outcome if whole else self.outcome.take(active)
            self.solver.follow(self.runs if whole else self.runs.take(active), part, self._record)
            if not whole:
                self.outcome.put(active, part)
            self._drain()
            end, rounds = part.end, rounds + 1
            for run in map(int, active[end == follow.OUT_OF_STEPS]):
                self._fail(run, f"{self.outcome.steps[run]} steps end at {self._percent(run)} of the stage")
            ended = active[
                np.isin(end, (follow.BRANCH_ENDS, follow.EVENT_ENDS, follow.NO_START, follow.UNSTABLE_START))
            ]
            resumed = active[end == follow.PAUSED]
            if rounds > MOST_EVENTS:
                for run in map(int, np.concatenate([ended, resumed])):
                    self._fail(run, f"{MOST_EVENTS} critical points end at {self._percent(run)} of the stage")
                return
            active = np.sort(np.concatenate([resumed, self._end_of_branch(ended)]))

    def step(self) -> None:
        """Take all runs through the stage by the plain procedure of fixed increments."""
        number = stepped.n_increments(self.stage, self.settings.increment)
        self.solver.step(self.runs, self.outcome, number, FLAT_TENSION * self.reference, self._record)
        self._drain()
        number = np.broadcast_to(number, (self.n_runs,))
        for run in map(int, np.flatnonzero(self.outcome.end != stepped.ARRIVED)):
            increment, n = int(self.outcome.steps[run]) + 1, int(number[run])
            if self.outcome.end[run] == stepped.DIVERGED:
                self._fail(run, f"increment {increment} of {n} did not converge")
            elif self.outcome.end[run] == stepped.FLAT:
                self._set(run, Status.COLLAPSED, f"prestress lost at increment {increment} of {n}")

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
                self._fail(run, f"no equilibrium found from the given coordinates: {residual}")
            elif fallen.end[row] != descend.STANDS:
                self._set(
                    run, Status.COLLAPSED, "the structure does not stand: nothing holds it in its position"
                )
        self._note_point(int(runs[0]), 1.0, int(fallen.iterations[0]))

    def stay(self, run: int, nodes: FloatArray, iterations: int, reason: str) -> None:
        """Leave a run at an equilibrium that does not stand, under the inputs at the end of the stage."""
        self.outcome.nodes[run], self.outcome.parameter[run] = nodes.ravel(), 1.0
        self.outcome.steps[run], self.outcome.iterations[run] = 1, iterations
        self.outcome.end[run] = follow.UNSTABLE_START
        self._set(run, Status.UNSTABLE, reason)
        self._note_point(run, 1.0, iterations)

    def fail_all(self, reason: str) -> None:
        """Give all runs up."""
        for run in range(self.n_runs):
            self._fail(run, reason)

    def go_on_from(self, first: "Supervisor") -> None:
        """Follow on where another one, of an earlier part of the same stage, has brought the runs."""
        self.status, self.reason, self.critical_points = first.status, first.reason, first.critical_points
        self.slack_events, self.history = first.slack_events, first.history
        self.outcome.steps[:], self.outcome.iterations[:] = first.outcome.steps, first.outcome.iterations
        self.outcome.end[:] = np.where(first.outcome.end == follow.ARRIVED, _UNDER_WAY, first.outcome.end)
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
            self._note_critical(run, kind)
            self._set(run, Status.UNSTABLE, f"the stable path ends: {self.critical_points[run][-1]}")
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
        loaded = np.any(self.load(run, parameter).force[self.arrays.free] != 0.0)
        carried = np.abs(self.outcome.tensions[run][self.arrays.moving]).max(initial=0.0)
        if not loaded and carried < PRESTRESS_GONE * self.reference[run]:
            return "collapse"
        if end == follow.EVENT_ENDS:
            return "slack"
        row = run if len(self.runs.start) > 1 else 0
        self.measured(run, self.runs.start[row].reshape(-1, 3), 0.0)
        at_start = self._tangent.lowest_eigenvalue()
        spectrum = self.measured(run, self.outcome.nodes[run].reshape(-1, 3), parameter).spectrum(1)
        if spectrum.values[0] > STILL_STIFF * abs(at_start):
            return "slack"
        motion = np.where(self.arrays.free, self.outcome.velocity[run].reshape(-1, 3), 0.0)
        push = np.where(self.arrays.free, self._tangent.force_rate(motion), 0.0)
        along = abs(float(np.sum(push * spectrum.vectors[0])))
        return "limit point" if along > ALONG_MODE * float(np.linalg.norm(push)) else "bifurcation"

    def _settle(self, runs: IndexArray, kinds: Sequence[str]) -> IndexArray:
        """Let runs fall just beyond the ends of their branches; return which can go on from there."""
        if not len(runs):
            return runs
        kind = dict(zip(runs.tolist(), kinds, strict=True))
        before, start = self.outcome.nodes[runs].copy(), self.outcome.parameter[runs]
        taut = self._taut(int(runs[0]), before[0]) if self._record is not None else None
        fallen = self._fall_beyond(runs, kind)
        goes_on = np.zeros(len(runs), dtype=np.bool_)
        for row, run in enumerate(runs.tolist()):
            ahead = float(fallen.parameter[row] - start[row])
            goes_on[row] = self._land(run, kind[run], before[row], fallen, row, ahead)
            self.outcome.nodes[run], self.outcome.parameter[run] = fallen.nodes[row], fallen.parameter[row]
        if taut is not None:
            run, parameter = int(runs[0]), float(fallen.parameter[0])
            self._note_events(taut, self._taut(run, fallen.nodes[0]), parameter)
            if not goes_on[0]:
                self._note_point(run, parameter, int(fallen.iterations[0]))
        return runs[goes_on]

    def _fall_beyond(self, runs: IndexArray, kind: dict[int, str]) -> Outcome:
        """Let runs fall beyond the ends of their branches, as far on as they have to; name collapses."""
        before, start = self.outcome.nodes[runs].copy(), self.outcome.parameter[runs]
        ahead = np.full(len(runs), 2.0 * self.settings.smallest_step)
        for row, run in enumerate(runs.tolist()):
            # Where nothing holds the start there is nothing to fall from: let the inputs take hold first.
            if kind[run] == "unstable start" and self._is_neutral(run):
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
        after = align(fallen.nodes[row].reshape(-1, 3), start, self._motions)
        if fallen.end[row] == descend.STANDS:
            # What the branch itself would have moved by is no part of a leap.
            along = ahead * self.outcome.velocity[run].reshape(-1, 3) if kind != "unstable start" else 0.0
            snap = float(np.linalg.norm(after - start - along, axis=1).max(initial=0.0))
            if snap > NO_LEAP * self.arrays.size or kind == "bifurcation":
                self._note_critical(run, kind, after, snap)
            if snap > SNAP * self.arrays.size:
                self.status[run] = Status.SNAPPED
            return True
        self._note_critical(run, kind)
        where = self.critical_points[run][-1]
        if fallen.end[row] in (descend.FLAT, descend.NEUTRAL):
            self._set(run, Status.COLLAPSED, f"prestress lost: {where}")
        else:
            self._fail(run, f"the fall beyond {where} found no equilibrium")
        return False

    def _is_neutral(self, run: int) -> bool:
        """Whether K is singular, but not negative, where a run stands."""
        tangent = self.measured(run, self.outcome.nodes[run], float(self.outcome.parameter[run]))
        return abs(tangent.lowest_eigenvalue()) <= descend.ZERO_EIGENVALUE * tangent.stiffness_scale

    def _fall(self, runs: IndexArray, nodes: FloatArray, parameter: FloatArray) -> Outcome:
        """Descend from positions ``(n, 3 n_nodes)`` under the inputs at `parameter`, off every saddle."""
        fallen = self.solver.outcome(nodes.reshape(len(runs), self.arrays.n_nodes, 3), len(runs), parameter)
        flat_below = FLAT_TENSION * self.reference[runs]
        self.solver.fall(self.runs, runs, fallen, flat_below)
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
            self.solver.fall(self.runs, runs[stuck], again, flat_below[stuck])
            fallen.put(stuck, again)
        fallen.end[fallen.end == descend.SADDLE] = descend.LOST
        self._polish(runs, fallen)
        self.outcome.iterations[runs] += fallen.iterations
        return fallen

    def _polish(self, runs: IndexArray, fallen: Outcome) -> None:
        """Bring falls into balance that have come near to it, and creep along too soft a valley."""
        creeping = np.flatnonzero((fallen.end == descend.LOST) & (fallen.residual <= NEARLY_BALANCED))
        creeping = creeping[fallen.parameter[creeping] < 1.0]
        if not len(creeping):
            return
        part = fallen.take(creeping)
        self.solver.stand(self.runs.take(runs[creeping]), part)
        away = np.abs(part.nodes - fallen.nodes[creeping]).max(axis=1, initial=0.0)
        stands = (part.end == follow.OUT_OF_STEPS) & (away <= NEAR_BALANCE * self.arrays.size)
        part.end[:] = np.where(stands, descend.STANDS, descend.LOST)
        fallen.put(creeping[stands], part.take(np.flatnonzero(stands)))

    def _off_saddle(self, run: int, nodes: FloatArray, parameter: float) -> FloatArray | None:
        """Return a small move along the lowest mode, to the side that a fixed vector without symmetry says.

        None where the eigenvalue is so near zero that the energy does not tell one side from the other.
        """
        tangent = self.measured(run, nodes, parameter)
        spectrum = tangent.spectrum(1)
        if spectrum.values[0] > -NEARLY_NEUTRAL * tangent.stiffness_scale:
            return None
        mode = spectrum.vectors[0].ravel()
        side = np.sign(np.random.default_rng(0).standard_normal(mode.size) @ mode) or 1.0
        move: FloatArray = side * PUSH * self.arrays.size / np.abs(mode).max() * mode
        return move

    # -- certificates ----------------------------------------------------------------------------

    def certified(self, modes: FloatArray | None = None, directions: Sequence[Direction] = ()) -> StageEnd:
        """Certify every run where it stands, and return what is known of it.

        Parameters
        ----------
        modes
            Guess of the softest modes, ``(n, n_nodes, 3)``.
        directions
            What to differentiate by.
        """
        solver, outcome = self.solver, self.outcome
        block_node = solver.pattern.block_node
        begin = solver.any_modes
        if modes is not None and len(modes) >= N_VECTORS:
            rows = np.where((block_node >= 0)[:, None], modes[:N_VECTORS, block_node], 0.0)
            begin = rows.reshape(N_VECTORS, -1)
        self._hold_anew(np.flatnonzero(self._carried_by_pins()))
        small = solver.iterates(self.n_runs)
        # Of bodies that are free the iterated value is not to be trusted: the dense spectrum tells each.
        iterated = small and not len(self._motions)
        certificate, by = solver.certify(self.runs, outcome, begin if iterated else None, directions)
        failed = self._is(Status.FAILED)
        scale = self._stiffest()
        for run in map(int, np.flatnonzero(~failed & (certificate.proof != PROVED))):
            tangent = self.measured(run, outcome.nodes[run].reshape(-1, 3), float(outcome.parameter[run]))
            certificate.lowest_eigenvalue[run] = tangent.lowest_eigenvalue()
        lowest = certificate.lowest_eigenvalue
        zero = descend.ZERO_EIGENVALUE * scale
        arrived = self._is(Status.STABLE) | self._is(Status.SNAPPED)
        for run in map(int, np.flatnonzero(arrived & ~(lowest > zero))):
            if lowest[run] >= -zero[run]:
                self._set(run, Status.COLLAPSED, "ends where K is singular")
            else:
                self._set(run, Status.UNSTABLE, f"ends where K has the negative eigenvalue {lowest[run]:.4g}")
        for run in map(int, np.flatnonzero(arrived & ~(outcome.residual <= self.settings.residual))):
            self._fail(run, f"its residual at the end is {outcome.residual[run]:.3g}")
        for run in map(int, np.flatnonzero(self._carried_by_pins())):
            self._fail(run, "its nodes have come to lie where they do not tell its rigid motions from others")
        for run in map(int, np.flatnonzero(self._is(Status.SNAPPED))):
            self.reason[run] = "; ".join(str(p) for p in self.critical_points[run] if self._is_snap(p))
        failed = self._is(Status.FAILED)
        if not self.history and self._record is not None and not failed[0]:
            self._note_point(0, float(outcome.parameter[0]), int(outcome.iterations[0]))
        nodes = outcome.nodes.reshape(self.n_runs, self.arrays.n_nodes, 3)
        if self.history and self.history[-1].parameter == outcome.parameter[0]:
            # What the last point was told by prediction is measured now.
            last = replace(self.history[-1], nodes=nodes[0].copy(), tensions=outcome.tensions[0].copy())
            self.history[-1] = last
        nothing_at = np.where(failed, np.nan, 0.0)
        stands = (self._is(Status.STABLE) | self._is(Status.SNAPPED))[:, None, None]
        return StageEnd(
            name=self.name,
            nodes=nodes + nothing_at[:, None, None],
            tensions=outcome.tensions + nothing_at[:, None],
            parameter=outcome.parameter,
            status=self.status,
            reason=self.reason,
            residual=outcome.residual + nothing_at,
            lowest_eigenvalue=lowest + nothing_at,
            n_negative=np.where(failed, 0, certificate.n_negative),
            strain_energy=certificate.strain_energy + nothing_at,
            steps=outcome.steps,
            iterations=outcome.iterations,
            nodes_by=np.where(stands, by.nodes_by, np.nan),
            tensions_by=np.where(stands, by.tensions_by, np.nan),
            critical_points=self.critical_points,
            slack_events=self.slack_events,
            history=self.history,
            last_load=self.load(0, float(outcome.parameter[0])) if self.n_runs == 1 else None,
        )

    def _hold_anew(self, runs: IndexArray) -> None:
        """Bring bodies into balance whose shape has outgrown what is held for their rigid motions."""
        for run in map(int, runs):
            alone = self.stage.of_run(run)
            stiffness = self.runs.stiffness[run if len(self.runs.stiffness) > 1 else 0]
            nodes = self.outcome.nodes[run].reshape(1, -1, 3)
            solver = Solver(self.solver.given, self.settings, 1, self._motions, nodes[0])
            # What is held stays where it is, not where the stage's supports would take it from its start.
            here = replace(alone, positions_start=nodes[0], positions_end=nodes[0])
            there = solver.outcome(nodes, 1, float(self.outcome.parameter[run]))
            solver.stand(solver.runs(here, stiffness, nodes, 1), there)
            near = np.abs(there.nodes - nodes.reshape(1, -1)).max() <= NEAR_BALANCE * self.arrays.size
            if near and there.end[0] in (follow.ARRIVED, follow.OUT_OF_STEPS):
                self.outcome.nodes[run], self.outcome.tensions[run] = there.nodes[0], there.tensions[0]
                held = (self.solver.given.free & ~self.arrays.free).ravel()
                start = np.array(np.broadcast_to(self.runs.start, self.outcome.nodes.shape), order="C")
                start[run, held] = there.nodes[0, held]
                self.runs = self.runs._replace(start=start)

    def _carried_by_pins(self) -> BoolArray:
        """Which runs lean on the coordinates that are held for neutral motions: they are in no equilibrium.

        What the members of a body pull with is in balance by itself, so that no force comes of such a
        coordinate, unless the nodes lie on a line, where they tell one motion less.
        """
        if not len(self._motions):
            return np.zeros(self.n_runs, dtype=np.bool_)
        nodes = self.outcome.nodes.reshape(self.n_runs, self.arrays.n_nodes, 3)
        loads = np.array([self.load(r, float(self.outcome.parameter[r])).force for r in range(self.n_runs)])
        out = internal_forces(self.arrays, nodes, self.outcome.tensions) - loads
        out = np.where(self.solver.given.free & ~self.arrays.free, out, 0.0)
        scale = np.maximum(np.abs(self.outcome.tensions).max(axis=1), np.abs(loads).max(axis=(1, 2)))
        # The other coordinates leave their own residuals to these, by levers as long as the body.
        worst: BoolArray = np.abs(out).max(axis=(1, 2)) > PINNED * self.settings.residual * scale
        return worst & (self._is(Status.STABLE) | self._is(Status.SNAPPED))

    def load(self, run: int, parameter: float) -> Load:
        """Return what acts on a run at a point of its way."""
        alone = self.stage.of_run(run)
        stiffness = self.runs.stiffness[run if len(self.runs.stiffness) > 1 else 0]
        rest_length = np.ascontiguousarray(alone.rest_length_at(parameter))
        return Load(rest_length, stiffness, alone.loads_at(parameter), self.settings.residual)

    @property
    def _tangent(self) -> Tangent:
        if self._one is None:
            self._one = Tangent(self.solver.given, self.solver.pattern, self._motions, self.arrays)
        return self._one

    @property
    def _motions(self) -> RigidMotions:
        none = np.zeros((0, self.arrays.n_nodes, 3))
        return self.solver.motions if self.solver.motions is not None else RigidMotions((), none, none)

    def measured(self, run: int, nodes: FloatArray, parameter: float) -> Tangent:
        """Return the tangent of a run, measured at some positions under the inputs at λ."""
        self._tangent.measure(nodes.reshape(-1, 3), self.load(run, parameter))
        return self._tangent

    def _stiffest(self) -> FloatArray:
        """Largest EA/l₀ of each run at the end of its way."""
        rest_length = np.abs(self.stage.rest_length_at(1.0))
        stiffest = plain.by_length(1.0, rest_length, self.stiffness).max(axis=-1, initial=0.0)
        return np.array(np.broadcast_to(stiffest, (self.n_runs,)))

    # -- what is told ----------------------------------------------------------------------------

    def _is(self, status: Status) -> BoolArray:
        return np.array([one is status for one in self.status], dtype=np.bool_)

    def _set(self, run: int, status: Status, reason: str) -> None:
        snaps = [str(p) for p in self.critical_points[run] if self._is_snap(p)]
        self.status[run], self.reason[run] = status, "; ".join([*snaps, reason])

    def _fail(self, run: int, reason: str) -> None:
        self._set(run, Status.FAILED, reason)

    def _is_snap(self, point: CriticalPoint) -> bool:
        return point.snap > SNAP * self.arrays.size

    def _percent(self, run: int) -> str:
        return f"{100.0 * self.outcome.parameter[run]:.4g} %"

    def _note_critical(self, run: int, kind: str, after: FloatArray | None = None, snap: float = 0.0) -> None:
        """Record the end of a branch and the fall from it; its mode and energy for a single run alone."""
        parameter, lowest, released = float(self.outcome.parameter[run]), np.nan, 0.0
        moved: tuple[str, ...] = ()
        if self._record is not None:
            load = self.load(run, parameter)
            if after is not None:
                self._tangent.measure(after, load)
                released = -self._tangent.potential(load)
            self._tangent.measure(self.outcome.nodes[run].reshape(-1, 3), load)
            if after is not None:
                released += self._tangent.potential(load)
            spectrum = self._tangent.spectrum(1)
            if len(spectrum.values):
                moved = most_moved(self.arrays.node_ids, np.linalg.norm(spectrum.vectors[0], axis=1))
            lowest = lowest_of(spectrum)
        points = self.critical_points[run]
        if points and not self._is_snap(points[-1]) and parameter - points[-1].parameter < SAME_POINT:
            # The branch had not ended there after all, but hardly farther on.
            points.pop()
        points.append(CriticalPoint(self.name, parameter, kind, lowest, moved, snap, max(0.0, released)))

    def _taut(self, run: int, nodes: FloatArray) -> BoolArray:
        return self.measured(run, nodes.reshape(-1, 3), float(self.outcome.parameter[run])).taut.copy()

    def _note_events(self, before: BoolArray, after: BoolArray, parameter: float) -> None:
        for e in np.flatnonzero(before != after):
            becomes = "taut" if after[e] else "slack"
            self.slack_events.append(SlackEvent(self.name, parameter, self.arrays.member_ids[e], becomes))

    def _note_point(self, run: int, parameter: float, iterations: int) -> None:
        """Add where a single run is to its history."""
        if self._record is None:
            return
        nodes = self.outcome.nodes[run].reshape(-1, 3)
        self._tangent.measure(nodes, self.load(run, parameter))
        self.history.append(PathPoint(self.name, parameter, nodes.copy(), self._tangent.tension, iterations))

    def _drain(self) -> None:
        """Take what the follower recorded of a single run."""
        record = self._record
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
