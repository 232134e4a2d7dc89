"""What the surrogates and all analyses of a study file share: names, laws of inputs, a model to ask."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import BeforeValidator, ConfigDict, Field, Strict, model_validator

from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.entry import Count, Entry, Examples, Identifier, Number
from tensegra.study.law_entries import DistributionEntry

__all__ = ["TRUTH", "Analysis", "InputEntry", "InputLaw", "Inputs", "Names", "Share", "SurrogateEntry"]

TRUTH = "truth"
"""The model that is no surrogate but the structure itself, solved anew."""

Names: TypeAlias = Annotated[tuple[Identifier, ...], Field(min_length=1)]
Flag: TypeAlias = Annotated[bool, Strict()]


class SurrogateEntry(Entry):
    """A surrogate to fit. Keys beyond these are options of its kind."""

    examples: ClassVar[Examples] = (
        {"kind": "gpr", "outputs": ["w"], "training_size": 512, "validation_size": 256},
    )

    model_config = ConfigDict(extra="allow")

    kind: Literal["gpr", "nn", "pce", "field", "piecewise", "auto"]
    """Kind of surrogate: Gaussian process (`gpr`), neural network (`nn`), polynomial chaos (`pce`), modes of
    many outputs (`field`), a piece for each regime (`piecewise`), or the best of the first three (`auto`)."""
    outputs: Names | None = None
    """Names of the outputs to learn; all if left out."""
    training_size: Count | None = None
    """Number of runs to learn from; all that are selected if left out. [1]"""
    validation_size: Count | None = None
    """Number of runs to hold out and to judge by; cross-validation if left out. [1]"""

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


class InputLaw(DistributionEntry):
    """How an analysis draws one variable: a law, a fixed number, or another variable's value."""

    examples: ClassVar[Examples] = (
        *DistributionEntry.examples,
        {"same_as": "A14"},
        {"fixed": 0.1},
    )

    fixed: Number | None = None
    """A number in place of a law; it may also stand alone. [variable]"""
    same_as: Identifier | None = None
    """Another variable whose value this one takes."""

    def law(self) -> Distribution | float | dict[str, str]:
        """Return a distribution, a number or ``{"same_as": name}``, as `tensegra.propagate` takes them."""
        if self.fixed is not None:
            return self.fixed
        if self.same_as is not None:
            return {"same_as": self.same_as}
        return as_distribution({self.kind: self.value.written()})


InputEntry: TypeAlias = Annotated[InputLaw, BeforeValidator(_fixed)]


Share: TypeAlias = Annotated[Number, Field(gt=0, lt=1)]
Inputs: TypeAlias = dict[Identifier, InputEntry]


class Analysis(Entry):
    """What every analysis has: a name for its section of the report, and a model to ask."""

    name: str | None = None
    """Name of the section in the report; the kind of analysis if left out."""
    model: Identifier
    """Surrogate to ask, or `truth`: the structure itself, solved anew."""
    outputs: Names | None = None
    """Names of the outputs asked about; all if left out."""
    confidence: Share = 0.95
    """Confidence of all intervals. [1]"""
