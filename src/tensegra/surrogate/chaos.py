"""Polynomial chaos: least squares in products of polynomials that are orthonormal under the inputs' laws.

The coefficients are the answer to several questions at once: the first is the mean, the sum of the squares
of the others the variance, and their shares the Sobol indices (Sudret, *Reliability Engineering and System
Safety* 93, 2008). The set of products is chosen by the leave-one-out error, which least squares yields
without a second fit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.basis import (
    Basis,
    law_quadrature,
    margin,
    recurrence,
    total_degree,
    uniform_quadrature,
)
from tensegra.surrogate.design import fresh_points, fresh_to_left_out
from tensegra.surrogate.jointlaw import is_correlated
from tensegra.surrogate.jointmoments import joint_moments
from tensegra.surrogate.leastsquares import LeastSquares, Rows, blocks, independent, leverages
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import HALF_WIDTH_90

__all__ = ["Chaos", "moments", "sobol_indices", "train"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

SHARE_OF_ROWS = 0.8  # largest number of terms: with more, the leverage of a row comes close to one
GROWTH = 0.3  # share of the margin that joins the set in a round of growth
SELECTION_ROWS = 4_000  # the terms are chosen on so many rows; their coefficients are fitted to all
PATIENCE = 3  # rounds of growth without a better leave-one-out error before it ends


@dataclass(frozen=True, eq=False)
class Chaos:
    """An expansion in orthonormal polynomials (`tensegra.surrogate.problem.Model`).

    Parameters
    ----------
    recurrences
        Recurrence coefficients of each input, shape (n_inputs, 2, max_degree + 1).
    indices
        Degrees of each term, shape (n_terms, n_inputs); the first is the constant.
    coefficients
        Shape (n_terms, n_outputs).
    factor
        Triangular factor R of the rows of the least squares, shape (n_terms, n_terms).
    deviation
        Calibrated amplitude of each output's standard deviation, shape (n_outputs,).
    loo_error
        Leave-one-out root mean square error relative to each output's standard deviation, (n_outputs,).
    """

    recurrences: Array
    indices: Indices
    coefficients: Array
    factor: Array
    deviation: Array
    loo_error: Array

    @property
    def has_std(self) -> bool:
        """True: the leave-one-out residuals tell it."""
        return True

    @property
    def basis(self) -> Basis:
        """The products of polynomials."""
        return Basis(self.recurrences, self.indices)

    def predict(self, Z: Array) -> Array:
        """Return the outputs."""
        basis = self.basis
        return np.concatenate([basis.values(block).T @ self.coefficients for block in blocks(Z)])

    def std(self, Z: Array) -> Array:
        """Return calibrated standard deviations: an amplitude times √(1 + leverage)."""
        basis = self.basis
        leverage = np.concatenate([leverages(self.factor, basis.values(block)) for block in blocks(Z)])
        return np.asarray(np.sqrt(1.0 + leverage)[:, None] * self.deviation)

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the expansion."""
        basis = self.basis
        return np.concatenate(
            [
                np.einsum("jmn,mk->nkj", basis.derivatives(block)[1], self.coefficients, optimize=True)
                for block in blocks(Z)
            ]
        )

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return the arrays; there are no settings."""
        return dict(vars(self)), {}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        return cls(**arrays, **settings)


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    degree: int | None = None,
    max_degree: int = 12,
    max_terms: int = 1500,
    sparse: bool = True,
    derivatives: bool = True,
) -> Chaos:
    """Fit an expansion shared by all outputs.

    Parameters
    ----------
    problem
        The standardised runs. The polynomials are orthonormal under `problem.distributions`, or under the
        uniform law on `problem.bounds`.
    rng
        Source of the runs on which the terms are chosen, where there are more than enough.
    degree
        Total degree; chosen by the leave-one-out error where left out.
    max_degree, max_terms
        Limits to that choice.
    sparse
        Also try sets of terms that grow, round by round, where the coefficients are large; kept if the
        leave-one-out error is smaller. Not tried with a given `degree`.
    derivatives
        Use the runs' derivatives if they have any.

    Returns
    -------
    Chaos
        The expansion.

    Raises
    ------
    StudyError
        If there are too few runs for the degree asked for.
    """
    highest = max_degree if degree is None else degree
    if highest < 0:
        raise StudyError.at("pce: degree", highest, "0 or more")
    recurrences = _recurrences(problem, highest + 1)  # one more, to judge the design by
    rows = Rows(problem.Z, problem.T, problem.dT if derivatives else None)
    if degree is not None:
        indices = total_degree(problem.Z.shape[1], degree)
        if len(indices) > rows.n_rows:
            raise StudyError.at(
                "pce: degree", degree, f"a degree with at most {rows.n_rows} terms (this has {len(indices)})"
            )
        return _corrected(_solve(rows, recurrences, indices), rows, problem, rng)
    some = rows.sample(SELECTION_ROWS, rng)
    limit = max(1, min(max_terms, int(SHARE_OF_ROWS * some.n_rows)))
    best = _best_total_degree(some, recurrences, highest, limit)
    if sparse:
        grown = _grow(some, recurrences, highest, limit)
        if _score(grown.loo_error) < _score(best.loo_error):
            best = grown
    best = best if some is rows else _solve(rows, recurrences, best.indices)
    return _corrected(best, rows, problem, rng)


def moments(surrogate: Surrogate) -> tuple[Array, Array]:
    """Return the mean and the standard deviation of each output.

    They are in closed form where the inputs are independent. Where they are not, the expansion is integrated
    over their joint law by quasi-Monte Carlo, for its polynomials are orthonormal under the marginals alone.

    Parameters
    ----------
    surrogate
        Of kind ``pce``.

    Returns
    -------
    tuple of ndarray
        Mean and standard deviation under the inputs' laws, shape (n_outputs,) each.
    """
    c = _expansion(surrogate).coefficients
    if is_correlated(surrogate.space):
        return joint_moments(surrogate)
    scale = surrogate.scaling.output_scale
    return surrogate.scaling.output_shift + scale * c[0], scale * np.sqrt(np.sum(c[1:] ** 2, axis=0))


def sobol_indices(surrogate: Surrogate) -> tuple[Array, Array]:
    """Return the first-order and total Sobol indices in closed form.

    Parameters
    ----------
    surrogate
        Of kind ``pce``.

    Returns
    -------
    tuple of ndarray
        Shares of each output's variance, shape (n_outputs, n_inputs) each; not a number for an output that
        does not vary.

    Raises
    ------
    StudyError
        If the inputs depend on each other: the variance then has no shares that belong to one input alone.
    """
    model = _expansion(surrogate)
    if is_correlated(surrogate.space):
        raise StudyError("Sobol indices: found inputs that are correlated, expected independent ones")
    square = model.coefficients[1:] ** 2
    active = model.indices[1:] > 0
    alone = active & (active.sum(axis=1) == 1)[:, None]
    with np.errstate(invalid="ignore"):  # 0/0 for an output that does not vary
        share = square / square.sum(axis=0)
    return share.T @ alone, share.T @ active


def _expansion(surrogate: Surrogate) -> Chaos:
    """Return the expansion inside a surrogate of kind `pce`."""
    if not isinstance(surrogate.model, Chaos):
        raise StudyError.at("closed-form moments and indices", surrogate.kind, "a surrogate of kind 'pce'")
    return surrogate.model


def _recurrences(problem: Problem, degree: int) -> Array:
    """Return the recurrence coefficients of each input in standardised units."""
    laws = []
    for j, (shift, scale) in enumerate(
        zip(problem.scaling.input_shift, problem.scaling.input_scale, strict=True)
    ):
        lower, upper = problem.bounds[j]
        if problem.distributions is not None:
            nodes, weights = law_quadrature(problem.distributions[j])
        else:
            # An input that was never varied has no law; any interval will do, its terms stay unused.
            nodes, weights = uniform_quadrature(lower, upper if upper > lower else lower + scale)
        laws.append(recurrence((nodes - shift) / scale, weights, degree))
    return np.stack(laws)


def _solve(rows: Rows, recurrences: Array, indices: Indices) -> Chaos:
    """Return the expansion in given terms."""
    return _finish(independent(rows, recurrences, indices))


def _finish(system: LeastSquares, size: int | None = None) -> Chaos:
    """Return the expansion in the first `size` terms, its standard deviation calibrated."""
    size = len(system.basis) if size is None else size
    residual, leverage = (part[0] for part in system.leave_one_out([size]))
    spread = np.abs(residual) / np.sqrt(1.0 + leverage)[:, None]
    return Chaos(
        recurrences=system.basis.coefficients,
        indices=np.ascontiguousarray(system.basis.indices[:size]),
        coefficients=np.ascontiguousarray(system.coefficients(size)),
        factor=np.ascontiguousarray(system.factor[:size, :size]),
        deviation=np.quantile(spread, 0.9, axis=0) / HALF_WIDTH_90,
        loo_error=np.sqrt(np.mean(residual**2, axis=0)),
    )


def _corrected(chaos: Chaos, rows: Rows, problem: Problem, rng: np.random.Generator) -> Chaos:
    """Return the expansion, its standard deviation true at fresh points, not just at runs left out."""
    if rows.dT is not None:  # derivatives fill the gaps between the runs
        return chaos
    # A stream of its own: a random design from the same seed would be drawn once more.
    rng = rng.spawn(1)[0]
    ratio = fresh_to_left_out(chaos.basis, chaos.factor, rows.Z, fresh_points(problem, rng), rng)
    return replace(chaos, deviation=ratio * chaos.deviation)


def _best_total_degree(rows: Rows, recurrences: Array, highest: int, limit: int) -> Chaos:
    """Return the total degree of the smallest leave-one-out error, all degrees from one triangularisation."""
    d = rows.Z.shape[1]
    while highest and len(total_degree(d, highest)) > limit:
        highest -= 1
    system = independent(rows, recurrences, total_degree(d, highest))
    degrees = system.basis.indices.sum(axis=1)
    sizes = [int(size) for size in np.flatnonzero(np.diff(degrees, append=highest + 1)) + 1]
    residuals, _ = system.leave_one_out(sizes)
    errors = np.sqrt(np.mean(residuals**2, axis=1))
    return _finish(system, sizes[int(np.argmin([_score(error) for error in errors]))])


def _grow(rows: Rows, recurrences: Array, highest: int, limit: int) -> Chaos:
    """Let the set of terms grow where the coefficients are large, until the error stops falling.

    In each round all terms of the margin are tried at once, and those with the largest coefficients
    stay. The set remains
    downward closed (Gerstner and Griebel, *Computing* 71, 2003, for quadrature).
    """
    indices = total_degree(rows.Z.shape[1], 0)
    best = _solve(rows, recurrences, indices)
    waiting = 0
    while waiting < PATIENCE:
        outside = margin(indices, highest)
        if len(outside) == 0 or len(indices) + len(outside) > limit:
            break
        system = independent(rows, recurrences, np.concatenate([indices, outside]))
        candidate = _finish(system)
        if _score(candidate.loo_error) < _score(best.loo_error):
            best, waiting = candidate, 0
        else:
            waiting += 1
        size = np.abs(candidate.coefficients[len(indices) :]).max(axis=1)
        large = np.argsort(-size, kind="stable")[: max(1, round(GROWTH * len(size)))]
        indices = np.concatenate([indices, system.basis.indices[len(indices) :][np.sort(large)]])
    return best


def _score(loo_error: Array) -> float:
    """Return the mean logarithm of the outputs' errors, so that each counts by its relative improvement."""
    return float(np.mean(np.log(loo_error + np.finfo(float).tiny)))
