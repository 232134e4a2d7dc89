"""Follow an unstable branch by arc length, for the policy ``trace``.

Where the stable branch has ended the path parameter may turn back, so it becomes an unknown: each
step prescribes the distance along the branch instead (Riks 1979, Crisfield 1981), measured in the
positions relative to the structure's size and in λ.
"""

from dataclasses import dataclass, field

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.law import plain
from tensegra.mechanics.stages import Ground, Leg
from tensegra.mechanics.status import CriticalPoint, PathPoint, Status, most_moved
from tensegra.mechanics.tangent import Tangent, lowest_of

LARGEST_ARC = 0.03
"""Longest step along the branch, as a share of the structure's size."""

LOWEST_PARAMETER = -2.0
"""A branch may pass through reversed inputs on its way; beyond this it is given up."""

SMALLEST_ARC = 1e-9
"""Step below which the branch cannot be followed."""

NEAR = 1e-12
"""Correction, as a share of the size, that is rounding."""

MOST_CORRECTIONS = 12
"""Newton solves of one point after which a step is cut."""


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """A point of the branch: λ, positions, the unit tangent (∂x/∂s, ∂λ/∂s) and the inertia of K."""

    parameter: float
    nodes: FloatArray
    motion: FloatArray
    rate: float
    n_negative: int
    iterations: int = 0


@dataclass(eq=False)
class Branch:
    """One run on its way along its branch."""

    tangent: Tangent
    name: str
    stage: StageInputs
    stiffness: FloatArray
    tolerance: float
    max_steps: int
    nodes: FloatArray
    parameter: float
    steps: int = 0
    iterations: int = 0
    status: Status = Status.UNSTABLE
    reason: str = ""
    critical_points: list[CriticalPoint] = field(default_factory=list)
    history: list[PathPoint] = field(default_factory=list)

    def load_at(self, parameter: float) -> Load:
        """Return what acts at λ."""
        return Load(
            self.stage.rest_length_at(parameter),
            self.stiffness,
            self.stage.loads_at(parameter),
            self.tolerance,
        )

    def with_supports(self, nodes: FloatArray, parameter: float) -> FloatArray:
        """Return `nodes` with the held coordinates where the supports are at λ."""
        return np.where(self.tangent.given.free, nodes, self.stage.positions_at(parameter))

    def velocity(self, parameter: float) -> tuple[FloatArray, FloatArray]:
        """Return dx/dλ and dT/dλ at the point last measured and factorised."""
        stage, tangent = self.stage, self.tangent
        held = np.where(tangent.given.free, 0.0, stage.positions_end - stage.positions_start)
        rest_length = stage.rest_length_at(parameter)
        by_length = plain.by_rest_length(tangent.length, rest_length, self.stiffness)
        tension_rate = tangent.taut * by_length * stage.rest_length_rate(parameter)
        force_rate = tangent.force_rate(held, tension_rate) - (stage.loads_end - stage.loads_start)
        velocity = tangent.solve(-force_rate) + held
        return velocity, tangent.axial * tangent.length_rate(velocity) + tension_rate

    def record(self, iterations: int) -> None:
        """Add where the run stands, at the last measure, to its history."""
        self.history.append(
            PathPoint(self.name, self.parameter, self.nodes, self.tangent.tension.copy(), iterations)
        )

    def end(self, status: Status, reason: str) -> None:
        """Set the status and the reason for it."""
        self.status, self.reason = status, reason


def traced(ground: Ground, leg: Leg, end: StageEnd) -> StageEnd:
    """Go on along the branch with every run whose stable branch ended before the stage did."""
    for run in range(leg.n_runs):
        if end.status[run] is not Status.UNSTABLE or end.parameter[run] >= 1.0:
            continue
        stiffness = leg.stiffness if leg.stiffness.ndim == 1 else leg.stiffness[run]
        stage, nodes = leg.stage.of_run(run), end.nodes[run]
        motions = ground.freedom(np.stack([stage.loads_start, stage.loads_end])).neutral
        branch = Branch(
            Tangent(ground.plain_arrays, motions=motions, nodes=nodes),
            leg.name,
            stage,
            stiffness,
            ground.settings.residual,
            ground.settings.max_steps,
            nodes,
            float(end.parameter[run]),
            int(end.steps[run]),
            int(end.iterations[run]),
        )
        trace_branch(branch)
        _take(end, run, branch)
    return end


