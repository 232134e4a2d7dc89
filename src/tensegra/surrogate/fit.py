"""`fit`: from runs to a surrogate."""

import inspect
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.surrogate.batches import field_runs
from tensegra.surrogate.jointlaw import joint_law
from tensegra.surrogate.kinds import kind_of
from tensegra.surrogate.problem import OutcomeModel, Problem
from tensegra.surrogate.regimes import RegimeData, campaign_runs
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.threads import one_thread
from tensegra.surrogate.validation import Validation, fold_indices, measure

if TYPE_CHECKING:
    from tensegra.mechanics import Batch

__all__ = ["check_options", "cross_validation", "data_of", "fit", "split"]

Array: TypeAlias = NDArray[np.float64]

# Below, the matrices are so small that the threads of the linear algebra wait for each other longer than they
# work: ten times longer on a machine that others use too.
MANY_RUNS = 4_000

OPTIONS_OF_AUTO = ("time_budget",)


class HasTrainingData(Protocol):
    """What `fit` needs of a campaign."""

    def training_data(self) -> TrainingData:
        """Return the runs to learn from."""
        ...


Data: TypeAlias = TrainingData | RegimeData
Arrays: TypeAlias = tuple[ArrayLike, ArrayLike] | tuple[ArrayLike, ArrayLike, ArrayLike | None]
Runs: TypeAlias = "Data | Batch | HasTrainingData | Arrays"
HeldOut: TypeAlias = "Data | Batch | HasTrainingData | tuple[ArrayLike, ArrayLike]"


