"""Intervals of a probability that was met k times in n.

Independent samples: Blaker's interval (2000, *Canadian Journal of Statistics* 28, 783-798,
doi:10.2307/3315916). It is exact, lies within that of Clopper and Pearson, and holds 95 to 98 % where theirs
holds 99 % of three expected events. Where events are many both hold alike, and
Clopper and Pearson's, which is in closed form, is taken.

Replicates of quasi-random samples: Clopper and Pearson's with the number of independent samples that would
scatter as much as the replicates do (Korn & Graubard 1998, *Survey Methodology* 24, 193-201).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# More events than these on the rarer side are many.
MANY_EVENTS = 20
# Of fewer events than these the replicates cannot tell their scatter; they count as independent samples.
FEW_EVENTS = 6
# Of an event seen fewer times than this the interval has to make up for samples that have not seen it at all:
# of three expected events one sample in twenty sees none, which leaves next to nothing of 5 % to the others.
HARDLY_SEEN = 10
LEFT_TO_OTHERS = 0.1
# Points that Blaker's ends are sought on, twice: to 1/4,000 of the way from Clopper and Pearson's.
GRID = 64


def wide_interval(k: float, n: float, confidence: float) -> tuple[float, float]:
    """Return the interval for those to whom an event that was not seen is none, and has no interval.

    It is Clopper and Pearson's, and reaches further towards nothing where the event was hardly seen.
    """
    if k > n / 2:
        low, high = wide_interval(n - k, n, confidence)
        return 1.0 - high, 1.0 - low
    low, high = _clopper_pearson(k, n, confidence)
    if k < HARDLY_SEEN:
        low = _clopper_pearson(k, n, 1.0 - LEFT_TO_OTHERS * (1.0 - confidence))[0]
    return low, high


def share_interval(least: float, most: float, n: float, confidence: float) -> tuple[float, float]:
    """Return the interval of a probability that was met between `least` and `most` times in n.

    Examples
    --------
    >>> low, high = share_interval(0, 0, 100, 0.95)
    >>> low, round(high, 4)
    (0.0, 0.0356)
    """
    low, _ = _independent(least, n, confidence)
    _, high = _independent(most, n, confidence)
    return low, high


def replicated_interval(
    shares: Array, size: float, confidence: float, *, wide: bool = False
) -> tuple[float, float]:
    """Return the interval of a probability from its share (n_replicates,) in replicates of `size` points.

    It is the `wide_interval` of as many independent samples, if `wide`.
    """
    from scipy.special import stdtrit

    inner = wide_interval if wide else _clopper_pearson
    n, share = size * shares.size, float(shares.mean())
    events = n * min(share, 1.0 - share)
    if shares.size < 2 or events < FEW_EVENTS:
        return (wide_interval if wide else _independent)(round(n * share), round(n), confidence)
    counts = shares * size
    floor = np.floor(counts.min() + 1e-6)
    if floor > 0 and counts.max() < min(floor + 1.5, size - 0.5):
        return _between(counts - floor, floor, size, confidence)
    tail = 0.5 + confidence / 2
    loss = float(stdtrit(n - 1, tail) / stdtrit(shares.size - 1, tail)) ** 2
    effective = loss * share * (1.0 - share) / (float(shares.var(ddof=1)) / shares.size)
    return inner(effective * share, effective, confidence)


def _between(more: Array, floor: float, size: float, confidence: float) -> tuple[float, float]:
    """Return the interval where every replicate counts `floor` events or one more.

    Even points do so in one dimension; the number of those with one more is binomial.
    """
    n, k = more.size, float(np.round(more.sum()))
    if k in {0.0, n}:
        half = unseen_share(n, confidence)
        return (floor + k / n - half) / size, (floor + k / n + half) / size
    low, high = _independent(k, n, confidence)
    return (floor + low) / size, (floor + high) / size


def unseen_share(n_replicates: int, confidence: float) -> float:
    """Return how often replicates may differ from what all of `n_replicates` agreed on."""
    return float(1.0 - (0.5 - confidence / 2) ** (1.0 / n_replicates))


@lru_cache(maxsize=4096)
def _independent(k: float, n: float, confidence: float) -> tuple[float, float]:
    low, high = _clopper_pearson(k, n, confidence)
    if min(k, n - k) > MANY_EVENTS:
        return low, high
    if k > n / 2:
        mirrored = _independent(n - k, n, confidence)
        return 1.0 - mirrored[1], 1.0 - mirrored[0]
    share = k / n
    return (
        _end(low, share, k, n, 1.0 - confidence) if k else 0.0,
        _end(high, share, k, n, 1.0 - confidence),
    )


def _end(outer: float, inner: float, k: float, n: float, alpha: float) -> float:
    """Return the outermost probability, from Clopper and Pearson's end inwards, that Blaker accepts."""
    for _ in range(2):
        grid = np.linspace(outer, inner, GRID)
        accepted = np.flatnonzero(_acceptability(grid, k, n) > alpha)
        if not accepted.size:
            return outer
        first = int(accepted[0])
        if first == 0:
            return outer
        outer, inner = float(grid[first - 1]), float(grid[first])
    return outer


def _acceptability(p: Array, k: float, n: float) -> Array:
    """Return the probability under `p` of a tail no likelier than that of k, on both sides together."""
    from scipy.special import bdtr

    # Beyond this number of events there is nothing left of any of these laws.
    most = min(n, k + 12.0 * np.sqrt(float(p.max()) * n) + 40.0)
    numbers = np.arange(most + 1.0)
    up_to = np.asarray(bdtr(numbers, int(n), p[:, None]))
    below, above = up_to[:, int(k)], 1.0 - (up_to[:, int(k) - 1] if k else np.zeros(len(p)))
    from_ = np.concatenate([np.ones((len(p), 1)), 1.0 - up_to[:, :-1]], axis=1)  # P(at least so many)
    other_below = np.where(up_to <= above[:, None], up_to, 0.0).max(axis=1)
    other_above = np.where(from_ <= below[:, None], from_, 0.0).max(axis=1)
    return np.asarray(np.minimum(1.0, np.where(above < below, above + other_below, below + other_above)))


def _clopper_pearson(k: float, n: float, confidence: float) -> tuple[float, float]:
    from scipy.special import betaincinv

    tail = (1.0 - confidence) / 2
    low = float(betaincinv(k, n - k + 1.0, tail)) if k > 0 else 0.0
    high = float(betaincinv(k + 1.0, n - k, 1.0 - tail)) if k < n else 1.0
    return low, high
