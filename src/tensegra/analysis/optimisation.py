"""Optimisation of an expression over a model's outputs, by any of several methods.

The search runs on whatever model it is given, usually a surrogate; the optimum it finds is then solved again
by the true model, and the difference is part of the result. A best value alone hides two things that a
designer must know, so the result tells them too: how many starts agree, and whether they agree on *where*.
The source paper's Eq. 12, |w|/(|v| + |w|), is 1 on a whole surface v = 0, so its starts agree on the value
and nothing else.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.discrete import SAME_VALUE
from tensegra.analysis.manystarts import Ends, many_starts
from tensegra.analysis.model import Model, as_model
from tensegra.analysis.optimum import Agreement, Optimum, Trace
from tensegra.analysis.problem import FEASIBLE, Assessment, Problem, Recorder, Scales, state_problem
from tensegra.analysis.truth import TrueModel
from tensegra.analysis.uniqueness import equal_places
from tensegra.errors import StudyError

Array = NDArray[np.float64]

METHODS = ("slsqp", "bfgs", "bayesian", "direct")

# Two points have the same objective within this share of its spread, and the same place within this share of
# the box (a smooth optimum is a thousandth of the box wide where its objective falls by a millionth).
SAME_OBJECTIVE, SAME_PLACE = 1e-6, 1e-2


def optimise(
    model: object,
    objective: str,
    *,
    search: Sequence[str] | None = None,
    inputs: Mapping[str, object] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    constraints: Sequence[str] = (),
    maximise: bool = True,
    method: str = "slsqp",
    starts: int = 200,
    evaluations: int = 40,
    acquisition: str = "ucb",
    xi: float | None = None,
    seed: int = 0,
    true_model: object | None = None,
    file: str | PathLike[str] | None = None,
    name: str = "optimisation",
    progress: Callable[[int, int], None] | None = None,
) -> Optimum:
    """Find the inputs in a box that make an expression largest or smallest.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    objective
        An expression over outputs and variables, such as ``"abs(w) / (abs(v) + abs(w))"``.
    search
        Names of the inputs to choose; by default the actuators of the study and what has bounds (all inputs
        of a model that has no actuators), less what `inputs` names. One that is discrete stays on its values.
    inputs
        By input that is not searched: the number to hold it at, or a law, at whose mean it is held. The rest
        are held at the means of their laws.
    bounds
        By searched input, [lower, upper]; the model's own box for the rest.
    constraints
        Comparisons such as ``"abs(v) <= 1"``.
    maximise
        Whether the largest value is wanted.
    method
        ``slsqp`` and ``bfgs`` (gradients, many starts), ``bayesian`` (a Gaussian process, few evaluations),
        or ``direct``: SLSQP on the true model itself, with its exact derivatives, whatever `model` is.
    starts
        Starts of the gradient methods, a Latin hypercube in the box. Of ``direct``, the best dozen of them
        are followed.
    evaluations, acquisition, xi
        Of ``bayesian``: at most so many evaluations; ``ucb``, ``ei`` or ``mpi``; and its exploration
        parameter ξ, unless given 0.01 for UCB (the source paper's) and MPI, 0 for EI.
    seed
        Of all random numbers.
    true_model
        Solves the optimum again; a study or a `Model`. Unless given, the optimum of a surrogate stays
        unchecked.
    file
        Of ``bayesian``: a JSON file that keeps the search after every evaluation; a search that it holds
        already is gone on with.
    name
        Of the result.
    progress
        Called with (evaluations done, evaluations in all or 0 where nobody knows).

    Raises
    ------
    StudyError
        If the problem cannot be stated so, or the model fails at every start.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegra.analysis import FunctionModel, optimise
    >>> box = np.array([[0.0, 1.0], [0.0, 1.0]])
    >>> bowl = FunctionModel(lambda X: ((X - 0.3) ** 2).sum(axis=1), ("a", "b"), ("y",), box)
    >>> best = optimise(bowl, "y", constraints=["a >= b + 0.2"], maximise=False, starts=5)
    >>> best.x.round(4), round(best.objective, 4)
    (array([0.4, 0.2]), 0.02)
    """
    if method not in METHODS:
        raise StudyError.at("optimisation.method", method, "one of " + ", ".join(METHODS), candidates=METHODS)
    for place, count in (("starts", starts), ("evaluations", evaluations)):
        if count < 1:
            raise StudyError.at(f"optimisation.{place}", count, "at least 1")
    if file is not None and method != "bayesian":
        raise StudyError.at("optimisation.file", str(file), "the method 'bayesian', which alone keeps one")
    asked = _asked(as_model(model), method, true_model)
    problem = state_problem(
        asked,
        objective,
        bounds=bounds,
        constraints=constraints,
        maximise=maximise,
        search=search,
        inputs=inputs,
    )
    if isinstance(problem.model, TrueModel) and method != "bayesian":
        problem = replace(problem, model=replace(problem.model, ahead=True, of=problem.used_outputs))
    recorder = Recorder(problem, progress, evaluations if method == "bayesian" else 0)
    began = time.perf_counter()
    if method == "bayesian":
        from tensegra.analysis import bayesian

        ends = bayesian.search(
            problem,
            recorder,
            evaluations=evaluations,
            acquisition=acquisition,
            xi=xi,
            seed=seed,
            file=None if file is None else Path(file),
        )
    else:
        ends = many_starts(problem, recorder, method, starts, seed)
    seconds = time.perf_counter() - began
    facts = {
        "name": name,
        "method": method,
        "seed": seed,
        "constraints": tuple(constraints),
        "seconds": seconds,
    }
    optimum = _optimum(problem, recorder, ends, facts)
    if true_model is None:
        return optimum
    return _solve_again(optimum, problem, ends.scales, as_model(true_model))


def _asked(model: Model, method: str, true_model: object | None) -> Model:
    """Return the model that a method searches on."""
    if method == "bayesian":
        return model
    if method == "direct" and not isinstance(model, TrueModel):
        if true_model is None:
            raise StudyError.at("optimisation.true_model", None, "the true model, which 'direct' searches on")
        model = as_model(true_model)
    return model


def _optimum(problem: Problem, recorder: Recorder, ends: Ends, facts: Mapping[str, Any]) -> Optimum:
    visited, start = recorder.all()
    feasible = np.isfinite(visited.objective) & (problem.violation(visited.margins, ends.scales) <= FEASIBLE)
    feasible &= problem.levels.hold(problem.to_unit(visited.X))  # a relaxed point is no answer
    sign = 1.0 if problem.maximise else -1.0
    merit = np.where(feasible, sign * visited.objective, -np.inf)
    index = int(np.argmax(merit)) if feasible.any() else _least_violation(problem, visited, ends.scales)
    best = np.maximum.accumulate(merit)
    trace = Trace(
        evaluation=np.arange(1, len(merit) + 1),
        start=start,
        x=visited.X,
        outputs=visited.outputs,
        objective=visited.objective,
        feasible=feasible,
        best=np.where(np.isfinite(best), sign * best, np.nan),
    )
    agreement = _agreement(problem, visited, merit, start, ends)
    success, reason = _verdict(agreement, ends)
    model, x = problem.model, visited.X[index]
    std = model.uncertainty(x[None])
    return Optimum(
        **facts,
        model=model.name,
        formula=str(problem.objective),
        maximise=problem.maximise,
        input_names=model.input_names,
        bounds=problem.bounds,
        search=problem.search,
        held=problem.held,
        x=x,
        inputs=_named(model.input_names, x),
        objective=float(visited.objective[index]),
        outputs=_named(model.output_names, visited.outputs[index]),
        outputs_std=None if std is None else _named(model.output_names, std[0]),
        margins=_least_by_text(problem, visited.margins[index]),
        success=success,
        reason=reason,
        agreement=agreement,
        trace=trace,
        n_evaluations=len(merit),
        units=dict(model.units),
    )


def _least_violation(problem: Problem, visited: Assessment, scales: Scales) -> int:
    violation = problem.violation(visited.margins, scales)
    return int(np.argmin(np.where(np.isfinite(visited.objective), violation, np.inf)))


def _agreement(
    problem: Problem, visited: Assessment, merit: Array, start: NDArray[np.intp], ends: Ends
) -> Agreement:
    """Compare what the starts reached, and where the best objective was met."""
    n_starts, n_converged = ends.converged.size, int(ends.converged.sum())
    if not np.isfinite(merit).any():
        nowhere = np.full(problem.n_inputs, np.nan)
        return Agreement(n_starts, n_converged, 0, n_starts, nowhere, nowhere, unique=False)
    same = merit >= merit.max() - SAME_OBJECTIVE * ends.scales.objective
    where = visited.X[same]
    index = int(np.argmax(merit))
    tolerance = SAME_OBJECTIVE * ends.scales.objective
    also = equal_places(problem, visited.X[index], float(visited.objective[index]), ends.scales, tolerance)
    where = np.concatenate([where, also])
    low, high = where.min(axis=0), where.max(axis=0)
    width = problem.bounds[:, 1] - problem.bounds[:, 0]
    unique = bool((high - low <= SAME_PLACE * width).all())
    return Agreement(
        n_starts,
        n_converged,
        np.unique(start[same]).size,
        _rivals(problem, visited.X[index], ends),
        low,
        high,
        unique,
    )


def _rivals(problem: Problem, x: Array, ends: Ends) -> int:
    """Return how many starts searched with the discrete values of `x`."""
    mask = problem.levels.mask
    if ends.z is None or not mask.any():
        return ends.converged.size
    return int((np.abs(ends.z - problem.to_unit(x))[:, mask] <= SAME_VALUE).all(axis=1).sum())


def _verdict(agreement: Agreement, ends: Ends) -> tuple[bool, str]:
    if agreement.n_best == 0:
        missed = "no point that satisfies all constraints was found; the one that misses by least is given"
        return False, missed
    told = ends.reasons[0]
    if agreement.n_starts > 1:
        told = (
            f"{agreement.n_best} of {agreement.n_starts} starts reached this objective, "
            f"{agreement.n_converged} reported convergence"
        )
        told += _few(agreement, ends)
    if not agreement.unique:
        told += "; it is met in different places, so the optimum is not unique"
    return agreement.n_converged > 0 or agreement.n_best > 1, told


def _few(agreement: Agreement, ends: Ends) -> str:
    """Return a warning where fewer than half of the starts converge, or agree."""
    told = ""
    if 2 * agreement.n_converged < agreement.n_starts:
        told += f"; fewer than half converged, most of the others say: {ends.commonest_failure()}"
    if 2 * agreement.n_best < agreement.n_rivals:
        why = "the others ended in worse local optima" if not told else "the others stopped short of it"
        told += f"; fewer than half agree, {why}: more starts may find a better one"
    return told


def _solve_again(optimum: Optimum, problem: Problem, scales: Scales, truth: Model) -> Optimum:
    """Solve the optimum by the true model and add the difference."""
    if truth.input_names != problem.model.input_names:
        raise StudyError.at(
            "optimisation.true_model",
            list(truth.input_names),
            f"the inputs {list(problem.model.input_names)}",
        )
    own = state_problem(
        truth,
        optimum.formula,
        bounds=dict(zip(truth.input_names, problem.bounds.tolist(), strict=True)),
        constraints=optimum.constraints,
        maximise=optimum.maximise,
    )
    found = truth.evaluate(optimum.x[None])
    again = own.assess(optimum.x[None], found)
    facts = vars(optimum) | {"true_status": str(found.status[0])}
    if np.isfinite(again.objective[0]):
        objective = float(again.objective[0])
        facts |= {
            "true_outputs": _named(truth.output_names, again.outputs[0]),
            "true_objective": objective,
            "true_margins": _least_by_text(own, again.margins[0]),
            "true_feasible": bool(own.violation(again.margins, scales)[0] <= FEASIBLE),
            "gap": objective - optimum.objective,
        }
    return Optimum(**facts)


def _least_by_text(problem: Problem, margins: Array) -> dict[str, float]:
    """Return the margin of each constraint as written: the least of the conditions that it was split into."""
    least: dict[str, float] = {}
    for constraint, margin in zip(problem.constraints, margins.tolist(), strict=True):
        value = -abs(margin) if constraint.equality else margin
        least[constraint.text] = min(value, least.get(constraint.text, np.inf))
    return least


def _named(names: Sequence[str], values: Array) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))
