"""Bayesian optimisation: a Gaussian process for each output, and the point that promises most.

The process learns the *outputs*; the objective and the constraints are known formulas of them and are applied
to its draws (composite Bayesian optimisation, Astudillo & Frazier 2019). So |w|/(|v| + |w|), which has a
crease no smooth process can follow, costs no more evaluations than v and w do. Where the objective is an
output itself this is the classical method, with the acquisitions of the source paper:

    UCB   μ + ξ σ                      (its Eq. 11)
    EI    E[max(0, f − best − ξ s)]     expected improvement
    MPI   P[f > best + ξ s]             probability of improvement

with s the standard deviation of the objective over the points seen, and f, best taken so that more is better.
With constraints the acquisition is multiplied by the probability that all of them hold (Gardner et al. 2014);
until a point satisfies them, that probability alone is followed. An acquisition that comes back to a known
point has nothing more to say; expected improvement then proposes instead, which keeps the paper's nearly
greedy UCB (ξ = 0.01) from spending its evaluations on one local optimum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.compiled import minimise
from tensegra.analysis.cubeprocess import fit_process
from tensegra.analysis.manystarts import Ends
from tensegra.analysis.problem import FEASIBLE, Assessment, Problem, Recorder
from tensegra.errors import StudyError
from tensegra.surrogate.threads import one_thread

if TYPE_CHECKING:
    from pathlib import Path

Array = NDArray[np.float64]

# The acquisitions and their ξ unless another is given: the source paper's for UCB; none for EI, whose margin
# would stop the search that far from the optimum.
ACQUISITIONS = {"ucb": 0.01, "ei": 0.0, "mpi": 0.01}

# Candidates that the acquisition is computed at before the best are refined.
N_CANDIDATES = 2000
N_REFINED = 4
# Draws of the outputs where the formula is not simply an output.
N_DRAWS = 64
# Two points of the unit cube closer than this are the same to the process; it would learn nothing.
SAME_POINT = 1e-4


class BayesianOptimiser:
    """Ask for a point, evaluate it, tell the outputs; repeat.

    Everything it proposes follows from what it was told and its seed, so that a search that is resumed
    (`tensegra.analysis.searchfile`) goes on as if it had never stopped.

    Parameters
    ----------
    problem
        What is optimised.
    n_initial
        Points of a scrambled Sobol sequence before the process takes over.
    acquisition, xi
        ``ucb``, ``ei`` or ``mpi``, and its exploration parameter ξ (`ACQUISITIONS` unless given).
    seed
        Of all random numbers.

    Examples
    --------
    >>> from tensegra.analysis import FunctionModel
    >>> from tensegra.analysis.problem import state_problem
    >>> import numpy as np
    >>> model = FunctionModel(lambda X: (X[:, 0] - 0.3) ** 2, ("a",), ("y",), np.array([[0.0, 1.0]]))
    >>> search = BayesianOptimiser(state_problem(model, "y", maximise=False), n_initial=4, seed=1)
    >>> for _ in range(10):
    ...     x = search.ask()
    ...     search.tell(x, model.evaluate([x]).values[0])
    >>> x, value = search.best()
    >>> x.round(2), value < 1e-4
    (array([0.3]), True)
    """

    def __init__(
        self,
        problem: Problem,
        *,
        n_initial: int = 8,
        acquisition: str = "ucb",
        xi: float | None = None,
        seed: int = 0,
    ) -> None:
        if acquisition not in ACQUISITIONS:
            expected = "one of " + ", ".join(ACQUISITIONS)
            raise StudyError.at("optimisation.acquisition", acquisition, expected, candidates=ACQUISITIONS)
        xi = ACQUISITIONS[acquisition] if xi is None else xi
        if not xi >= 0.0:
            raise StudyError.at("optimisation.xi", xi, "a number not below 0")
        for constraint in problem.constraints:
            if constraint.equality:
                raise StudyError.at(
                    "constraints",
                    constraint.text,
                    "a band such as -0.1 <= v <= 0.1: no sample meets an equality",
                )
        from scipy.stats import qmc

        self.problem, self.acquisition, self.xi, self.seed = problem, acquisition, xi, seed
        self._columns = [problem.model.output_names.index(name) for name in problem.used_outputs]
        size = 1 << max(n_initial - 1, 1).bit_length()
        initial = qmc.Sobol(problem.n_inputs, rng=np.random.default_rng(seed)).random(size)
        self._initial = self._snapped(initial[:n_initial])
        self.X = np.zeros((0, problem.n_inputs))
        self.outputs = np.zeros((0, len(problem.model.output_names)))

    @property
    def n_initial(self) -> int:
        """Number of space-filling points at the beginning."""
        return len(self._initial)

    @property
    def n_told(self) -> int:
        """Number of evaluations told so far."""
        return len(self.X)

    def ask(self) -> Array:
        """Return the next point (n_inputs,) to evaluate, in the problem's units."""
        if self.n_told < len(self._initial):
            return self._point(self._initial[self.n_told])
        valid = np.asarray(np.isfinite(self.outputs[:, self._columns]).all(axis=1))
        rng = np.random.default_rng([self.seed, self.n_told])
        if valid.sum() < 2:
            return self._point(self._snapped(rng.random((1, self.problem.n_inputs)))[0])
        Z = self.problem.to_unit(self.X)
        self._processes = [
            fit_process(Z[valid], self.outputs[valid, column], rng) for column in self._columns
        ]
        return self._point(self._propose(Z, valid, rng))

    def tell(self, x: Array, outputs: Array) -> None:
        """Take in the outputs (n_outputs,) at `x` (n_inputs,); NaN says that the model failed there."""
        self.X = np.vstack([self.X, np.asarray(x, dtype=float)])
        self.outputs = np.vstack([self.outputs, np.asarray(outputs, dtype=float)])

    def best(self) -> tuple[Array, float]:
        """Return the best feasible point so far and its objective; NaN where there is none."""
        merit, feasible = self._merit()
        if not feasible.any():
            return np.full(self.problem.n_inputs, np.nan), np.nan
        index = int(np.argmax(np.where(feasible, merit, -np.inf)))
        return self.X[index], float(self._sign * merit[index])

    @property
    def _sign(self) -> float:
        return 1.0 if self.problem.maximise else -1.0

    def _point(self, z: Array) -> Array:
        return np.asarray(self.problem.from_unit(z[None])[0])

    def _snapped(self, Z: Array) -> Array:
        """Move points (n, d) to the values of discrete inputs, and of inputs that are held."""
        return np.asarray(np.where(self.problem.fixed, 0.0, self.problem.levels.snap(Z)))

    def _assess(self, X: Array, outputs: Array) -> tuple[Array, Array]:
        """Return the merit (n,), more being better, and the margins (n, n_constraints)."""
        columns = self.problem.columns(X, outputs)
        merit = np.broadcast_to(self._sign * self.problem.objective(columns), (len(X),))
        margins = [np.broadcast_to(c.margin(columns), (len(X),)) for c in self.problem.constraints]
        return merit, np.stack(margins, axis=1) if margins else np.zeros((len(X), 0))

    def _merit(self) -> tuple[Array, NDArray[np.bool_]]:
        merit, margins = self._assess(self.X, self.outputs)
        finite = np.isfinite(merit)
        feasible = finite.copy()
        if self.problem.constraints and finite.any():
            scales = self.problem.scales(Assessment(self.X, self.outputs, merit, margins))
            feasible &= np.nan_to_num(self.problem.violation(margins, scales), nan=np.inf) <= FEASIBLE
        return merit, feasible

    def _propose(self, Z: Array, valid: NDArray[np.bool_], rng: np.random.Generator) -> Array:
        """Maximise the acquisition over the unit cube: many candidates, the best of them refined."""
        merit, feasible = self._merit()
        state = _State(
            incumbent=float(merit[feasible].max()) if feasible.any() else -np.inf,
            worst=float(merit[np.isfinite(merit)].min(initial=np.inf)),
            spread=float(np.std(merit[np.isfinite(merit)])) or 1.0,
            normals=_normal_draws(len(self._columns), self.seed),
        )

        best = Z[np.argsort(-np.where(feasible, merit, -np.inf), kind="stable")[:3]]
        candidates = self._snapped(_candidates(best, rng))
        # Where the asked-for acquisition has settled on a known point, expected improvement looks elsewhere.
        for acquisition, xi in ((self.acquisition, self.xi), ("ei", 0.0)):

            def score(points: Array, acquisition: str = acquisition, xi: float = xi) -> Array:
                points = self._snapped(points)
                values = self._log_acquisition(points, state, acquisition, xi)
                values[_nearest_failed(points, Z, valid)] = -np.inf
                return np.nan_to_num(values, nan=-1e300, neginf=-1e300)

            order = np.argsort(-score(candidates), kind="stable")
            refined = [_ascend(score, candidates[index]) for index in order[:N_REFINED]]
            for _, end in sorted(refined, key=lambda pair: -pair[0]):
                point = self._snapped(end[None])[0]
                if np.abs(Z - point).max(axis=1).min() > SAME_POINT:
                    return np.asarray(point)
        unknown = sum(process.predict(candidates)[1] / process.scale for process in self._processes)
        unknown = np.where(_nearest_failed(candidates, Z, valid), -1.0, unknown)
        return np.asarray(candidates[int(np.argmax(unknown))])

    def _log_acquisition(self, points: Array, state: "_State", acquisition: str, xi: float) -> Array:
        from scipy.special import log_ndtr

        mean, std, margin_mean, margin_std = self._posterior(points, state.normals)
        log_feasible = log_ndtr(margin_mean / margin_std).sum(axis=1)
        if not np.isfinite(state.incumbent):
            return np.asarray(log_feasible)
        if acquisition == "ucb":
            height = mean + xi * std
            if not self.problem.constraints:
                return np.asarray(height)
            return np.asarray(np.log(np.maximum(height - state.worst, 1e-12 * state.spread)) + log_feasible)
        u = (mean - state.incumbent - xi * state.spread) / std
        if acquisition == "mpi":
            return np.asarray(log_ndtr(u) + log_feasible)
        return np.asarray(np.log(std) + _log_improvement(u) + log_feasible)

    def _posterior(self, points: Array, normals: Array) -> tuple[Array, Array, Array, Array]:
        """Return mean and standard deviation of the merit (n,) and of the margins (n, n_constraints)."""
        predictions = [process.predict(points) for process in self._processes]
        means, stds = (np.stack([pair[i] for pair in predictions], axis=1) for i in (0, 1))
        X = self.problem.from_unit(points)
        if self.problem.objective.text in self.problem.used_outputs and not self.problem.constraints:
            return self._sign * means[:, 0], stds[:, 0], np.zeros((len(points), 0)), np.ones((len(points), 0))
        drawn = means[:, None, :] + stds[:, None, :] * normals
        outputs = np.zeros((drawn.shape[0] * drawn.shape[1], self.outputs.shape[1]))
        outputs[:, self._columns] = drawn.reshape(-1, drawn.shape[2])
        merit, margins = self._assess(np.repeat(X, len(normals), axis=0), outputs)
        merit, margins = merit.reshape(drawn.shape[:2]), margins.reshape(*drawn.shape[:2], -1)
        floor = 1e-12
        return (
            merit.mean(axis=1),
            np.maximum(merit.std(axis=1), floor * np.abs(merit).max(initial=1e-300)),
            margins.mean(axis=1),
            np.maximum(margins.std(axis=1), floor * np.abs(margins).max(initial=1e-300)),
        )


