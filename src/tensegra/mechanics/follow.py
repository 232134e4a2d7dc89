"""Follow one stage: adaptive steps along the branch of stable equilibria.

A step is a predictor of second order and a Newton corrector. It is taken back and cut where the
corrector does not contract, moves the structure far from the guess, or lands where K is not
positive definite any more. Where a cable goes slack or comes taut on the way, the step ends there.
Where no step is small enough the stable branch has ended: the point is located, named, and the
policy decides whether the path stops there or the structure settles into the equilibrium below.
"""

from dataclasses import dataclass, field

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray, path_lengths
from tensegra.mechanics.equilibrium import (
    FLAT_TENSION,
    ZERO_EIGENVALUE,
    Attempt,
    Load,
    carried_tension,
    descend,
    newton,
    potential,
    unbalanced,
)
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.status import CriticalPoint, PathPoint, SlackEvent, Status
from tensegra.mechanics.tangent import Tangent

SNAP = 1e-4
"""A fall that moves no node by this share of the structure's size has not left the branch."""

STILL_STIFF = 0.02
"""Share of the first lowest eigenvalue that a smooth loss of stability is far below when located."""

ALONG_MODE = 1e-4
"""Share of a change of the loads along the critical mode from which on it is a fold."""

FARTHEST_FALL = 0.02
"""Increment beyond a critical point within which a structure that falls has to find a stable place."""

PRESTRESS_GONE = 1e-3
"""Where the branch ends with less than this share of the reference tension left, it is a collapse."""


@dataclass(eq=False)
class StageRun:
    """Where a stage stands: mutable, owned by the follower."""

    name: str
    nodes: FloatArray
    parameter: float = 0.0
    steps: int = 0
    iterations: int = 0
    outcome: Status = Status.STABLE
    reason: str = ""
    critical_points: list[CriticalPoint] = field(default_factory=list)
    slack_events: list[SlackEvent] = field(default_factory=list)
    history: list[PathPoint] = field(default_factory=list)

    @property
    def goes_on(self) -> bool:
        """Whether the end of the stage is still ahead."""
        return self.parameter < 1.0 and self.outcome in (Status.STABLE, Status.SNAPPED)

    def end(self, outcome: Status, reason: str) -> None:
        """Set the outcome and the reason for it."""
        self.outcome, self.reason = outcome, reason


@dataclass(frozen=True, eq=False)
class Departure:
    """An accepted point with its derivatives by λ: where the next step starts."""

    parameter: float
    nodes: FloatArray
    tension: FloatArray
    taut: BoolArray
    velocity: FloatArray
    tension_rate: FloatArray
    bend: FloatArray

    @property
    def speed(self) -> float:
        """Largest velocity of a coordinate."""
        return float(np.abs(self.velocity).max(initial=0.0))


