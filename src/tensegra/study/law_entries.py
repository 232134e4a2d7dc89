"""The laws that a study file may write, and their parameters.

A plain list stands for the first parameters in order: ``{uniform: [0.09, 0.10]}`` is
``{uniform: {low: 0.09, high: 0.10}}``.
"""

import math
from abc import abstractmethod
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from tensegra.study.entry import Entry, Examples, Number, OneOf, Positive
from tensegra.study.laws import DiscreteLaw, KernelDensity, Law, MeasuredLaw, Reflected

__all__ = ["LAWS", "DistributionEntry", "Empirical", "LawEntry"]


class LawEntry(Entry):
    """The parameters of one law."""

    in_variable_units: ClassVar[tuple[str, ...]] = ()
    """Parameters that are measured in the variable's own unit, and may be written with one."""

    @model_validator(mode="before")
    @classmethod
    def _name_positions(cls, data: Any) -> Any:  # noqa: ANN401 - pydantic hands over what the file holds
        if isinstance(data, list | tuple):
            keys = cls.known_keys()
            if len(data) > len(keys):
                raise ValueError(
                    f"found {len(data)} numbers, expected at most {len(keys)}: {', '.join(keys)}"
                )
            return dict(zip(keys, data, strict=False))
        return data

    @abstractmethod
    def law(self) -> Law:
        """Return the law with these parameters."""


class Uniform(LawEntry):
    """Equal density between `low` and `high`."""

    examples: ClassVar[Examples] = ({"low": 0.09, "high": 0.1},)

    in_variable_units = ("low", "high")
    low: Number
    """Smallest value. [variable]"""
    high: Number
    """Largest value. [variable]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_order(low=self.low, high=self.high)
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.uniform(self.low, self.high - self.low)


class Normal(LawEntry):
    """The normal law of mean `mean` and standard deviation `std`."""

    examples: ClassVar[Examples] = ({"mean": 11500, "std": 200},)

    in_variable_units = ("mean", "std")
    mean: Number
    """Mean. [variable]"""
    std: Positive
    """Standard deviation. [variable]"""

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.norm(self.mean, self.std)


class TruncatedNormal(LawEntry):
    """A normal law cut at `low` and `high`, or at one of them.

    `mean` and `std` are those of the law before the cut.
    """

    examples: ClassVar[Examples] = ({"mean": 0.1, "std": 0.002, "low": 0.09, "high": 0.11},)

    in_variable_units = ("mean", "std", "low", "high")
    mean: Number
    """Mean before the cut. [variable]"""
    std: Positive
    """Standard deviation before the cut. [variable]"""
    low: Number | None = None
    """Smallest value; no cut below if left out. [variable]"""
    high: Number | None = None
    """Largest value; no cut above if left out. [variable]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.low is not None and self.high is not None:
            _require_order(low=self.low, high=self.high)
        elif self.low is None and self.high is None:
            raise ValueError("found neither low nor high, expected at least one of them")
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        low = -math.inf if self.low is None else (self.low - self.mean) / self.std
        high = math.inf if self.high is None else (self.high - self.mean) / self.std
        return stats.truncnorm(low, high, loc=self.mean, scale=self.std)


class Lognormal(LawEntry):
    """`shift` plus a variable whose logarithm is normal; `mean` and `std` are that variable's own."""

    examples: ClassVar[Examples] = ({"mean": 2.0, "std": 0.4, "shift": 1.0},)

    in_variable_units = ("mean", "std", "shift")
    mean: Positive
    """Mean of the variable less its shift. [variable]"""
    std: Positive
    """Standard deviation. [variable]"""
    shift: Number = 0.0
    """What is added to it. [variable]"""

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        variance_of_log = math.log1p((self.std / self.mean) ** 2)
        scale = self.mean * math.exp(-0.5 * variance_of_log)
        return stats.lognorm(math.sqrt(variance_of_log), loc=self.shift, scale=scale)


class Exponential(LawEntry):
    """``shift + φ``, or ``shift − φ`` where `reflected`; φ is exponential with mean `mean`.

    The paper's actuation A = 0.1 − φ is ``{mean: 0.001, shift: 0.1, reflected: true}``.
    """

    examples: ClassVar[Examples] = ({"mean": 0.001, "shift": 0.1, "reflected": True},)

    in_variable_units = ("mean", "shift")
    mean: Positive
    """Mean of the exponential part φ. [variable]"""
    shift: Number = 0.0
    """Value to which φ is added. [variable]"""
    reflected: bool = Field(default=False, strict=True)
    """Whether φ is subtracted instead."""

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        if self.reflected:
            return Reflected(stats.expon(scale=self.mean), self.shift)
        return stats.expon(loc=self.shift, scale=self.mean)


