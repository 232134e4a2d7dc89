"""Polynomial chaos: expansions in products of polynomials that are orthonormal under the inputs' laws.

The coefficients are the answer to several questions at once: the first is the mean, the sum of the squares
of the others the variance, and their shares the Sobol indices (Sudret, *Reliability Engineering and System
Safety* 93, 2008). The set of products is chosen by the leave-one-out error, which least squares yields
without a second fit; where that leaves an error, terms are sought among more candidates than there are runs
(`tensegra.surrogate.sparse`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.study.data import Distribution
from tensegra.surrogate.basis import (
    Basis,
    highest_degrees,
    law_quadrature,
    recurrence,
    uniform_quadrature,
)
from tensegra.surrogate.calibration import Predictor, cross_calibrated
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.design import fresh_points, fresh_to_left_out
from tensegra.surrogate.leastsquares import LeastSquares, Rows, blocks, independent, leverages
from tensegra.surrogate.problem import Problem, Scaling
from tensegra.surrogate.sparse import Regularised, pursued, regularised, tried
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.terms import margin, n_total_degree, total_degree
from tensegra.surrogate.validation import HALF_WIDTH_90

__all__ = ["Chaos", "learnt_under", "moments", "sobol_indices", "train"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]
Way: TypeAlias = "Callable[[Rows], Chaos]"

SHARE_OF_ROWS = 0.8  # largest number of terms: with more, the leverage of a row comes close to one
GROWTH = 0.3  # share of the margin that joins the set in a round of growth
SELECTION_ROWS = 4_000  # the terms are chosen on so many rows; their coefficients are fitted to all
PATIENCE = 3  # rounds of growth without a better leave-one-out error before it ends
MAX_DEGREE, MAX_SPARSE_DEGREE = 12, 30  # of least squares, and of terms that are sought one by one
# More terms than runs are sought where the leave-one-out error, over the spread, is larger than ENOUGH, and
# between so few runs that nothing can be told and so many that least squares have all they need.
ENOUGH, FEWEST_RUNS, MOST_RUNS = 1e-7, 20, 2_000
NORMS = (1.0, 0.75, 0.5)  # of the hyperbolic sets that are searched
BETTER = 0.8  # of the plain expansion's error: what another one has to come down to
RAW_BETTER = 0.1  # the like, for polynomials of an input whose law is tame in another coordinate
SAME_LAW = 1e-6  # recurrence coefficients of two laws that agree to this are those of one law


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
    coordinates
        What the polynomials are polynomials of.
    """

    recurrences: Array
    indices: Indices
    coefficients: Array
    factor: Array
    deviation: Array
    loo_error: Array
    coordinates: Coordinates

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
        basis, W = self.basis, self.coordinates.forward(Z)
        return np.concatenate([basis.values(block).T @ self.coefficients for block in blocks(W)])

    def std(self, Z: Array) -> Array:
        """Return calibrated standard deviations: an amplitude times √(1 + leverage)."""
        basis, W = self.basis, self.coordinates.forward(Z)
        leverage = np.concatenate([leverages(self.factor, basis.values(block)) for block in blocks(W)])
        return np.asarray(np.sqrt(1.0 + leverage)[:, None] * self.deviation)

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the expansion."""
        basis, W = self.basis, self.coordinates.forward(Z)
        slopes = [
            np.einsum("jmn,mk->nkj", basis.derivatives(block)[1], self.coefficients, optimize=True)
            for block in blocks(W)
        ]
        return self.coordinates.gradient(Z, np.concatenate(slopes))

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        own = {name: value for name, value in vars(self).items() if name != "coordinates"}
        arrays, settings = self.coordinates.state()
        return own | arrays, settings

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        own = {name: array for name, array in arrays.items() if not name.startswith("coordinate_")}
        return cls(**own, coordinates=Coordinates.from_state(arrays, settings))


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    degree: int | None = None,
    max_degree: int | None = None,
    max_terms: int = 1500,
    sparse: bool = True,
    derivatives: bool = True,
) -> Chaos:
    """Fit an expansion shared by all outputs.

    Parameters
    ----------
    problem
        The standardised runs. The polynomials are orthonormal under `problem.distributions`, or under the
        uniform law on `problem.bounds`; in the logarithm of an input with a heavy tail, unless polynomials of
        the input itself have a tenth of the error.
    rng
        Source of the runs on which the terms are chosen.
    degree
        Total degree; chosen by the leave-one-out error where left out.
    max_degree, max_terms
        Limits to that choice; left out, the degree is at most 12, and 30 of terms that are sought one by one.
    sparse
        Also try sets of terms that grow, round by round, where the coefficients are large, and, of 20 to
        2,000 runs without derivatives, terms sought among more candidates than there are runs. Not tried with
        a given `degree`.
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
    for asked in (degree, max_degree):
        if asked is not None and asked < 0:
            raise StudyError.at("pce: degree", asked, "0 or more")
    search = _Search(degree, max_degree, max_terms, sparse, derivatives)
    tame, raw = Coordinates.of(problem), Coordinates.raw(problem.Z.shape[1])
    best = search.expansion(problem, tame, rng)
    if not tame.all_raw:
        other = search.expansion(problem, raw, rng)
        if _score(other.loo_error) < _score(best.loo_error) + np.log(RAW_BETTER):
            best = other
    return best


