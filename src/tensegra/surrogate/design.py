"""What leaving out a run of a design tells of a fresh point.

A space-filling design puts its runs apart from each other. So a run that is left out lies in a hole that no
fresh point sees, and its error without it is larger than theirs. By how much, other functions tell, whose
values are known everywhere: for an expansion the polynomials just outside its basis, which are what it leaves
out.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.basis import Basis, highest_degrees
from tensegra.surrogate.leastsquares import leverages
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.terms import margin

__all__ = ["N_MIXTURES", "fresh_points", "fresh_ratio", "fresh_to_left_out"]

Array: TypeAlias = NDArray[np.float64]

N_FRESH = 1_000  # with the mixtures below, the ratio is then known to about ±1 %
N_TERMS, N_MIXTURES = 200, 24  # terms outside, and random mixtures of them that stand for what is left out
MANY_RUNS_PER_TERM = 50  # with more, one run hardly matters


def fresh_points(problem: Problem, rng: np.random.Generator) -> Array:
    """Draw standardised points from the laws of the inputs, shape (n_points, n_inputs)."""
    U = rng.uniform(size=(N_FRESH, problem.Z.shape[1]))
    if problem.distributions is None:
        X = problem.bounds[:, 0] + U * (problem.bounds[:, 1] - problem.bounds[:, 0])
    else:
        X = np.column_stack([law.ppf(u) for law, u in zip(problem.distributions, U.T, strict=True)])
    return problem.scaling.inputs(X)


def fresh_to_left_out(basis: Basis, factor: Array, Z: Array, fresh: Array, rng: np.random.Generator) -> float:
    """Return the error at fresh points over that at runs left out, both studentised, 1 at most.

    Parameters
    ----------
    basis
        The terms of an expansion, its recurrence coefficients one degree further.
    factor
        Triangular factor of its least squares.
    Z
        The runs, shape (n_runs, n_inputs).
    fresh
        Fresh points, shape (n_points, n_inputs).
    rng
        Source of the mixtures.
    """
    from scipy.linalg import solve_triangular

    m = len(basis)
    if len(Z) > MANY_RUNS_PER_TERM * m or len(Z) <= m:
        return 1.0
    outside = margin(basis.indices, highest_degrees(basis.coefficients))
    if len(outside) == 0:
        return 1.0
    if len(outside) > N_TERMS:
        outside = outside[np.sort(rng.choice(len(outside), size=N_TERMS, replace=False))]
    both = Basis(basis.coefficients, np.concatenate([basis.indices, outside]))
    mixtures = rng.normal(size=(len(outside), N_MIXTURES))

    at_runs, at_fresh = both.values(Z), both.values(fresh)
    Q = solve_triangular(factor, at_runs[:m], trans="T")
    left_out = at_runs[m:].T @ mixtures
    fitted = Q @ left_out
    residual = np.abs(left_out - Q.T @ fitted)
    own = np.maximum(1.0 - np.sum(Q**2, axis=0), np.finfo(float).eps)
    error = np.abs(at_fresh[m:].T @ mixtures - at_fresh[:m].T @ solve_triangular(factor, fitted))
    leverage = leverages(factor, at_fresh[:m])
    return fresh_ratio(error / np.sqrt(1.0 + leverage)[:, None], residual / np.sqrt(own)[:, None])


def fresh_ratio(fresh: Array, left_out: Array) -> float:
    """Return the mean ratio of the 90 % quantiles of two sets of errors, 1 at most.

    Parameters
    ----------
    fresh, left_out
        Errors over their standard deviations, shapes (n_points, n_mixtures) and (n_runs, n_mixtures).
    """
    at_fresh, at_left_out = (np.quantile(errors, 0.9, axis=0) for errors in (fresh, left_out))
    ratio = float(np.mean(at_fresh / np.maximum(at_left_out, np.finfo(float).tiny)))
    return min(1.0, ratio)
