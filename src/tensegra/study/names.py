"""The names by which the surrogates and analyses of a study refer to each other, and to what it varies."""

from collections.abc import Mapping, Sequence
from typing import Any

from tensegra.errors import StudyError
from tensegra.files import require_file_names
from tensegra.study.analyses import TRUTH, AnalysisEntry, SurrogateEntry
from tensegra.study.entry import Entry

__all__ = ["require_known_names"]


def require_known_names(
    surrogates: Mapping[str, SurrogateEntry],
    analyses: Sequence[AnalysisEntry],
    variables: Sequence[str],
    outputs: Sequence[str],
    source: str,
) -> None:
    """Refuse surrogates and analyses that name a model, variable or output that there is not.

    Raises
    ------
    StudyError
        With the place, the name and the nearest one.
    """
    if TRUTH in surrogates:
        raise StudyError(
            f"{source} surrogates.{TRUTH}: the name stands for the structure itself, choose another"
        )
    require_file_names(surrogates, f"{source} surrogates", StudyError)
    for name, surrogate in surrogates.items():
        _require(surrogate.outputs or (), "an output", outputs, f"{source} surrogates.{name}.outputs")
    models = [*surrogates, TRUTH]
    for i, entry in enumerate(analyses):
        analysis, place = entry.value, f"{source} analyses[{i}].{entry.kind}"
        _require([analysis.model], "a surrogate or 'truth'", models, f"{place}.model")
        _require(analysis.outputs or (), "an output", outputs, f"{place}.outputs")
        _require(getattr(analysis, "search", None) or (), "a variable", variables, f"{place}.search")
        _require_keys(analysis, variables, outputs, place)
        predict = getattr(analysis, "predict", None)
        if predict is not None:
            _require_keys(predict, variables, outputs, f"{place}.predict")
            _require(predict.outputs or (), "an output", outputs, f"{place}.predict.outputs")
        if getattr(analysis, "compare_with", None) is not None:
            _require([analysis.compare_with], "a surrogate or 'truth'", models, f"{place}.compare_with")


def _require_keys(analysis: Entry, variables: Sequence[str], outputs: Sequence[str], place: str) -> None:
    """Refuse keys of an analysis's mappings that are no variables, or no outputs."""
    for key in ("inputs", "errors", "bounds"):
        _require(getattr(analysis, key, ()), "a variable", variables, f"{place}.{key}")
    for key in ("limits", "targets", "tolerance"):
        names = getattr(analysis, key, None)
        _require(names if isinstance(names, Mapping) else (), "an output", outputs, f"{place}.{key}")
    columns = (*variables, *outputs, *(f"{name}_std" for name in outputs))
    expected = "a variable, an output or <output>_std"
    _require(getattr(analysis, "measurements", ()), expected, columns, f"{place}.measurements")
    for key in ("inputs", "errors"):
        for name, law in getattr(analysis, key, {}).items():
            if law.same_as is not None:
                others = [variable for variable in variables if variable != name]
                _require([law.same_as], "another variable", others, f"{place}.{key}.{name}.same_as")


def _require(
    found: Sequence[str] | Mapping[str, Any], expected: str, known: Sequence[str], place: str
) -> None:
    for name in found:
        if name not in known:
            raise StudyError.at(place, name, expected, candidates=known)
