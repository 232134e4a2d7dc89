"""The file of a Bayesian search: what was asked and told, so that it can go on later.

A search on the true model, or on an experiment, may be stopped at any time. The file holds the points with
their outputs, the settings that the proposals follow from, and the problem, which it is checked against.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.analysis.bayesian import ACQUISITIONS, BayesianOptimiser
from tensegra.analysis.problem import Problem
from tensegra.analysis.results import plain
from tensegra.errors import StudyError
from tensegra.files import write_json

SCHEMA = "tensegra/search/1"


def save_search(optimiser: BayesianOptimiser, path: Path) -> None:
    """Write a search to a JSON file; it is there as a whole, or as it was.

    Raises
    ------
    StudyError
        If it cannot be written.
    """
    content = {
        "schema": SCHEMA,
        "problem": _problem(optimiser.problem),
        "settings": _settings(optimiser.acquisition, optimiser.xi, optimiser.seed),
        "n_initial": optimiser.n_initial,
        "x": optimiser.X.tolist(),
        "outputs": plain(optimiser.outputs),  # a failed run is null
        "thetas": plain(list(optimiser.thetas)),
    }
    write_json(path, content, StudyError)


def load_search(
    path: Path, problem: Problem, *, acquisition: str = "ucb", xi: float | None = None, seed: int = 0
) -> BayesianOptimiser:
    """Read a search that `save_search` wrote.

    Parameters
    ----------
    path
        The file.
    problem, acquisition, xi, seed
        What is searched now, and how; they must be those of the file.

    Raises
    ------
    StudyError
        If the file is no such search, or of another problem or other settings.
    """
    try:
        content: Any = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StudyError(f"{path}: cannot be read as a search ({error})") from None
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise StudyError.at(
            str(path), content.get("schema") if isinstance(content, dict) else content, repr(SCHEMA)
        )
    xi = ACQUISITIONS.get(acquisition) if xi is None else xi
    for part, wanted in (("problem", _problem(problem)), ("settings", _settings(acquisition, xi, seed))):
        for key, value in wanted.items():
            if content[part].get(key) != value:
                raise StudyError.at(f"{path}: {part}.{key}", content[part].get(key), f"{value!r}")
    optimiser = BayesianOptimiser(
        problem, n_initial=content["n_initial"], acquisition=acquisition, xi=xi, seed=seed
    )
    for x, outputs in zip(content["x"], content["outputs"], strict=True):
        told = [np.nan if value is None else value for value in outputs]
        optimiser.tell(np.array(x), np.array(told))
    optimiser.thetas = [None if theta is None else np.array(theta) for theta in content["thetas"]]
    return optimiser


def _problem(problem: Problem) -> dict[str, Any]:
    return {
        "objective": problem.objective.text,
        "constraints": list(dict.fromkeys(constraint.text for constraint in problem.constraints)),
        "maximise": problem.maximise,
        "inputs": list(problem.model.input_names),
        "outputs": list(problem.model.output_names),
        "bounds": problem.bounds.tolist(),
    }


def _settings(acquisition: str, xi: float | None, seed: int) -> dict[str, Any]:
    return {"acquisition": acquisition, "xi": xi, "seed": seed}
