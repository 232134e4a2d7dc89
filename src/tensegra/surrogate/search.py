"""The search for the terms of an expansion, and the fit of their coefficients."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.basis import highest_degrees, law_quadrature, recurrence, uniform_quadrature
from tensegra.surrogate.calibration import Predictor, cross_calibrated
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.design import fresh_points, fresh_to_left_out
from tensegra.surrogate.expansion import Chaos
from tensegra.surrogate.leastsquares import LeastSquares, Rows, independent
from tensegra.surrogate.problem import Problem, Scaling
from tensegra.surrogate.sparse import Regularised, pursued, regularised, tried
from tensegra.surrogate.terms import margin, n_total_degree, total_degree
from tensegra.surrogate.validation import HALF_WIDTH_90

__all__ = ["Search", "law_recurrence", "law_recurrences", "score"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]
Way: TypeAlias = Callable[[Rows], Chaos]

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


@dataclass(frozen=True)
class Search:
    """How terms are chosen: the options of `tensegra.surrogate.chaos.train`."""

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
        recurrences = law_recurrences(problem, coordinates, max(plain, highest) + 1)
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
        if other is None or score(other.loo_error) > score(best.loo_error):
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
            if score(grown.loo_error) < score(best.loo_error):
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


def law_recurrences(problem: Problem, coordinates: Coordinates, degree: int) -> Array:
    """Return the recurrence coefficients of each input's coordinate."""
    laws = []
    for j, scale in enumerate(problem.scaling.input_scale):
        lower, upper = problem.bounds[j]
        if problem.distributions is not None:
            points = law_quadrature(problem.distributions[j], degree + 1)
        else:
            # An input that was never varied has no law; any interval will do, its terms stay unused.
            points = uniform_quadrature(lower, upper if upper > lower else lower + scale)
        laws.append(law_recurrence(points, j, problem.scaling, coordinates, degree))
    return np.stack(laws)


def law_recurrence(
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
    spread = np.abs(residual) / np.sqrt(1.0 + np.maximum(leverage, 0.0))[:, None]  # rounding
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
    return _finish(system, sizes[int(np.argmin([score(error) for error in errors]))])


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
        if score(candidate.loo_error) < score(best.loo_error):
            best, waiting = candidate, 0
        else:
            waiting += 1
        size = np.abs(candidate.coefficients[len(indices) :]).max(axis=1)
        large = np.argsort(-size, kind="stable")[: max(1, round(GROWTH * len(size)))]
        indices = np.concatenate([indices, system.basis.indices[len(indices) :][np.sort(large)]])
    return best


def score(loo_error: Array) -> float:
    """Return the mean logarithm of the outputs' errors, so that each counts by its relative improvement."""
    return float(np.mean(np.log(loo_error + np.finfo(float).tiny)))
