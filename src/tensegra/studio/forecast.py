"""What a campaign knows of a set-point: predictions beside the truth, the spread of outputs, an optimum."""

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import optimise
from tensegra.errors import StudyError
from tensegra.mechanics import Equilibrium
from tensegra.mechanics.status import axis_index, index_of, names_in
from tensegra.studio.source import Source
from tensegra.study import Study
from tensegra.surrogate import OutsideBoxWarning

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["best", "predictions", "spread", "true_outputs"]

FloatArray = NDArray[np.float64]

WITHIN = 1.645
"""Standard deviations either way that hold 90 % of a normal law."""

SAMPLES, BINS = 2000, 40
"""Of the spread of an output: some two per cent of error in a probability, and a bar a few pixels wide."""

STARTS = 24
"""Of a search from the page: it has to end while one waits."""


class _OneRun:
    """An equilibrium as the one run of a batch, as far as an output looks at it."""

    def __init__(self, found: Equilibrium, reference: FloatArray) -> None:
        self.node_ids, self.member_ids = found.structure.node_ids, found.structure.member_ids
        self.nodes, self.tensions = found.nodes[None], found.tensions[None]
        self.slack, self.lowest_eigenvalue = found.slack[None], np.array([found.lowest_eigenvalue])
        self._reference, self._reactions = reference, found.reactions

    def coordinate(self, axis: str, nodes: str | Sequence[str]) -> FloatArray:
        return np.array([self.nodes[0][self._rows(nodes), axis_index(axis)].mean()])

    def displacement(self, axis: str, nodes: str | Sequence[str]) -> FloatArray:
        moved = self.nodes[0] - self._reference
        return np.array([moved[self._rows(nodes), axis_index(axis)].mean()])

    def reaction(self, axis: str, nodes: str | Sequence[str]) -> FloatArray:
        return np.array([self._reactions[self._rows(nodes), axis_index(axis)].sum()])

    def _rows(self, nodes: str | Sequence[str]) -> list[int]:
        return [index_of(self.node_ids, node, "node") for node in names_in(nodes)]


def true_outputs(study: Study, found: Equilibrium, reference: FloatArray) -> dict[str, float]:
    """Return the outputs of a study where a structure stands.

    Parameters
    ----------
    study
        The study.
    found
        The equilibrium.
    reference
        From where displacements are measured, ``(n_nodes, 3)``.
    """
    run: Any = _OneRun(found, reference)
    return {output.name: float(output.of(run)[0]) for output in study.outputs}


def predictions(source: Source, values: Mapping[str, float]) -> dict[str, Any]:
    """Return what each surrogate says of a set-point.

    Returns
    -------
    dict
        By surrogate: ``outputs`` (name → [value, low, high], an interval of 90 % or nulls), ``outside``
        (whether the point lies outside the box of its training), ``regimes`` (name → probability).
    """
    return {name: _prediction(surrogate, values) for name, surrogate in source.surrogates.items()}


