"""Follow one stage: adaptive steps along the branch of stable equilibria.

A step is a tangent predictor and a Newton corrector. It is taken back and cut where the corrector
does not contract, moves the structure far, or lands where K is not positive definite any more.
Where no step is small enough the stable branch has ended: the point is located, named, and the
policy decides whether the path stops there or the structure settles into the equilibrium below.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.equilibrium import FLAT_TENSION, Attempt, Load, descend, newton, unbalanced
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.results import CriticalPoint, PathPoint, SlackEvent, Status
from tensegra.mechanics.tangent import Tangent

Policy = Literal["settle", "stop"]


@dataclass(frozen=True)
class PathSettings:
    """How a path is followed.

    Attributes
    ----------
    policy
        What to do where the stable branch ends: ``settle`` into the stable equilibrium that a
        slowly loaded structure falls into, or ``stop``.
    first_step
        First increment of the path parameter.
    smallest_step
        Increment below which the branch is held to end; critical points are located to it.
    largest_move
        Largest move of a coordinate in one step, as a share of the structure's size.
    contraction
        Ratio of successive Newton corrections above which a step is cut.
    max_steps
        Steps of one stage after which it fails.
    """

    policy: Policy = "settle"
    first_step: float = 0.25
    smallest_step: float = 2e-7
    largest_move: float = 0.05
    contraction: float = 0.5
    max_steps: int = 20_000


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
        self._last: tuple[float, FloatArray] | None = None

    def load_at(self, parameter: float) -> Load:
        """Return what acts at the path parameter."""
        return Load(
            self.inputs.rest_length_at(parameter), self.stiffness, self.inputs.loads_at(parameter)
        )

    def with_supports(self, nodes: FloatArray, parameter: float) -> FloatArray:
        """Return `nodes` with the held coordinates where the supports are at the parameter."""
        return np.where(self.arrays.free, nodes, self.inputs.positions_at(parameter))

    def velocity(self, parameter: float) -> tuple[FloatArray, FloatArray]:
        """Return dx/dλ, ``(n_nodes, 3)``, and dT/dλ, ``(n_members,)``.

        The equilibrium at `parameter` has to be the one last measured and factorised.
        """
        inputs, tangent = self.inputs, self.tangent
        held = np.where(self.arrays.free, 0.0, inputs.positions_end - inputs.positions_start)
        rest_length = inputs.rest_length_at(parameter)
        tension_rate = -tangent.axial * tangent.length / rest_length * inputs.rest_length_rate(parameter)
        force_rate = tangent.force_rate(held, tension_rate) - (inputs.loads_end - inputs.loads_start)
        velocity = tangent.solve(-force_rate) + held
        return velocity, tangent.axial * tangent.length_rate(velocity) + tension_rate

    def run(self, name: str, nodes: FloatArray) -> StageRun:
        """Follow the stage from the equilibrium `nodes` at λ = 0."""
        run = StageRun(name, nodes)
        start = newton(self.tangent, nodes, self.load_at(0.0), max_iterations=4)
        if start.converged and self.tangent.n_negative == 0:
            run.nodes = start.nodes
        elif not self._leave_branch(run, "unstable start", nodes):
            return run
        self._record(run, self.tangent.taut, 0)
        step = self.settings.first_step
        while run.parameter < 1.0 and run.outcome in (Status.STABLE, Status.SNAPPED):
            step = self._advance(run, step)
            if run.steps >= self.settings.max_steps:
                run.outcome = Status.FAILED
                run.reason = f"no end after {run.steps} steps, at {100 * run.parameter:.4g} % of the stage"
        return run

    def _advance(self, run: StageRun, step: float) -> float:
        """Take one step, as large as it may be, and return the next."""
        velocity, tension_rate = self.velocity(run.parameter)
        speed = float(np.abs(velocity).max())
        taut, tension = self.tangent.taut.copy(), self.tangent.tension.copy()
        bend = self._bend(run, velocity)
        step = min(step, self.largest_move / speed if speed > 0.0 else 1.0)
        cut = False
        while step >= self.settings.smallest_step or run.parameter + step >= 1.0:
            parameter = min(1.0, run.parameter + step)
            if 1.0 - parameter < self.settings.smallest_step:
                parameter = 1.0
            increment = parameter - run.parameter
            move = increment * velocity + 0.5 * increment**2 * bend
            guess = self.with_supports(run.nodes + move, parameter)
            attempt = newton(
                self.tangent,
                guess,
                self.load_at(parameter),
                tension=tension + increment * tension_rate,
                largest_move=0.5 * increment * speed + 0.1 * self.largest_move,
                slowest_contraction=self.settings.contraction,
            )
            run.iterations += attempt.iterations
            if attempt.converged and self.tangent.n_negative == 0:
                correction = float(np.abs(attempt.nodes - guess).max())
                self._last = run.parameter, velocity
                run.nodes, run.parameter = attempt.nodes, parameter
                self._record(run, taut, attempt.iterations)
                return self._next_step(increment, correction, increment * speed, cut=cut)
            cut = True
            step = 0.4 * increment
            if step < self.settings.smallest_step:
                break
        self._end_of_branch(run, taut)
        return self.settings.first_step

    def _bend(self, run: StageRun, velocity: FloatArray) -> FloatArray:
        """Estimate d²x/dλ² from the last two velocities: a predictor of second order."""
        if self._last is None:
            return np.zeros_like(velocity)
        parameter, before = self._last
        return (velocity - before) / (run.parameter - parameter)

    def _next_step(self, increment: float, correction: float, predicted: float, *, cut: bool) -> float:
        """Aim at a correction of a tenth of the predicted move: the error grows with the square."""
        if cut:
            return increment
        aim = 0.1 * predicted + 0.01 * self.largest_move
        factor = min(3.0, max(0.5, aim / correction)) if correction > 0.0 else 3.0
        return increment * factor

    def _record(self, run: StageRun, taut_before: np.ndarray, iterations: int) -> None:
        changed = np.flatnonzero(self.tangent.taut != taut_before)
        for e in changed:
            becomes = "taut" if self.tangent.taut[e] else "slack"
            run.slack_events.append(
                SlackEvent(run.name, run.parameter, self.arrays.member_ids[e], becomes)
            )
        run.steps += 1
        run.history.append(
            PathPoint(run.name, run.parameter, run.nodes, self.tangent.tension.copy(), iterations)
        )

    def _end_of_branch(self, run: StageRun, taut: np.ndarray) -> None:
        """Name the point where the stable branch ends and do what the policy says."""
        load = self.load_at(run.parameter)
        out, _ = unbalanced(self.tangent, run.nodes, load)
        self.tangent.factorise()
        kind = self._kind(run, taut)
        if self.settings.policy == "stop":
            self._note_critical(run, kind, run.nodes, 0.0)
            run.outcome = Status.UNSTABLE
            run.reason = f"the stable path ends: {run.critical_points[-1]}"
            return
        self._leave_branch(run, kind, run.nodes)

    def _kind(self, run: StageRun, taut: np.ndarray) -> str:
        """Tell a collapse, a fold, a bifurcation and a cable gone slack apart."""
        touches = self.arrays.free.any(axis=1)[self.arrays.segment_nodes].any(axis=1)
        moving = np.logical_or.reduceat(touches, self.arrays.segment_start[:-1])
        loaded = np.abs(self.inputs.loads_at(run.parameter)[self.arrays.free]).max(initial=0.0) > 0.0
        carried = np.abs(self.tangent.tension[moving]).max(initial=0.0)
        if not loaded and carried < 1e-3 * self.reference_tension:
            return "collapse"
        spectrum = self.tangent.spectrum(1)
        speed = np.abs(self.velocity_from(run.parameter)).max()
        beyond = newton(
            self.tangent,
            self.with_supports(run.nodes, run.parameter),
            self.load_at(min(1.0, run.parameter + self.settings.smallest_step)),
            largest_move=0.1 * self.largest_move,
        )
        if beyond.converged and np.any(self.tangent.taut != taut):
            return "slack"
        if beyond.converged and self.tangent.n_negative > 0:
            return "bifurcation"
        near_zero = spectrum.values[0] * self.arrays.size < 1e-3 * self.reference_tension
        return "limit point" if near_zero or speed > 1e3 * self.arrays.size else "slack"

    def velocity_from(self, parameter: float) -> FloatArray:
        """Return dx/dλ after factorising K at the last measure."""
        self.tangent.factorise()
        return self.velocity(parameter)[0]

    def _leave_branch(self, run: StageRun, kind: str, before: FloatArray) -> bool:
        """Settle just beyond the end of the branch; return whether the path can go on from there."""
        self._last = None
        parameter = min(1.0, run.parameter + 2.0 * self.settings.smallest_step)
        fallen = self.fall(run, before, parameter)
        if fallen.flat:
            at_end = self.fall(run, fallen.nodes, 1.0)
            if at_end.flat or not at_end.converged:
                self._note_critical(run, "collapse", before, 0.0)
                run.nodes, run.parameter = at_end.nodes, 1.0
                run.outcome = Status.COLLAPSED if at_end.flat else "failed"
                run.reason = (
                    f"prestress lost: {run.critical_points[-1]}"
                    if at_end.flat
                    else f"no equilibrium found beyond {run.critical_points[-1]}"
                )
                return False
            parameter, fallen, kind = 1.0, at_end, "collapse"
        if not fallen.converged:
            self._note_critical(run, kind, before, 0.0)
            run.outcome = Status.FAILED
            run.reason = f"the fall beyond {run.critical_points[-1]} found no equilibrium"
            return False
        snap = float(np.linalg.norm(fallen.nodes - before, axis=1).max())
        run.nodes, run.parameter = fallen.nodes, parameter
        if snap > 1e-4 * self.arrays.size:
            self._note_critical(run, kind, before, snap)
            run.outcome = Status.SNAPPED
            run.reason = "; ".join(str(point) for point in run.critical_points)
        newton(self.tangent, run.nodes, self.load_at(run.parameter), max_iterations=4)
        return True

    def fall(self, run: StageRun, nodes: FloatArray, parameter: float) -> Attempt:
        attempt = descend(
            self.tangent,
            self.with_supports(nodes, parameter),
            self.load_at(parameter),
            reference_tension=self.reference_tension,
            largest_move=0.4 * self.largest_move,
        )
        run.iterations += attempt.iterations
        return attempt

    def _note_critical(self, run: StageRun, kind: str, before: FloatArray, snap: float) -> None:
        """Record the critical point with the mode of K at the last stable position."""
        after = self.tangent
        load = self.load_at(run.parameter)
        unbalanced(after, before, load)
        spectrum = after.spectrum(1)
        mode = np.linalg.norm(spectrum.vectors[0], axis=1)
        most = np.argsort(-mode, kind="stable")[:4]
        moved = tuple(self.arrays.node_ids[n] for n in most if mode[n] > 0.3 * mode.max(initial=0.0))
        run.critical_points.append(
            CriticalPoint(run.name, run.parameter, kind, float(spectrum.values[0]), moved, snap)
        )


def reference_tension(tensions: FloatArray, stiffness: FloatArray) -> float:
    """Return what counts as a tension of the structure: the largest it has had, never nothing."""
    return max(float(np.abs(tensions).max(initial=0.0)), FLAT_TENSION * float(stiffness.max(initial=1.0)))
