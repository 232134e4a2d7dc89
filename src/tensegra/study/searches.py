"""The analyses of a study file that look for values of variables: optimisation, robust, inverse."""

from typing import Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from tensegra.study.entry import Count, Examples, Flag, Identifier, Number, Positive
from tensegra.study.models import Analysis, Inputs, Names, Share

__all__ = ["Inverse", "Optimisation", "Robust"]

Bounds: TypeAlias = dict[Identifier, tuple[Number, Number]]


def _require_ordered(bounds: Bounds) -> None:
    for name, (low, high) in bounds.items():
        if not low <= high:
            raise ValueError(f"bounds of {name!r}: found [{low}, {high}], expected lower <= upper")


class _Search(Analysis):
    """An objective and constraints, expressions in variables and outputs, in a box.

    `search` names the variables to choose: by default the actuators and what has bounds (or errors), less
    what `inputs` names.
    """

    search: Names | None = None
    """Variables to choose; if left out, actuators and what has bounds or errors, less what `inputs` names."""
    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""
    objective: str = Field(min_length=1)
    """Expression in variables and outputs that is to be best."""
    maximise: Flag = True
    """Whether the largest value is best; else the smallest."""
    constraints: tuple[str, ...] = ()
    """Conditions, expressions in variables and outputs with <= or >=."""
    bounds: Bounds = Field(default_factory=dict)
    """Lower and upper bound of variables to choose, by variable; the study's box if left out. [variable]"""
    evaluations: Count = 40
    """Limit to the evaluations of the methods `bayesian` and `direct`. [1]"""

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

    examples: ClassVar[Examples] = (
        {
            "name": "Straightest lift",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.95,
            "search": ["A14"],
            "inputs": {"A23": 0.1},
            "objective": "abs(w)",
            "maximise": True,
            "constraints": ["w <= 52"],
            "bounds": {"A14": [0.09, 0.1]},
            "evaluations": 40,
            "methods": ["slsqp", "bayesian"],
            "starts": 100,
            "acquisition": "ei",
            "xi": 0.01,
        },
    )

    methods: tuple[Literal["slsqp", "bfgs", "bayesian", "direct"], ...] = Field(
        default=("slsqp",), min_length=1
    )
    """Methods to search by, one after the other."""
    starts: Count = 200
    """Number of starts of the methods that descend. [1]"""
    acquisition: Literal["ucb", "ei", "mpi"] = "ucb"
    """What the method `bayesian` chooses its next point by."""
    xi: Annotated[Number, Field(ge=0)] | None = None
    """Parameter of the acquisition; its usual value if left out. [1]"""


class Robust(_Search):
    """The inputs at which a statistic of an objective is best, under `errors` that add to them.

    The statistic is mean - `kappa` std (+ where less is better), or the value that a share `quantile` of the
    outcomes falls short of. The variables that are not searched keep their joint law, or that in `inputs`.
    """

    examples: ClassVar[Examples] = (
        {
            "name": "Robust lift",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.95,
            "search": ["A14"],
            "inputs": {"A23": 0.1},
            "objective": "w",
            "maximise": True,
            "constraints": ["w <= 52"],
            "bounds": {"A14": [0.09, 0.1]},
            "evaluations": 40,
            "errors": {"A14": {"normal": [0, 0.001]}},
            "kappa": 2,
            "method": "slsqp",
            "starts": 20,
            "draws": 64,
            "samples": 1000,
        },
        {"model": "poly", "objective": "w", "errors": {"A14": {"normal": [0, 0.001]}}, "quantile": 0.05},
    )

    errors: Inputs = Field(default_factory=dict)
    """Laws of errors that add to the variables chosen, by variable."""
    kappa: Annotated[Number, Field(ge=0)] | None = None
    """Number of standard deviations that the mean is lowered by (raised where less is better). [1]"""
    quantile: Share | None = None
    """Share of the outcomes that fall short of the value to be best, in place of `kappa`. [1]"""
    method: Literal["slsqp", "bfgs", "bayesian"] = "slsqp"
    """Method to search by."""
    starts: Count = 20
    """Number of starts of the methods that descend. [1]"""
    draws: Count = 64
    """Number of draws of the errors at each point of the search. [1]"""
    samples: Annotated[Count, Field(ge=2)] = 1000
    """Number of samples that the best point is judged by. [1]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.kappa is not None and self.quantile is not None:
            raise ValueError("found kappa and quantile, expected one of them")
        return self


class Inverse(Analysis):
    """The inputs that bring outputs to `targets`, numbers or lists of them along a trajectory.

    `search` names the variables to choose, as for an optimisation; the others keep their joint law, or that
    in `inputs`.
    """

    examples: ClassVar[Examples] = (
        {
            "name": "Reach",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.9,
            "search": ["A14"],
            "targets": {"w": [50, 51, None]},
            "bounds": {"A14": [0.09, 0.1]},
            "errors": {"A14": {"normal": [0, 0.001]}},
            "inputs": {"A23": 0.1},
            "constraints": ["w <= 52"],
            "tolerance": {"w": 0.1},
            "starts": 20,
            "samples": 256,
        },
    )

    search: Names | None = None
    """Variables to choose; if left out, actuators and what has bounds or errors, less what `inputs` names."""
    targets: dict[Identifier, Number | tuple[Number | None, ...]] = Field(min_length=1)
    """Values wanted, by output: a number, or a list of them along a trajectory, null where none is wanted.
    [output]"""
    bounds: Bounds = Field(default_factory=dict)
    """Lower and upper bound of variables to choose, by variable; the study's box if left out. [variable]"""
    errors: Inputs = Field(default_factory=dict)
    """Laws of errors that add to the variables chosen, by variable."""
    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""
    constraints: tuple[str, ...] = ()
    """Conditions, expressions in variables and outputs with <= or >=."""
    tolerance: Positive | dict[Identifier, Positive] | None = None
    """Distance from a target that counts as reached, one for all outputs or by output. [output]"""
    starts: Count = 20
    """Number of starts. [1]"""
    samples: Annotated[Count, Field(ge=2)] = 256
    """Number of samples that the spread at the answer is judged by. [1]"""
    confidence: Share = 0.90
    """Confidence of all intervals. [1]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_ordered(self.bounds)
        sizes = {name: len(values) for name, values in self.targets.items() if isinstance(values, tuple)}
        if len(set(sizes.values())) > 1 or 0 in sizes.values():
            raise ValueError(f"found targets of lengths {sizes}, expected numbers or lists of one length")
        return self
