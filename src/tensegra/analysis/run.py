"""Carry out the analyses that a study file lists."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from tensegra.analysis.calibration import calibrate
from tensegra.analysis.chaosindices import chaos_indices
from tensegra.analysis.inverse import reach
from tensegra.analysis.model import Model, SurrogateModel
from tensegra.analysis.optimisation import optimise
from tensegra.analysis.posterior import Calibration
from tensegra.analysis.propagation import Propagation, propagate
from tensegra.analysis.robust import robust_optimise
from tensegra.analysis.screening import morris_screening
from tensegra.analysis.sensitivity import sobol_indices
from tensegra.analysis.truth import TrueModel
from tensegra.errors import StudyError

if TYPE_CHECKING:
    from tensegra.study.campaign import Campaign
    from tensegra.study.study import Study

# The name by which a study file asks for the structure itself.
TRUTH = "truth"


class Result(Protocol):
    """What every analysis returns; it can be told apart by its `kind`."""

    @property
    def kind(self) -> str:
        """The kind of its entry in the study: ``propagation``, ``sensitivity``, …."""
        ...

    @property
    def name(self) -> str:
        """The name of the entry."""
        ...

    def table(self) -> list[dict[str, Any]]:
        """Return the result's table, a mapping per row."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        ...


Progress = Callable[[str, int, int], None]


def run_analyses(
    study: "Study",
    campaign: "Campaign | None",
    surrogates: Mapping[str, object],
    progress: Progress | None = None,
) -> list[Result]:
    """Carry out all analyses of a study, in its order.

    Parameters
    ----------
    study
        Its `analyses` are carried out; it is the true model too, for an entry whose model is ``truth`` and
        for solving each optimum again.
    campaign
        The runs that the surrogates learned from, which must be the study's own; None where there are none.
    surrogates
        Fitted surrogates by the name that the study gives them.
    progress
        Called with (name of the entry, done, in all or 0 where nobody knows).

    Returns
    -------
    list
        One result per entry, of the kind that the entry's function returns; an optimisation gives one per
        method. All randomness follows the study's seed.

    Raises
    ------
    StudyError
        If the campaign belongs to another study, an entry asks for a surrogate that is not among
        `surrogates`, or cannot be carried out.
    """
    if campaign is not None and campaign.study.fingerprint != study.fingerprint:
        raise StudyError.at("analyses: campaign", campaign.study.name, f"runs of the study {study.name!r}")
    models = _Models(study, surrogates)
    return [
        result
        for entry in study.analyses
        for result in _DISPATCH[entry.kind](study, models, entry.value, progress)
    ]


@dataclass(frozen=True)
class _Models:
    study: "Study"
    surrogates: Mapping[str, object]

    def named(self, name: str) -> Model:
        if name == TRUTH:
            return TrueModel(self.study)
        if name not in self.surrogates:
            known = (*self.surrogates, TRUTH)
            raise StudyError.at("analyses.model", name, "one of " + ", ".join(known), candidates=known)
        counts = TrueModel(self.study).counts
        return SurrogateModel(self.surrogates[name], name, self.study.space, counts)


def _laws(entries: Mapping[str, Any]) -> dict[str, object]:
    return {variable: entry.law() for variable, entry in entries.items()}


