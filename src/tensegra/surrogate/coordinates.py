"""Coordinates in which the laws of the inputs are tame.

A lognormal input of a large spread has most of its runs in a small corner of its box and a few far out; a
length scale that suits the one is wrong for the others. In its logarithm it is a normal law. Which inputs are
learnt in another coordinate their laws tell, or the runs where no law is known, and the surrogate's file
keeps it. The probability itself, F(x), is no such coordinate: its slope is zero wherever a density vanishes,
so that a smooth response is not smooth in it at the ends, and it has none at atoms.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.study.quadrature import law_quadrature
from tensegra.surrogate.problem import Problem

__all__ = ["LOG", "RAW", "TWO_SIDED", "Coordinates"]

Array: TypeAlias = NDArray[np.float64]
Weighted: TypeAlias = tuple[Array, Array]

RAW, LOG, TWO_SIDED = "raw", "log", "two-sided log"
SKEW = 1.5  # a lognormal law of 47 % has it; less does no harm as it is
KURTOSIS = 10.0  # a normal law has 3, an exponential one 9
TAMER = 0.5  # a coordinate has to halve what is wrong: log x of an exponential law is as lopsided as x
QUARTILE = 1.349  # distance of the quartiles of a normal law in standard deviations
_ARRAYS = ("origin", "size", "edge", "shift", "scale")


@dataclass(frozen=True, eq=False)
class Coordinates:
    """A monotone map of each standardised input, and the like for their slopes.

    Parameters
    ----------
    kinds
        ``"raw"`` (the input itself), ``"log"`` of its distance from `origin` on the side of `size`, or
        ``"two-sided log"``, arsinh((z − origin)/size), for each input.
    origin, size, edge
        Of these maps; nearer to the origin than `edge` the logarithm goes on as its tangent. Shape
        (n_inputs,) each.
    shift, scale
        Standardise the coordinate over the runs; zero and one where it is raw.
    """

    kinds: tuple[str, ...]
    origin: Array
    size: Array
    edge: Array
    shift: Array
    scale: Array

    @classmethod
    def raw(cls, n_inputs: int) -> Self:
        """Return the coordinates that are the inputs themselves."""
        zero, one = np.zeros(n_inputs), np.ones(n_inputs)
        return cls((RAW,) * n_inputs, zero, one, one, zero, one)

    @classmethod
    def of(cls, problem: Problem) -> "Coordinates":
        """Return coordinates in which the laws of a problem are tame; of its runs, where it has no laws."""
        d = problem.Z.shape[1]
        found = cls.raw(d)
        arrays = {name: getattr(found, name).copy() for name in _ARRAYS}
        kinds = list(found.kinds)
        X = problem.scaling.input_shift + problem.scaling.input_scale * problem.Z
        for j in range(d):
            if problem.distributions is None:
                points, weights = X[:, j], np.full(len(X), 1.0 / len(X))
                ends = (np.inf, np.inf)
            else:
                law = problem.distributions[j]
                points, weights = law_quadrature(law)
                ends = _support(law)
            kinds[j], origin, size = _tamest(points, weights, (*ends, 0.0), X[:, j])
            shift, scale = problem.scaling.input_shift[j], problem.scaling.input_scale[j]
            if kinds[j] == LOG:
                away = size * (np.append(X[:, j], problem.bounds[j]) - origin)
                arrays["edge"][j] = away[away > 0].min() / scale
            else:
                size = size / scale
            if kinds[j] != RAW:
                arrays["origin"][j], arrays["size"][j] = (origin - shift) / scale, size
        return _standardised(cls(tuple(kinds), **arrays), problem.Z)

    @property
    def all_raw(self) -> bool:
        """Whether the coordinates are the inputs themselves."""
        return all(kind == RAW for kind in self.kinds)

    def forward(self, Z: Array) -> Array:
        """Return the coordinates of standardised inputs, shape (n_points, n_inputs) both."""
        if self.all_raw:
            return Z
        W = np.array(Z)
        for j, kind in enumerate(self.kinds):
            if kind == LOG:
                away = self.size[j] * (Z[:, j] - self.origin[j])
                beyond = np.maximum(away, self.edge[j])
                W[:, j] = np.log(beyond) + (away - beyond) / self.edge[j]
            elif kind == TWO_SIDED:
                W[:, j] = np.arcsinh((Z[:, j] - self.origin[j]) / self.size[j])
        return (W - self.shift) / self.scale

    def slope(self, Z: Array) -> Array:
        """Return the derivatives of the coordinates by the inputs, shape (n_points, n_inputs)."""
        slope = np.ones_like(Z)
        for j, kind in enumerate(self.kinds):
            if kind == LOG:
                away = self.size[j] * (Z[:, j] - self.origin[j])
                slope[:, j] = self.size[j] / np.maximum(away, self.edge[j])
            elif kind == TWO_SIDED:
                slope[:, j] = 1.0 / np.hypot(self.size[j], Z[:, j] - self.origin[j])
        return slope / self.scale

    def problem(self, problem: Problem) -> Problem:
        """Return a problem with its points, and derivatives by the inputs, in these coordinates."""
        if self.all_raw:
            return problem
        dT = None if problem.dT is None else problem.dT / self.slope(problem.Z)[:, None]
        return replace(problem, Z=self.forward(problem.Z), dT=dT)

    def gradient(self, Z: Array, slope: Array) -> Array:
        """Return the derivatives by the inputs of what has the derivatives `slope` by the coordinates.

        Parameters
        ----------
        Z
            Standardised inputs, shape (n_points, n_inputs).
        slope
            Shape (n_points, n_outputs, n_inputs).
        """
        return slope if self.all_raw else slope * self.slope(Z)[:, None]

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays = {} if self.all_raw else {f"coordinate_{name}": getattr(self, name) for name in _ARRAYS}
        return arrays, {"coordinates": list(self.kinds)}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the coordinates that `state` was taken from."""
        kinds = tuple(settings["coordinates"])
        if all(kind == RAW for kind in kinds):
            return cls.raw(len(kinds))
        return cls(kinds, **{name: arrays[f"coordinate_{name}"] for name in _ARRAYS})


