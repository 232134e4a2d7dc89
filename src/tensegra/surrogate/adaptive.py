"""As many runs as an error needs: batches of runs, until the surrogate is as exact as asked."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.study.selection import CERTIFIED
from tensegra.surrogate.auto import choose
from tensegra.surrogate.fit import cross_validation, fit
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import Validation, fold_indices

if TYPE_CHECKING:
    from scipy.stats.qmc import QMCEngine

    from tensegra.study import Study

__all__ = ["Learnt", "Round", "learn"]

Array: TypeAlias = NDArray[np.float64]
Solve: TypeAlias = "Callable[[Array], ArrayLike | tuple[ArrayLike, ArrayLike | None]]"

N_FOLDS = 5
POOL = 20  # candidates for each run that is chosen
NEIGHBOURS = 3  # runs whose errors tell the error between them


@dataclass(frozen=True)
class Round:
    """The error after a batch of runs: of `n_runs` solved, `n_valid` can be learnt from."""

    n_runs: int
    n_valid: int
    error: float


@dataclass(frozen=True, eq=False)
class Learnt:
    """A surrogate, the runs that it took, and the error after each batch.

    Parameters
    ----------
    surrogate
        Trained on all runs, with its cross-validated `validation`.
    data
        The runs that it was trained on.
    rounds
        The error after each batch.
    target_error
        What was asked for.
    without_derivatives
        The rounds that the same took without derivatives; empty unless that was asked for.
    """

    surrogate: Surrogate
    data: TrainingData
    rounds: tuple[Round, ...]
    target_error: float
    without_derivatives: tuple[Round, ...] = ()

    @property
    def met(self) -> bool:
        """Whether the error is as small as asked."""
        return self.rounds[-1].error <= self.target_error

    @property
    def n_runs(self) -> int:
        """Number of runs solved."""
        return self.rounds[-1].n_runs

    def __repr__(self) -> str:
        text = f"Learnt({self.surrogate.kind!r}: {_told(self.rounds, self.target_error)}"
        if self.without_derivatives:
            text += f"; without derivatives {_told(self.without_derivatives, self.target_error)}"
        return f"{text})"


def learn(
    evaluate: "Study | Solve",
    target_error: float,
    *,
    bounds: ArrayLike | None = None,
    kind: str = "pce",
    derivatives: bool = False,
    compare: bool = False,
    first: int | None = None,
    batch: int | None = None,
    max_runs: int = 2_000,
    seed: int = 0,
    **options: Any,  # noqa: ANN401 - of the kind, whose `train` types them
) -> Learnt:
    """Add runs in batches until the cross-validated error is as small as asked.

    The first batch fills the space. Of each further batch half goes on filling it, and half lies where the
    error is expected to be largest: in the widest gaps between runs that were predicted badly without
    themselves.

    Parameters
    ----------
    evaluate
        A study; or a function that takes design points, shape (n, n_inputs), and returns outputs, shape
        (n, n_outputs), or outputs and derivatives, shape (n, n_outputs, n_inputs). A run without outputs is
        NaN; it counts, but nothing is learnt from it.
    target_error
        The largest `normalised_error` that an output may have in five-fold cross-validation, a fraction.
    bounds
        The box, shape (n_inputs, 2); of the study, where left out.
    kind, options
        Kind of surrogate and its options; ``"auto"`` lets the first batch choose the kind.
    derivatives
        Whether to ask the study for derivatives; a function decides itself.
    compare
        Whether to do the same without derivatives, too, so that one sees what they save.
    first, batch
        Number of runs of the first batch and of each further one; 10 and 5 for each input where left out.
    max_runs
        Limit to the number of runs.
    seed
        Seed of all that is random.

    Returns
    -------
    Learnt
        The surrogate, and the number of runs it took.

    Raises
    ------
    StudyError
        If the bounds are missing, a number is not positive, or too few runs can be learnt from.

    Examples
    --------
    >>> learnt = learn(lambda X: np.exp(X[:, :1] * X[:, 1:]), 1e-6, bounds=[[0, 1], [0, 1]])
    >>> learnt.met
    True
    >>> learnt
    Learnt('pce': 1e-06 with ... runs)
    """
    runs = _Source.of(evaluate, bounds, derivatives=derivatives or compare)
    d = len(runs.bounds)
    first = 10 * d if first is None else first
    batch = 5 * d if batch is None else batch
    if not (target_error > 0 and 2 * N_FOLDS <= first <= max_runs and batch >= 2):
        found = {"target_error": target_error, "first": first, "batch": batch, "max_runs": max_runs}
        raise StudyError.at(
            "learn", found, f"a positive error, {2 * N_FOLDS} runs or more at first, 2 or more in a batch"
        )
    plan = _Plan(target_error, kind, options, first, batch, max_runs, seed)
    learnt = _learn(runs, plan)
    if not compare:
        return learnt
    if learnt.data.dY is None:
        raise StudyError("learn: compare asks for derivatives, but the function returned none")
    without = _learn(replace(runs, derivatives=False), plan)
    return replace(learnt, without_derivatives=without.rounds)


@dataclass(frozen=True, eq=False)
class _Source:
    """Where runs come from, and what they are called."""

    solve: Callable[[Array], tuple[Array, Array | None]]
    bounds: Array
    names: dict[str, Any]
    derivatives: bool

    @classmethod
    def of(cls, evaluate: "Study | Solve", bounds: ArrayLike | None, *, derivatives: bool) -> "_Source":
        study: Any = evaluate
        names: dict[str, Any] = {}
        if hasattr(study, "evaluate"):
            names = {
                "input_names": study.input_names,
                "output_names": study.output_names,
                "input_units": tuple(variable.unit for variable in study.variables),
                "output_units": tuple(output.unit for output in study.outputs),
                "study_fingerprint": study.fingerprint,
            }
            if bounds is None:  # in a box of one's own the study's laws do not hold
                bounds, names["space"] = study.space.bounds, study.space

            def solve(X: Array) -> tuple[Array, Array | None]:
                runs = study.evaluate(X, derivatives=derivatives)
                stands = np.isin(runs.status, CERTIFIED)
                return np.where(stands[:, None], runs.Y, np.nan), runs.dY

        else:

            def solve(X: Array) -> tuple[Array, Array | None]:
                answer = study(X)
                Y, dY = answer if isinstance(answer, tuple) else (answer, None)
                Y = np.asarray(Y, dtype=np.float64).reshape(len(X), -1)
                if dY is None:
                    return Y, None
                return Y, np.asarray(dY, dtype=np.float64).reshape(*Y.shape, X.shape[1])

        if bounds is None:
            raise StudyError.at("learn: bounds", None, "a row (lower, upper) for each input")
        box = np.asarray(bounds, dtype=np.float64)
        if box.ndim != 2 or box.shape[1] != 2 or not np.all(box[:, 0] < box[:, 1]):
            raise StudyError.at("learn: bounds", box.tolist(), "a row (lower, upper) for each input")
        return cls(solve, box, names, derivatives=True)

    def data(self, unit: Array) -> tuple[TrainingData, NDArray[np.bool_]]:
        """Solve points of the unit cube; return what can be learnt from, and which points that are."""
        X = self.bounds[:, 0] + unit * (self.bounds[:, 1] - self.bounds[:, 0])
        Y, dY = self.solve(X)
        dY = dY if self.derivatives else None
        valid = np.asarray(np.isfinite(Y).all(axis=1))
        if dY is not None:
            valid &= np.isfinite(dY).all(axis=(1, 2))
        if not valid.any():
            raise StudyError(f"learn: none of {len(X)} runs can be learnt from")
        slopes = None if dY is None else dY[valid]
        return TrainingData(X=X[valid], Y=Y[valid], dY=slopes, bounds=self.bounds, **self.names), valid


@dataclass(frozen=True, eq=False)
class _Plan:
    target_error: float
    kind: str
    options: dict[str, Any]
    first: int
    batch: int
    max_runs: int
    seed: int


def _learn(runs: _Source, plan: _Plan) -> Learnt:
    """Add batches until the error is met."""
    from scipy.stats import qmc

    d = len(runs.bounds)
    filling = qmc.Sobol(d, seed=np.random.default_rng(plan.seed))
    rng = np.random.default_rng(plan.seed)
    solved = _sobol(filling, plan.first)
    data, valid = runs.data(solved)
    kind, rounds = plan.kind, []
    if kind == "auto":
        kind = choose(data, seed=plan.seed).surrogate.kind
    while True:
        validation, errors = _errors(data, kind, plan)
        rounds.append(Round(len(solved), data.n_points, validation.error))
        n_more = min(plan.batch, plan.max_runs - len(solved))
        if validation.error <= plan.target_error or n_more == 0:
            break
        n_filling = (n_more + 1) // 2
        new = _sobol(filling, n_filling)
        known = np.concatenate([solved, new])
        new = np.concatenate(
            [
                new,
                _worst(
                    known, solved[valid], errors, rng.uniform(size=(POOL * n_more, d)), n_more - n_filling
                ),
            ]
        )
        more, more_valid = runs.data(new)
        solved, valid = np.concatenate([solved, new]), np.concatenate([valid, more_valid])
        data = _joined(data, more)
    surrogate = fit(data, kind, validation=None, seed=plan.seed, **plan.options)
    return Learnt(replace(surrogate, validation=validation), data, tuple(rounds), plan.target_error)


def _errors(data: TrainingData, kind: str, plan: _Plan) -> tuple[Validation, Array]:
    """Cross-validate; return the errors of the runs too, relative to the spread of each output."""
    folds = fold_indices(data.n_points, N_FOLDS, np.random.default_rng(plan.seed))
    validation, answers = cross_validation(data, folds, kind, plan.seed, plan.options)
    error = np.empty(data.n_points)
    spread = np.maximum(data.Y.std(axis=0), np.finfo(float).tiny)
    for fold, answer in zip(folds, answers, strict=True):
        error[fold] = np.max(np.abs(answer.prediction - answer.Y) / spread, axis=1)
    return validation, error


def _sobol(filling: "QMCEngine", n: int) -> Array:
    """Return the next points of the sequence; it is continued, so it need not end at a power of two."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The balance properties of Sobol")
        return np.asarray(filling.random(n))