def _prediction(surrogate: "Surrogate", values: Mapping[str, float]) -> dict[str, Any]:
    X = np.array([[values[name] for name in surrogate.input_names]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideBoxWarning)
        if surrogate.has_std:
            Y, std = surrogate.predict(X, return_std=True)
        else:
            Y, std = surrogate.predict(X), np.full((1, len(surrogate.output_names)), np.nan)
        regimes = surrogate.outcome(X)[0] if surrogate.regime_names else np.zeros(0)
    low, high = Y[0] - WITHIN * std[0], Y[0] + WITHIN * std[0]
    rows = zip(surrogate.output_names, Y[0], low, high, strict=True)
    return {
        "outputs": {name: [_finite(v) for v in row] for name, *row in rows},
        "outside": not bool(surrogate.inside(X)[0]),
        "regimes": dict(zip(surrogate.regime_names, regimes.tolist(), strict=True)),
    }


def spread(
    source: Source, name: str, values: Mapping[str, float], free: Sequence[str], limits: Mapping[str, float]
) -> dict[str, Any]:
    """Return how the outputs scatter about a set-point where some variables follow their laws.

    Parameters
    ----------
    source
        What the server was started with.
    name
        The surrogate that is asked.
    values
        The set-point: the values of all variables that are held.
    free
        Variables that follow their laws in the study, drawn with the copula that joins all variables.
    limits
        By output, a limit whose probability of being exceeded is wanted.

    Returns
    -------
    dict
        By output: its histogram, mean, percentiles 5, 50 and 95, and share above the limit; ``slopes`` is
        how far it would change over each variable's range, were it as steep throughout as at the set-point.

    Raises
    ------
    StudyError
        For an unknown surrogate or variable.
    """
    surrogate, study = _surrogate(source, name), _study(source)
    names = study.input_names
    for variable in free:
        if variable not in names:
            raise StudyError.at("spread", variable, "a variable of the study", candidates=names)
    U = np.random.default_rng(study.seed).random((SAMPLES, len(names)))
    X = study.space.from_unit(U)
    for column, variable in enumerate(names):
        if variable not in free:
            X[:, column] = values[variable]
    X = X[:, [names.index(variable) for variable in surrogate.input_names]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideBoxWarning)
        Y = surrogate.predict(X)
        here = np.array([[values[variable] for variable in surrogate.input_names]])
        slopes = surrogate.gradient(here)[0] * np.diff(surrogate.bounds, axis=1).T
    return {
        output: (_histogram(Y[:, k], limits.get(output)) or {})
        | {"slopes": {v: _finite(slope) for v, slope in zip(surrogate.input_names, slopes[k], strict=True)}}
        for k, output in enumerate(surrogate.output_names)
    }


def _histogram(values: FloatArray, limit: float | None) -> dict[str, Any] | None:
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    counts, edges = np.histogram(values, bins=BINS)
    return {
        "counts": counts.tolist(),
        "low": float(edges[0]),
        "high": float(edges[-1]),
        "mean": float(values.mean()),
        "percentiles": np.percentile(values, (5, 50, 95)).tolist(),
        "exceedance": None if limit is None else float((values > limit).mean()),
    }


def best(
    source: Source,
    name: str,
    output: str,
    *,
    maximise: bool,
    search: Sequence[str],
    values: Mapping[str, float],
) -> dict[str, Any]:
    """Return where an output is largest or smallest, by a surrogate, solved again by the true model.

    Parameters
    ----------
    source
        What the server was started with.
    name
        The surrogate that is searched.
    output
        Which output; no formula is taken from a page.
    maximise
        Whether the largest is wanted.
    search
        Variables that may be chosen, in their boxes; the others are held.
    values
        The set-point.

    Raises
    ------
    StudyError
        For an unknown surrogate, output or variable.
    """
    surrogate, study = _surrogate(source, name), _study(source)
    if output not in surrogate.output_names:
        raise StudyError.at("optimise", output, "an output", candidates=surrogate.output_names)
    for variable in search:
        if variable not in study.input_names:
            raise StudyError.at("optimise", variable, "a variable", candidates=study.input_names)
    held = {variable: values[variable] for variable in study.input_names if variable not in search}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", OutsideBoxWarning)
        found = optimise(
            surrogate,
            output,
            search=list(search),
            inputs=held,
            maximise=maximise,
            starts=STARTS,
            seed=study.seed,
            true_model=study,
        )
    entry = {
        "optimisation": {
            "name": f"{'largest' if maximise else 'smallest'} {output}",
            "model": name,
            "objective": output,
            "maximise": maximise,
            "methods": ["slsqp"],
            "search": list(search),
            "inputs": held,
        }
    }
    from tensegra.structure.text import dump_yaml

    return {
        "inputs": {variable: float(value) for variable, value in found.inputs.items()},
        "objective": found.objective,
        "true_objective": found.true_objective,
        "true_status": found.true_status,
        "success": found.success,
        "reason": found.reason,
        "evaluations": found.n_evaluations,
        "seconds": found.seconds,
        "entry": dump_yaml([entry]),
    }


def _surrogate(source: Source, name: str) -> "Surrogate":
    if name not in source.surrogates:
        raise StudyError.at("surrogate", name, "one of the campaign's", candidates=source.surrogates)
    return source.surrogates[name]


def _study(source: Source) -> Study:
    if source.study is None:
        raise StudyError("this needs a campaign; the server was started with a structure")
    return source.study


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