def fit(
    data: Runs,
    kind: str = "gpr",
    *,
    outputs: Sequence[str] | None = None,
    training_size: int | None = None,
    validation: "float | str | HeldOut | None" = 0.2,
    seed: int = 0,
    time_budget: float | None = None,
    **options: Any,  # noqa: ANN401 - of the kind, whose `train` types them
) -> Surrogate:
    """Train a surrogate on runs, and measure it on runs that it has not seen.

    Parameters
    ----------
    data
        A campaign, `TrainingData`, or arrays ``(X, Y)`` or ``(X, Y, dY)``; `RegimeData` where it is known
        what became of the runs that do not stand; or a `Batch`, whose outputs are all coordinates and
        tensions.
    kind
        ``"gpr"`` (Gaussian process: the most accurate up to some thousand runs, and it knows its own error),
        ``"nn"`` (neural network: fast to evaluate, takes any number of runs), ``"pce"`` (polynomial chaos:
        trained in a moment, with moments and Sobol indices in closed form), ``"field"`` (hundreds of outputs
        that depend on each other), ``"piecewise"`` (a piece for each regime, and the probability of each), or
        ``"auto"``: the first three are tried (`tensegra.surrogate.auto.choose`).
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
    time_budget
        For ``"auto"``: seconds that the trials may take, a minute where left out.
    **options
        Options of the kind: see `tensegra.surrogate.gpr.train`, `tensegra.surrogate.network.train`,
        `tensegra.surrogate.chaos.train`, `tensegra.surrogate.field.train` and
        `tensegra.surrogate.piecewise.train`.

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
    if kind == "auto" or time_budget is not None:
        return _choose(data, kind, outputs, training_size, validation, seed, time_budget, options)
    check_options(kind, options)
    runs = data_of(data, kind)
    if outputs is not None:
        runs = runs.select_outputs(outputs)
    rng = np.random.default_rng(seed)
    training, held_out, n_folds = split(runs, kind, training_size, validation, rng)
    folds = fold_indices(training.n_points, n_folds, rng) if n_folds else []

    surrogate = _train(training, kind, seed, options)
    if folds:
        crossed, _ = cross_validation(training, folds, kind, seed, options)
        return replace(surrogate, validation=crossed)
    if held_out is None:
        return surrogate
    answers = [Answers.of(surrogate, held_out)]
    return replace(
        surrogate, validation=measured(answers, f"held out {held_out.n_points}", training.n_points)
    )


def _choose(
    data: Runs,
    kind: str,
    outputs: Sequence[str] | None,
    training_size: int | None,
    validation: "float | str | HeldOut | None",
    seed: int,
    time_budget: float | None,
    options: Mapping[str, Any],
) -> Surrogate:
    """Let trials choose the kind."""
    from tensegra.surrogate.auto import TIME_BUDGET, choose

    if kind != "auto":
        raise StudyError.at("time_budget", time_budget, "none, unless the kind is 'auto'")
    check_options(kind, options)
    budget = TIME_BUDGET if time_budget is None else time_budget
    return choose(
        data,
        time_budget=budget,
        outputs=outputs,
        validation=validation,
        training_size=training_size,
        seed=seed,
    ).surrogate


def _train(data: Data, kind: str, seed: int, options: Mapping[str, Any]) -> Surrogate:
    """Train on all of the runs."""
    start = time.perf_counter()
    runs = data.runs if isinstance(data, RegimeData) else data
    problem = Problem.of(data)
    with one_thread(wanted=runs.n_points < MANY_RUNS):
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
        n_train=data.n_points,
        seconds=time.perf_counter() - start,
        seed=seed,
        options=dict(options),
        study_fingerprint=runs.study_fingerprint,
        space=joint_law(runs),
    )


@dataclass(frozen=True, eq=False)
class Answers:
    """What a surrogate says of runs that it has not seen: arrays of those that stand, and of all regimes."""

    output_names: tuple[str, ...]
    Y: Array
    prediction: Array
    std: Array | None
    right: NDArray[np.bool_] | None

    @classmethod
    def of(cls, surrogate: Surrogate, data: Data) -> "Answers":
        """Ask a surrogate; one that knows of regimes on the condition that the runs stand, as they do."""
        runs = data.runs if isinstance(data, RegimeData) else data
        model, right, std = surrogate.model, None, None
        if isinstance(model, OutcomeModel):
            Z, scaling = surrogate.scaling.inputs(runs.X), surrogate.scaling
            prediction = scaling.output_shift + scaling.output_scale * model.predict_standing(Z)
            if surrogate.has_std:
                std = scaling.output_scale * model.std_standing(Z)
            if isinstance(data, RegimeData):
                names = np.array(model.regime_names)
                right = names[model.chosen(scaling.inputs(data.X))] == data.labels
        elif surrogate.has_std:
            prediction, std = surrogate.predict(runs.X, return_std=True)
        else:
            prediction = surrogate.predict(runs.X)
        return cls(runs.output_names, runs.Y, prediction, std, right)


def cross_validation(
    runs: Data, folds: Sequence[NDArray[np.intp]], kind: str, seed: int, options: Mapping[str, Any]
) -> tuple[Validation, list[Answers]]:
    """Measure the error of each fold's runs by a surrogate that was trained on the other folds.

    Returns
    -------
    tuple
        The measures, and what each fold was told.
    """
    answers = [answers_of_fold(runs, fold, kind, seed, options) for fold in folds]
    return measured(answers, f"{len(folds)}-fold", runs.n_points - max(map(len, folds))), answers


def answers_of_fold(
    runs: Data, fold: NDArray[np.intp], kind: str, seed: int, options: Mapping[str, Any]
) -> Answers:
    """Return what a surrogate that was trained on the other runs says of those of a fold."""
    others = np.setdiff1d(np.arange(runs.n_points), fold)
    return Answers.of(_train(runs.rows(others), kind, seed, options), runs.rows(fold))


def measured(answers: Sequence[Answers], method: str, n_train: int) -> Validation:
    """Measure what surrogates said, all their answers together."""
    stds = [each.std for each in answers if each.std is not None]
    found = measure(
        np.concatenate([each.Y for each in answers]),
        np.concatenate([each.prediction for each in answers]),
        np.concatenate(stds) if len(stds) == len(answers) else None,
        method=method,
        n_train=n_train,
        output_names=answers[0].output_names,
    )
    right = [each.right for each in answers if each.right is not None]
    return replace(found, outcome_right=float(np.mean(np.concatenate(right)))) if right else found


def data_of(data: "Runs | HeldOut", kind: str) -> Data:
    """Return the training data of what the user brought, the regimes only for a kind that asks for them."""
    if isinstance(data, RegimeData):
        return data if kind == "piecewise" else data.runs
    if isinstance(data, TrainingData):
        return data
    if isinstance(data, tuple):
        if len(data) not in (2, 3):
            raise StudyError.at("runs", f"{len(data)} arrays", "(X, Y) or (X, Y, dY)")
        X, Y, dY = (*data, None)[:3]
        return TrainingData(X=X, Y=Y, dY=dY)
    from tensegra.mechanics import Batch
    from tensegra.study import Campaign

    if isinstance(data, Batch):
        return data_of(field_runs(data), kind)
    if isinstance(data, Campaign) and kind == "piecewise":
        return campaign_runs(data)
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

    asked = fit if kind == "auto" else kind_of(kind).train
    known = {
        name: parameter.annotation
        for name, parameter in inspect.signature(asked).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY and (kind != "auto" or name in OPTIONS_OF_AUTO)
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


def split(
    runs: Data,
    kind: str,
    training_size: int | None,
    validation: "float | str | HeldOut | None",
    rng: np.random.Generator,
) -> tuple[Data, Data | None, int]:
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
            held_out = _like(data_of(validation, kind), runs)
    order = rng.permutation(runs.n_points)
    left = order[n_held:]
    size = len(left) if training_size is None else training_size
    if not 2 <= size <= len(left):
        raise StudyError.at("training size", size, f"2 to {len(left)}, the number of runs not held out")
    if n_held:
        held_out = runs.rows(np.sort(order[:n_held]))
    return runs.rows(np.sort(left[:size])), held_out, n_folds


def _like(held_out: Data, runs: Data) -> Data:
    """Return the held-out runs with the outputs of `runs`: by name where they have these, else by place."""
    one, other = (each.runs if isinstance(each, RegimeData) else each for each in (held_out, runs))
    if set(other.output_names) <= set(one.output_names):
        held_out = held_out.select_outputs(other.output_names)
        one = one.select_outputs(other.output_names)
    found, expected = ((each.n_inputs, each.n_outputs) for each in (one, other))
    if found != expected:
        raise StudyError.at("validation: numbers of inputs and outputs", found, f"{expected}")
    return held_out
