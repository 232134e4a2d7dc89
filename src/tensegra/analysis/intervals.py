"""Confidence intervals of statistics, for two kinds of sample.

Independent (Monte-Carlo) samples: a mean's interval is Student's after Hall's transformation, which takes the
skewness out of the t-statistic (Hall 1992, *Journal of the Royal Statistical Society* B 54, 221-228). The
degrees of freedom are those of an estimated variance (Satterthwaite), so that heavy tails widen it. A
standard deviation is the root of a mean, that of the squared deviations. Quantiles lie between order
statistics, free of any assumption on the distribution; a probability has an exact interval.

Quasi-random samples are not independent of each other. They come in independently randomised replicates, and
the same interval is taken of the replicates' values (Owen, *Monte Carlo theory, methods and examples*, ch.
17). Their variance has the divisor n, for its error is far below 1/n. Where all replicates agree they still
do not know what they have not seen, and the interval keeps the width of that.

Value and interval are of one formula with one divisor. `benchmarks/coverage.py` measures how often they hold.

Every function takes the pooled sketch of all samples and the sketches of the replicates, one for independent
samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.results import Estimate
from tensegra.analysis.shares import replicated_interval, share_interval, unseen_share, wide_interval
from tensegra.analysis.sketch import Sketch
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Fewer values have no spread to speak of.
FEWEST_VALUES = 4
# A sequence that scatters this many times less than independent samples has gained on the tails, too.
LITTLE_GAIN = 3.0


def mean(pooled: Sketch, replicates: Sequence[Sketch], confidence: float) -> Estimate:
    """Estimate the mean."""
    if pooled.count == 0:
        return Estimate(np.nan)
    share = _share_of_two(pooled, replicates, confidence)
    if share is not None:
        width = pooled.maximum - pooled.minimum
        low, high = (pooled.minimum + width * end for end in (share.low, share.high))
        return Estimate(pooled.mean, low, high)
    if pooled.count < 2:
        return Estimate(pooled.mean)
    samples = _Moments(pooled.count, pooled.mean, *(pooled.powers / pooled.count).tolist())
    if len(replicates) > 1:
        means = np.array([sketch.mean for sketch in replicates if sketch.count])
        return Estimate(
            pooled.mean, *_over_replicates(means, samples, pooled.maximum - pooled.minimum, confidence)
        )
    return Estimate(pooled.mean, *samples.interval(confidence))


def deviation(pooled: Sketch, replicates: Sequence[Sketch], confidence: float) -> Estimate:
    """Estimate the standard deviation of any distribution that has a fourth moment."""
    n = pooled.count
    divisor = n if len(replicates) > 1 else n - 1
    if n < 2:
        return Estimate(np.nan)
    variance = float(pooled.powers[0]) / divisor
    std = float(np.sqrt(variance))
    if variance == 0.0:
        return Estimate(std, std, std)
    share = _share_of_two(pooled, replicates, confidence)
    if share is not None:
        return _of_two(std, share, pooled.maximum - pooled.minimum)
    if n < FEWEST_VALUES or not np.isfinite(variance):
        return Estimate(std)
    values, counts = pooled.values_and_counts()
    with np.errstate(over="ignore", invalid="ignore"):
        squares = (values - pooled.mean) ** 2 * (n / divisor)
        samples = _Moments(n, variance, *(float(counts @ (squares - variance) ** p) / n for p in (2, 3, 4)))
    if len(replicates) > 1:
        own = np.array([s.powers[0] / s.count + (s.mean - pooled.mean) ** 2 for s in replicates if s.count])
        low, high = _over_replicates(own, samples, float(squares.max()), confidence)
    else:
        low, high = samples.interval(confidence)
    return Estimate(std, float(np.sqrt(max(low, 0.0))), float(np.sqrt(high)))


def quantile(pooled: Sketch, replicates: Sequence[Sketch], probability: float, confidence: float) -> Estimate:
    """Estimate a quantile between order statistics.

    For independent samples P(X₍l₎ ≤ q ≤ X₍u₎) ≥ confidence whatever the distribution, with l and u from the
    binomial law. For replicates the interval holds every value at which the share of samples up to it has an
    interval that holds the probability. An end is infinite where no sample lies beyond.

    Raises
    ------
    StudyError
        If `probability` is not between 0 and 1.
    """
    if not 0.0 <= probability <= 1.0:
        raise StudyError.at("quantile", probability, "a probability between 0 and 1")
    value, n = pooled.quantile(probability), pooled.count
    if n < 2:
        return Estimate(value)
    if len(replicates) > 1:
        lower, upper = _inverted(pooled, replicates, probability, confidence)
    else:
        lower, upper = _ranks(n, probability, confidence)
    low = pooled.order_statistic(lower)[0] if lower >= 1 else -np.inf
    high = pooled.order_statistic(upper)[1] if upper <= n else np.inf
    return Estimate(value, low, high)


def exceedance(pooled: Sketch, replicates: Sequence[Sketch], limit: float, confidence: float) -> Estimate:
    """Estimate the probability of a value above `limit`."""
    n = pooled.count
    if n == 0:
        return Estimate(np.nan)
    least, most = pooled.count_above(limit)
    value = 0.5 * (least + most) / n
    if len(replicates) > 1:
        bracket = [_shares_above(replicates, limit, end) for end in (0, 1)]
        low, high = (
            replicated_interval(shares, _size(replicates), confidence)[i] for i, shares in enumerate(bracket)
        )
        return Estimate(value, low, high)
    return Estimate(value, *share_interval(least, most, n, confidence))


def worst_case(
    estimate: Estimate, pooled: Sketch, n_failed: int, limit: float, confidence: float
) -> Estimate:
    """Widen an exceedance to hold whatever failed runs may have done: none of them exceeds, or all do."""
    if n_failed == 0:
        return estimate
    least, most = pooled.count_above(limit)
    n = pooled.count + n_failed
    return Estimate(estimate.value, *share_interval(least, most + n_failed, n, confidence))


@dataclass(frozen=True)
class _Moments:
    """The number of some independent values, their mean, and their central moments."""

    n: int
    mean: float
    m2: float
    m3: float
    m4: float

    @classmethod
    def of(cls, values: Array) -> "_Moments":
        centre = float(values.mean())
        with np.errstate(over="ignore", invalid="ignore"):
            return cls(values.size, centre, *(float(((values - centre) ** p).mean()) for p in (2, 3, 4)))

    @property
    def variance_of_mean(self) -> float:
        return self.m2 / (self.n - 1)

    @property
    def skewness_of_mean(self) -> float:
        with np.errstate(over="ignore", invalid="ignore"):
            return float(self.m3 / np.float64(self.m2) ** 1.5 / np.sqrt(self.n))

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the variance: 2n/(κ − 1), two at least for κ ≤ n, and n − 1 at most."""
        with np.errstate(over="ignore", invalid="ignore"):
            kurtosis = float(self.m4 / np.float64(self.m2) ** 2)
        return min(self.n - 1.0, 2.0 * self.n / max(kurtosis - 1.0, 1e-12))

    def interval(
        self, confidence: float, *, skewness: float | None = None, freedom: float | None = None
    ) -> tuple[float, float]:
        """Return the interval of the mean, its skewness and the degrees of freedom their own unless given."""
        from scipy.special import stdtrit

        if not self.m2 > 0.0:
            return self.mean, self.mean
        a = self.skewness_of_mean if skewness is None else skewness
        freedom = self.freedom if freedom is None else freedom
        if not np.isfinite([a, freedom]).all():
            return np.nan, np.nan
        t = float(stdtrit(freedom, 0.5 + confidence / 2))
        error = float(np.sqrt(self.variance_of_mean))
        return self.mean - error * _unskewed(t, a), self.mean - error * _unskewed(-t, a)


