"""The kind of surrogate, chosen by trials: the smallest cross-validated error within a time budget."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.errors import StudyError
from tensegra.surrogate.fit import cross_validation, data_of, fit, split
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import Validation, fold_indices

if TYPE_CHECKING:
    from tensegra.surrogate.fit import Data, HeldOut, Runs

__all__ = ["CANDIDATES", "TIME_BUDGET", "Choice", "Trial", "choose"]

TIME_BUDGET = 60.0
N_FOLDS = 5
SMALLEST_FOLD = 2
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
        Its cross-validated error, the largest of its outputs' `Validation.normalised_error`; None if it was
        not tried, for want of time.
    seconds
        Time that the trial took, or would have taken; None if there was no time to tell.
    """

    kind: str
    error: float | None
    seconds: float | None


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
    choice depends on the machine; the first is always tried.

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
    best = min((t for t in trials if t.error is not None), key=lambda t: t.error or 0.0)
    options = dict(next(options for kind, options, _ in CANDIDATES if kind == best.kind))
    surrogate = fit(training, best.kind, validation=held_out, seed=seed, **options)
    if held_out is None:
        surrogate = replace(surrogate, validation=validations[best.kind])
    return Choice(surrogate, tuple(trials))


def _trials(
    runs: "Data", n_folds: int, time_budget: float, seed: int
) -> tuple[list[Trial], dict[str, Validation]]:
    """Cross-validate the candidates as long as there is time."""
    folds = fold_indices(runs.n_points, n_folds, np.random.default_rng(seed))
    trials: list[Trial] = []
    validations: dict[str, Validation] = {}
    end = time.perf_counter() + time_budget
    for kind, options, growth in CANDIDATES:
        left = end - time.perf_counter()
        if trials and left <= 0:
            trials.append(Trial(kind, None, None))
            continue
        if trials:
            # Trained once for each fold, and once more if it is the best.
            expected = (n_folds + 1) * _expected_seconds(runs, kind, options, growth, seed)
            if expected > left:  # perhaps what was compiled for it is there now
                expected = (n_folds + 1) * _expected_seconds(runs, kind, options, growth, seed)
            if expected > end - time.perf_counter():
                trials.append(Trial(kind, None, expected))
                continue
        began = time.perf_counter()
        validations[kind], _ = cross_validation(runs, folds, kind, seed, options)
        trials.append(Trial(kind, validations[kind].error, time.perf_counter() - began))
    return trials, validations


def _expected_seconds(runs: "Data", kind: str, options: Mapping[str, Any], growth: float, seed: int) -> float:
    """Return the time that training on all runs may take, told by some of them."""
    n_probe = max(runs.n_points // PROBE_SHARE, min(PROBE_RUNS, runs.n_points))
    rows = np.random.default_rng(seed).choice(runs.n_points, size=n_probe, replace=False)
    probe = fit(runs.rows(np.sort(rows)), kind, validation=None, seed=seed, **options)
    factor: float = (runs.n_points / n_probe) ** growth
    return probe.seconds * factor
