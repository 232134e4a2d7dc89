"""The `analyses` of a study file: their form.

What they do is the matter of `tensegra.analysis`, which reads these entries.
"""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from tensegra.study.entry import Count, Entry, Examples, Flag, Identifier, Number, OneOf
from tensegra.study.models import TRUTH, Analysis, InputEntry, Inputs, Names, Share, SurrogateEntry
from tensegra.study.searches import Inverse, Optimisation, Robust

__all__ = ["TRUTH", "AnalysisEntry", "InputEntry", "SurrogateEntry"]


class Propagation(Analysis):
    """Distribution of the outputs under random inputs; `compare_with` names a second model.

    `quantiles` are probabilities, `limits` values of outputs whose probability of being exceeded is wanted.
    """

    examples: ClassVar[Examples] = (
        {
            "name": "Actuation error",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.9,
            "samples": 10000,
            "method": "quasi_monte_carlo",
            "inputs": {"A14": {"uniform": [0.09, 0.1]}, "A23": {"same_as": "A14"}},
            "compare_with": "truth",
            "quantiles": [0.05, 0.95],
            "limits": {"w": [50, 52]},
        },
    )

    samples: Count = 10_000
    """Number of samples. [1]"""
    method: Literal["monte_carlo", "quasi_monte_carlo"] = "monte_carlo"
    """Random samples, or a scrambled Sobol sequence with replicates."""
    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""
    compare_with: Identifier | None = None
    """A second model, asked for the same samples."""
    quantiles: tuple[Share, ...] = ()
    """Probabilities whose quantiles are wanted. [1]"""
    limits: dict[Identifier, Number | tuple[Number, ...]] = Field(default_factory=dict)
    """Values, by output, whose probability of being exceeded is wanted. [output]"""


class Sensitivity(Analysis):
    """Sobol indices by Saltelli's design of `samples` base points, a power of two.

    The method ``chaos`` has them from a surrogate of kind ``pce``, under the laws that it was trained with.
    """

    examples: ClassVar[Examples] = (
        {
            "name": "Which input matters",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.95,
            "method": "saltelli",
            "samples": 1024,
            "second_order": False,
            "inputs": {"A14": {"uniform": [0.09, 0.1]}},
        },
    )

    method: Literal["saltelli", "chaos"] = "saltelli"
    """`saltelli` samples the model, `chaos` takes the indices from a surrogate of kind `pce`."""
    samples: Count = 1024
    """Number of base points of Saltelli's design, a power of two. [1]"""
    second_order: Flag = True
    """Whether indices of pairs are wanted, too."""
    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""

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


class Morris(Analysis):
    """Screening of many inputs by their elementary effects along random trajectories."""

    examples: ClassVar[Examples] = (
        {
            "name": "Screening",
            "model": "truth",
            "outputs": ["w"],
            "confidence": 0.95,
            "trajectories": 20,
            "levels": 4,
            "inputs": {"A14": {"uniform": [0.09, 0.1]}},
        },
    )

    trajectories: Annotated[Count, Field(ge=4)] = 20
    """Number of random trajectories. [1]"""
    levels: Annotated[Count, Field(multiple_of=2)] = 4
    """Number of levels of each variable, an even number. [1]"""
    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""


class Predict(Entry):
    """What a calibration predicts from its posterior: outputs under further `inputs`."""

    examples: ClassVar[Examples] = (
        {
            "inputs": {"A23": 0.1},
            "outputs": ["w"],
            "samples": 2000,
            "quantiles": [0.05, 0.95],
            "limits": {"w": 51},
        },
    )

    inputs: Inputs = Field(default_factory=dict)
    """Laws, fixed numbers or `same_as` in place of the study's own laws, by variable."""
    outputs: Names | None = None
    """Names of the outputs to predict; all if left out."""
    samples: Annotated[Count, Field(ge=2)] = 2000
    """Number of samples. [1]"""
    quantiles: tuple[Share, ...] = ()
    """Probabilities whose quantiles are wanted. [1]"""
    limits: dict[Identifier, Number | tuple[Number, ...]] = Field(default_factory=dict)
    """Values, by output, whose probability of being exceeded is wanted. [output]"""


class Calibration(Analysis):
    """The posterior of the variables, given `measurements` of outputs: a CSV file, or its columns.

    A row per measured state; columns named by the variables that were known, by the outputs, and their
    standard deviations, ``<output>_std``. The other variables are inferred, `inputs` giving their priors or
    the number that they are fixed at.
    """

    examples: ClassVar[Examples] = (
        {
            "name": "Twin",
            "model": "poly",
            "outputs": ["w"],
            "confidence": 0.9,
            "measurements": {"A14": [0.09, 0.1], "w": [48.0, 53.1], "w_std": [0.1, 0.1]},
            "inputs": {"A23": {"uniform": [0.09, 0.1]}},
            "chains": 8,
            "warmup": 150,
            "draws": 400,
            "predict": {"samples": 2000},
        },
    )

    measurements: dict[Identifier, tuple[Number | None, ...]] = Field(min_length=1)
    """CSV file relative to the study's, or its columns by name: variables that were known, outputs, and their
    standard deviations `<output>_std`. [variable or output]"""
    inputs: Inputs = Field(default_factory=dict)
    """Priors of the variables that are inferred, or the number that they are fixed at, by variable."""
    chains: Annotated[Count, Field(ge=2)] = 8
    """Number of Markov chains. [1]"""
    warmup: Annotated[Count, Field(ge=30)] = 150
    """Number of draws of each chain that tune it and are thrown away. [1]"""
    draws: Annotated[Count, Field(ge=50)] = 400
    """Number of draws of each chain that are kept. [1]"""
    confidence: Share = 0.90
    """Confidence of all intervals. [1]"""
    predict: Predict | None = None
    """What to predict from the posterior."""


class AnalysisEntry(OneOf):
    """One entry of `analyses`: a mapping with one key, the kind of analysis."""

    examples: ClassVar[Examples] = (
        {"propagation": {"model": "poly"}},
        {"sensitivity": {"model": "poly"}},
        {"morris": {"model": "truth"}},
        {"optimisation": {"model": "poly", "objective": "w"}},
        {"robust": {"model": "poly", "objective": "w", "errors": {"A14": {"normal": [0, 0.001]}}}},
        {"inverse": {"model": "poly", "targets": {"w": 50}}},
        {"calibration": {"model": "poly", "measurements": {"A14": [0.09], "w": [48.0], "w_std": [0.1]}}},
    )

    propagation: Propagation | None = None
    """Distribution of outputs under random inputs."""
    sensitivity: Sensitivity | None = None
    """Sobol indices."""
    morris: Morris | None = None
    """Screening by elementary effects."""
    optimisation: Optimisation | None = None
    """The best values of the variables."""
    robust: Robust | None = None
    """The best values under errors."""
    inverse: Inverse | None = None
    """The values that bring outputs to targets."""
    calibration: Calibration | None = None
    """The variables' posterior from measurements."""
