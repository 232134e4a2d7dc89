"""Intervals of a Gaussian process that hold at fresh points.

The amplitude of its standard deviation is taken from runs that it was not told of. Left out one by one, with
the length scales kept, they tell too small an error where the runs are few, for the length scales were found
on them; left out in folds, with the length scales found again, they tell it. Where the runs are many this no
longer matters, and the holes that a space-filling design has where a run is left out do.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.design import N_MIXTURES, fresh_ratio
from tensegra.surrogate.process import Process, kernel
from tensegra.surrogate.validation import HALF_WIDTH_90, fold_indices

__all__ = ["calibrated", "fold_factor", "fresh_to_left_out"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]

N_FOLDS = 10  # with 4, the gaps that a fold leaves are wider than those between all runs
ENOUGH_RUNS = 100  # whose errors tell the quantile; each fold costs a search for length scales
# Of the random functions that tell what a run left out means for a fresh point: number of bumps, and their
# width over the length scales. It hardly matters: 0.6 to 0.9 gave the same.
BUMPS, ROUGHNESS = 40, 0.8


def calibrated(standardised_residuals: Array) -> float:
    """Return the factor that makes 90 % of the residuals lie within their 90 % interval.

    The quantile of n residuals is known to √(0.9 · 0.1/n); it is taken one of these higher, so that an
    interval errs to the safe side in two of three cases.
    """
    level = min(1.0, 0.9 + np.sqrt(0.09 / standardised_residuals.size))
    return float(np.quantile(np.abs(standardised_residuals), level) / HALF_WIDTH_90)


def fold_factor(n: int, standardised: Callable[[Indices, Indices], Array], rng: np.random.Generator) -> float:
    """Return by how much the standard deviations of folds have to grow, 1 at least.

    Parameters
    ----------
    n
        Number of runs.
    standardised
        Given the runs to learn from and those of a fold, returns the errors of the fold over what is said
        of them.
    rng
        Source of the folds.
    """
    folds = fold_indices(n, min(N_FOLDS, n // 2), rng)
    errors: list[Array] = []
    while sum(map(len, errors)) < min(n, ENOUGH_RUNS):
        fold = folds[len(errors)]
        errors.append(standardised(np.setdiff1d(np.arange(n), fold), fold))
    return max(1.0, calibrated(np.concatenate(errors)))


def fresh_to_left_out(
    process: Process,
    sample: NDArray[np.intp],
    inverse_diagonal: Array,
    fresh: Array,
    rng: np.random.Generator,
) -> float:
    """Return the error at fresh points over that at runs left out, both over their standard deviations.

    It is measured on random functions somewhat rougher than the process is made for, and 1 at most (see
    `tensegra.surrogate.design`).
    """
    from scipy.linalg import cho_solve

    lower, upper = process.centres.min(axis=0), process.centres.max(axis=0)
    centres = lower + (upper - lower) * rng.uniform(-0.2, 1.2, size=(BUMPS, len(lower)))
    mixtures = rng.normal(size=(BUMPS, N_MIXTURES))
    rougher = ROUGHNESS * process.length_scale
    weights = cho_solve((process.factor, True), kernel(process.centres, centres, rougher) @ mixtures)
    left_out = np.abs(weights[sample]) / np.sqrt(inverse_diagonal)[:, None]
    error = np.abs(kernel(fresh, centres, rougher) @ mixtures - process.kernel(fresh) @ weights)
    error /= np.sqrt(process.variance(fresh))[:, None]
    return fresh_ratio(error, left_out)
