"""Carry out the analyses that a study file lists."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from tensegra.analysis.model import Model, SurrogateModel
from tensegra.analysis.optimisation import optimise
from tensegra.analysis.propagation import propagate
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
        """``propagation``, ``sensitivity`` or ``optimisation``."""
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
    list of Propagation, Sensitivity or Optimum
        One per entry; an optimisation gives one per method. All randomness follows the study's seed.

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
        return SurrogateModel(self.surrogates[name], name, self.study.space)


def _told(progress: Progress | None, name: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, total: progress(name, done, total)


def _propagation(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401 - the study's pydantic entry
    name = entry.name or "propagation"
    yield propagate(
        models.named(entry.model),
        {variable: law.law() for variable, law in entry.inputs.items()},
        samples=entry.samples,
        method=entry.method,
        outputs=entry.outputs,
        compare_with=None if entry.compare_with is None else models.named(entry.compare_with),
        seed=study.seed,
        name=name,
        progress=_told(progress, name),
    )


def _sensitivity(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    name = entry.name or "sensitivity"
    yield sobol_indices(
        models.named(entry.model),
        {variable: law.law() for variable, law in entry.inputs.items()},
        samples=entry.samples,
        second_order=entry.second_order,
        outputs=entry.outputs,
        seed=study.seed,
        name=name,
        progress=_told(progress, name),
    )


def _optimisation(study: "Study", models: _Models, entry: Any, progress: Progress | None) -> Iterator[Result]:  # noqa: ANN401
    name = entry.name or "optimisation"
    for method in entry.methods:
        yield optimise(
            models.named(entry.model),
            entry.objective,
            bounds=entry.bounds,
            constraints=entry.constraints,
            maximise=entry.maximise,
            method=method,
            starts=entry.starts,
            evaluations=entry.evaluations,
            xi=entry.xi,
            seed=study.seed,
            true_model=TrueModel(study),
            name=name,
            progress=_told(progress, f"{name} ({method})"),
        )


_DISPATCH = {"propagation": _propagation, "sensitivity": _sensitivity, "optimisation": _optimisation}
