"""Expansions whose terms are found among more candidates than there are runs, and the trial that picks one.

A leave-one-out error does not see that its terms were picked for the very runs that it leaves out: with 100
runs and 4,000 candidates it promises 1e-8 where the truth is 1e-3. So the ways of choosing are compared on
runs that none of them has seen, and only then is the best one given all of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.basis import Basis, univariate
from tensegra.surrogate.leastsquares import LeastSquares, Rows, independent
from tensegra.surrogate.prior import condition, likely_sizes
from tensegra.surrogate.problem import Model
from tensegra.surrogate.pursuit import hyperbolic, pursue
from tensegra.surrogate.terms import largest

__all__ = ["Regularised", "pursued", "regularised", "tried"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

TRIAL_SHARE = 0.25  # of the runs, on which the ways are compared
CANDIDATES_PER_RUN = 5  # of a pursuit: with more, chance makes more of them look good than it adds
SHARE_OF_RUNS = 0.8  # most terms of a pursuit
MOST_CANDIDATES = 4_000
DEGREES = 20  # of each input, whose sizes the prior tells
SIZES_RUNS = 300  # the prior's sizes are found on so many runs: the time grows with their cube
TERMS_PER_RUN = 6  # of an expansion with a prior: the terms beyond weigh less than its error
LEFT_OUT = 0.02  # of the leave-one-out error: terms that together weigh less are left out


@dataclass(frozen=True, eq=False)
class Regularised:
    """An expansion with a prior.

    `indices` (n_terms, n_inputs) and `coefficients` (n_terms, n_outputs) are its terms, `factor` the
    triangular factor of the runs' and the prior's rows together, `residuals` (n_runs, n_outputs) those
    without each run in turn, and `spread` (n_runs,) their standard deviations over that of the noise.
    """

    indices: Indices
    coefficients: Array
    factor: Array
    residuals: Array
    spread: Array


def pursued(rows: Rows, recurrences: Array, highest: Indices, norm: float, max_terms: int) -> LeastSquares:
    """Return the least squares in the terms that a pursuit among a hyperbolic set takes.

    Parameters
    ----------
    rows
        The runs' values.
    recurrences
        Recurrence coefficients of each input.
    highest
        Highest degree of each input.
    norm
        Of the hyperbolic set.
    max_terms
        Most terms.
    """
    n = len(rows.Z)
    candidates = hyperbolic(highest, norm, min(CANDIDATES_PER_RUN * n, MOST_CANDIDATES))
    values = Basis(recurrences, candidates).values(rows.Z)
    limit = min(max_terms, max(1, int(SHARE_OF_RUNS * n)), len(candidates))
    order, size = pursue(values, rows.targets[:, 0], limit)
    return independent(rows, recurrences, candidates[order[:size]])


def regularised(
    rows: Rows,
    recurrences: Array,
    highest: Indices,
    max_terms: int,
    rng: np.random.Generator,
    *,
    free: bool,
) -> Regularised:
    """Return the expansion with the prior that the runs make most probable.

    Parameters
    ----------
    rows, recurrences, highest, max_terms
        As for `pursued`.
    rng
        Source of the runs that tell the prior's sizes.
    free
        Whether each degree of each input has a size of its own.
    """
    n = len(rows.Z)
    T = rows.targets[:, 0]
    mean = T.mean(axis=0)
    some = np.sort(rng.choice(n, size=min(n, SIZES_RUNS), replace=False))
    n_degrees = min(DEGREES, int(highest.max()))
    p, _ = univariate(recurrences, rows.Z[some], n_degrees + 1)
    p = np.where(np.arange(1, n_degrees + 1)[:, None] <= highest[:, None, None], p[:, 1:], 0.0)
    sizes = likely_sizes(p, T[some] - mean, free=free)
    indices = largest(sizes.theta, min(max_terms, TERMS_PER_RUN * n))
    with_constant = np.column_stack([np.ones(len(sizes.theta)), sizes.theta])
    weights = np.prod(with_constant[np.arange(len(sizes.theta)), indices], axis=1)
    values = Basis(recurrences, indices).values(rows.Z)
    posterior = condition(values, T - mean, weights, sizes.nugget)
    coefficients = posterior.coefficients.copy()
    coefficients[0] += mean
    kept = _felt(coefficients, posterior.residuals)
    return Regularised(
        indices=indices[kept],
        coefficients=coefficients[kept],
        factor=_factor(values[kept], weights[kept], posterior.nugget),
        residuals=posterior.residuals,
        spread=np.sqrt(posterior.variance / posterior.nugget),
    )


def tried(rows: Rows, ways: Sequence[Callable[[Rows], Model]], rng: np.random.Generator) -> Array:
    """Return the errors of several ways of learning, on runs that none of them has seen.

    Parameters
    ----------
    rows
        The runs.
    ways
        Each learns from rows.
    rng
        Source of the runs that are kept from them.

    Returns
    -------
    ndarray
        Mean logarithm of the outputs' root mean square errors, shape (n_ways,).
    """
    order = rng.permutation(len(rows.Z))
    n_tried = max(1, round(TRIAL_SHARE * len(order)))
    seen, kept = rows.of_runs(np.sort(order[n_tried:])), rows.of_runs(np.sort(order[:n_tried]))
    errors = []
    for way in ways:
        error = way(seen).predict(kept.Z) - kept.targets[:, 0]
        errors.append(np.mean(np.log(np.sqrt(np.mean(error**2, axis=0)) + np.finfo(float).tiny)))
    return np.array(errors)


def _felt(coefficients: Array, residuals: Array) -> NDArray[np.bool_]:
    """Return the terms that are not negligible beside the error; the constant always is one."""
    square = coefficients**2 / np.maximum(np.mean(residuals**2, axis=0), np.finfo(float).tiny)
    share = square.max(axis=1)
    share[0] = np.inf
    order = np.argsort(share)
    kept = np.ones(len(share), dtype=bool)
    kept[order[np.cumsum(share[order]) <= LEFT_OUT**2]] = False
    return kept


def _factor(values: Array, weights: Array, nugget: float) -> Array:
    """Return the triangular factor of the runs' rows and the prior's."""
    from scipy.linalg import qr

    prior = np.diag(np.sqrt(nugget / weights))
    stacked = np.vstack([values.T, prior])
    return np.triu(qr(stacked, mode="r", overwrite_a=True, check_finite=False)[0][: len(weights)])