def search(
    problem: Problem,
    recorder: Recorder,
    *,
    evaluations: int,
    acquisition: str,
    xi: float | None,
    seed: int,
    file: "Path | None" = None,
) -> Ends:
    """Run rounds of ask, evaluate and tell up to `evaluations`, those that `file` holds among them."""
    from tensegra.analysis.searchfile import load_search, save_search

    n_initial = min(max(2 * len(problem.search) + 2, 5), max(evaluations // 2, 2))
    optimiser = BayesianOptimiser(problem, n_initial=n_initial, acquisition=acquisition, xi=xi, seed=seed)
    n_before = 0
    if file is not None and file.exists():
        optimiser = load_search(file, problem, acquisition=acquisition, xi=xi, seed=seed)
        n_before = optimiser.n_told
        if n_before:
            recorder.adopt(optimiser.X, optimiser.outputs)
    while optimiser.n_told < evaluations:
        with one_thread():  # matrices of so few points are no work to share
            x = optimiser.ask()
        _, _, found = recorder.evaluate_at(x[None], [0])
        optimiser.tell(x, found.outputs[0])
        if file is not None:
            save_search(optimiser, file)
    visited, _ = recorder.all()
    # The scales are those of the whole box: the points of the search itself crowd around the optimum.
    spread = visited.rows(slice(optimiser.n_initial))
    if not np.isfinite(spread.objective).any():
        spread = visited
    reason = f"{optimiser.n_told} evaluations, the first {optimiser.n_initial} of them space-filling"
    if n_before:
        reason += f"; {n_before} are from an earlier search"
    return Ends(problem.scales(spread), np.array([True]), (reason,))


@dataclass(frozen=True)
class _State:
    """What the acquisitions measure against: best and worst merit so far, its spread, and fixed draws."""

    incumbent: float
    worst: float
    spread: float
    normals: Array


def _candidates(best: Array, rng: np.random.Generator) -> Array:
    """Return points all over the cube and, at ever smaller scales, around the best ones."""
    from scipy.stats import qmc

    d = best.shape[1]
    spread = qmc.Sobol(d, rng=rng).random(1 << (N_CANDIDATES - 1).bit_length())
    near = [z + scale * rng.standard_normal((50, d)) for z in best for scale in (0.1, 0.01, 0.001)]
    return np.asarray(np.clip(np.vstack([spread, *near]), 0.0, 1.0))


def _ascend(score: Callable[[Array], Array], z: Array) -> tuple[float, Array]:
    """Climb from `z` inside the cube, central differences in one batch; return the height and the point."""
    d, step = z.size, 1e-5

    def value(z: Array) -> tuple[float, Array]:
        low, high = np.clip(z - step, 0.0, 1.0), np.clip(z + step, 0.0, 1.0)
        probes = np.tile(z, (2 * d + 1, 1))
        probes[np.arange(d), np.arange(d)] = low
        probes[d + np.arange(d), np.arange(d)] = high
        found = score(probes)
        slope = (found[d : 2 * d] - found[:d]) / (high - low)
        return -float(found[-1]), -np.nan_to_num(slope, nan=0.0, posinf=0.0, neginf=0.0)

    result = minimise(value, z, method="L-BFGS-B", bounds=[(0.0, 1.0)] * d, options={"maxiter": 60})
    return -float(result.fun), np.clip(result.x, 0.0, 1.0)


def _nearest_failed(points: Array, Z: Array, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which points lie nearest to one where the model failed: it is expected to fail there too."""
    if valid.all():
        return np.zeros(len(points), dtype=bool)
    nearest = ((points[:, None, :] - Z) ** 2).sum(axis=2).argmin(axis=1)
    return np.asarray(~valid[nearest])


def _normal_draws(n_outputs: int, seed: int) -> Array:
    """Return standard normal draws (N_DRAWS, n_outputs), fixed so that the acquisition is smooth."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    U = qmc.Sobol(n_outputs, rng=np.random.default_rng(seed)).random(N_DRAWS)
    return np.asarray(ndtri(np.clip(U, 1e-6, 1.0 - 1e-6)))


def _log_improvement(u: Array) -> Array:
    """Return log(φ(u) + u Φ(u)) without underflow (Ament et al. 2023, arXiv:2310.20708, Eq. 9)."""
    from scipy.special import erfcx, ndtr

    density = np.exp(-0.5 * u**2) / np.sqrt(2.0 * np.pi)
    near = np.log(np.maximum(density + u * ndtr(u), np.finfo(float).tiny))
    v = np.maximum(-u, 1.0)
    tail = np.where(v < 1e4, 1.0 - np.sqrt(np.pi / 2.0) * v * erfcx(v / np.sqrt(2.0)), v**-2.0)
    far = -0.5 * v**2 - 0.5 * np.log(2.0 * np.pi) + np.log(np.maximum(tail, np.finfo(float).tiny))
    return np.asarray(np.where(u > -1.0, near, far))
