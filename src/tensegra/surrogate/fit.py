"""`fit`: from runs to a surrogate."""

import inspect
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.surrogate.kinds import kind_of
from tensegra.surrogate.surrogate import Problem, Surrogate
from tensegra.surrogate.validation import Validation, fold_indices, measure

__all__ = ["check_options", "fit"]

Array: TypeAlias = NDArray[np.float64]

# Below, the matrices are so small that the threads of the linear algebra wait for each other longer than they
# work: ten times longer on a machine that others use too.
MANY_RUNS = 4_000


class HasTrainingData(Protocol):
    """What `fit` needs of a campaign."""

    def training_data(self) -> TrainingData:
        """Return the runs to learn from."""
        ...


Runs: TypeAlias = (
    TrainingData
    | HasTrainingData
    | tuple[ArrayLike, ArrayLike]
    | tuple[ArrayLike, ArrayLike, ArrayLike | None]
)
HeldOut: TypeAlias = TrainingData | HasTrainingData | tuple[ArrayLike, ArrayLike]


def fit(
    data: Runs,
    kind: str = "gpr",
    *,
    outputs: Sequence[str] | None = None,
    training_size: int | None = None,
    validation: float | str | HeldOut | None = 0.2,
    seed: int = 0,
    **options: Any,  # noqa: ANN401 - of the kind, whose `train` types them
) -> Surrogate:
    """Train a surrogate on runs, and measure it on runs that it has not seen.

    Parameters
    ----------
    data
        A campaign, `TrainingData`, or arrays ``(X, Y)`` or ``(X, Y, dY)``.
    kind
        ``"gpr"`` (Gaussian process: the most accurate up to some thousand runs, and it knows its own error),
        ``"nn"`` (neural network: fast to evaluate, takes any number of runs) or ``"pce"`` (polynomial chaos:
        trained in a moment, with moments and Sobol indices in closed form).
    outputs
        The outputs to learn, by name; all where left out.
    training_size
        Number of runs to train on, drawn at random from those not held out; all of them where left out.
    validation
        Which runs to measure the error on: a fraction or a number of runs to hold out at random, ``"5-fold"``
        (the error by cross-validation, the surrogate itself trained on all runs), runs of their own (as
        `TrainingData`, a campaign or ``(X, Y)``), or None.
    seed
        Seed of all that is random.
    **options
        Options of the kind: see `tensegra.surrogate.gpr.train`, `tensegra.surrogate.network.train` and
        `tensegra.surrogate.chaos.train`.

    Returns
    -------
    Surrogate
        The trained surrogate, its `validation` filled.

    Raises
    ------
    StudyError
        If the kind, an option or an output does not exist, or the runs are too few.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.random.default_rng(1).uniform(size=(60, 2))
    >>> w = np.exp(X[:, 0]) + 0.1 * X[:, 1]
    >>> surrogate = fit((X, w), "pce")
    >>> surrogate.validation.relative_error[0] < 1e-6
    True
    >>> surrogate.predict([[0.5, 0.5]]).round(4)
    array([[1.6987]])
    """
    check_options(kind, options)
    runs = _runs(data)
    if outputs is not None:
        runs = runs.select_outputs(outputs)
    rng = np.random.default_rng(seed)
    training, held_out, n_folds = _split(runs, training_size, validation, rng)
    folds = fold_indices(training.n_points, n_folds, rng) if n_folds else []

    surrogate = _train(training, kind, seed, options)
    if folds:
        return replace(surrogate, validation=_cross_validation(training, folds, kind, seed, options))
    if held_out is None:
        return surrogate
    prediction, std = _answers(surrogate, held_out.X)
    measured = measure(
        held_out.Y,
        prediction,
        std,
        method=f"held out {held_out.n_points}",
        n_train=training.n_points,
        output_names=runs.output_names,
    )
    return replace(surrogate, validation=measured)


def _train(runs: TrainingData, kind: str, seed: int, options: Mapping[str, Any]) -> Surrogate:
    """Train on all of the runs."""
    import scipy.linalg  # noqa: F401 - its library has to be there for its threads to be limited
    from threadpoolctl import threadpool_limits

    start = time.perf_counter()
    problem = Problem.of(runs)
    with threadpool_limits(1 if runs.n_points < MANY_RUNS else None, user_api="blas"):
        model = kind_of(kind).train(problem, np.random.default_rng(seed), **options)
    return Surrogate(
        kind=kind,
        input_names=runs.input_names,
        output_names=runs.output_names,
        input_units=runs.input_units,
        output_units=runs.output_units,
        bounds=runs.box,
        scaling=problem.scaling,
        model=model,
        n_train=runs.n_points,
        seconds=time.perf_counter() - start,
        seed=seed,
        options=dict(options),
        study_fingerprint=runs.study_fingerprint,
    )


