r"""An expansion with more terms than runs: coefficients with a prior, whose sizes the runs tell.

The coefficient of a product is taken as normal with the variance Π_j θ_{j, α_j}; then the runs are values of
a Gaussian process with the kernel Π_j (1 + Σ_k θ_jk p_k(z_j) p_k(z'_j)), and the θ that make them most
probable tell which inputs and degrees matter (automatic relevance: MacKay, *Neural Computation* 4, 1992; the
kernel: Yan et al., *Computer Methods in Applied Mechanics and Engineering* 336, 2018). First θ_jk falls
geometrically with k, two numbers for each input; from there every θ_jk is free. What a term is worth is so
told by all terms that share its degrees, where a pursuit judges each by itself: with 100 runs in eight inputs
chance makes many of 4,000 candidates look good.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Posterior", "Sizes", "condition", "likely_sizes"]

Array: TypeAlias = NDArray[np.float64]

FIRST_SIZES = (-2.0, -2.0)  # log of θ_j1, and log-odds of the ratio of successive ones
SIZE_BOUNDS, RATIO_BOUNDS, FREE_BOUNDS = (-20.0, 3.0), (-9.0, 3.0), (-34.0, 3.0)  # of these logarithms
NUGGETS = (1e-13, 1.0)  # noise over the prior's variance: from rounding to nothing but noise
FIRST_NUGGET = 1e-6
SMOOTH_ITERATIONS, FREE_ITERATIONS = 40, 60  # past them the error no longer falls (measured)
REFUSED = 1e25  # stands for the likelihood where the kernel matrix has no Cholesky factor


@dataclass(frozen=True, eq=False)
class Sizes:
    """Prior variances θ of the degrees from the first on, shape (n_inputs, degree), and the nugget."""

    theta: Array
    nugget: float


@dataclass(frozen=True, eq=False)
class Posterior:
    """Coefficients (n_terms, n_outputs), residuals without each run, their variances (n_runs,), nugget."""

    coefficients: Array
    residuals: Array
    variance: Array
    nugget: float


def likely_sizes(p: Array, T: Array, *, free: bool) -> Sizes:
    """Return the prior under which the outputs are most probable.

    Parameters
    ----------
    p
        Polynomials of each input from the first degree on, shape (n_inputs, degree, n_runs).
    T
        Outputs of zero mean, shape (n_runs, n_outputs); each has an amplitude of its own, which is
        concentrated out of the likelihood.
    free
        Whether, after θ that fall geometrically, every θ is found for itself.
    """
    T = T[:, np.ptp(T, axis=0) > 0]
    d, n_degrees, _ = p.shape
    powers = np.arange(n_degrees)
    log_nuggets = (np.log(NUGGETS[0]), np.log(NUGGETS[1]))
    if T.shape[1] == 0:
        return Sizes(np.zeros((d, n_degrees)), FIRST_NUGGET)

    def geometric(x: Array) -> tuple[Array, Array]:
        ratio = 1.0 / (1.0 + np.exp(-x[d : 2 * d]))
        return np.exp(x[:d, None]) * ratio[:, None] ** powers, ratio

    def smooth(x: Array) -> tuple[float, Array]:
        theta, ratio = geometric(x)
        value, slope, by_nugget = _surprise(p, T, theta, float(np.exp(x[-1])))
        slope = slope * theta
        by_ratio = slope @ powers * (1.0 - ratio)
        return value, np.concatenate([slope.sum(axis=1), by_ratio, [by_nugget * np.exp(x[-1])]])

    start = np.concatenate([np.full(d, FIRST_SIZES[0]), np.full(d, FIRST_SIZES[1]), [np.log(FIRST_NUGGET)]])
    x = _minimum(smooth, start, [SIZE_BOUNDS] * d + [RATIO_BOUNDS] * d + [log_nuggets], SMOOTH_ITERATIONS)
    theta = geometric(x)[0]
    if free:

        def each(x: Array) -> tuple[float, Array]:
            theta = np.exp(x[:-1]).reshape(d, n_degrees)
            value, slope, by_nugget = _surprise(p, T, theta, float(np.exp(x[-1])))
            return value, np.append((slope * theta).ravel(), by_nugget * np.exp(x[-1]))

        start = np.append(np.log(np.maximum(theta, np.exp(FREE_BOUNDS[0] + 1))).ravel(), x[-1])
        x = _minimum(each, start, [FREE_BOUNDS] * theta.size + [log_nuggets], FREE_ITERATIONS)
        theta = np.exp(x[:-1]).reshape(d, n_degrees)
    theta[~p.any(axis=2)] = 0.0  # degrees of which the law has no polynomial
    return Sizes(theta, float(np.exp(x[-1])))


def condition(values: Array, T: Array, weights: Array, nugget: float) -> Posterior:
    """Return the coefficients that the runs leave most probable.

    Parameters
    ----------
    values
        The terms at the runs, shape (n_terms, n_runs).
    T
        Outputs, shape (n_runs, n_outputs).
    weights
        Prior variance of each term's coefficient, shape (n_terms,).
    nugget
        Variance of the noise, in the same unit.
    """
    from scipy.linalg import cho_solve, cholesky, solve_triangular

    n = len(T)
    K = (values.T * weights) @ values
    while True:
        try:
            factor = cholesky(K + nugget * np.eye(n), lower=True)
            break
        except np.linalg.LinAlgError:  # what rounding makes of the smallest nugget
            nugget *= 10.0
    solved = cho_solve((factor, True), T)
    inverse_diagonal = np.sum(solve_triangular(factor, np.eye(n), lower=True) ** 2, axis=0)
    return Posterior(
        coefficients=weights[:, None] * (values @ solved),
        residuals=solved / inverse_diagonal[:, None],
        variance=1.0 / inverse_diagonal,
        nugget=nugget,
    )


def _minimum(
    function: Callable[[Array], tuple[float, Array]],
    start: Array,
    bounds: list[tuple[float, float]],
    iterations: int,
) -> Array:
    from scipy.optimize import minimize

    found = minimize(
        function, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": iterations}
    )
    return np.asarray(found.x)


def _surprise(p: Array, T: Array, theta: Array, nugget: float) -> tuple[float, Array, float]:
    """Return −log of the outputs' probability, and its slopes by θ and by the nugget."""
    from scipy.linalg import LinAlgError, cho_solve, cholesky
    from scipy.linalg.lapack import dpotri

    n, n_outputs = T.shape
    factors = [1.0 + (p[j].T * theta[j]) @ p[j] for j in range(len(p))]
    A = np.prod(factors, axis=0)
    A[np.diag_indices(n)] += nugget
    try:
        factor = cholesky(A, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return REFUSED, np.zeros_like(theta), 0.0  # the line search turns back
    solved = cho_solve((factor, True), T)
    amplitude = np.maximum(np.sum(T * solved, axis=0) / n, np.finfo(float).tiny)
    value = 0.5 * n * np.sum(np.log(amplitude)) + n_outputs * np.sum(np.log(np.diagonal(factor)))
    lower = np.tril(dpotri(factor, lower=1)[0])
    inner = n_outputs * (lower + np.tril(lower, -1).T) - (solved / amplitude) @ solved.T
    by_nugget = 0.5 * float(np.trace(inner))
    # The product of all factors but one: of those before it, and of those after it times `inner`.
    before = [np.ones((n, n))]
    for factor_j in factors[:-1]:
        before.append(before[-1] * factor_j)
    slope = np.empty_like(theta)
    for j in reversed(range(len(p))):
        slope[j] = 0.5 * np.einsum("kn,kn->k", p[j] @ (inner * before[j]), p[j])
        inner *= factors[j]
    return float(value), slope, by_nugget
