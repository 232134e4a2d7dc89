"""The joint law that a surrogate was trained under, as its file holds it.

A law of a study is written as the study writes it, a frozen law of `scipy.stats` by its name and parameters.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.space import Space
from tensegra.study.variables import Coordinate, Prestress, Target, Variable

__all__ = ["is_correlated", "joint_law", "read_joint_law", "written_joint_law"]


def joint_law(data: TrainingData) -> Space | None:
    """Return the joint law of training data: their space, or independent inputs of their laws, or None."""
    if data.space is not None or data.distributions is None:
        return data.space
    columns = zip(data.input_names, data.distributions, data.input_units, strict=True)
    made: list[Any] = [Variable(name, "", "", _study_law(law), unit) for name, law, unit in columns]
    return Space(tuple(made))


def is_correlated(space: Space | None) -> bool:
    """Tell whether some variables of a space depend on each other."""
    if space is None or space.correlation is None:
        return False
    return not np.array_equal(space.correlation, np.eye(space.n_inputs))


def written_joint_law(space: Space) -> dict[str, Any]:
    """Return a space in JSON's own types.

    Raises
    ------
    StudyError
        If a law is neither one of a study nor a frozen law of `scipy.stats`.
    """
    return {
        "variables": [
            {
                "name": variable.name,
                "quantity": variable.quantity,
                "target": variable.target if isinstance(variable.target, str) else variable.target.written(),
                "law": _written_law(variable.name, variable.distribution),
                "unit": variable.unit,
                "label": variable.label,
            }
            for variable in space.variables
        ],
        "correlation": None if space.correlation is None else space.correlation.tolist(),
    }


def read_joint_law(written: Mapping[str, Any]) -> Space:
    """Return the space that `written_joint_law` wrote."""
    variables = tuple(
        Variable(
            name=entry["name"],
            quantity=entry["quantity"],
            target=_target(entry["target"]),
            distribution=_law(entry["law"], f"law of {entry['name']}"),
            unit=entry["unit"],
            label=entry["label"],
        )
        for entry in written["variables"]
    )
    correlation = written["correlation"]
    return Space(variables, None if correlation is None else np.array(correlation, dtype=np.float64))


def _study_law(law: Any) -> Any:  # noqa: ANN401 - anything with a density and quantiles, or a study's mapping
    return as_distribution(law) if isinstance(law, Mapping) else law


def _written_law(name: str, law: Any) -> dict[str, Any]:  # noqa: ANN401 - a study's or SciPy's law
    if isinstance(law, Distribution):
        return law.to_mapping()
    own = getattr(law, "dist", None)
    if own is None or _scipy_law(own.name) is None:
        raise StudyError.at(f"law of {name}", law, "a law of a study or a frozen one of scipy.stats to save")
    parameters = {key: float(value) for key, value in law.kwds.items()}
    return {"scipy": {"name": own.name, "args": [float(value) for value in law.args], "kwds": parameters}}


def _law(written: Mapping[str, Any], place: str) -> Any:  # noqa: ANN401 - as above
    if "scipy" not in written:
        return as_distribution(written, place)
    entry = written["scipy"]
    made = _scipy_law(entry["name"])
    if made is None:
        raise StudyError.at(place, entry["name"], "a law of scipy.stats")
    return made(*entry["args"], **entry["kwds"])


def _scipy_law(name: str) -> Any:  # noqa: ANN401 - SciPy's distributions share no public type
    from scipy import stats

    found = getattr(stats, name, None)
    return found if isinstance(found, stats.rv_continuous | stats.rv_discrete) else None


def _target(written: Any) -> Target:  # noqa: ANN401 - as the file holds it
    if isinstance(written, str):
        return written
    return Coordinate(**written) if "axis" in written else Prestress(**written)
