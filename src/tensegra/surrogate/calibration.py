"""Standard deviations that hold: scaled until 90 % of unseen runs lie within their 90 % intervals.

The runs are dealt into folds. Each fold is compared with what a model trained on the others says of it, and
the quantile of error over standard deviation scales the standard deviations of the model that is trained on
all runs: both grow alike when runs are missing, so that their ratio carries over. This asks for a training
that comes out alike each time; that of networks does not.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.problem import Problem
from tensegra.surrogate.validation import HALF_WIDTH_90, fold_indices

__all__ = ["FEWEST_RUNS", "Predictor", "cross_calibrated"]

Array: TypeAlias = NDArray[np.float64]
Predictor: TypeAlias = Callable[[Array], tuple[Array, Array]]
"""Returns outputs and standard deviations, not yet calibrated, at standardised points."""

N_FOLDS = 4
ENOUGH_RUNS = 1_000  # the 90 % of the interval is then 90 ± 1 (one sigma)
FEWEST_RUNS = 2 * N_FOLDS


def cross_calibrated(
    problem: Problem, train: Callable[[Problem, np.random.Generator], Predictor], rng: np.random.Generator
) -> Array:
    """Return the factor of each output's standard deviation, shape (n_outputs,).

    Parameters
    ----------
    problem
        All runs, `FEWEST_RUNS` at least.
    train
        Trains on some of them.
    rng
        Source of the folds and of what is random in the training.
    """
    n = len(problem.Z)
    folds = fold_indices(n, N_FOLDS, rng)
    if len(folds[0]) >= ENOUGH_RUNS:
        folds = [np.sort(rng.choice(folds[0], size=ENOUGH_RUNS, replace=False))]
    ratios = []
    for fold in folds:
        predictor = train(problem.rows(np.setdiff1d(np.arange(n), fold)), rng)
        outputs, std = predictor(problem.Z[fold])
        ratios.append(np.abs(outputs - problem.T[fold]) / std)
    return np.asarray(np.quantile(np.concatenate(ratios), 0.9, axis=0) / HALF_WIDTH_90)
