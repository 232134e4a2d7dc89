"""Follow a branch past its critical points by arc length.

Beyond the end of the stable branch the path parameter may turn back, so it becomes an unknown: each
step prescribes the distance along the branch instead (Riks 1979, Crisfield 1981), measured in the
positions relative to the structure's size and in λ.
"""

from dataclasses import dataclass

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.equilibrium import (
    RESIDUAL_TOLERANCE,
    newton,
    predicted_tension,
    unbalanced,
    unbalanced_by,
)
from tensegra.mechanics.follow import StageFollower, StageRun, most_moved
from tensegra.mechanics.status import CriticalPoint, Status

LARGEST_ARC = 0.03
"""Longest step along the branch, as a share of the structure's size."""

LOWEST_PARAMETER = -2.0
"""A branch may pass through reversed inputs on its way; beyond this it is given up."""

SMALLEST_ARC = 1e-9
"""Step below which the branch cannot be followed."""


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A point of the branch: λ, positions, the unit tangent (∂x/∂s, ∂λ/∂s) and the inertia of K."""

    parameter: float
    nodes: FloatArray
    motion: FloatArray
    rate: float
    n_negative: int
    iterations: int = 0


def trace_branch(follower: StageFollower, run: StageRun) -> None:
    """Go on from the end of the stable branch until λ = 1.

    Every critical point passed is noted. The run ends ``snapped`` where the branch is stable again
    at λ = 1 (it left its stable part on the way), ``unstable`` where it is not, ``failed`` where the
    branch never comes back to λ = 1.
    """
    run.critical_points.clear()
    here = _point(follower, run.nodes, run.parameter, None)
    arc = 0.25 * LARGEST_ARC
    while run.steps < follower.settings.max_steps:
        there = _step(follower, here, arc)
        if there is None:
            arc *= 0.4
            if arc < SMALLEST_ARC:
                run.end(Status.FAILED, f"the branch is lost at {100 * here.parameter:.4g} % of the stage")
                return
            continue
        if there.n_negative != here.n_negative:
            _note(follower, run, *_locate(follower, here, there, arc))
        if there.parameter >= 1.0:
            _finish(follower, run, here, there)
            return
        if there.parameter < LOWEST_PARAMETER:
            run.end(Status.FAILED, f"the branch does not come back, after {_passed(run)}")
            return
        run.steps += 1
        run.iterations += there.iterations
        run.nodes, run.parameter = there.nodes, there.parameter
        unbalanced(follower.tangent, there.nodes, follower.load_at(there.parameter))
        follower.record(run, there.iterations)
        here = there
        arc = min(LARGEST_ARC, arc * (1.5 if there.iterations <= 4 else 0.7 if there.iterations > 6 else 1.0))
    run.end(Status.FAILED, f"no end after {run.steps} steps along the branch")


def _point(
    follower: StageFollower,
    nodes: FloatArray,
    parameter: float,
    before: BranchPoint | None,
    iterations: int = 0,
) -> BranchPoint:
    """Measure a point of the branch and orient its tangent like the one before it."""
    size = follower.arrays.size
    unbalanced(follower.tangent, nodes, follower.load_at(parameter))
    n_negative = follower.tangent.factorise()
    velocity, _ = follower.velocity(parameter)
    norm = float(np.sqrt(np.sum((velocity / size) ** 2) + 1.0))
    motion, rate = velocity / norm, 1.0 / norm
    if before is not None and np.sum(motion * before.motion) / size**2 + rate * before.rate < 0.0:
        motion, rate = -motion, -rate
    return BranchPoint(parameter, nodes, motion, rate, n_negative, iterations)


def _step(follower: StageFollower, here: BranchPoint, arc: float) -> BranchPoint | None:
    """Take a step of length `arc`; None where the corrector does not converge."""
    tangent, size = follower.tangent, follower.arrays.size
    x, parameter = here.nodes + arc * here.motion, here.parameter + arc * here.rate
    tension: FloatArray | None = None
    last_move = np.inf
    for iteration in range(10):
        load = follower.load_at(parameter)
        x = follower.with_supports(x, parameter)
        out, residual = unbalanced_by(tangent, x, load, tension)
        if residual <= RESIDUAL_TOLERANCE and unbalanced(tangent, x, load)[1] <= RESIDUAL_TOLERANCE:
            turned = (
                np.sum((x - here.nodes) * here.motion) / size**2 + (parameter - here.parameter) * here.rate
            )
            return _point(follower, x, parameter, here, iteration) if turned > 0.0 else None
        tangent.factorise()
        velocity, tension_rate = follower.velocity(parameter)
        correction = tangent.solve(-out)
        ahead = np.sum((x + correction - here.nodes) * here.motion) / size**2
        ahead += (parameter - here.parameter) * here.rate - arc
        slope = np.sum(velocity * here.motion) / size**2 + here.rate
        change = -ahead / slope
        move = correction + change * velocity
        size_of_move = float(np.abs(move).max() / size + abs(change))
        if not size_of_move < 5.0 * arc or (iteration > 1 and size_of_move > 0.7 * last_move):
            return None
        tension = predicted_tension(tangent, load, correction, change * tension_rate)
        x, parameter, last_move = x + move, parameter + change, size_of_move
    return None


def _locate(
    follower: StageFollower, here: BranchPoint, there: BranchPoint, arc: float
) -> tuple[BranchPoint, str]:
    """Bisect the step to the change of inertia; return the point before it and its kind."""
    low, high, last = 0.0, arc, here
    while high - low > SMALLEST_ARC:
        middle = _step(follower, here, 0.5 * (low + high))
        if middle is None:
            break
        if middle.n_negative == here.n_negative:
            low, last = 0.5 * (low + high), middle
        else:
            high, there = 0.5 * (low + high), middle
    return last, "limit point" if last.rate * there.rate < 0.0 else "bifurcation"


def _note(follower: StageFollower, run: StageRun, point: BranchPoint, kind: str) -> None:
    unbalanced(follower.tangent, point.nodes, follower.load_at(point.parameter))
    spectrum = follower.tangent.spectrum(min(follower.arrays.n_free, point.n_negative + 2))
    nearest = int(np.argmin(np.abs(spectrum.values)))
    moved = most_moved(follower.arrays.node_ids, np.linalg.norm(spectrum.vectors[nearest], axis=1))
    run.critical_points.append(
        CriticalPoint(run.name, point.parameter, kind, float(spectrum.values[nearest]), moved)
    )


def _passed(run: StageRun) -> str:
    return "; ".join(str(point) for point in run.critical_points)


def _finish(follower: StageFollower, run: StageRun, here: BranchPoint, there: BranchPoint) -> None:
    """Land on λ = 1 by Newton's method from the chord of the last step."""
    share = (1.0 - here.parameter) / (there.parameter - here.parameter)
    guess = follower.with_supports(here.nodes + share * (there.nodes - here.nodes), 1.0)
    attempt = newton(follower.tangent, guess, follower.load_at(1.0))
    run.iterations += attempt.iterations
    if not attempt.converged:
        run.end(Status.FAILED, f"the branch could not be closed at its end, after {_passed(run)}")
        return
    run.nodes, run.parameter = attempt.nodes, 1.0
    run.steps += 1
    follower.record(run, attempt.iterations)
    outcome = Status.UNSTABLE if follower.tangent.n_negative > 0 else Status.SNAPPED
    run.end(outcome, f"traced through {_passed(run)}")