class StageFollower:
    """Follows one stage of a structure from an equilibrium at λ = 0 to λ = 1."""

    def __init__(
        self,
        tangent: Tangent,
        inputs: StageInputs,
        stiffness: FloatArray,
        reference_tension: float,
        settings: PathSettings,
    ) -> None:
        self.tangent = tangent
        self.inputs = inputs
        self.stiffness = stiffness
        self.reference_tension = reference_tension
        self.settings = settings
        self.arrays = tangent.arrays
        self.largest_move = settings.largest_move * self.arrays.size
        self._last: Departure | None = None

    def load_at(self, parameter: float) -> Load:
        """Return what acts at the path parameter."""
        return Load(self.inputs.rest_length_at(parameter), self.stiffness, self.inputs.loads_at(parameter))

    def with_supports(self, nodes: FloatArray, parameter: float) -> FloatArray:
        """Return `nodes` with the held coordinates where the supports are at the parameter."""
        return np.where(self.arrays.free, nodes, self.inputs.positions_at(parameter))

    def velocity(self, parameter: float) -> tuple[FloatArray, FloatArray]:
        """Return dx/dλ, ``(n_nodes, 3)``, and dT/dλ, ``(n_members,)``.

        The equilibrium at `parameter` has to be the one last measured and factorised.
        """
        inputs, tangent = self.inputs, self.tangent
        held = np.where(self.arrays.free, 0.0, inputs.positions_end - inputs.positions_start)
        tension_rate = self._tension_rate(parameter)
        force_rate = tangent.force_rate(held, tension_rate) - (inputs.loads_end - inputs.loads_start)
        velocity = tangent.solve(-force_rate) + held
        return velocity, tangent.axial * tangent.length_rate(velocity) + tension_rate

    def start(self, name: str, nodes: FloatArray) -> StageRun:
        """Begin a stage at the equilibrium `nodes`; one that does not stand falls at once."""
        run = StageRun(name, nodes)
        attempt = newton(self.tangent, nodes, self.load_at(0.0), max_iterations=4)
        if attempt.converged and self.tangent.n_negative == 0:
            run.nodes = attempt.nodes
        elif not self._settle(run, "unstable start"):
            return run
        self.record(run, 0)
        return run

    def run(self, name: str, nodes: FloatArray) -> StageRun:
        """Follow the stage from the equilibrium `nodes` at λ = 0."""
        run = self.start(name, nodes)
        step = self.settings.first_step
        while run.goes_on:
            step = self._advance(run, step)
            if run.steps >= self.settings.max_steps:
                run.end(Status.FAILED, f"{run.steps} steps end at {100 * run.parameter:.4g} % of the stage")
        return run

    def _advance(self, run: StageRun, step: float) -> float:
        """Take one step, as large as it may be, and return the next."""
        here = self._departure(run)
        step = min(step, self.largest_move / here.speed if here.speed > 0.0 else 1.0)
        cut = False
        while True:
            parameter = min(1.0, run.parameter + step)
            if 1.0 - parameter < self.settings.smallest_step:
                parameter = 1.0
            increment = parameter - run.parameter
            guess, attempt = self._attempt(here, parameter)
            run.iterations += attempt.iterations
            if attempt.converged and self.tangent.n_negative == 0:
                correction = float(np.abs(attempt.nodes - guess).max(initial=0.0))
                parameter, attempt = self._first_event(run, here, parameter, attempt)
                self._last = here
                run.nodes, run.parameter = attempt.nodes, parameter
                self._note_events(run, here.taut, self.tangent.taut)
                run.steps += 1
                self.record(run, attempt.iterations)
                return self._next_step(increment, correction, increment * here.speed, cut=cut)
            cut, step = True, 0.4 * increment
            if step < self.settings.smallest_step:
                break
        self._end_of_branch(run, here)
        return self.settings.first_step

    def _departure(self, run: StageRun) -> Departure:
        """Differentiate at the point last accepted; curvature comes from the two last velocities."""
        velocity, tension_rate = self.velocity(run.parameter)
        taut = self.tangent.taut
        bend = np.zeros_like(velocity)
        last = self._last
        if last is not None and run.parameter > last.parameter and np.array_equal(last.taut, taut):
            bend = (velocity - last.velocity) / (run.parameter - last.parameter)
        return Departure(
            run.parameter, run.nodes, self.tangent.tension.copy(), taut, velocity, tension_rate, bend
        )

    def _attempt(self, here: Departure, parameter: float) -> tuple[FloatArray, Attempt]:
        """Predict and correct; return the guess and the outcome."""
        increment = parameter - here.parameter
        move = increment * here.velocity + 0.5 * increment**2 * here.bend
        guess = self.with_supports(here.nodes + move, parameter)
        attempt = newton(
            self.tangent,
            guess,
            self.load_at(parameter),
            tension=here.tension + increment * here.tension_rate,
            largest_move=0.5 * increment * here.speed + 0.1 * self.largest_move,
            slowest_contraction=self.settings.contraction,
            polish=parameter >= 1.0,
        )
        return guess, attempt

    def _first_event(
        self, run: StageRun, here: Departure, parameter: float, attempt: Attempt
    ) -> tuple[float, Attempt]:
        """Shorten an accepted step to the first change between slack and taut within it.

        The event is bracketed from both sides in turn, close to where the elongations of the
        members that change vanish by interpolation, and by halving where that does not help; the
        point returned lies behind it by the smallest step at most. Where a point on the way is not
        reached, the step ends at the nearest that was.
        """
        before, after = here.parameter, parameter
        gap_before, gap_after = self._gaps(here.nodes, before), self._gaps(attempt.nodes, after)
        reached, margin, halve = attempt, 0.02, False
        changed = np.flatnonzero(self.tangent.taut != here.taut)
        while len(changed) and after - before > self.settings.smallest_step:
            with np.errstate(divide="ignore", invalid="ignore"):  # gaps that do not change
                shares = gap_before[changed] / (gap_before[changed] - gap_after[changed])
            share = float(np.min(shares, where=np.isfinite(shares), initial=1.0)) + margin
            share = 0.5 if halve else min(0.98, max(0.02, share))
            width, aim = after - before, before + share * (after - before)
            _, trial = self._attempt(here, aim)
            run.iterations += trial.iterations
            if not (trial.converged and self.tangent.n_negative == 0):
                break
            changes = np.flatnonzero(self.tangent.taut != here.taut)
            if len(changes):
                after, gap_after, reached, changed = aim, self._gaps(trial.nodes, aim), trial, changes
            else:
                before, gap_before = aim, self._gaps(trial.nodes, aim)
            margin, halve = -margin, after - before > 0.5 * width and not halve
        if reached is not attempt or len(changed):
            unbalanced(self.tangent, reached.nodes, self.load_at(after))
            self.tangent.factorise()
        return after, reached

    def _gaps(self, nodes: FloatArray, parameter: float) -> FloatArray:
        """Elongations ℓ − l₀ of all members at a position."""
        gaps: FloatArray = path_lengths(self.arrays, nodes) - self.inputs.rest_length_at(parameter)
        return gaps

    def _next_step(self, increment: float, correction: float, predicted: float, *, cut: bool) -> float:
        """Aim at a correction of a tenth of the predicted move: the error grows with the square."""
        if cut:
            return increment
        aim = 0.1 * predicted + 0.01 * self.largest_move
        factor = min(3.0, max(0.5, aim / correction)) if correction > 0.0 else 3.0
        return increment * factor

    def _note_events(self, run: StageRun, before: BoolArray, after: BoolArray) -> None:
        for e in np.flatnonzero(before != after):
            becomes = "taut" if after[e] else "slack"
            run.slack_events.append(SlackEvent(run.name, run.parameter, self.arrays.member_ids[e], becomes))

    def record(self, run: StageRun, iterations: int) -> None:
        """Add where the run stands, at the last measure, to its history."""
        tension = self.tangent.tension.copy()
        run.history.append(PathPoint(run.name, run.parameter, run.nodes, tension, iterations))

    def _end_of_branch(self, run: StageRun, here: Departure) -> None:
        """Name the point where the stable branch ends and do what the policy says."""
        kind = self._kind(run, here)
        if self.settings.policy == "settle":
            self._settle(run, kind)
            return
        self._note_critical(run, kind)
        run.end(Status.UNSTABLE, f"the stable path ends: {run.critical_points[-1]}")

    def _kind(self, run: StageRun, here: Departure) -> str:
        """Tell a collapse, a cable gone slack, a bifurcation and a fold apart.

        K goes to zero along a mode φ at a fold and at a bifurcation, but only at a fold does what is
        being changed push along φ; where K was still stiff the next step, a cable took it away.
        """
        tangent = self.tangent
        unbalanced(tangent, run.history[0].nodes, self.load_at(run.history[0].parameter))
        at_start = tangent.lowest_eigenvalue()
        unbalanced(tangent, run.nodes, self.load_at(run.parameter))
        carried, loaded = carried_tension(tangent, self.load_at(run.parameter))
        if not loaded and carried < PRESTRESS_GONE * self.reference_tension:
            return "collapse"
        spectrum = tangent.spectrum(1)
        if spectrum.values[0] > STILL_STIFF * at_start:
            return "slack"
        mode = spectrum.vectors[0]
        push = tangent.force_rate(
            np.where(self.arrays.free, 0.0, here.velocity), self._tension_rate(run.parameter)
        )
        push = np.where(self.arrays.free, push - (self.inputs.loads_end - self.inputs.loads_start), 0.0)
        along = abs(float(np.sum(push * mode)))
        return "limit point" if along > ALONG_MODE * float(np.linalg.norm(push)) else "bifurcation"

    def _tension_rate(self, parameter: float) -> FloatArray:
        """Rate dT/dλ of the tensions where the nodes stay, at the last measure."""
        rest_length = self.inputs.rest_length_at(parameter)
        rate = self.inputs.rest_length_rate(parameter)
        drop: FloatArray = -self.tangent.axial * self.tangent.length / rest_length * rate
        return drop

    def _settle(self, run: StageRun, kind: str) -> bool:
        """Fall just beyond the end of the branch; return whether the path can go on from there."""
        self._last = None
        before = run.nodes
        unbalanced(self.tangent, before, self.load_at(run.parameter))
        taut = self.tangent.taut
        ahead = 2.0 * self.settings.smallest_step
        if kind == "unstable start" and self._is_neutral():
            ahead = self.settings.first_step  # nothing to fall from: let the inputs take hold first
        parameter = min(1.0, run.parameter + ahead)
        fallen = self.fall(run, before, parameter)
        while fallen.neutral and ahead < FARTHEST_FALL:
            # Just beyond a critical point K is not told from a singular one: fall farther on.
            ahead *= 10.0
            parameter = min(1.0, run.parameter + ahead)
            fallen = self.fall(run, before, parameter)
        if fallen.flat or fallen.neutral:
            # Nothing carries force here. What follows may tighten the structure again.
            kind, parameter = "collapse", 1.0
            fallen = self.fall(run, fallen.nodes, parameter)
        self._note_events(run, taut, self.tangent.taut)
        if fallen.flat or fallen.neutral or not fallen.converged:
            self._note_critical(run, kind)
            where = run.critical_points[-1]
            run.nodes, run.parameter = fallen.nodes, 1.0
            if fallen.converged:
                run.end(Status.COLLAPSED, f"prestress lost: {where}")
            else:
                run.end(Status.FAILED, f"the fall beyond {where} found no equilibrium")
            return False
        snap = float(np.linalg.norm(fallen.nodes - before, axis=1).max())
        if snap > SNAP * self.arrays.size:
            self._note_critical(run, kind, after=fallen.nodes)
            run.end(Status.SNAPPED, "; ".join(str(point) for point in run.critical_points))
        elif kind == "bifurcation":
            # The path forks without a jump: it stays a continuous path of stable equilibria.
            self._note_critical(run, kind)
        run.nodes, run.parameter = fallen.nodes, parameter
        newton(self.tangent, run.nodes, self.load_at(parameter), max_iterations=4)
        return True

    def _is_neutral(self) -> bool:
        """Whether K is singular, but not negative, at the last measure."""
        lowest = self.tangent.lowest_eigenvalue()
        return abs(lowest) <= ZERO_EIGENVALUE * self.tangent.stiffness_scale

    def fall(self, run: StageRun, nodes: FloatArray, parameter: float) -> Attempt:
        """Descend from `nodes` under the inputs at `parameter`."""
        attempt = descend(
            self.tangent,
            self.with_supports(nodes, parameter),
            self.load_at(parameter),
            reference_tension=self.reference_tension,
            largest_move=0.4 * self.largest_move,
        )
        run.iterations += attempt.iterations
        return attempt

    def _note_critical(self, run: StageRun, kind: str, after: FloatArray | None = None) -> None:
        """Record the end of the branch, with its mode, and the fall from it to `after`."""
        load = self.load_at(run.parameter)
        snap = released = 0.0
        if after is not None:
            unbalanced(self.tangent, after, load)
            released = -potential(self.tangent, after, load)
            snap = float(np.linalg.norm(after - run.nodes, axis=1).max())
        unbalanced(self.tangent, run.nodes, load)
        if after is not None:
            released += potential(self.tangent, run.nodes, load)
        spectrum = self.tangent.spectrum(1)
        motion = np.linalg.norm(spectrum.vectors[0], axis=1)
        moved = most_moved(self.arrays.node_ids, motion)
        run.critical_points.append(
            CriticalPoint(
                run.name, run.parameter, kind, float(spectrum.values[0]), moved, snap, max(0.0, released)
            )
        )


def most_moved(node_ids: tuple[str, ...], motion: FloatArray) -> tuple[str, ...]:
    """Return up to four nodes that move most, none below a third of the largest motion."""
    return most_moved_of_each(node_ids, motion[None])[0]


def most_moved_of_each(node_ids: tuple[str, ...], motions: FloatArray) -> tuple[tuple[str, ...], ...]:
    """Return `most_moved` for each row of `motions`, ``(n, n_nodes)``."""
    most = np.argsort(-motions, axis=1, kind="stable")[:, :4]
    moved = np.take_along_axis(motions, most, axis=1)
    counts = (moved > motions.max(axis=1, keepdims=True, initial=0.0) / 3.0).sum(axis=1)
    return tuple(
        tuple(node_ids[n] for n in row[:count])
        for row, count in zip(most.tolist(), counts.tolist(), strict=True)
    )


def reference_tension(tensions: FloatArray, stiffness: FloatArray) -> float:
    """Return what counts as a tension of the structure: the largest it has had, never nothing."""
    return max(float(np.abs(tensions).max(initial=0.0)), FLAT_TENSION * float(stiffness.max(initial=1.0)))
