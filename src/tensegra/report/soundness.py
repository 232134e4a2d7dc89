"""What can be known of a study's surrogates and analyses before it is run: asked here, not hours later."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from tensegra.errors import StudyError
from tensegra.report.study_tables import title_of
from tensegra.study import AnalysisEntry, Study
from tensegra.study.analyses import TRUTH
from tensegra.study.memory import campaign_bytes, require_room
from tensegra.study.study import require_room_for

__all__ = ["require_known_parts", "require_sound"]


def require_sound(study: Study) -> None:
    """Refuse what would only fail after the campaign.

    Options that a surrogate does not take; formulas that are none; outputs that the model of an analysis
    lacks; indices of correlated inputs, or from a surrogate that cannot give them; more points than the
    memory holds.

    Raises
    ------
    StudyError
        With the place and the nearest right name.
    """
    from tensegra.surrogate.fit import check_options

    for name, surrogate in study.surrogates.items():
        try:
            check_options(surrogate.kind, surrogate.options)
        except StudyError as error:
            raise StudyError(f"surrogates.{name}: {error}") from None
    require_room_for(study)
    for i, entry in enumerate(study.analyses):
        place = f"analyses[{i}].{entry.kind}"
        _require_counts_fit(study, entry, place)
        _require_indices(study, entry, place)
        _require_formulas(study, entry, place)
        _require_outputs(study, entry, place)


def _require_formulas(study: Study, entry: AnalysisEntry, place: str) -> None:
    """Refuse an objective or a constraint that is no formula over what the model knows."""
    from tensegra.analysis import parse_constraint, parse_expression

    names = (*study.input_names, *_outputs_of(study, entry.value.model))
    if entry.optimisation or entry.robust:
        parse_expression(entry.value.objective, names, place=f"{place}.objective")
    for j, constraint in enumerate(getattr(entry.value, "constraints", ())):
        parse_constraint(constraint, names, place=f"{place}.constraints[{j}]")


def _require_outputs(study: Study, entry: AnalysisEntry, place: str) -> None:
    """Refuse outputs that the model of an analysis, or the one that it is compared with, lacks."""
    asked = entry.value
    known = _outputs_of(study, asked.model)
    for key, wanted in _wanted_outputs(asked):
        for name in wanted:
            if name in study.output_names and name not in known:
                raise StudyError.at(f"{place}.{key}", name, f"an output of {asked.model!r}", candidates=known)
    other = getattr(asked, "compare_with", None)
    if other is not None:
        answered = _outputs_of(study, other)
        for name in asked.outputs or known:
            if name not in answered:
                raise StudyError.at(f"{place}.compare_with", other, f"a model that has the output {name!r}")


def require_known_parts(study: Study, only: Collection[str]) -> None:
    """Refuse names that are neither a surrogate's nor an analysis's.

    Raises
    ------
    StudyError
        With the nearest right name.
    """
    titles = [title_of(entry, i) for i, entry in enumerate(study.analyses)]
    known = [*study.surrogates, *titles, *dict.fromkeys(entry.kind for entry in study.analyses)]
    for name in only:
        if name not in known:
            expected = f"a surrogate or an analysis of the study ({', '.join(known) or 'it has none'})"
            raise StudyError.at("--only", name, expected, candidates=known)


def _outputs_of(study: Study, model: str) -> tuple[str, ...]:
    """Return the outputs that a model answers for."""
    if model == TRUTH or study.surrogates[model].outputs is None:
        return study.output_names
    return tuple(study.surrogates[model].outputs or ())


def _wanted_outputs(asked: Any) -> Iterator[tuple[str, Collection[str]]]:  # noqa: ANN401 - an entry's value
    """Yield the keys of an analysis that name outputs, with the names."""
    for key in ("outputs", "limits", "targets", "measurements"):
        wanted = getattr(asked, key, None)
        if wanted:
            yield key, tuple(wanted)
    tolerance = getattr(asked, "tolerance", None)
    if isinstance(tolerance, Mapping):
        yield "tolerance", tuple(tolerance)
    predict = getattr(asked, "predict", None)
    if predict is not None:
        yield "predict.outputs", tuple(predict.outputs or ())
        yield "predict.limits", tuple(predict.limits)


def _require_indices(study: Study, entry: AnalysisEntry, place: str) -> None:
    """Refuse indices that the study cannot have: they belong to independent inputs."""
    if not (entry.sensitivity or entry.morris):
        return
    asked = entry.value
    if entry.sensitivity and asked.method == "chaos":
        kind = study.surrogates[asked.model].kind if asked.model != TRUTH else TRUTH
        if kind not in {"pce", "auto"}:
            raise StudyError.at(
                f"{place}.model", asked.model, "a surrogate of kind 'pce' for the method chaos"
            )
    if study.space.correlation is None:
        return
    own = [i for i, name in enumerate(study.input_names) if name not in asked.inputs]
    correlation = study.space.correlation[np.ix_(own, own)]
    if not np.array_equal(correlation, np.eye(len(own))):
        rows = np.flatnonzero((correlation != np.eye(len(own))).any(axis=1))
        names = [study.input_names[own[row]] for row in rows]
        expected = "independent inputs; give laws of their own to these in `inputs`"
        raise StudyError.at(f"{place}.inputs", ", ".join(names), expected)


def _require_counts_fit(study: Study, entry: AnalysisEntry, place: str) -> None:
    """Refuse as many samples as the memory does not hold."""
    d, k = study.space.n_inputs, len(study.outputs)
    for key, count in _counts(entry, d).items():
        require_room(f"{place}.{key}", getattr(entry.value, key), campaign_bytes(count, d, k))


def _counts(entry: AnalysisEntry, n_inputs: int) -> dict[str, int]:
    """Return the keys of an analysis that set how much is computed at a time, and the points of each."""
    asked = entry.value
    match entry.kind:
        case "sensitivity":
            return {"samples": asked.samples * (2 * n_inputs + 2)}
        case "morris":
            return {"trajectories": asked.trajectories * (n_inputs + 1)}
        case "calibration":
            return {"warmup": asked.chains * asked.warmup, "draws": asked.chains * asked.draws}
        case "robust":
            return {"samples": asked.samples, "draws": asked.draws, "starts": asked.starts}
    return {key: getattr(asked, key) for key in ("samples", "starts") if hasattr(asked, key)}
