"""Confidence intervals of statistics, for two kinds of sample.

Independent (Monte-Carlo) samples use the classical ones: Student's t for the mean, the fourth moment for the
standard deviation, order statistics for quantiles (free of any assumption on the distribution), Clopper and
Pearson for a probability.

Quasi-random samples are not independent of each other. They come in independently randomised replicates, and
the spread of an unbiased statistic over the replicates gives its Student interval (Owen, *Monte Carlo theory,
methods and examples*, ch. 17). Means and shares are unbiased in every replicate, however few points it has;
standard deviations and quantiles are not, so their intervals are drawn from those of a mean of squares and of
a share.

Every function takes the pooled sketch of all samples and the sketches of the replicates, one for independent
samples.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.results import Estimate
from tensegra.analysis.sketch import Sketch
from tensegra.errors import StudyError

Array = NDArray[np.float64]


def mean(pooled: Sketch, replicates: Sequence[Sketch], confidence: float) -> Estimate:
    """Estimate the mean."""
    if pooled.count == 0:
        return Estimate(np.nan)
    if len(replicates) > 1:
        means = np.array([sketch.mean for sketch in replicates if sketch.count])
        return _about(pooled.mean, _half_width(means, confidence))
    error = np.sqrt(pooled.variance() / pooled.count)
    return _about(pooled.mean, _student(pooled.count - 1, confidence) * error)


def deviation(pooled: Sketch, replicates: Sequence[Sketch], confidence: float) -> Estimate:
    """Estimate the standard deviation of any distribution that has a fourth moment.

    Var(s²) = (μ₄ − σ⁴ (n − 3)/(n − 1)) / n for independent samples. The interval is taken on the logarithm of
    s², where s² is closest to normal and the lower end never negative.
    """
    from scipy.special import ndtri

    n, variance = pooled.count, pooled.variance()
    std = float(np.sqrt(variance))
    if variance == 0.0:
        return Estimate(std, std, std)
    if n < 4:
        return Estimate(std)
    if len(replicates) > 1:
        squares = [s.powers[0] / s.count + (s.mean - pooled.mean) ** 2 for s in replicates if s.count]
        relative = _half_width(np.array(squares), confidence) / variance
    else:
        excess = float(pooled.powers[2]) / n / variance**2 - (n - 3) / (n - 1)
        relative = ndtri(0.5 + confidence / 2) * np.sqrt(max(excess, 0.0) / n)
    factor = float(np.exp(0.5 * relative))
    return Estimate(std, std / factor, std * factor)


def quantile(pooled: Sketch, replicates: Sequence[Sketch], probability: float, confidence: float) -> Estimate:
    """Estimate a quantile between order statistics.

    For independent samples P(X₍l₎ ≤ q ≤ X₍u₎) ≥ confidence whatever the distribution, with l and u from the
    binomial law. For replicates l and u come from the interval of the share of samples below q (Woodruff
    1952).

    Raises
    ------
    StudyError
        If `probability` is not between 0 and 1.
    """
    from scipy.stats import binom

    if not 0.0 <= probability <= 1.0:
        raise StudyError.at("quantile", probability, "a probability between 0 and 1")
    value, n, tail = pooled.quantile(probability), pooled.count, (1.0 - confidence) / 2
    if n < 2:
        return Estimate(value)
    if len(replicates) > 1:
        half = _half_width(_shares_above(replicates, value), confidence)
        if np.isnan(half):
            return Estimate(value)
        lower, upper = int(np.floor(n * (probability - half))), int(np.ceil(n * (probability + half))) + 1
    else:
        lower, upper = int(binom.ppf(tail, n, probability)), int(binom.ppf(1.0 - tail, n, probability)) + 1
    low = pooled.order_statistic(lower)[0] if lower >= 1 else np.nan
    high = pooled.order_statistic(upper)[1] if upper <= n else np.nan
    return Estimate(value, low, high)


def exceedance(pooled: Sketch, replicates: Sequence[Sketch], limit: float, confidence: float) -> Estimate:
    """Estimate the probability of a value above `limit`."""
    n = pooled.count
    if n == 0:
        return Estimate(np.nan)
    least, most = pooled.count_above(limit)
    value = 0.5 * (least + most) / n
    if len(replicates) > 1:
        shares = _shares_above(replicates, limit)
        if np.ptp(shares) > 0.0:
            half = _half_width(shares, confidence)
            return Estimate(value, max(value - half, 0.0), min(value + half, 1.0))
    # Replicates that all agree (a rare event that none saw) say nothing about their spread: the interval of
    # independent samples is the careful answer.
    return Estimate(value, *_clopper_pearson(least, most, n, confidence))


def worst_case(
    estimate: Estimate, pooled: Sketch, n_failed: int, limit: float, confidence: float
) -> Estimate:
    """Widen an exceedance to hold whatever failed runs may have done: none of them exceeds, or all do."""
    if n_failed == 0:
        return estimate
    least, most = pooled.count_above(limit)
    n = pooled.count + n_failed
    return Estimate(estimate.value, *_clopper_pearson(least, most + n_failed, n, confidence))


def _clopper_pearson(least: int, most: int, n: int, confidence: float) -> tuple[float, float]:
    """Return the exact interval of a probability that was met between `least` and `most` times in n."""
    from scipy.stats import beta

    tail = (1.0 - confidence) / 2
    low = float(beta.ppf(tail, least, n - least + 1)) if least else 0.0
    high = float(beta.ppf(1.0 - tail, most + 1, n - most)) if most < n else 1.0
    return low, high


def _shares_above(replicates: Sequence[Sketch], limit: float) -> Array:
    return np.array([np.mean(s.count_above(limit)) / s.count for s in replicates if s.count])


def _student(freedom: int, confidence: float) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + confidence / 2)) if freedom > 0 else np.nan


def _half_width(samples: Array, confidence: float) -> float:
    """Return the half-width of the Student interval of the mean of independent `samples` (n,)."""
    if samples.size < 2:
        return np.nan
    return float(_student(samples.size - 1, confidence) * samples.std(ddof=1) / np.sqrt(samples.size))


def _about(value: float, half: float) -> Estimate:
    return Estimate(value, float(value - half), float(value + half))
