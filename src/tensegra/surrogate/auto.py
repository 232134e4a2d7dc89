"""The kind of surrogate, chosen by a race: the smallest cross-validated error within a time budget.

All kinds are tried on one fold; only those that come near the best of them are tried on the others (Maron and
Moore, *Artificial Intelligence Review* 11, 193-225, 1997, race models in this way).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.errors import StudyError
from tensegra.surrogate.fit import answers_of_fold, data_of, fit, measured, split
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import Validation, fold_indices

if TYPE_CHECKING:
    from tensegra.surrogate.fit import Answers, Data, HeldOut, Runs

__all__ = ["CANDIDATES", "TIME_BUDGET", "Choice", "Trial", "choose"]

TIME_BUDGET = 60.0
N_FOLDS = 5
SMALLEST_FOLD = 2
GIVEN_UP = 3.0  # times the smallest error of the first fold: what is as far off does not win on the others
PROBE_SHARE, PROBE_RUNS = 4, 300  # a quarter of the runs, or so many, tell what all will take

# Kind, options, and the power of the number of runs that its time grows with at most; the quickest first.
CANDIDATES: tuple[tuple[str, Mapping[str, Any], float], ...] = (
    ("pce", {}, 1.5),
    ("gpr", {}, 1.4),
    ("nn", {}, 1.0),
)


@dataclass(frozen=True)
class Trial:
    """What came of one candidate.

    Parameters
    ----------
    kind
        The kind, with its own options.
    error
        Its cross-validated error, the largest of its outputs' `Validation.normalised_error`; that of the
        first fold if it was given up after it; None if it was not tried, for want of time.
    seconds
        Time that the trial took, or would have taken; None if there was no time to tell.
    given_up
        Whether it was tried on the first fold only.
    """

    kind: str
    error: float | None
    seconds: float | None
    given_up: bool = False


@dataclass(frozen=True, eq=False)
class Choice:
    """The surrogate of the best kind, and what all of them did.

    Parameters
    ----------
    surrogate
        The best, trained and validated as asked.
    trials
        The candidates, in the order of their trials.
    """

    surrogate: Surrogate
    trials: tuple[Trial, ...]

    def __repr__(self) -> str:
        told = []
        for trial in self.trials:
            error = "no time" if trial.error is None else format(trial.error, ".1e")
            took = "" if trial.seconds is None else f" ({trial.seconds:.1f} s)"
            took += ", given up after one fold" if trial.given_up else ""
            told.append(f"{trial.kind} {error}{took}")
        return f"Choice({self.surrogate.kind!r}: {', '.join(told)})"


def choose(
    data: "Runs",
    *,
    time_budget: float = TIME_BUDGET,
    outputs: Sequence[str] | None = None,
    validation: "float | str | HeldOut | None" = None,
    training_size: int | None = None,
    seed: int = 0,
) -> Choice:
    """Train the kind with the smallest cross-validated error.

    The kinds `pce`, `gpr` and `nn` are tried in this order, with their own options. One of which a trial on a
    quarter of the runs tells that it would take longer than is left of the budget is passed over, so that the
    choice depends on the machine; the first is always tried. One that is far from the best of them on the
    first fold is given up.

    Parameters
    ----------
    data, outputs, validation, training_size, seed
        As for `fit`; runs that are held out are kept from the trials too. Without such runs the surrogate's
        validation is that of its trial.
    time_budget
        Seconds for the trials.

    Returns
    -------
    Choice
        The surrogate and the errors of all kinds.

    Raises
    ------
    StudyError
        As `fit`; or if the budget is not positive.

    Examples
    --------
    >>> X = np.random.default_rng(1).uniform(size=(60, 2))
    >>> choose((X, X[:, 0] ** 3 + X[:, 1]), time_budget=1e-3).surrogate.kind
    'pce'
    """
    if not time_budget > 0:
        raise StudyError.at("auto: time_budget", time_budget, "a positive number of seconds")
    runs = data_of(data, "auto")
    if outputs is not None:
        runs = runs.select_outputs(outputs)
    training, held_out, n_asked = split(runs, "auto", training_size, validation, np.random.default_rng(seed))
    n_folds = n_asked or min(N_FOLDS, training.n_points // SMALLEST_FOLD)
    trials, validations = _trials(training, n_folds, time_budget, seed)
    best = min((t for t in trials if t.kind in validations), key=lambda t: t.error or 0.0)
    options = dict(next(options for kind, options, _ in CANDIDATES if kind == best.kind))
    surrogate = fit(training, best.kind, validation=held_out, seed=seed, **options)
    if held_out is None:
        surrogate = replace(surrogate, validation=validations[best.kind])
    return Choice(surrogate, tuple(trials))


def _trials(
    runs: "Data", n_folds: int, time_budget: float, seed: int
) -> tuple[list[Trial], dict[str, Validation]]:
    """Race the candidates as long as there is time; return also the validations of those that finished."""
    folds = fold_indices(runs.n_points, n_folds, np.random.default_rng(seed))
    n_train = runs.n_points - max(map(len, folds))
    end = time.perf_counter() + time_budget
    trials: dict[str, Trial] = {}
    answers: dict[str, list[Answers]] = {}
    for kind, options, growth in CANDIDATES:
        if answers:
            expected = _expected_for_all(runs, kind, options, growth, seed, n_folds, end)
            if expected is None or expected > end - time.perf_counter():
                trials[kind] = Trial(kind, None, expected)
                continue
        began = time.perf_counter()
        answers[kind] = [answers_of_fold(runs, folds[0], kind, seed, options)]
        error = measured(answers[kind], "one fold", n_train).error
        trials[kind] = Trial(kind, error, time.perf_counter() - began, given_up=True)
    validations: dict[str, Validation] = {}
    # The best of the first fold comes first, so that one at least is finished.
    order = sorted(answers, key=lambda kind: trials[kind].error or 0.0)
    for kind in order:
        first = trials[kind]
        out_of_time = time.perf_counter() > end
        if validations and (out_of_time or (first.error or 0.0) > GIVEN_UP * (trials[order[0]].error or 0.0)):
            continue
        began = time.perf_counter()
        own = next(options for name, options, _ in CANDIDATES if name == kind)
        answers[kind] += [answers_of_fold(runs, fold, kind, seed, own) for fold in folds[1:]]
        validations[kind] = measured(answers[kind], f"{n_folds}-fold", n_train)
        seconds = (first.seconds or 0.0) + time.perf_counter() - began
        trials[kind] = Trial(kind, validations[kind].error, seconds)
    return list(trials.values()), validations


def _expected_for_all(
    runs: "Data", kind: str, options: Mapping[str, Any], growth: float, seed: int, n_folds: int, end: float
) -> float | None:
    """Return the time that training for each fold, and once more for the best, may take; None without any."""
    if time.perf_counter() >= end:
        return None
    expected = (n_folds + 1) * _expected_seconds(runs, kind, options, growth, seed)
    if expected > end - time.perf_counter():  # perhaps what was compiled for it is there now
        expected = (n_folds + 1) * _expected_seconds(runs, kind, options, growth, seed)
    return expected


def _expected_seconds(runs: "Data", kind: str, options: Mapping[str, Any], growth: float, seed: int) -> float:
    """Return the time that training on all runs may take, told by some of them."""
    n_probe = max(runs.n_points // PROBE_SHARE, min(PROBE_RUNS, runs.n_points))
    rows = np.random.default_rng(seed).choice(runs.n_points, size=n_probe, replace=False)
    probe = fit(runs.rows(np.sort(rows)), kind, validation=None, seed=seed, **options)
    factor: float = (runs.n_points / n_probe) ** growth
    return probe.seconds * factor