def _take(end: StageEnd, run: int, branch: Branch) -> None:
    """Write where a branch has led into the end of the stage."""
    end.critical_points[run] = branch.critical_points
    end.status[run], end.reason[run] = branch.status, branch.reason
    end.steps[run], end.iterations[run], end.parameter[run] = (
        branch.steps,
        branch.iterations,
        branch.parameter,
    )
    if branch.status is Status.FAILED:
        end.give_up(run, branch.reason)
        return
    load = branch.load_at(branch.parameter)
    _, end.residual[run] = branch.tangent.measure(branch.nodes, load)
    end.nodes[run], end.tensions[run] = branch.nodes, branch.tangent.tension
    end.strain_energy[run] = branch.tangent.energy(load)
    end.lowest_eigenvalue[run] = lowest_of(branch.tangent.spectrum(1))
    branch.tangent.measure(branch.nodes, load)
    end.n_negative[run] = branch.tangent.factorise()
    if end.last_load is not None:
        end.last_load = load
        end.history.extend(branch.history)


def trace_branch(run: Branch) -> None:
    """Go on from the end of the stable branch until λ = 1.

    Every critical point passed is noted. The run ends ``snapped`` where the branch is stable again
    at λ = 1 (it left its stable part on the way), ``unstable`` where it is not, ``failed`` where the
    branch never comes back to λ = 1.
    """
    run.critical_points.clear()
    here = _point(run, run.nodes, run.parameter, None)
    arc = 0.25 * LARGEST_ARC
    while run.steps < run.max_steps:
        there = _step(run, here, arc)
        if there is None:
            arc *= 0.4
            if arc < SMALLEST_ARC:
                run.end(Status.FAILED, f"the branch is lost at {100 * here.parameter:.4g} % of the stage")
                return
            continue
        if there.n_negative != here.n_negative:
            _note(run, *_locate(run, here, there, arc))
        if there.parameter >= 1.0:
            _finish(run, here, there)
            return
        if there.parameter < LOWEST_PARAMETER:
            run.end(Status.FAILED, f"the branch does not come back, after {_passed(run)}")
            return
        run.steps += 1
        run.iterations += there.iterations
        run.nodes, run.parameter = there.nodes, there.parameter
        run.tangent.measure(there.nodes, run.load_at(there.parameter))
        run.record(there.iterations)
        here = there
        arc = min(LARGEST_ARC, arc * (1.5 if there.iterations <= 4 else 0.7 if there.iterations > 6 else 1.0))
    run.end(Status.FAILED, f"no end after {run.steps} steps along the branch")


def _point(
    run: Branch,
    nodes: FloatArray,
    parameter: float,
    before: BranchPoint | None,
    iterations: int = 0,
) -> BranchPoint:
    """Measure a point of the branch and orient its tangent like the one before it."""
    size = run.tangent.arrays.size
    run.tangent.measure(nodes, run.load_at(parameter))
    n_negative = run.tangent.factorise()
    velocity, _ = run.velocity(parameter)
    norm = float(np.sqrt(np.sum((velocity / size) ** 2) + 1.0))
    motion, rate = velocity / norm, 1.0 / norm
    if before is not None and np.sum(motion * before.motion) / size**2 + rate * before.rate < 0.0:
        motion, rate = -motion, -rate
    return BranchPoint(parameter, nodes, motion, rate, n_negative, iterations)


