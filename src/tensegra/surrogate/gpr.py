"""Gaussian process regression: a radial basis function with one length scale per input, one per output.

The kernel is k(x, x') = exp(−½ Σ ((x_i − x'_i)/ℓ_i)²), (S1), as in Eq. (6) of the source paper. Runs of a
mechanics solver are exact to some twelve digits, so the accuracy is lost in the algebra, not in the data: the
length scales are found on a subset, where the likelihood is cheap and its Cholesky factor not yet singular,
and the process is conditioned on all runs with the smallest nugget that lets the factorisation pass.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import log
from typing import Any, Self, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.design import fresh_points
from tensegra.surrogate.intervals import calibrated, fold_factor, fresh_to_left_out
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.process import Process, kernel

__all__ = ["GaussianProcess", "train"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.intp]
T = TypeVar("T")

SMALLEST_NUGGET = 1e-13  # times the kernel's amplitude: below, rounding makes any factorisation fail
LARGEST_NUGGET = 1e-2  # above, something other than rounding is wrong
FIRST_LENGTH_SCALES = (1.0, 3.0)  # starts, in standard deviations of the input
RESTART_RANGE = (0.2, 10.0)
LENGTH_SCALE_BOUNDS = (0.05, 1e3)
SEARCH_ITERATIONS, LINE_SEARCH_STEPS = 60, 10  # past them the search only follows the rounding of K
REFUSED = 1e25  # stands for the likelihood where the kernel matrix has no Cholesky factor
BLOCK = 2048  # points at once: the kernel matrix of a block stays in the cache's neighbourhood
# With so few runs the length scales fit them better than fresh points; fewer than 20 make no folds.
FEW_RUNS = range(20, 201)
CALIBRATION_POINTS = 1_000  # enough for the 90 % quantile to ±1 % (one sigma)


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """Independent processes, one per output (`tensegra.surrogate.problem.Model`), in tame coordinates."""

    processes: tuple[Process, ...]
    coordinates: Coordinates

    @property
    def has_std(self) -> bool:
        """True: a process knows its variance."""
        return True

    def predict(self, Z: Array) -> Array:
        """Return the posterior means."""
        return _blockwise(
            self.coordinates.forward(Z),
            lambda block: np.stack([p.kernel(block) @ p.weights for p in self.processes], axis=1),
        )

    def std(self, Z: Array) -> Array:
        """Return the calibrated posterior standard deviations."""
        return _blockwise(
            self.coordinates.forward(Z),
            lambda block: np.stack(
                [p.deviation * np.sqrt(p.variance(block)) for p in self.processes], axis=1
            ),
        )

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the posterior means: Σ_c w_c k(z, c) (c − z)/ℓ²."""
        slope = _blockwise(
            self.coordinates.forward(Z),
            lambda block: np.stack([p.slope(block) for p in self.processes], axis=1),
        )
        return self.coordinates.gradient(Z, slope)

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays, settings = self.coordinates.state()
        for i, p in enumerate(self.processes):
            arrays |= {
                f"length_scale_{i}": p.length_scale,
                f"centres_{i}": p.centres,
                f"weights_{i}": p.weights,
                f"factor_{i}": p.factor,
            }
            if p.posterior is not None:
                arrays[f"posterior_{i}"] = p.posterior
        scalars = [{"nugget": p.nugget, "deviation": p.deviation} for p in self.processes]
        return arrays, settings | {"processes": scalars}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        return cls(
            tuple(
                Process(
                    length_scale=arrays[f"length_scale_{i}"],
                    centres=arrays[f"centres_{i}"],
                    weights=arrays[f"weights_{i}"],
                    factor=arrays[f"factor_{i}"],
                    posterior=arrays.get(f"posterior_{i}"),
                    **scalars,
                )
                for i, scalars in enumerate(settings["processes"])
            ),
            Coordinates.from_state(arrays, settings),
        )


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    subset: int = 300,
    restarts: int = 0,
    exact_limit: int = 10_000,
    inducing_points: int = 1_000,
) -> GaussianProcess:
    """Fit one process per output.

    Parameters
    ----------
    problem
        The standardised runs; derivatives are not used. Inputs with heavy tails are learnt in their logarithm
        (`tensegra.surrogate.coordinates`).
    rng
        Source of the subset, the restarts and the inducing points.
    subset
        Number of runs on which the length scales are fitted, drawn at random.
    restarts
        Further starts of the search for them, at random; it has two of its own.
    exact_limit
        Up to this number of runs the process is conditioned on each of them, above on inducing points.
    inducing_points
        Their number, chosen one after the other where the variance left is largest.

    Returns
    -------
    GaussianProcess
        The processes, with standard deviations calibrated on runs left out: of 200 at most (and not more
        than `subset`) in folds, with length scales found again, of more one by one.
    """
    for name, count in (("subset", subset), ("inducing_points", inducing_points)):
        if count < 2:
            raise StudyError.at(f"gpr: {name}", count, "2 or more")
    coordinates = Coordinates.of(problem)
    own = coordinates.problem(problem)
    n = len(own.Z)
    chosen = np.sort(rng.choice(n, size=min(n, subset), replace=False))
    d = own.Z.shape[1]
    fixed = np.repeat(FIRST_LENGTH_SCALES, d).reshape(-1, d)
    lowest, highest = RESTART_RANGE
    random = lowest * (highest / lowest) ** rng.uniform(size=(restarts, d))
    starts = np.concatenate([fixed, random])
    processes = []
    # A stream of its own: a random design from the same seed would be drawn once more.
    stream = rng.spawn(1)[0]
    fresh = coordinates.forward(fresh_points(problem, stream))
    for t in own.T.T:
        length_scale = fit_length_scale(own.Z[chosen], t[chosen], starts)
        if n in FEW_RUNS and n <= subset:
            processes.append(_condition_few(own.Z, t, length_scale, fresh, stream))
        elif n <= exact_limit:
            processes.append(_condition(own.Z, t, length_scale, fresh, stream))
        else:
            processes.append(_condition_sparsely(own.Z, t, length_scale, inducing_points, rng))
    return GaussianProcess(tuple(processes), coordinates)


