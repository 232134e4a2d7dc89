"""The `surrogates` and `analyses` of a study file: their form, and the names that they refer to.

What they do is the matter of `tensegra.surrogate` and `tensegra.analysis`, which read these entries.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BeforeValidator, ConfigDict, Field, Strict, model_validator

from tensegra.errors import StudyError
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.entry import Count, Entry, Identifier, Number, OneOf
from tensegra.study.law_entries import DistributionEntry

__all__ = ["TRUTH", "AnalysisEntry", "InputEntry", "SurrogateEntry", "require_known_names"]

TRUTH = "truth"
"""The model that is no surrogate but the structure itself, solved anew."""

Names: TypeAlias = Annotated[tuple[Identifier, ...], Field(min_length=1)]
Flag: TypeAlias = Annotated[bool, Strict()]


class SurrogateEntry(Entry):
    """A surrogate to fit. Keys beyond these are options of its kind."""

    model_config = ConfigDict(extra="allow")

    kind: Literal["gpr", "nn", "pce", "field", "piecewise", "auto"]
    outputs: Names | None = None
    training_size: Count | None = None
    validation_size: Count | None = None

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:  # noqa: ANN401 - the options are the kind's to know
        return data

    @property
    def options(self) -> dict[str, Any]:
        """The options of the kind."""
        return dict(self.model_extra or {})


def _fixed(value: object) -> object:
    return value if isinstance(value, Mapping) else {"fixed": value}


class _InputEntry(DistributionEntry):
    """How an analysis draws one variable: a law, a fixed number, or another variable's value."""

    fixed: Number | None = None
    same_as: Identifier | None = None

    def law(self) -> Distribution | float | dict[str, str]:
        """Return a distribution, a number or ``{"same_as": name}``, as `tensegra.propagate` takes them."""
        if self.fixed is not None:
            return self.fixed
        if self.same_as is not None:
            return {"same_as": self.same_as}
        return as_distribution({self.kind: self.value.written()})


InputEntry: TypeAlias = Annotated[_InputEntry, BeforeValidator(_fixed)]


class _Analysis(Entry):
    """What every analysis has: a name for its section of the report, and a model to ask."""

    name: str | None = None
    model: Identifier
    outputs: Names | None = None


class Propagation(_Analysis):
    """Distribution of the outputs under random inputs; `compare_with` names a second model."""

    samples: Count = 10_000
    method: Literal["monte_carlo", "quasi_monte_carlo"] = "monte_carlo"
    inputs: dict[Identifier, InputEntry] = Field(default_factory=dict)
    compare_with: Identifier | None = None


class Sensitivity(_Analysis):
    """Sobol indices by Saltelli's design of `samples` base points, a power of two."""

    samples: Count = 1024
    second_order: Flag = True
    inputs: dict[Identifier, InputEntry] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.samples & (self.samples - 1):
            above = 1 << self.samples.bit_length()
            raise ValueError(
                f"found {self.samples} samples, expected a power of two such as {above // 2} or {above}"
            )
        return self


class Optimisation(_Analysis):
    """The inputs at which an objective, an expression in variables and outputs, is best."""

    objective: str = Field(min_length=1)
    maximise: Flag = True
    constraints: tuple[str, ...] = ()
    bounds: dict[Identifier, tuple[Number, Number]] = Field(default_factory=dict)
    methods: tuple[Literal["slsqp", "bfgs", "bayesian"], ...] = Field(default=("slsqp",), min_length=1)
    starts: Count = 200
    evaluations: Count = 40
    xi: Annotated[Number, Field(ge=0)] = 0.01

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, (low, high) in self.bounds.items():
            if not low < high:
                raise ValueError(f"bounds of {name!r}: found [{low}, {high}], expected lower < upper")
        return self


class AnalysisEntry(OneOf):
    """One entry of `analyses`: a mapping with one key, the kind of analysis."""

    propagation: Propagation | None = None
    sensitivity: Sensitivity | None = None
    optimisation: Optimisation | None = None


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
    for name, surrogate in surrogates.items():
        _require(surrogate.outputs or (), "an output", outputs, f"{source} surrogates.{name}.outputs")
    models = [*surrogates, TRUTH]
    for i, entry in enumerate(analyses):
        analysis, place = entry.value, f"{source} analyses[{i}].{entry.kind}"
        _require([analysis.model], "a surrogate or 'truth'", models, f"{place}.model")
        _require(analysis.outputs or (), "an output", outputs, f"{place}.outputs")
        for key in ("inputs", "bounds"):
            _require(getattr(analysis, key, ()), "a variable", variables, f"{place}.{key}")
        for name, law in getattr(analysis, "inputs", {}).items():
            if law.same_as is not None:
                others = [variable for variable in variables if variable != name]
                _require([law.same_as], "another variable", others, f"{place}.inputs.{name}.same_as")
        if getattr(analysis, "compare_with", None) is not None:
            _require([analysis.compare_with], "a surrogate or 'truth'", models, f"{place}.compare_with")


def _require(
    found: Sequence[str] | Mapping[str, Any], expected: str, known: Sequence[str], place: str
) -> None:
    for name in found:
        if name not in known:
            raise StudyError.at(place, name, expected, candidates=known)