def _told(progress: Progress | None, name: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, total: progress(name, done, total)


def _common(study: "Study", entry: Any, default: str, progress: Progress | None) -> dict[str, Any]:  # noqa: ANN401 - the study's pydantic entry
    """Return the arguments that all analyses take."""
    name = entry.name or default
    return {
        "seed": study.seed,
        "confidence": entry.confidence,
        "name": name,
        "progress": _told(progress, name),
    }


def _propagation(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401 - the study's pydantic entry
    yield propagate(
        models.named(entry.model),
        _laws(entry.inputs),
        samples=entry.samples,
        method=entry.method,
        outputs=entry.outputs,
        compare_with=None if entry.compare_with is None else models.named(entry.compare_with),
        quantiles=entry.quantiles,
        limits=entry.limits,
        **_common(study, entry, "propagation", progress),
    )


def _sensitivity(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    if entry.method == "chaos":
        yield chaos_indices(
            models.named(entry.model),
            outputs=entry.outputs,
            second_order=entry.second_order,
            seed=study.seed,
            confidence=entry.confidence,
            name=entry.name or "sensitivity",
        )
        return
    yield sobol_indices(
        models.named(entry.model),
        _laws(entry.inputs),
        samples=entry.samples,
        second_order=entry.second_order,
        outputs=entry.outputs,
        **_common(study, entry, "sensitivity", progress),
    )


def _morris(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    yield morris_screening(
        models.named(entry.model),
        _laws(entry.inputs),
        trajectories=entry.trajectories,
        levels=entry.levels,
        outputs=entry.outputs,
        **_common(study, entry, "screening", progress),
    )


def _optimisation(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    name = entry.name or "optimisation"
    for method in entry.methods:
        yield optimise(
            models.named(TRUTH if method == "direct" else entry.model),
            entry.objective,
            search=entry.search,
            inputs=_laws(entry.inputs),
            bounds=entry.bounds,
            constraints=entry.constraints,
            maximise=entry.maximise,
            method=method,
            starts=entry.starts,
            evaluations=entry.evaluations,
            acquisition=entry.acquisition,
            xi=entry.xi,
            seed=study.seed,
            true_model=TrueModel(study),
            name=name,
            progress=_told(progress, f"{name} ({method})"),
        )


def _robust(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    yield robust_optimise(
        models.named(entry.model),
        entry.objective,
        search=entry.search,
        errors=_laws(entry.errors),
        inputs=_laws(entry.inputs),
        kappa=entry.kappa,
        quantile=entry.quantile,
        bounds=entry.bounds,
        constraints=entry.constraints,
        maximise=entry.maximise,
        method=entry.method,
        starts=entry.starts,
        evaluations=entry.evaluations,
        draws=entry.draws,
        samples=entry.samples,
        true_model=TrueModel(study),
        **_common(study, entry, "robust optimisation", progress),
    )


def _inverse(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    yield reach(
        models.named(entry.model),
        entry.targets,
        search=entry.search,
        bounds=entry.bounds,
        errors=_laws(entry.errors),
        inputs=_laws(entry.inputs),
        constraints=entry.constraints,
        tolerance=entry.tolerance,
        starts=entry.starts,
        samples=entry.samples,
        true_model=TrueModel(study),
        **_common(study, entry, "inverse problem", progress),
    )


def _calibration(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    model = models.named(entry.model)
    found = calibrate(
        model,
        entry.measurements,
        inputs=_laws(entry.inputs),
        chains=entry.chains,
        warmup=entry.warmup,
        draws=entry.draws,
        true_model=TrueModel(study),
        **_common(study, entry, "calibration", progress),
    )
    if entry.predict is not None:
        found = replace(found, after=_predicted(study, model, entry, found))
    yield found


def _predicted(study: "Study", model: Model, entry: Any, found: Calibration) -> tuple[Propagation, ...]:  # noqa: ANN401
    """Propagate from the prior and from the posterior, under the same further inputs."""
    others = _laws(entry.predict.inputs)
    prior = _laws(entry.inputs) | others
    return tuple(
        propagate(
            model,
            inputs,
            samples=entry.predict.samples,
            outputs=entry.predict.outputs,
            quantiles=entry.predict.quantiles,
            limits=entry.predict.limits,
            seed=study.seed,
            confidence=entry.confidence,
            name=f"{found.name}, {label}",
        )
        for label, inputs in (("prior", prior), ("posterior", found.inputs(**others)))
    )


_DISPATCH = {
    "propagation": _propagation,
    "sensitivity": _sensitivity,
    "morris": _morris,
    "optimisation": _optimisation,
    "robust": _robust,
    "inverse": _inverse,
    "calibration": _calibration,
}
