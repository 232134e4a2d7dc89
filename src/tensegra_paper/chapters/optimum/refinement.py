"""Searches on a surrogate that FEM confirms: where it does not, runs are added and the search is repeated."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import Model, Optimum, SurrogateModel
from tensegra.surrogate import RegimeData
from tensegra_paper.models import (
    LIFT_INPUTS,
    cable_model,
    lift_data,
    lift_runs,
    lift_surrogate,
    trained,
)
from tensegra_paper.setting import Setting

__all__ = ["Question", "Searches", "confirmed", "confirmed_searches", "joined"]

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

Array: TypeAlias = NDArray[np.float64]

ROUNDS = 4
N_ADDED, REACH = 256, 0.15
"""Runs added around an optimum that FEM does not confirm, and how far they reach, as a share of the box."""

SHARE = 0.3
"""Of the tolerance of a problem, that surrogate and FEM may differ by at an optimum."""

MARGIN = 0.02
"""What a constraint may miss by FEM, cm."""


@dataclass(frozen=True)
class Question:
    """A problem and the method that is asked, with the relative tolerance of the objective."""

    problem: str
    method: str
    tolerance: float


@dataclass(frozen=True)
class Searches:
    """What was found, and what it took.

    Attributes
    ----------
    found
        By question.
    surrogate
        The last one, of all runs.
    n_first, n_runs
        Number of runs learned from at first and at the end.
    repeated
        The questions that were asked again, in order, with the gaps that led to it.
    """

    found: dict[Question, Optimum]
    surrogate: "Surrogate"
    n_first: int
    n_runs: int
    repeated: tuple[tuple[Question, float], ...]


def confirmed_searches(
    setting: Setting, questions: Sequence[Question], search: Callable[[Model, Question], Optimum]
) -> Searches:
    """Search on the surrogate of `lift_surrogate`; with more runs again where FEM does not confirm it.

    Parameters
    ----------
    setting
        Gives folder, scale and seeds.
    questions
        What is asked.
    search
        Takes the surrogate's model and a question, and returns an optimum that was solved again by FEM.
    """
    space = cable_model(setting, LIFT_INPUTS).space
    data, surrogate = lift_data(setting, lift_runs(setting)), lift_surrogate(setting)
    n_first, found = data.n_points, dict[Question, Optimum]()
    repeated: list[tuple[Question, float]] = []
    pending = list(questions)
    for number in range(ROUNDS + 1):
        model = SurrogateModel(surrogate, "surrogate", space)
        found |= {question: search(model, question) for question in pending}
        pending = [question for question in pending if not confirmed(found[question], question.tolerance)]
        if not pending or number == ROUNDS:
            break
        repeated += [(question, abs(found[question].gap or np.inf)) for question in pending]
        for question in pending:
            data = joined(data, _around(setting, found[question], f"{number}-{question.method}"))
        setting.tell(f"{len(pending)} optima are not confirmed by FEM; learning from {data.n_points} runs")
        surrogate = trained(setting, f"lift-{number + 1}", data, "piecewise")
    return Searches(found, surrogate, n_first, data.n_points, tuple(repeated))


def confirmed(found: Optimum, tolerance: float) -> bool:
    """Tell whether FEM agrees with an optimum: on the objective, and that the constraints hold."""
    if found.gap is None or found.true_margins is None:
        return False
    near = abs(found.gap) <= SHARE * tolerance * abs(found.objective)
    return near and all(margin >= -MARGIN for margin in found.true_margins.values())


def _around(setting: Setting, found: Optimum, name: str) -> RegimeData:
    """Solve Sobol points of a box around an optimum."""
    from scipy.stats import qmc

    low, high = found.bounds.T
    reach = REACH * (high - low)
    lower, upper = np.maximum(found.x - reach, low), np.minimum(found.x + reach, high)
    X = lower + (upper - lower) * qmc.Sobol(len(low), rng=setting.seed_of(f"around {name}")).random(N_ADDED)
    inputs = dict(zip(LIFT_INPUTS, X.T, strict=True))
    return lift_data(setting, setting.runs(f"lift-around-{name}", setting.without_gravity, inputs))


def joined(one: RegimeData, other: RegimeData) -> RegimeData:
    """Return the runs of both, with names and bounds of the first.

    Examples
    --------
    >>> one = RegimeData.of([[0.0], [1.0]], [1.0, np.nan], ["taut", "collapsed"])
    >>> joined(one, one)
    RegimeData(2 of 4 points stand: x1 → y1; 2 collapsed, 2 taut)
    """
    X, Y = np.concatenate([one.runs.X, other.runs.X]), np.concatenate([one.runs.Y, other.runs.Y])
    return RegimeData(
        runs=replace(one.runs, X=X, Y=Y),
        regimes=np.concatenate([one.regimes, other.regimes]),
        fallen_X=np.concatenate([one.fallen_X, other.fallen_X]),
        fallen=np.concatenate([one.fallen, other.fallen]),
    )