def fit_length_scale(Z: Array, t: Array, starts: Array) -> Array:
    """Return the length scales of largest marginal likelihood, shape (n_inputs,).

    The kernel's amplitude is concentrated out: for given length scales its best value is tᵀK⁻¹t/n (Rasmussen
    and Williams, 2006, Eq. 5.8 solved for it). Amplitude and length scales trade off along a narrow valley;
    searched together, as scikit-learn's regressor does, they take ten times the evaluations and get stuck.

    Parameters
    ----------
    Z, t
        Standardised points (n_points, n_inputs) and one output (n_points,).
    starts
        Length scales to start from, shape (n_starts, n_inputs).
    """
    from scipy.optimize import minimize

    def search(nugget: float) -> Array:
        best, smallest = None, REFUSED
        for start in starts:
            found = minimize(
                _negative_log_likelihood,
                np.log(start),
                args=(Z, t, nugget),
                jac=True,
                method="L-BFGS-B",
                bounds=[(log(LENGTH_SCALE_BOUNDS[0]), log(LENGTH_SCALE_BOUNDS[1]))] * Z.shape[1],
                options={"maxiter": SEARCH_ITERATIONS, "maxls": LINE_SEARCH_STEPS},
            )
            if found.fun < smallest:
                best, smallest = np.exp(found.x), found.fun
        if best is None:
            raise np.linalg.LinAlgError
        return np.asarray(best)

    return _with_smallest_nugget(search)[0]