def _standardised(coordinates: Coordinates, Z: Array) -> Coordinates:
    """Return coordinates of zero mean and unit spread over some points where they are not raw."""
    W = coordinates.forward(Z)
    changed = np.array([kind != RAW for kind in coordinates.kinds]) & (np.ptp(W, axis=0) > 0)
    return replace(
        coordinates,
        shift=np.where(changed, W.mean(axis=0), 0.0),
        scale=np.where(changed, W.std(axis=0), 1.0),
    )


def _tamest(
    points: Array, weights: Array, origins: tuple[float, ...], runs: Array
) -> tuple[str, float, float]:
    """Return kind, origin and size of the coordinate in which a law is tame enough."""
    skew, kurtosis = _shape(points, weights)
    best, tamest = (RAW, 0.0, 1.0), np.inf
    if abs(skew) > SKEW:
        for origin in origins:
            side = float(np.sign(np.sum(weights * np.sign(points - origin))))
            if np.isfinite(origin) and np.all(side * (runs - origin) > 0):
                inside = side * (points - origin) > 0
                if weights[~inside].sum() > np.finfo(float).eps:
                    continue
                log = _shape(np.log(side * (points[inside] - origin)), weights[inside])[0]
                if abs(log) < min(TAMER * abs(skew), tamest):
                    best, tamest = (LOG, float(origin), side), abs(log)
    if best[0] == RAW and kurtosis > KURTOSIS:
        order = np.argsort(points)
        level = np.cumsum(weights[order])
        low, middle, high = np.interp([0.25, 0.5, 0.75], level, points[order])
        size = float(high - low) / QUARTILE
        if size > 0 and _shape(np.arcsinh((points - middle) / size), weights)[1] < TAMER * kurtosis:
            best = (TWO_SIDED, float(middle), size)
    return best


def _shape(points: Array, weights: Array) -> tuple[float, float]:
    """Return the skewness and the kurtosis of a law; zeros for one of a single value."""
    from_mean = points - weights @ points
    variance = weights @ from_mean**2
    if not variance > 0:
        return 0.0, 0.0
    z = from_mean / np.sqrt(variance)
    return float(weights @ z**3), float(weights @ z**4)


def _support(law: object) -> tuple[float, float]:
    """Return the ends of a law's support, infinite where they are not told."""
    support = getattr(law, "support", (-np.inf, np.inf))
    low, high = support() if callable(support) else support
    return float(low), float(high)
