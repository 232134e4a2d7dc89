"""The laws that a study file may write, and their parameters.

A plain list stands for the first parameters in order: ``{uniform: [0.09, 0.10]}`` is
``{uniform: {low: 0.09, high: 0.10}}``.
"""

import math
from abc import abstractmethod
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from tensegra.study.entry import Entry, Number, OneOf, Positive
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

    in_variable_units = ("low", "high")
    low: Number
    high: Number

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

    in_variable_units = ("mean", "std")
    mean: Number
    std: Positive

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.norm(self.mean, self.std)


class TruncatedNormal(LawEntry):
    """A normal law cut at `low` and `high`, or at one of them.

    `mean` and `std` are those of the law before the cut.
    """

    in_variable_units = ("mean", "std", "low", "high")
    mean: Number
    std: Positive
    low: Number | None = None
    high: Number | None = None

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

    in_variable_units = ("mean", "std", "shift")
    mean: Positive
    std: Positive
    shift: Number = 0.0

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

    in_variable_units = ("mean", "shift")
    mean: Positive
    shift: Number = 0.0
    reflected: bool = Field(default=False, strict=True)

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        if self.reflected:
            return Reflected(stats.expon(scale=self.mean), self.shift)
        return stats.expon(loc=self.shift, scale=self.mean)


class Beta(LawEntry):
    """The beta law of shapes `a` and `b`, stretched over the interval from `low` to `high`."""

    in_variable_units = ("low", "high")
    a: Positive
    b: Positive
    low: Number = 0.0
    high: Number = 1.0

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

    in_variable_units = ("scale", "shift")
    shape: Positive
    scale: Positive
    shift: Number = 0.0

    def law(self) -> Law:
        """Return the law with these parameters."""
        from scipy import stats

        return stats.weibull_min(self.shape, loc=self.shift, scale=self.scale)


class Triangular(LawEntry):
    """Density rising linearly from `low` to `mode` and falling to `high`."""

    in_variable_units = ("low", "mode", "high")
    low: Number
    mode: Number
    high: Number

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

    in_variable_units = ("values",)
    values: tuple[Number, ...] = Field(min_length=1)
    probabilities: tuple[Positive, ...] | None = None

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

    in_variable_units = ("values", "bandwidth")
    values: tuple[Number, ...] | None = None
    file: str | None = None
    column: str | None = None
    method: Literal["data", "kde"] = "data"
    bandwidth: Positive | None = None

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

    uniform: Uniform | None = None
    normal: Normal | None = None
    truncated_normal: TruncatedNormal | None = None
    lognormal: Lognormal | None = None
    exponential: Exponential | None = None
    beta: Beta | None = None
    weibull: Weibull | None = None
    triangular: Triangular | None = None
    discrete: Discrete | None = None
    empirical: Empirical | None = None


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
