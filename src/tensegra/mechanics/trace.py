"""Follow an unstable branch by arc length, for the policy ``trace``."""

from dataclasses import dataclass, field

import numpy as np

from tensegra.mechanics.arc import Branch, BranchPoint, predicted_tension
from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import Load
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
"""Newton solves of the last point after which the branch cannot be closed."""


@dataclass(eq=False)
class Traced:
    """One run on its way along its branch."""

    branch: Branch
    name: str
    max_steps: int
    nodes: FloatArray
    parameter: float
    steps: int = 0
    iterations: int = 0
    status: Status = Status.UNSTABLE
    reason: str = ""
    critical_points: list[CriticalPoint] = field(default_factory=list)
    history: list[PathPoint] = field(default_factory=list)

    @property
    def tangent(self) -> Tangent:
        """Of the branch."""
        return self.branch.tangent

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
        tangent = Tangent(ground.plain_arrays, motions=motions, nodes=nodes)
        one = Traced(
            Branch(tangent, stage, stiffness, ground.settings.residual),
            leg.name,
            ground.settings.max_steps,
            nodes,
            float(end.parameter[run]),
            int(end.steps[run]),
            int(end.iterations[run]),
        )
        trace_branch(one)
        _take(end, run, one)
    return end


def _take(end: StageEnd, run: int, one: Traced) -> None:
    """Write where a branch has led into the end of the stage."""
    end.critical_points[run] = one.critical_points
    end.status[run], end.reason[run] = one.status, one.reason
    end.steps[run], end.iterations[run], end.parameter[run] = one.steps, one.iterations, one.parameter
    if one.status is Status.FAILED:
        end.give_up(run, one.reason)
        return
    load = one.branch.load_at(one.parameter)
    _, end.residual[run] = one.tangent.measure(one.nodes, load)
    end.nodes[run], end.tensions[run] = one.nodes, one.tangent.tension
    end.strain_energy[run] = one.tangent.energy(load)
    end.lowest_eigenvalue[run] = lowest_of(one.tangent.spectrum(1))
    one.tangent.measure(one.nodes, load)
    end.n_negative[run] = one.tangent.factorise()
    if end.last_load is not None:
        end.last_load = load
        end.history.extend(one.history)


def trace_branch(run: Traced) -> None:
    """Go on from the end of the stable branch until λ = 1.

    Every critical point passed is noted. The run ends ``snapped`` where the branch is stable again
    at λ = 1 (it left its stable part on the way), ``unstable`` where it is not, ``failed`` where the
    branch never comes back to λ = 1.
    """
    run.critical_points.clear()
    here = run.branch.point(run.nodes, run.parameter)
    arc = 0.25 * LARGEST_ARC
    while run.steps < run.max_steps:
        there = run.branch.step(here, arc)
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
        run.tangent.measure(there.nodes, run.branch.load_at(there.parameter))
        run.record(there.iterations)
        here = there
        arc = min(LARGEST_ARC, arc * (1.5 if there.iterations <= 4 else 0.7 if there.iterations > 6 else 1.0))
    run.end(Status.FAILED, f"no end after {run.steps} steps along the branch")


def _locate(run: Traced, here: BranchPoint, there: BranchPoint, arc: float) -> tuple[BranchPoint, str]:
    """Bisect the step to the change of inertia; return the point before it and its kind."""
    low, high, last = 0.0, arc, here
    while high - low > SMALLEST_ARC:
        middle = run.branch.step(here, 0.5 * (low + high))
        if middle is None:
            break
        if middle.n_negative == here.n_negative:
            low, last = 0.5 * (low + high), middle
        else:
            high, there = 0.5 * (low + high), middle
    return last, "limit point" if last.rate * there.rate < 0.0 else "bifurcation"


def _note(run: Traced, point: BranchPoint, kind: str) -> None:
    run.tangent.measure(point.nodes, run.branch.load_at(point.parameter))
    spectrum = run.tangent.spectrum(min(len(run.tangent.free_index), point.n_negative + 2))
    nearest = int(np.argmin(np.abs(spectrum.values)))
    moved = most_moved(run.tangent.arrays.node_ids, np.linalg.norm(spectrum.vectors[nearest], axis=1))
    run.critical_points.append(
        CriticalPoint(run.name, point.parameter, kind, float(spectrum.values[nearest]), moved)
    )


def _passed(run: Traced) -> str:
    return "; ".join(str(point) for point in run.critical_points)


def _finish(run: Traced, here: BranchPoint, there: BranchPoint) -> None:
    """Land on λ = 1 by Newton's method from the chord of the last step."""
    share = (1.0 - here.parameter) / (there.parameter - here.parameter)
    guess = run.branch.with_supports(here.nodes + share * (there.nodes - here.nodes), 1.0)
    landed = _newton(run, guess, run.branch.load_at(1.0))
    if landed is None:
        run.end(Status.FAILED, f"the branch could not be closed at its end, after {_passed(run)}")
        return
    run.nodes, run.parameter = landed, 1.0
    run.steps += 1
    run.tangent.measure(landed, run.branch.load_at(1.0))
    run.record(MOST_CORRECTIONS)
    outcome = Status.UNSTABLE if run.tangent.factorise() > 0 else Status.SNAPPED
    run.end(outcome, f"traced through {_passed(run)}")


def _newton(run: Traced, guess: FloatArray, load: Load) -> FloatArray | None:
    """Solve f = p by Newton's method in positions and tensions; None where it does not converge."""
    tangent, x, tension, found = run.tangent, guess, None, None
    for _ in range(MOST_CORRECTIONS):
        out, residual = tangent.measure(x, load, tension)
        if residual <= run.branch.tolerance and tangent.measure(x, load)[1] <= run.branch.tolerance:
            found = x
        tangent.factorise()
        correction = tangent.solve(-out)
        if found is not None and not np.abs(correction).max(initial=0.0) > NEAR * tangent.arrays.size:
            break
        tension = predicted_tension(tangent, load, correction)
        x = x + correction
        run.iterations += 1
    return found