def _answers(surrogate: Surrogate, X: Array) -> tuple[Array, Array | None]:
    """Return the predictions and, where the surrogate has them, their standard deviations."""
    if surrogate.has_std:
        return surrogate.predict(X, return_std=True)
    return surrogate.predict(X), None


def _cross_validation(
    runs: TrainingData, folds: Sequence[NDArray[np.intp]], kind: str, seed: int, options: Mapping[str, Any]
) -> Validation:
    """Measure the error of each fold's runs by a surrogate that was trained on the other folds."""
    prediction = np.empty_like(runs.Y)
    std: Array | None = np.empty_like(runs.Y)
    for fold in folds:
        others = np.setdiff1d(np.arange(runs.n_points), fold)
        prediction[fold], fold_std = _answers(_train(runs.rows(others), kind, seed, options), runs.X[fold])
        if std is not None and fold_std is not None:
            std[fold] = fold_std
        else:
            std = None
    return measure(
        runs.Y,
        prediction,
        std,
        method=f"{len(folds)}-fold",
        n_train=runs.n_points - max(map(len, folds)),
        output_names=runs.output_names,
    )


def _runs(data: Runs | HeldOut) -> TrainingData:
    """Return the training data of whatever the user brought."""
    if isinstance(data, TrainingData):
        return data
    if isinstance(data, tuple):
        if len(data) not in (2, 3):
            raise StudyError.at("runs", f"{len(data)} arrays", "(X, Y) or (X, Y, dY)")
        X, Y, dY = (*data, None)[:3]
        return TrainingData(X=X, Y=Y, dY=dY)
    if hasattr(data, "training_data"):
        return data.training_data()
    raise StudyError.at("runs", type(data).__name__, "a campaign, TrainingData, (X, Y) or (X, Y, dY)")


def check_options(kind: str, options: Mapping[str, Any]) -> None:
    """Refuse an option that the kind does not have, or a value that it cannot be.

    Raises
    ------
    StudyError
        With the option, what was found and what was expected.
    """
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    known = {
        name: parameter.annotation
        for name, parameter in inspect.signature(kind_of(kind).train).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    for name, value in options.items():
        if name not in known:
            raise StudyError.at(f"options of {kind}", name, f"one of {', '.join(known)}", candidates=known)
        plain = value.item() if isinstance(value, np.generic) else value
        try:
            TypeAdapter(known[name], config=ConfigDict(strict=True)).validate_python(plain)
        except ValidationError:
            expected = inspect.formatannotation(known[name]).replace("collections.abc.", "")
            raise StudyError.at(f"options of {kind}: {name}", value, expected) from None


def _split(
    runs: TrainingData,
    training_size: int | None,
    validation: float | str | HeldOut | None,
    rng: np.random.Generator,
) -> tuple[TrainingData, TrainingData | None, int]:
    """Return the runs to train on, those held out (or None) and the number of folds (or 0)."""
    n_held, n_folds, held_out = 0, 0, None
    match validation:
        case None:
            pass
        case str():
            spelled = re.fullmatch(r"(\d+)-fold", validation)
            if spelled is None:
                raise StudyError.at("validation", validation, "a number, '5-fold', runs or None")
            n_folds = int(spelled[1])
        case bool():
            raise StudyError.at("validation", validation, "a number, '5-fold', runs or None")
        case int() | float():
            n_held = round(validation * runs.n_points) if 0 < validation < 1 else int(validation)
            if not 0 < n_held < runs.n_points or n_held != validation >= 1:
                raise StudyError.at(
                    "validation", validation, f"a fraction, or fewer than {runs.n_points} runs"
                )
        case _:
            held_out = _like(_runs(validation), runs)
    order = rng.permutation(runs.n_points)
    left = order[n_held:]
    size = len(left) if training_size is None else training_size
    if not 2 <= size <= len(left):
        raise StudyError.at("training size", size, f"2 to {len(left)}, the number of runs not held out")
    if n_held:
        held_out = runs.rows(np.sort(order[:n_held]))
    return runs.rows(np.sort(left[:size])), held_out, n_folds


def _like(held_out: TrainingData, runs: TrainingData) -> TrainingData:
    """Return the held-out runs with the outputs of `runs`: by name where they have these, else by place."""
    if set(runs.output_names) <= set(held_out.output_names):
        held_out = held_out.select_outputs(runs.output_names)
    found, expected = ((each.n_inputs, each.n_outputs) for each in (held_out, runs))
    if found != expected:
        raise StudyError.at("validation: numbers of inputs and outputs", found, f"{expected}")
    return held_out