def _worst(solved: Array, learnt: Array, errors: Array, pool: Array, n: int) -> Array:
    """Choose points of the unit cube where the error is expected to be largest, one after the other.

    That is the mean error of the nearest runs that were learnt from, times the distance to the nearest run of
    all, the ones just chosen included, to the power of the number of inputs: the error in a gap, weighted by
    its volume.

    Parameters
    ----------
    solved
        All runs so far, shape (n_solved, n_inputs).
    learnt, errors
        Those that were learnt from, and their cross-validated errors.
    pool
        Candidates, shape (n_pool, n_inputs).
    n
        Number to choose.
    """
    from scipy.spatial import cKDTree

    _, near = cKDTree(learnt).query(pool, k=min(NEIGHBOURS, len(learnt)))
    expected = errors[near.reshape(len(pool), -1)].mean(axis=1) + np.finfo(float).tiny
    gap, _ = cKDTree(solved).query(pool)
    chosen = []
    for _ in range(n):
        best = int(np.argmax(expected * gap ** pool.shape[1]))
        chosen.append(best)
        gap = np.minimum(gap, np.linalg.norm(pool - pool[best], axis=1))
    return pool[chosen]


def _joined(data: TrainingData, more: TrainingData) -> TrainingData:
    """Return both, one after the other."""
    dY = None if data.dY is None or more.dY is None else np.concatenate([data.dY, more.dY])
    return replace(data, X=np.concatenate([data.X, more.X]), Y=np.concatenate([data.Y, more.Y]), dY=dY)


def _told(rounds: Sequence[Round], target: float) -> str:
    """Say how many runs it took, or that it was not met."""
    last = rounds[-1]
    if last.error <= target:
        return f"{target:g} with {last.n_runs} runs"
    return f"{target:g} not met with {last.n_runs} runs ({last.error:.1e})"
