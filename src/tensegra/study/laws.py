"""Probability laws that SciPy does not have ready: reflected, discrete, and those of measurements."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.study.quadrature import merged

__all__ = ["DiscreteLaw", "KernelDensity", "Law", "MeasuredLaw", "Reflected"]

Array: TypeAlias = NDArray[np.float64]

CHUNK = 2_000_000
"""Numbers of an intermediate table (points by measurements) held at a time: 16 MB."""

MOST_POINTS = 100_000
"""Points that may stand for a law of measurements: with very many, each interval or kernel needs few."""


class Law(Protocol):
    """What a distribution is made of; a frozen distribution of `scipy.stats` is one."""

    def ppf(self, q: Array, /) -> Array:
        """Return the quantiles at the probabilities `q`."""
        ...

    def isf(self, q: Array, /) -> Array:
        """Return the values that are exceeded with the probabilities `q`, exact in the upper tail."""
        ...

    def cdf(self, x: Array, /) -> Array:
        """Return the probabilities of values up to `x`."""
        ...

    def pdf(self, x: Array, /) -> Array:
        """Return the density at `x`."""
        ...

    def mean(self) -> float:
        """Return the mean."""
        ...

    def std(self) -> float:
        """Return the standard deviation."""
        ...

    def support(self) -> tuple[float, float]:
        """Return the ends of the support, infinite where it has none."""
        ...


class _ContinuousLaw(Law, Protocol):
    """A law that also knows the probability of larger values, exact in the far tail."""

    def sf(self, x: Array, /) -> Array: ...


@dataclass(frozen=True)
class Reflected:
    """The law of ``shift − φ``, where φ follows `law`."""

    law: _ContinuousLaw
    shift: float

    def ppf(self, q: Array) -> Array:
        """Return the quantiles at the probabilities `q`."""
        return self.shift - self.law.isf(q)

    def isf(self, q: Array) -> Array:
        """Return the values that are exceeded with the probabilities `q`."""
        return self.shift - self.law.ppf(q)

    def cdf(self, x: Array) -> Array:
        """Return the probabilities of values up to `x`."""
        return self.law.sf(self.shift - x)

    def pdf(self, x: Array) -> Array:
        """Return the density at `x`."""
        return self.law.pdf(self.shift - x)

    def mean(self) -> float:
        """Return the mean."""
        return self.shift - self.law.mean()

    def std(self) -> float:
        """Return the standard deviation."""
        return self.law.std()

    def support(self) -> tuple[float, float]:
        """Return the ends of the support, infinite where it has none."""
        low, high = self.law.support()
        return self.shift - high, self.shift - low


class DiscreteLaw:
    """Finitely many values with their probabilities; `pdf` is the probability of a value.

    Parameters
    ----------
    values, probabilities
        Shape (n,) each; the values are all different, the probabilities positive.
    """

    def __init__(self, values: ArrayLike, probabilities: ArrayLike) -> None:
        values = np.asarray(values, dtype=np.float64)
        order = np.argsort(values)
        weights = np.asarray(probabilities, dtype=np.float64)[order]
        self.values = values[order]
        self.probabilities = weights / weights.sum()
        self._cumulative = np.cumsum(self.probabilities)
        self._cumulative[-1] = 1.0

    def ppf(self, q: Array) -> Array:
        """Return the quantiles at the probabilities `q`."""
        index = np.searchsorted(self._cumulative, q, side="left").clip(max=len(self.values) - 1)
        return np.asarray(self.values[index])

    def isf(self, q: Array) -> Array:
        """Return the values that are exceeded with the probabilities `q`."""
        return self.ppf(1.0 - q)

    def quadrature(self, order: int) -> tuple[Array, Array]:  # noqa: ARG002 - exact to any order
        """Return the values and their probabilities: every expectation is a sum over them."""
        return self.values, self.probabilities

    def cdf(self, x: Array) -> Array:
        """Return the probabilities of values up to `x`."""
        below = np.searchsorted(self.values, x, side="right")
        return np.asarray(np.concatenate([[0.0], self._cumulative])[below])

    def pdf(self, x: Array) -> Array:
        """Return the probability of the value `x`."""
        index = np.searchsorted(self.values, x).clip(max=len(self.values) - 1)
        return np.where(self.values[index] == x, self.probabilities[index], 0.0)

    def mean(self) -> float:
        """Return the mean."""
        return float(self.probabilities @ self.values)

    def std(self) -> float:
        """Return the standard deviation."""
        return float(np.sqrt(self.probabilities @ (self.values - self.mean()) ** 2))

    def support(self) -> tuple[float, float]:
        """Return the smallest and the largest value."""
        return float(self.values[0]), float(self.values[-1])


class MeasuredLaw:
    """The law of measurements as they are: quantiles interpolated between the sorted values.

    The k-th of n sorted values is the quantile at (k − 1)/(n − 1), which is definition 7 of Hyndman
    and Fan, *The American Statistician* 50 (1996) 361-365, and NumPy's default.

    Parameters
    ----------
    values
        At least two different numbers, shape (n,).
    """

    def __init__(self, values: ArrayLike) -> None:
        self.values = np.sort(np.asarray(values, dtype=np.float64))
        self._level = np.arange(len(self.values)) / (len(self.values) - 1)

    def ppf(self, q: Array) -> Array:
        """Return the quantiles at the probabilities `q`."""
        return np.interp(q, self._level, self.values)

    def isf(self, q: Array) -> Array:
        """Return the values that are exceeded with the probabilities `q`."""
        return self.ppf(1.0 - q)

    def quadrature(self, order: int) -> tuple[Array, Array]:
        """Return points and probabilities exact for polynomials to degree 2 · `order` − 1.

        Between two neighbouring values the law is uniform, so Gauss points stand for it there; values that
        were measured several times are atoms.
        """
        gaps = len(self.values) - 1
        node, weight = np.polynomial.legendre.leggauss(max(2, min(order, MOST_POINTS // gaps)))
        step = np.diff(self.values)
        wide = step > 0
        inside = self.values[:-1, None] + step[:, None] * (0.5 + 0.5 * node)
        points = np.concatenate([inside[wide].ravel(), self.values[:-1][~wide]])
        between = np.tile(weight / (2 * gaps), int(wide.sum()))
        return merged(points, np.concatenate([between, np.full(int((~wide).sum()), 1 / gaps)]))

    def cdf(self, x: Array) -> Array:
        """Return the probabilities of values up to `x`."""
        left, step, rise = self._interval(x)
        inside = self._level[left] + (x - self.values[left]) / step * rise
        return np.where(x < self.values[0], 0.0, np.where(x >= self.values[-1], 1.0, inside))

    def pdf(self, x: Array) -> Array:
        """Return the density at `x`: constant between two neighbouring values."""
        _, step, rise = self._interval(x)
        return np.where((x < self.values[0]) | (x > self.values[-1]), 0.0, rise / step)

    def _interval(self, x: Array) -> tuple[NDArray[np.intp], Array, Array]:
        """Return the value to the left of `x`, the way to the next different one, the probability between."""
        last_step = np.searchsorted(self.values, self.values[-1], side="left") - 1
        left = (np.searchsorted(self.values, x, side="right") - 1).clip(0, last_step)
        return left, self.values[left + 1] - self.values[left], self._level[left + 1] - self._level[left]

    def mean(self) -> float:
        """Return the mean."""
        return float(np.mean((self.values[1:] + self.values[:-1]) / 2))

    def std(self) -> float:
        """Return the standard deviation."""
        a, b = self.values[:-1] - self.mean(), self.values[1:] - self.mean()
        return float(np.sqrt(np.mean((a * a + a * b + b * b) / 3)))

    def support(self) -> tuple[float, float]:
        """Return the smallest and the largest value."""
        return float(self.values[0]), float(self.values[-1])


class KernelDensity:
    """The law of measurements, smoothed by a Gaussian kernel.

    Parameters
    ----------
    values
        At least two different numbers, shape (n,).
    bandwidth
        Standard deviation of the kernel; Scott's rule, std · n^(−1/5), where it is None.
    """

    def __init__(self, values: ArrayLike, bandwidth: float | None = None) -> None:
        self.values = np.sort(np.asarray(values, dtype=np.float64))
        scott = float(np.std(self.values, ddof=1)) * len(self.values) ** -0.2
        self.bandwidth = scott if bandwidth is None else bandwidth

    def ppf(self, q: Array) -> Array:
        """Return the quantiles at the probabilities `q`."""
        from scipy.optimize import elementwise
        from scipy.special import ndtri

        level = q.ravel()
        result = np.where(level <= 0.0, -np.inf, np.inf)
        inside = (level > 0.0) & (level < 1.0)
        if inside.any():
            # A mixture's quantile lies between the least and the greatest quantile of its kernels.
            offset = self.bandwidth * ndtri(level[inside])
            bracket = (self.values[0] + offset - self.bandwidth, self.values[-1] + offset + self.bandwidth)
            solution = elementwise.find_root(self._excess, bracket, args=(level[inside],))
            result[inside] = solution.x
        return result.reshape(q.shape)

    def isf(self, q: Array) -> Array:
        """Return the values that are exceeded with the probabilities `q`: the kernel has no sides."""
        return -KernelDensity(-self.values, self.bandwidth).ppf(q)

    def quadrature(self, order: int) -> tuple[Array, Array]:
        """Return points and probabilities exact for polynomials to degree 2 · `order` − 1.

        They are the Gauss points of each kernel.
        """
        n = len(self.values)
        node, weight = np.polynomial.hermite_e.hermegauss(max(2, min(order, MOST_POINTS // n)))
        points = self.values[:, None] + self.bandwidth * node
        return merged(points.ravel(), np.tile(weight / (n * weight.sum()), n))

    def cdf(self, x: Array) -> Array:
        """Return the probabilities of values up to `x`."""
        from scipy.special import ndtr

        return self._mean_over_kernels(ndtr, x)

    def pdf(self, x: Array) -> Array:
        """Return the density at `x`."""
        return self._mean_over_kernels(_gauss, x) / self.bandwidth

    def _excess(self, x: Array, probability: Array) -> Array:
        return self.cdf(x) - probability

    def _mean_over_kernels(self, function: Callable[[Array], Array], x: Array) -> Array:
        points = x.ravel()
        rows = max(1, CHUNK // len(self.values))
        parts = [
            function((points[i : i + rows, None] - self.values) / self.bandwidth).mean(axis=1)
            for i in range(0, len(points), rows)
        ]
        return np.concatenate([*parts, np.empty(0)]).reshape(x.shape)

    def mean(self) -> float:
        """Return the mean."""
        return float(self.values.mean())

    def std(self) -> float:
        """Return the standard deviation."""
        return float(np.hypot(self.values.std(), self.bandwidth))

    def support(self) -> tuple[float, float]:
        """Return the ends of the support: there are none."""
        return -np.inf, np.inf


def _gauss(z: Array) -> Array:
    density: Array = np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)
    return density
