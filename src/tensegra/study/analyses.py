"""The `surrogates` and `analyses` of a study file: their form, and the names that they refer to.

What they do is the matter of `tensegra.surrogate` and `tensegra.analysis`, which read these entries.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import BeforeValidator, ConfigDict, Field, Strict, model_validator

from tensegra.errors import StudyError
from tensegra.files import require_file_names
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.entry import Count, Entry, Identifier, Number, OneOf, Positive
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


Share: TypeAlias = Annotated[Number, Field(gt=0, lt=1)]
Inputs: TypeAlias = dict[Identifier, InputEntry]
Bounds: TypeAlias = dict[Identifier, tuple[Number, Number]]


def _require_ordered(bounds: Bounds) -> None:
    for name, (low, high) in bounds.items():
        if not low <= high:
            raise ValueError(f"bounds of {name!r}: found [{low}, {high}], expected lower <= upper")


class _Analysis(Entry):
    """What every analysis has: a name for its section of the report, and a model to ask."""

    name: str | None = None
    model: Identifier
    outputs: Names | None = None
    confidence: Share = 0.95


class Propagation(_Analysis):
    """Distribution of the outputs under random inputs; `compare_with` names a second model.

    `quantiles` are probabilities, `limits` values of outputs whose probability of being exceeded is wanted.
    """

    samples: Count = 10_000
    method: Literal["monte_carlo", "quasi_monte_carlo"] = "monte_carlo"
    inputs: Inputs = Field(default_factory=dict)
    compare_with: Identifier | None = None
    quantiles: tuple[Share, ...] = ()
    limits: dict[Identifier, Number | tuple[Number, ...]] = Field(default_factory=dict)


class Sensitivity(_Analysis):
    """Sobol indices by Saltelli's design of `samples` base points, a power of two.

    The method ``chaos`` has them from a surrogate of kind ``pce``, under the laws that it was trained with.
    """

    method: Literal["saltelli", "chaos"] = "saltelli"
    samples: Count = 1024
    second_order: Flag = True
    inputs: Inputs = Field(default_factory=dict)

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.samples & (self.samples - 1):
            above = 1 << self.samples.bit_length()
            raise ValueError(
                f"found {self.samples} samples, expected a power of two such as {above // 2} or {above}"
            )
        if self.method == "chaos" and self.inputs:
            raise ValueError(
                "found inputs, which the method 'chaos' does not take: it keeps those of its training"
            )
        return self


class Morris(_Analysis):
    """Screening of many inputs by their elementary effects along random trajectories."""

    trajectories: Annotated[Count, Field(ge=4)] = 20
    levels: Annotated[Count, Field(multiple_of=2)] = 4
    inputs: Inputs = Field(default_factory=dict)


class _Search(_Analysis):
    """An objective and constraints, expressions in variables and outputs, in a box.

    `search` names the variables to choose: by default the actuators and what has bounds (or errors), less
    what `inputs` names.
    """

    search: Names | None = None
    inputs: Inputs = Field(default_factory=dict)
    objective: str = Field(min_length=1)
    maximise: Flag = True
    constraints: tuple[str, ...] = ()
    bounds: Bounds = Field(default_factory=dict)
    evaluations: Count = 40

    @model_validator(mode="after")
    def _check_bounds(self) -> Self:
        _require_ordered(self.bounds)
        return self


class Optimisation(_Search):
    """The inputs at which an objective is best, by each of several methods.

    The variables that are not searched are held at the means of their laws, or of those in `inputs`. The
    method ``direct`` searches on the structure itself, whatever the model. `acquisition` and its parameter
    `xi` are those of ``bayesian``.
    """

    methods: tuple[Literal["slsqp", "bfgs", "bayesian", "direct"], ...] = Field(
        default=("slsqp",), min_length=1
    )
    starts: Count = 200
    acquisition: Literal["ucb", "ei", "mpi"] = "ucb"
    xi: Annotated[Number, Field(ge=0)] | None = None


class Robust(_Search):
    """The inputs at which a statistic of an objective is best, under `errors` that add to them.

    The statistic is mean - `kappa` std (+ where less is better), or the value that a share `quantile` of the
    outcomes falls short of. The variables that are not searched keep their joint law, or that in `inputs`.
    """

    errors: Inputs = Field(default_factory=dict)
    kappa: Annotated[Number, Field(ge=0)] | None = None
    quantile: Share | None = None
    method: Literal["slsqp", "bfgs", "bayesian"] = "slsqp"
    starts: Count = 20
    draws: Count = 64
    samples: Annotated[Count, Field(ge=2)] = 1000

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.kappa is not None and self.quantile is not None:
            raise ValueError("found kappa and quantile, expected one of them")
        return self


class Inverse(_Analysis):
    """The inputs that bring outputs to `targets`, numbers or lists of them along a trajectory.

    `search` names the variables to choose, as for an optimisation; the others keep their joint law, or that
    in `inputs`.
    """

    search: Names | None = None
    targets: dict[Identifier, Number | tuple[Number | None, ...]] = Field(min_length=1)
    bounds: Bounds = Field(default_factory=dict)
    errors: Inputs = Field(default_factory=dict)
    inputs: Inputs = Field(default_factory=dict)
    constraints: tuple[str, ...] = ()
    tolerance: Positive | dict[Identifier, Positive] | None = None
    starts: Count = 20
    samples: Annotated[Count, Field(ge=2)] = 256
    confidence: Share = 0.90

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_ordered(self.bounds)
        sizes = {name: len(values) for name, values in self.targets.items() if isinstance(values, tuple)}
        if len(set(sizes.values())) > 1 or 0 in sizes.values():
            raise ValueError(f"found targets of lengths {sizes}, expected numbers or lists of one length")
        return self


class Predict(Entry):
    """What a calibration predicts from its posterior: outputs under further `inputs`."""

    inputs: Inputs = Field(default_factory=dict)
    outputs: Names | None = None
    samples: Annotated[Count, Field(ge=2)] = 2000
    quantiles: tuple[Share, ...] = ()
    limits: dict[Identifier, Number | tuple[Number, ...]] = Field(default_factory=dict)


class Calibration(_Analysis):
    """The posterior of the variables, given `measurements` of outputs: a CSV file, or its columns.

    A row per measured state; columns named by the variables that were known, by the outputs, and their
    standard deviations, ``<output>_std``. The other variables are inferred, `inputs` giving their priors or
    the number that they are fixed at.
    """

    measurements: dict[Identifier, tuple[Number | None, ...]] = Field(min_length=1)
    inputs: Inputs = Field(default_factory=dict)
    chains: Annotated[Count, Field(ge=2)] = 8
    warmup: Annotated[Count, Field(ge=30)] = 150
    draws: Annotated[Count, Field(ge=50)] = 400
    confidence: Share = 0.90
    predict: Predict | None = None


class AnalysisEntry(OneOf):
    """One entry of `analyses`: a mapping with one key, the kind of analysis."""

    propagation: Propagation | None = None
    sensitivity: Sensitivity | None = None
    morris: Morris | None = None
    optimisation: Optimisation | None = None
    robust: Robust | None = None
    inverse: Inverse | None = None
    calibration: Calibration | None = None


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