def _unskewed(t: float, a: float) -> float:
    """Return the t-statistic whose transform t + a t²/3 + a² t³/27 + a/6 (Hall 1992) is `t`."""
    if abs(a) < 1e-8:
        return t
    return float(3.0 / a * (np.cbrt(1.0 + a * (t - a / 6.0)) - 1.0))


def _over_replicates(values: Array, samples: _Moments, span: float, confidence: float) -> tuple[float, float]:
    """Return the interval of what the replicates' means `values` are unbiased for.

    The scatter is that of the replicates. Their few values tell little of its shape: where the sequence gains
    little on independent samples, as it does in a heavy tail, the samples tell more. `span` is the range of
    one sample.
    """
    if values.size < 2:
        return np.nan, np.nan
    own = _Moments.of(values)
    if samples.m2 > 0.0 and np.ptp(values) <= 1e-12 * abs(own.mean):
        half = unseen_share(values.size, confidence) * span * values.size / samples.n
        return own.mean - half, own.mean + half
    if not own.m2 > 0.0:
        return own.interval(confidence)
    gain = float(np.sqrt(samples.variance_of_mean / own.variance_of_mean))
    skewness = samples.skewness_of_mean * gain if gain <= LITTLE_GAIN else own.skewness_of_mean
    return own.interval(confidence, skewness=skewness, freedom=min(own.freedom, samples.freedom))