class Beta(LawEntry):
    """The beta law of shapes `a` and `b`, stretched over the interval from `low` to `high`."""

    examples: ClassVar[Examples] = ({"a": 2, "b": 5, "low": 0.0, "high": 0.1},)

    in_variable_units = ("low", "high")
    a: Positive
    """First shape. [1]"""
    b: Positive
    """Second shape. [1]"""
    low: Number = 0.0
    """Smallest value. [variable]"""
    high: Number = 1.0
    """Largest value. [variable]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_order(low=self.low, high=self.high)
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.beta(self.a, self.b, loc=self.low, scale=self.high - self.low)


class Weibull(LawEntry):
    """`shift` plus a Weibull variable of `shape` and `scale` (its 63.2 % quantile)."""

    examples: ClassVar[Examples] = ({"shape": 1.5, "scale": 2.0, "shift": 0.5},)

    in_variable_units = ("scale", "shift")
    shape: Positive
    """Shape. [1]"""
    scale: Positive
    """Scale, the 63.2 % quantile less the shift. [variable]"""
    shift: Number = 0.0
    """Smallest value. [variable]"""

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.weibull_min(self.shape, loc=self.shift, scale=self.scale)


class Triangular(LawEntry):
    """Density rising linearly from `low` to `mode` and falling to `high`."""

    examples: ClassVar[Examples] = ({"low": 0.08, "mode": 0.1, "high": 0.11},)

    in_variable_units = ("low", "mode", "high")
    low: Number
    """Smallest value. [variable]"""
    mode: Number
    """Most likely value. [variable]"""
    high: Number
    """Largest value. [variable]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _require_order(low=self.low, high=self.high)
        if not self.low <= self.mode <= self.high:
            raise ValueError(f"found the mode {self.mode}, expected one from {self.low} to {self.high}")
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        width = self.high - self.low
        return stats.triang((self.mode - self.low) / width, loc=self.low, scale=width)


class Discrete(LawEntry):
    """Finitely many `values`, equally likely or with `probabilities` that sum to 1."""

    examples: ClassVar[Examples] = ({"values": [0.0, 0.05, 0.1], "probabilities": [0.2, 0.3, 0.5]},)

    in_variable_units = ("values",)
    values: tuple[Number, ...] = Field(min_length=1)
    """Values that it can have, each another. [variable]"""
    probabilities: tuple[Positive, ...] | None = None
    """Their probabilities, which sum to 1; equal ones if left out. [1]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(set(self.values)) < len(self.values):
            raise ValueError("found a value twice, expected different values")
        if self.probabilities is not None:
            if len(self.probabilities) != len(self.values):
                raise ValueError(
                    f"found {len(self.probabilities)} probabilities for {len(self.values)} values"
                )
            if not math.isclose(math.fsum(self.probabilities), 1.0, abs_tol=1e-6):
                raise ValueError(
                    f"found a sum of probabilities of {math.fsum(self.probabilities)}, expected 1"
                )
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        return DiscreteLaw(self.values, self.probabilities or np.ones(len(self.values)))


class Empirical(LawEntry):
    """Measurements: `values`, or the column `column` (the only one if left out) of a CSV `file`.

    With the method ``data`` quantiles are interpolated between the sorted measurements, so nothing
    lies beyond the extremes; ``kde`` smooths them by a Gaussian kernel of standard deviation
    `bandwidth` (Scott's rule if left out).
    """

    examples: ClassVar[Examples] = (
        {"values": [1.1, 1.3, 1.2, 1.6], "method": "kde", "bandwidth": 0.1},
        {"file": "measured.csv", "column": "A14"},
    )

    in_variable_units = ("values", "bandwidth")
    values: tuple[Number, ...] | None = None
    """Measured values, at least two different ones. [variable]"""
    file: str | None = None
    """CSV file with the measured values, in place of `values`."""
    column: str | None = None
    """Column of the file; the only one if left out."""
    method: Literal["data", "kde"] = "data"
    """`data` interpolates between the sorted measurements, `kde` smooths them by a Gaussian kernel."""
    bandwidth: Positive | None = None
    """Standard deviation of the kernel; Scott's rule if left out. [variable]"""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.values is None) == (self.file is None):
            raise ValueError("expected either values or a file")
        if self.values is not None and len(set(self.values)) < 2:
            raise ValueError("expected at least two different measurements")
        if self.bandwidth is not None and self.method != "kde":
            raise ValueError("found a bandwidth, which only the method 'kde' takes")
        return self

    def law(self) -> Law:
        """Return the law with these parameters."""
        values = np.asarray(self.values, dtype=np.float64)
        return KernelDensity(values, self.bandwidth) if self.method == "kde" else MeasuredLaw(values)


class DistributionEntry(OneOf):
    """A distribution as a study file writes it: one law and its parameters."""

    examples: ClassVar[Examples] = (
        {"uniform": {"low": 0.09, "high": 0.1}},
        {"normal": [11500, 200]},
        {"truncated_normal": {"mean": 0.1, "std": 0.002, "high": 0.1}},
        {"lognormal": [2, 0.4]},
        {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
        {"beta": [2, 5]},
        {"weibull": [1.5, 2]},
        {"triangular": [0.08, 0.1, 0.11]},
        {"discrete": {"values": [0, 0.1]}},
        {"empirical": {"values": [1.1, 1.3, 1.2]}},
    )

    uniform: Uniform | None = None
    """Equal density between two values."""
    normal: Normal | None = None
    """Normal law."""
    truncated_normal: TruncatedNormal | None = None
    """Normal law that is cut on one side or both."""
    lognormal: Lognormal | None = None
    """Law of a variable whose logarithm is normal."""
    exponential: Exponential | None = None
    """Exponential law, shifted and perhaps reflected."""
    beta: Beta | None = None
    """Beta law on an interval."""
    weibull: Weibull | None = None
    """Weibull law."""
    triangular: Triangular | None = None
    """Triangular law."""
    discrete: Discrete | None = None
    """Finitely many values."""
    empirical: Empirical | None = None
    """Law of measurements."""


LAWS: dict[str, type[LawEntry]] = {
    "uniform": Uniform,
    "normal": Normal,
    "truncated_normal": TruncatedNormal,
    "lognormal": Lognormal,
    "exponential": Exponential,
    "beta": Beta,
    "weibull": Weibull,
    "triangular": Triangular,
    "discrete": Discrete,
    "empirical": Empirical,
}


def _require_order(*, low: float, high: float) -> None:
    if not low < high:
        raise ValueError(f"found low {low} and high {high}, expected low < high")
