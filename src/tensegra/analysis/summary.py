"""The statistics of one quantity, each with its confidence interval, its histogram and its density."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.intervals import deviation, exceedance, mean, quantile, worst_case
from tensegra.analysis.results import Estimate, plain
from tensegra.analysis.sketch import Sketch

Array = NDArray[np.float64]

# Bars of a histogram: enough to show a shape, few enough to be told apart on a page.
MIN_BARS, MAX_BARS = 10, 80
N_DENSITY = 256


@dataclass(frozen=True)
class Histogram:
    """Counts (n,) between edges (n + 1,)."""

    edges: Array
    counts: NDArray[np.int64]


@dataclass(frozen=True)
class Density:
    """A Gaussian kernel density estimate: its values on a grid, and its bandwidth (Silverman's rule)."""

    grid: Array
    values: Array
    bandwidth: float


@dataclass(frozen=True)
class Summary:
    """What the samples say about one quantity.

    Attributes
    ----------
    name, unit
        The quantity.
    n
        Number of valid samples.
    mean, std, q25, q50, q75
        Estimates with intervals at the level `confidence`.
    minimum, maximum
        The sample's extremes. They have no interval without an assumption; what can be said is
    beyond
        with that confidence, less than this share of the distribution lies above the maximum (and, likewise,
        below the minimum): 1 − (1 − confidence)^(1/n), Wilks 1941. It supposes independent samples.
    histogram, density
        Data for the figure.
    """

    name: str
    unit: str
    n: int
    confidence: float
    mean: Estimate
    std: Estimate
    minimum: float
    maximum: float
    q25: Estimate
    q50: Estimate
    q75: Estimate
    beyond: float
    histogram: Histogram
    density: Density
    _replicates: tuple[Sketch, ...] = field(repr=False, compare=False)
    _pooled: Sketch = field(repr=False, compare=False)

    def quantile(self, probability: float) -> Estimate:
        """Return any quantile with its interval.

        Raises
        ------
        StudyError
            If `probability` is not between 0 and 1.
        """
        return quantile(self._pooled, self._replicates, probability, self.confidence)

    def exceedance(self, limit: float) -> Estimate:
        """Return the probability of a value above `limit`, with its interval."""
        return exceedance(self._pooled, self._replicates, limit, self.confidence)

    def worst_case_exceedance(self, limit: float, n_failed: int) -> Estimate:
        """Return the same with an interval that holds whatever `n_failed` further samples may have done."""
        return worst_case(self.exceedance(limit), self._pooled, n_failed, limit, self.confidence)

    def share_above(self, limit: float) -> float:
        """Return the share of the samples above `limit`, without an interval."""
        return float(np.mean(self._pooled.count_above(limit))) / self.n if self.n else float("nan")

    def value_at(self, probability: float) -> float:
        """Return a quantile without an interval."""
        return self._pooled.quantile(probability)

    def rows(self) -> dict[str, Estimate]:
        """Return the paper's statistics (its Table 2) in its order."""
        return {
            "mean": self.mean,
            "std": self.std,
            "min": Estimate(self.minimum),
            "max": Estimate(self.maximum),
            "q25": self.q25,
            "q50": self.q50,
            "q75": self.q75,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content: dict[str, Any] = {
            "name": self.name,
            "unit": self.unit,
            "n": self.n,
            "confidence": self.confidence,
        }
        content |= {"statistics": self.rows(), "beyond": self.beyond}
        content |= {"histogram": vars(self.histogram), "density": vars(self.density)}
        return dict(plain(content))


def summarise(
    name: str, replicates: Sequence[Sketch], *, confidence: float = 0.95, unit: str = ""
) -> Summary:
    """Summarise the samples of one quantity.

    Parameters
    ----------
    name, unit
        The quantity.
    replicates
        One sketch of independent samples, or several of independently randomised quasi-random samples.
    confidence
        Level of all intervals.
    """
    pooled = replicates[0]
    if len(replicates) > 1:
        pooled = Sketch(replicates[0].exact_limit, replicates[0].n_bins)
        for replicate in replicates:
            pooled.merge(replicate)
    several = tuple(replicates)
    q25, q50, q75 = (quantile(pooled, several, p, confidence) for p in (0.25, 0.5, 0.75))
    nothing = pooled.count == 0
    return Summary(
        name=name,
        unit=unit,
        n=pooled.count,
        confidence=confidence,
        mean=mean(pooled, several, confidence),
        std=deviation(pooled, several, confidence),
        minimum=np.nan if nothing else pooled.minimum,
        maximum=np.nan if nothing else pooled.maximum,
        q25=q25,
        q50=q50,
        q75=q75,
        beyond=1.0 if nothing else float(-np.expm1(np.log1p(-confidence) / pooled.count)),
        histogram=_histogram(pooled, q75.value - q25.value),
        density=_density(pooled, q75.value - q25.value),
        _replicates=several,
        _pooled=pooled,
    )


def _histogram(pooled: Sketch, quartile_range: float) -> Histogram:
    """Bars by the rule of Freedman and Diaconis, within reason."""
    width = 2.0 * quartile_range * max(pooled.count, 1) ** (-1 / 3)
    wanted = (pooled.maximum - pooled.minimum) / width if pooled.count > 1 and width > 0 else MIN_BARS
    counts, edges = pooled.histogram(int(np.clip(wanted, MIN_BARS, MAX_BARS)))
    return Histogram(edges, counts)


def _density(pooled: Sketch, quartile_range: float) -> Density:
    """Gaussian kernel density of finely binned samples, the bins 20 times finer than the kernel."""
    std = np.sqrt(pooled.variance())
    if pooled.count < 2 or not std > 0.0:
        return Density(np.zeros(0), np.zeros(0), 0.0)
    scale = min(std, quartile_range / 1.349) if quartile_range > 0 else std
    bandwidth = float(0.9 * scale * pooled.count ** (-1 / 5))
    grid = np.linspace(pooled.minimum - 3 * bandwidth, pooled.maximum + 3 * bandwidth, N_DENSITY)
    fine = int(np.clip(20 * (pooled.maximum - pooled.minimum) / bandwidth, 200, 20_000))
    counts, edges = pooled.histogram(fine)
    centres, weight = 0.5 * (edges[1:] + edges[:-1]), counts / (pooled.count * bandwidth * np.sqrt(2 * np.pi))
    # What lies 8 bandwidths off adds less than 1e-14 of its weight.
    ends = np.searchsorted(centres, [grid - 8.0 * bandwidth, grid + 8.0 * bandwidth]).T
    values = np.array(
        [
            weight[first:last] @ np.exp(-0.5 * ((point - centres[first:last]) / bandwidth) ** 2)
            for point, (first, last) in zip(grid, ends.tolist(), strict=True)
        ]
    )
    return Density(grid, values, bandwidth)