def _share_of_two(pooled: Sketch, replicates: Sequence[Sketch], confidence: float) -> Estimate | None:
    """Return how often the larger value is met, where there are two values only; else None.

    The interval is a wide one: a sample that has not met the larger value at all knows of no interval, and
    the others have to make up for it.
    """
    if not pooled.maximum > pooled.minimum or pooled.resolution or pooled.count < FEWEST_VALUES:
        return None
    above = pooled.count_above(pooled.minimum)[0]
    if pooled.order_statistic(pooled.count - above + 1)[0] < pooled.maximum:
        return None
    share = above / pooled.count
    if len(replicates) > 1:
        shares = _shares_above(replicates, pooled.minimum, 0)
        return Estimate(share, *replicated_interval(shares, _size(replicates), confidence, wide=True))
    return Estimate(share, *wide_interval(above, pooled.count, confidence))


def _of_two(std: float, share: Estimate, width: float) -> Estimate:
    """Return the standard deviation of a quantity that takes two values, √(p(1 − p)) times their distance."""
    ends = [width * float(np.sqrt(p * (1.0 - p))) for p in (share.low, share.high)]
    top = 0.5 * width if share.low <= 0.5 <= share.high else max(ends)
    return Estimate(std, min(*ends, std), max(top, std))


def _ranks(n: int, probability: float, confidence: float) -> tuple[int, int]:
    """Return the ranks of the order statistics that hold a quantile, the likeliest numbers below it."""
    from scipy.stats import binom

    reach = 8.0 * np.sqrt(n * probability * (1.0 - probability)) + 20.0
    below = np.arange(max(int(n * probability - reach), 0), min(int(n * probability + reach) + 1, n) + 1)
    mass = binom.pmf(below, n, probability)
    # The masses rise to one peak and fall, so what is left without the least of them has no gap.
    rising = np.argsort(mass, kind="stable")
    left = mass.sum() - np.cumsum(mass[rising])
    kept = below[rising[min(np.count_nonzero(left >= confidence), below.size - 1) :]]
    return int(kept.min()), int(kept.max()) + 1


def _inverted(
    pooled: Sketch, replicates: Sequence[Sketch], probability: float, confidence: float
) -> tuple[int, int]:
    """Return the first ranks up to which the share of samples may, and must, exceed a probability."""
    size = _size(replicates)

    def interval(rank: int) -> tuple[float, float]:
        low, high = pooled.order_statistic(rank)
        shares = [_shares_above(replicates, end, 0) for end in (high, low)]
        above = [replicated_interval(each, size, confidence) for each in shares]
        return 1.0 - above[1][1], 1.0 - above[0][0]

    nothing = share_interval(0, 0, pooled.count, confidence)[1]
    lower = 0 if nothing >= probability else _first(pooled.count, lambda r: interval(r)[1] >= probability)
    return lower, _first(pooled.count, lambda r: interval(r)[0] > probability)


def _first(n: int, holds: Callable[[int], bool]) -> int:
    """Return the first rank of 1 … n at which a condition holds, n + 1 where it does nowhere."""
    low, high = 1, n + 1
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle + 1, high)
    return low


def _size(replicates: Sequence[Sketch]) -> float:
    """Return the mean number of samples in a replicate."""
    return float(np.mean([s.count for s in replicates if s.count]))


def _shares_above(replicates: Sequence[Sketch], limit: float, end: int) -> Array:
    """Return the replicates' shares above a limit: the least that they may be (`end` 0), or the most."""
    return np.array([s.count_above(limit)[end] / s.count for s in replicates if s.count])
