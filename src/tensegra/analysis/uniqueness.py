"""Is the optimum the only one? Walk along the crease it lies on, and see.

An objective with ``abs``, ``min`` or ``max`` often has its optimum on a kink, a surface t(x) = 0. The source
paper's Eq. 12 is 1 wherever v = 0, but all starts may still end at one point of that surface, because the
smooth stand-ins of the kink lean towards one. So from the optimum we step along the surface, in every
direction that it leaves free, fall back onto it by Gauss and Newton's method, and compare the objective
there.
"""

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.problem import FEASIBLE, Problem, Scales

Array = NDArray[np.float64]

# A kink is met where its argument is below this share of its typical size.
ON_KINK = 1e-5
# Step along the surface, in the unit cube, and corrections after it.
STEP, CORRECTIONS = 0.05, 6


def equal_places(problem: Problem, x: Array, objective: float, scales: Scales, tolerance: float) -> Array:
    """Return points (m, n_inputs) away from `x` whose objective is no worse than `objective` by `tolerance`.

    They lie on the same kink as `x`, within the bounds and the constraints; m is 0 where `x` is on no kink.
    """
    low, width = problem.bounds[:, 0], problem.bounds[:, 1] - problem.bounds[:, 0]
    free = width > 0.0
    z = np.where(free, (x - low) / np.where(free, width, 1.0), 0.0)
    arguments, slopes = _kinks(problem, x[None], scales)
    met = np.abs(arguments[0]) <= ON_KINK
    if not met.any():
        return np.zeros((0, x.size))
    rows = slopes[0, met] * free
    _, singular, directions = np.linalg.svd(rows)
    rank = int((singular > 1e-9 * max(float(singular.max(initial=0.0)), 1e-300)).sum())
    along = directions[rank:][:, free].any(axis=1)
    tangents = directions[rank:][along] * free
    if not tangents.size:
        return np.zeros((0, x.size))
    points = np.clip(z + STEP * np.concatenate([tangents, -tangents]), 0.0, 1.0)
    for _ in range(CORRECTIONS):
        arguments, slopes = _kinks(problem, problem.from_unit(points), scales)
        solved = np.asarray(np.isfinite(arguments).all(axis=1) & np.isfinite(slopes).all(axis=(1, 2)))
        steps = [
            np.linalg.pinv(slope[met] * free) @ value[met] if known else np.zeros(x.size)
            for slope, value, known in zip(slopes, arguments, solved, strict=True)
        ]
        points = np.clip(points - np.array(steps), 0.0, 1.0)
    X = problem.from_unit(points)
    found = problem.assess(X, problem.model.evaluate(X))
    loss = (objective - found.objective) * (1.0 if problem.maximise else -1.0)
    good = (loss <= tolerance) & (problem.violation(found.margins, scales) <= FEASIBLE)
    return np.asarray(X[good & (np.abs(points - z).max(axis=1) > 0.2 * STEP)])


def _kinks(problem: Problem, X: Array, scales: Scales) -> tuple[Array, Array]:
    """Return the objective's kink arguments (n, n_kinks), scaled, and their slopes in the unit cube."""
    columns = problem.columns(X, problem.model.evaluate(X).values)
    names = (*problem.model.input_names, *problem.model.output_names)
    n, d = X.shape
    chain = np.concatenate([np.broadcast_to(np.eye(d), (n, d, d)), problem.model.gradient(X)], axis=1)
    values, partials = problem.objective.kink_slopes(columns, seeds=names)
    size = scales.kinks[: len(values), None]
    width = problem.bounds[:, 1] - problem.bounds[:, 0]
    # A kink does not depend on most names; 0 · NaN of an output that it does not use would spoil it.
    slopes = np.einsum("kns,nsd->nkd", partials, np.nan_to_num(chain)) * width
    return (values / size).T, slopes / size.reshape(1, -1, 1)