@dataclass(frozen=True)
class _Search:
    """The options of `train`."""

    degree: int | None
    max_degree: int | None
    max_terms: int
    sparse: bool
    derivatives: bool

    def expansion(self, problem: Problem, coordinates: Coordinates, rng: np.random.Generator) -> Chaos:
        """Return the expansion in given coordinates."""
        plain = MAX_DEGREE if self.max_degree is None else self.max_degree
        plain = plain if self.degree is None else self.degree
        highest = MAX_SPARSE_DEGREE if self.max_degree is None else self.max_degree
        # One more, to judge the design by.
        recurrences = _recurrences(problem, coordinates, max(plain, highest) + 1)
        own = coordinates.problem(problem)
        rows = Rows(own.Z, own.T, own.dT if self.derivatives else None)
        fresh = coordinates.forward(fresh_points(problem, rng.spawn(1)[0]))
        if self.degree is not None:
            chaos = _solve(rows, recurrences, self._given(rows, recurrences))
            return replace(_corrected(chaos, rows, fresh, rng), coordinates=coordinates)
        best = self._least_squares(rows, recurrences, plain, rng)
        n = len(rows.Z)
        seek = self.sparse and rows.dT is None and FEWEST_RUNS <= n <= MOST_RUNS
        other = None
        if seek and np.any(best.loo_error > ENOUGH):
            limits = np.minimum(highest_degrees(recurrences), highest)
            other = self._among_many(own, recurrences, limits, plain, rng)
        if other is None or _score(other.loo_error) > _score(best.loo_error):
            other = _corrected(best, rows, fresh, rng)
        return replace(other, coordinates=coordinates)

    def _given(self, rows: Rows, recurrences: Array) -> Indices:
        """Return the terms of a given degree, if the runs are enough for them."""
        assert self.degree is not None  # noqa: S101 - asked before
        limits = np.minimum(highest_degrees(recurrences), self.degree)
        n_terms = n_total_degree(limits, self.degree)
        if n_terms > rows.n_rows:
            expected = f"a degree with at most {rows.n_rows} terms (this has {n_terms})"
            raise StudyError.at("pce: degree", self.degree, expected)
        return total_degree(len(limits), self.degree, limits)

    def _least_squares(self, rows: Rows, recurrences: Array, highest: int, rng: np.random.Generator) -> Chaos:
        """Return the better of a total degree and a set of terms that grew."""
        some = rows.sample(SELECTION_ROWS, rng)
        limits = np.minimum(highest_degrees(recurrences), highest)
        limit = max(1, min(self.max_terms, int(SHARE_OF_ROWS * some.n_rows)))
        best = _best_total_degree(some, recurrences, highest, limits, limit)
        if self.sparse:
            grown = _grow(some, recurrences, limits, limit)
            if _score(grown.loo_error) < _score(best.loo_error):
                best = grown
        return best if some is rows else _solve(rows, recurrences, best.indices)

    def _among_many(
        self, problem: Problem, recurrences: Array, limits: Indices, plain: int, rng: np.random.Generator
    ) -> Chaos | None:
        """Return the best expansion with terms sought among many, or None where plain least squares do."""
        rows = Rows(problem.Z, problem.T, None)
        stream, trials = rng.spawn(2)

        def by_pursuit(norm: float) -> Way:
            return lambda rows: _finish(pursued(rows, recurrences, limits, norm, self.max_terms))

        def by_prior(*, free: bool) -> Way:
            return lambda rows: _with_prior(
                regularised(rows, recurrences, limits, self.max_terms, stream, free=free), recurrences
            )

        ways: list[Way] = [
            lambda rows: self._least_squares(rows, recurrences, plain, stream),
            *(by_pursuit(norm) for norm in NORMS),
            *(by_prior(free=free) for free in (False, True)),
        ]
        errors = tried(rows, ways, trials)
        best = int(np.argmin(errors))
        if errors[best] > errors[0] + np.log(BETTER):
            return None

        def predictor(problem: Problem, _: np.random.Generator) -> Predictor:
            chaos = ways[best](Rows(problem.Z, problem.T, None))
            return lambda Z: (chaos.predict(Z), chaos.std(Z) + np.finfo(float).tiny)

        chaos = ways[best](rows)
        # The leave-one-out residuals do not know that the terms were picked for their runs.
        return replace(chaos, deviation=chaos.deviation * cross_calibrated(problem, predictor, trials))