def _step(run: Branch, here: BranchPoint, arc: float) -> BranchPoint | None:
    """Take a step of length `arc`; None where the corrector does not converge."""
    tangent, size = run.tangent, run.tangent.arrays.size
    x, parameter = here.nodes + arc * here.motion, here.parameter + arc * here.rate
    tension: FloatArray | None = None
    last_move = np.inf
    for iteration in range(10):
        load = run.load_at(parameter)
        x = run.with_supports(x, parameter)
        out, residual = tangent.measure(x, load, tension)
        if residual <= run.tolerance and tangent.measure(x, load)[1] <= run.tolerance:
            turned = (
                np.sum((x - here.nodes) * here.motion) / size**2 + (parameter - here.parameter) * here.rate
            )
            return _point(run, x, parameter, here, iteration) if turned > 0.0 else None
        tangent.factorise()
        velocity, tension_rate = run.velocity(parameter)
        correction = tangent.solve(-out)
        ahead = np.sum((x + correction - here.nodes) * here.motion) / size**2
        ahead += (parameter - here.parameter) * here.rate - arc
        slope = np.sum(velocity * here.motion) / size**2 + here.rate
        change = -ahead / slope
        move = correction + change * velocity
        size_of_move = float(np.abs(move).max() / size + abs(change))
        if not size_of_move < 5.0 * arc or (iteration > 1 and size_of_move > 0.7 * last_move):
            return None
        tension = predicted_tension(tangent, load, correction) + change * tension_rate
        x, parameter, last_move = x + move, parameter + change, size_of_move
    return None


def _locate(run: Branch, here: BranchPoint, there: BranchPoint, arc: float) -> tuple[BranchPoint, str]:
    """Bisect the step to the change of inertia; return the point before it and its kind."""
    low, high, last = 0.0, arc, here
    while high - low > SMALLEST_ARC:
        middle = _step(run, here, 0.5 * (low + high))
        if middle is None:
            break
        if middle.n_negative == here.n_negative:
            low, last = 0.5 * (low + high), middle
        else:
            high, there = 0.5 * (low + high), middle
    return last, "limit point" if last.rate * there.rate < 0.0 else "bifurcation"


def _note(run: Branch, point: BranchPoint, kind: str) -> None:
    run.tangent.measure(point.nodes, run.load_at(point.parameter))
    spectrum = run.tangent.spectrum(min(len(run.tangent.free_index), point.n_negative + 2))
    nearest = int(np.argmin(np.abs(spectrum.values)))
    moved = most_moved(run.tangent.arrays.node_ids, np.linalg.norm(spectrum.vectors[nearest], axis=1))
    run.critical_points.append(
        CriticalPoint(run.name, point.parameter, kind, float(spectrum.values[nearest]), moved)
    )


def _passed(run: Branch) -> str:
    return "; ".join(str(point) for point in run.critical_points)


def _finish(run: Branch, here: BranchPoint, there: BranchPoint) -> None:
    """Land on λ = 1 by Newton's method from the chord of the last step."""
    share = (1.0 - here.parameter) / (there.parameter - here.parameter)
    guess = run.with_supports(here.nodes + share * (there.nodes - here.nodes), 1.0)
    landed = _newton(run, guess, run.load_at(1.0))
    if landed is None:
        run.end(Status.FAILED, f"the branch could not be closed at its end, after {_passed(run)}")
        return
    run.nodes, run.parameter = landed, 1.0
    run.steps += 1
    run.tangent.measure(landed, run.load_at(1.0))
    run.record(MOST_CORRECTIONS)
    outcome = Status.UNSTABLE if run.tangent.factorise() > 0 else Status.SNAPPED
    run.end(outcome, f"traced through {_passed(run)}")


def _newton(run: Branch, guess: FloatArray, load: Load) -> FloatArray | None:
    """Solve f = p by Newton's method in positions and tensions; None where it does not converge."""
    tangent, x, tension, found = run.tangent, guess, None, None
    for _ in range(MOST_CORRECTIONS):
        out, residual = tangent.measure(x, load, tension)
        if residual <= run.tolerance and tangent.measure(x, load)[1] <= run.tolerance:
            found = x
        tangent.factorise()
        correction = tangent.solve(-out)
        if found is not None and not np.abs(correction).max(initial=0.0) > NEAR * tangent.arrays.size:
            break
        tension = predicted_tension(tangent, load, correction)
        x = x + correction
        run.iterations += 1
    return found


def predicted_tension(tangent: Tangent, load: Load, correction: FloatArray) -> FloatArray:
    """Return the tensions k (ℓ − l₀ + b·u) after a correction u of the nodes, were all members taut."""
    along = plain.by_length(tangent.length, load.rest_length, load.stiffness) * tangent.length_rate(
        correction
    )
    tension: FloatArray = plain.tension(tangent.length, load.rest_length, load.stiffness) + along
    return tension