def _negative_log_likelihood(
    log_length_scale: Array, Z: Array, t: Array, nugget: float
) -> tuple[float, Array]:
    """Return −log p(t) with the best amplitude, but for a constant, and its gradient."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve
    from sklearn.gaussian_process.kernels import RBF

    n = len(t)
    K, slopes = RBF(np.exp(log_length_scale))(Z, eval_gradient=True)
    K[np.diag_indices(n)] += nugget
    try:
        factor = cho_factor(K, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return REFUSED, np.zeros_like(log_length_scale)  # the line search turns back
    weights = cho_solve(factor, t)
    amplitude = max(float(t @ weights) / n, np.finfo(float).tiny)
    value = 0.5 * n * np.log(amplitude) + np.sum(np.log(np.diagonal(factor[0])))
    inner = cho_solve(factor, np.eye(n)) - np.outer(weights, weights) / amplitude
    return float(value), 0.5 * np.einsum("ij,ijk->k", inner, slopes)


def _with_smallest_nugget(attempt: Callable[[float], T]) -> tuple[T, float]:
    """Return the first result of `attempt` whose factorisation passes, and the nugget, raised tenfold."""
    nugget = SMALLEST_NUGGET
    while True:
        try:
            return attempt(nugget), nugget
        except np.linalg.LinAlgError as error:
            nugget *= 10
            if nugget > LARGEST_NUGGET:
                raise StudyError(
                    f"gpr: the kernel matrix cannot be factorised even with a nugget of {LARGEST_NUGGET:g}"
                ) from error


def _cholesky(Z: Array, length_scale: Array) -> tuple[Array, float]:
    """Return the lower Cholesky factor of k(Z, Z) + nugget, and the nugget."""
    from scipy.linalg import cholesky

    def attempt(nugget: float) -> Array:
        K = kernel(Z, Z, length_scale)
        K[np.diag_indices_from(K)] += nugget
        # The transpose of the symmetric matrix lies in memory as LAPACK wants it, so nothing is copied.
        upper: Array = cholesky(K.T, overwrite_a=True, check_finite=False)
        return np.ascontiguousarray(upper.T)

    return _with_smallest_nugget(attempt)


def _condition(Z: Array, t: Array, length_scale: Array, fresh: Array, rng: np.random.Generator) -> Process:
    """Condition the process on every run, its standard deviation calibrated on runs left out one by one."""
    from scipy.linalg import cho_solve, solve_triangular

    n = len(Z)
    factor, nugget = _cholesky(Z, length_scale)
    weights = cho_solve((factor, True), t)
    # Leave-one-out residual and variance of run i are w_i/d_i and 1/d_i with d = diag K⁻¹ (Rasmussen and
    # Williams, Gaussian Processes for Machine Learning, 2006, Eqs. 5.10 to 5.12).
    sample = np.sort(rng.choice(n, size=min(n, CALIBRATION_POINTS), replace=False))
    unit = np.zeros((n, len(sample)))
    unit[sample, np.arange(len(sample))] = 1.0
    inverse_diagonal = np.sum(solve_triangular(factor, unit, lower=True) ** 2, axis=0)
    process = Process(length_scale, Z, weights, factor, None, nugget, 1.0)
    ratio = fresh_to_left_out(process, sample, inverse_diagonal, fresh, rng) if len(fresh) else 1.0
    return replace(process, deviation=ratio * calibrated(weights[sample] / np.sqrt(inverse_diagonal)))


def _condition_few(
    Z: Array, t: Array, length_scale: Array, fresh: Array, rng: np.random.Generator
) -> Process:
    """Condition the process on so few runs that the length scales found on them have to be found again."""
    none = np.zeros((0, Z.shape[1]))

    def standardised(used: Indices, fold: Indices) -> Array:
        # From a start that does not know the fold; the length scales of all runs would.
        again = fit_length_scale(Z[used], t[used], np.full((1, Z.shape[1]), FIRST_LENGTH_SCALES[0]))
        process = _condition(Z[used], t[used], again, none, rng)
        residual = t[fold] - process.kernel(Z[fold]) @ process.weights
        # An output that does not vary has neither errors nor a deviation.
        std = process.deviation * np.sqrt(process.variance(Z[fold]))
        return np.asarray(residual / np.maximum(std, np.finfo(float).tiny))

    process = _condition(Z, t, length_scale, fresh, rng)
    return replace(process, deviation=process.deviation * fold_factor(len(Z), standardised, rng))


def _condition_sparsely(
    Z: Array, t: Array, length_scale: Array, n_centres: int, rng: np.random.Generator
) -> Process:
    """Condition the process on all runs through inducing points, by orthogonal triangularisation.

    The weights minimise ‖K_nm w − t‖² + nugget wᵀ K_mm w; the triangular factor of these stacked rows is
    updated block by block, so the n × m matrix never exists, and the condition number is never squared.
    """
    from scipy.linalg import qr, solve_triangular

    pool = np.sort(rng.choice(len(Z), size=min(len(Z), 10 * n_centres), replace=False))
    centres = Z[pool[_spread(Z[pool], length_scale, n_centres)]]
    m = len(centres)
    factor, nugget = _cholesky(centres, length_scale)
    held = np.zeros(len(Z), dtype=bool)
    held[rng.choice(len(Z), size=min(len(Z) // 10, CALIBRATION_POINTS), replace=False)] = True
    R = np.column_stack([np.sqrt(nugget) * factor.T, np.zeros(m)])
    for block in np.array_split(np.flatnonzero(~held), max(1, len(Z) // (4 * m))):
        rows = np.column_stack([kernel(Z[block], centres, length_scale), t[block]])
        R = qr(np.vstack([R, rows]), mode="r", overwrite_a=True, check_finite=False)[0][: m + 1]
    weights = solve_triangular(R[:m, :m], R[:m, m])
    posterior = np.ascontiguousarray(R[:m, :m].T)
    process = Process(length_scale, centres, weights, factor, posterior, nugget, 1.0)
    residual = t[held] - process.kernel(Z[held]) @ weights
    deviation = calibrated(residual / np.sqrt(process.variance(Z[held])))
    return Process(length_scale, centres, weights, factor, posterior, nugget, deviation)


def _spread(Z: Array, length_scale: Array, n_centres: int) -> NDArray[np.intp]:
    """Choose points one after the other where the variance left is largest (pivoted Cholesky)."""
    left = np.ones(len(Z))
    columns = np.empty((min(n_centres, len(Z)), len(Z)))
    chosen = []
    for j in range(len(columns)):
        pivot = int(np.argmax(left))
        if left[pivot] <= SMALLEST_NUGGET:  # the rest is spanned to rounding
            break
        column = kernel(Z, Z[pivot : pivot + 1], length_scale)[:, 0] - columns[:j, pivot] @ columns[:j]
        columns[j] = column / np.sqrt(left[pivot])
        left -= columns[j] ** 2
        left[pivot] = 0.0
        chosen.append(pivot)
    return np.sort(np.array(chosen))


def _blockwise(Z: Array, function: Callable[[Array], Array]) -> Array:
    """Evaluate block by block, so that no kernel matrix outgrows the memory."""
    return np.concatenate([function(Z[i : i + BLOCK]) for i in range(0, max(len(Z), 1), BLOCK)])