def moments(surrogate: Surrogate) -> tuple[Array, Array]:
    """Return the mean and the standard deviation of each output, in closed form.

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
    """
    model = _expansion(surrogate)
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


def learnt_under(surrogate: Surrogate, column: int, law: Distribution) -> bool:
    """Tell whether a law is the one of an input that an expansion was trained with.

    Parameters
    ----------
    surrogate
        Of kind ``pce``.
    column
        The input's place.
    law
        The law.
    """
    model = _expansion(surrogate)
    known = model.recurrences[column]
    degree = min(3, known.shape[1] - 1)
    own = _recurrence(law_quadrature(law), column, surrogate.scaling, model.coordinates, degree)
    return bool(np.allclose(own, known[:, : degree + 1], rtol=SAME_LAW, atol=SAME_LAW))


def _recurrences(problem: Problem, coordinates: Coordinates, degree: int) -> Array:
    """Return the recurrence coefficients of each input's coordinate."""
    laws = []
    for j, scale in enumerate(problem.scaling.input_scale):
        lower, upper = problem.bounds[j]
        if problem.distributions is not None:
            points = law_quadrature(problem.distributions[j], degree + 1)
        else:
            # An input that was never varied has no law; any interval will do, its terms stay unused.
            points = uniform_quadrature(lower, upper if upper > lower else lower + scale)
        laws.append(_recurrence(points, j, problem.scaling, coordinates, degree))
    return np.stack(laws)


def _recurrence(
    points: tuple[Array, Array], column: int, scaling: Scaling, coordinates: Coordinates, degree: int
) -> Array:
    """Return the recurrence coefficients of one input's coordinate, of its law's points in its own unit."""
    Z = np.zeros((len(points[0]), len(scaling.input_shift)))
    Z[:, column] = (points[0] - scaling.input_shift[column]) / scaling.input_scale[column]
    return recurrence(coordinates.forward(Z)[:, column], points[1], degree)


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
        coordinates=Coordinates.raw(len(system.basis.coefficients)),
    )


def _with_prior(found: Regularised, recurrences: Array) -> Chaos:
    """Return the expansion with a prior, its standard deviation calibrated."""
    spread = np.abs(found.residuals) / found.spread[:, None]
    return Chaos(
        recurrences=recurrences,
        indices=found.indices,
        coefficients=found.coefficients,
        factor=found.factor,
        deviation=np.quantile(spread, 0.9, axis=0) / HALF_WIDTH_90,
        loo_error=np.sqrt(np.mean(found.residuals**2, axis=0)),
        coordinates=Coordinates.raw(len(recurrences)),
    )


def _corrected(chaos: Chaos, rows: Rows, fresh: Array, rng: np.random.Generator) -> Chaos:
    """Return the expansion, its standard deviation true at fresh points, not just at runs left out."""
    if rows.dT is not None:  # derivatives fill the gaps between the runs
        return chaos
    # A stream of its own: a random design from the same seed would be drawn once more.
    ratio = fresh_to_left_out(chaos.basis, chaos.factor, rows.Z, fresh, rng.spawn(1)[0])
    return replace(chaos, deviation=ratio * chaos.deviation)


def _best_total_degree(rows: Rows, recurrences: Array, highest: int, limits: Indices, limit: int) -> Chaos:
    """Return the total degree of the smallest leave-one-out error, all degrees from one triangularisation."""
    while highest and n_total_degree(limits, highest) > limit:
        highest -= 1
    system = independent(rows, recurrences, total_degree(len(limits), highest, limits))
    degrees = system.basis.indices.sum(axis=1)
    sizes = [int(size) for size in np.flatnonzero(np.diff(degrees, append=highest + 1)) + 1]
    residuals, _ = system.leave_one_out(sizes)
    errors = np.sqrt(np.mean(residuals**2, axis=1))
    return _finish(system, sizes[int(np.argmin([_score(error) for error in errors]))])


def _grow(rows: Rows, recurrences: Array, limits: Indices, limit: int) -> Chaos:
    """Let the set of terms grow where the coefficients are large, until the error stops falling.

    In each round all terms of the margin are tried at once, and those with the largest coefficients
    stay. The set remains
    downward closed (Gerstner and Griebel, *Computing* 71, 2003, for quadrature).
    """
    indices = total_degree(len(limits), 0)
    best = _solve(rows, recurrences, indices)
    waiting = 0
    while waiting < PATIENCE:
        outside = margin(indices, limits)
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
