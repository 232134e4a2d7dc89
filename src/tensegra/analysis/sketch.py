"""Order statistics and moments of a stream of any length, in bounded memory.

The first `EXACT_LIMIT` values are kept, so a study of ordinary size has exact quantiles. Beyond that they are
counted in bins (`DyadicBins`) about a 30,000th to a 60,000th of the range wide, which bracket every rank and
every quantile with certainty.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.bins import N_BINS, DyadicBins

Array = NDArray[np.float64]

EXACT_LIMIT = 2**17


class Sketch:
    """Counts, moments, extremes and order statistics of a stream.

    Attributes
    ----------
    count, mean, minimum, maximum
        Of the values so far.
    powers
        Σ (x − mean)^p for p = 2, 3, 4.

    Examples
    --------
    >>> sketch = Sketch()
    >>> sketch.add([3.0, 1.0, 2.0])
    >>> sketch.mean, sketch.minimum, sketch.quantile(0.5)
    (2.0, 1.0, 2.0)
    """

    def __init__(self, exact_limit: int = EXACT_LIMIT, n_bins: int = N_BINS) -> None:
        self.exact_limit, self.n_bins = exact_limit, n_bins
        self.count = 0
        self.mean = 0.0
        self.powers = np.zeros(3)
        self.minimum, self.maximum = np.inf, -np.inf
        self.bins: DyadicBins | None = None
        self.kept: list[Array] = []
        self._n_kept = 0
        self._in_order = False

    @property
    def resolution(self) -> float:
        """Width of the bin that brackets an order statistic; 0 while the values are kept."""
        return 0.0 if self.bins is None else self.bins.width

    def add(self, values: ArrayLike) -> None:
        """Take in finite values of shape (n,)."""
        x = np.array(values, dtype=float).ravel()
        if x.size == 0:
            return
        with np.errstate(over="ignore", invalid="ignore"):  # moments beyond the floats are infinite or NaN
            mean = float(x.mean())
            centred = x - mean
            squares = centred * centred
            self._pool(x.size, mean, np.array([squares.sum(), squares @ centred, squares @ squares]))
        self.minimum, self.maximum = min(self.minimum, float(x.min())), max(self.maximum, float(x.max()))
        self._keep([x])

    def merge(self, other: "Sketch") -> None:
        """Take in all that `other` has seen."""
        if other.count == 0:
            return
        with np.errstate(over="ignore", invalid="ignore"):
            self._pool(other.count, other.mean, other.powers)
        self.minimum, self.maximum = min(self.minimum, other.minimum), max(self.maximum, other.maximum)
        if other.bins is not None:
            self.bins = self.bins or DyadicBins(self.minimum, self.maximum, self.n_bins)
            self.bins.merge(other.bins)
        self._keep(other.kept)

    def variance(self) -> float:
        """Return the unbiased variance, NaN for fewer than two values."""
        return float(self.powers[0]) / (self.count - 1) if self.count > 1 else float("nan")

    def values_and_counts(self) -> tuple[Array, Array]:
        """Return the values and how often each occurred; binned ones stand at the middle of their bin."""
        bins = self._settled()
        if bins is None:
            return (self._sorted(), np.ones(self.count)) if self.count else (np.zeros(0), np.zeros(0))
        return bins.edge(np.arange(bins.counts.size) + 0.5), bins.counts.astype(float)

    def order_statistic(self, rank: int) -> tuple[float, float]:
        """Bracket the `rank`-th smallest value, 1 ≤ rank ≤ count."""
        bins = self._settled()
        if bins is None:
            value = float(self._sorted()[rank - 1])
            return value, value
        low = float(bins.edge(np.searchsorted(np.cumsum(bins.counts), rank)))
        return max(low, self.minimum), min(low + bins.width, self.maximum)

    def quantile(self, probability: float) -> float:
        """Return the quantile, interpolated linearly between order statistics (or inside a bin)."""
        if self.count == 0:
            return float("nan")
        bins = self._settled()
        if bins is None:
            return float(np.quantile(self._sorted(), probability))
        target, cumulative = probability * self.count, np.cumsum(bins.counts)
        index = int(np.searchsorted(cumulative, max(target, 1.0)))
        inside = 1.0 - (cumulative[index] - target) / bins.counts[index]
        return float(np.clip(bins.edge(index + inside), self.minimum, self.maximum))

    def count_above(self, limit: float) -> tuple[int, int]:
        """Bracket how many values lie above `limit`; both ends agree while the values are kept."""
        if self.count == 0 or limit >= self.maximum:
            return 0, 0
        if limit < self.minimum:
            return self.count, self.count
        bins = self._settled()
        if bins is None:
            above = self.count - int(np.searchsorted(self._sorted(), limit, side="right"))
            return above, above
        index = bins.index(limit)
        return int(bins.counts[index + 1 :].sum()), int(bins.counts[index:].sum())

    def histogram(self, n_bars: int) -> tuple[NDArray[np.int64], Array]:
        """Return counts (n,) and edges (n + 1,) of `n_bars` bars; of binned values up to twice as many."""
        if self.count == 0:
            return np.zeros(0, dtype=np.int64), np.zeros(0)
        bins = self._settled()
        if bins is None:
            # Values that differ by rounding alone have no room for bars between them.
            room = n_bars * 4.0 * np.spacing(max(abs(self.minimum), abs(self.maximum)))
            narrow = self.maximum - self.minimum < room
            span = (self.minimum - room, self.maximum + room) if narrow else None
            counts, edges = np.histogram(self._sorted(), bins=n_bars, range=span)
            return counts.astype(np.int64), edges
        group = max(1, bins.counts.size // n_bars)
        padded = np.pad(bins.counts, (0, -bins.counts.size % group))
        grouped = padded.reshape(-1, group).sum(axis=1)
        return grouped, bins.edge(group * np.arange(grouped.size + 1))

    def _keep(self, parts: list[Array]) -> None:
        """Keep values, or set them aside to be binned some thousands at a time."""
        self.kept = [*self.kept, *parts]
        self._n_kept += sum(part.size for part in parts)
        self._in_order = False
        if self._n_kept > (self.exact_limit if self.bins is None else self.n_bins):
            self._flush()

    def _settled(self) -> DyadicBins | None:
        """Bin what was set aside; return the bins, None while all values are kept."""
        if self.bins is not None:
            self._flush()
        return self.bins

    def _flush(self) -> None:
        self.bins = self.bins or DyadicBins(self.minimum, self.maximum, self.n_bins)
        for part in self.kept:
            self.bins.add(part)
        self.kept, self._n_kept = [], 0

    def _sorted(self) -> Array:
        if not self._in_order:
            self.kept, self._in_order = [np.sort(np.concatenate(self.kept))], True
        return self.kept[0]

    def _pool(self, count: int, mean: float, powers: Array) -> None:
        """Pool central moments by the pairwise update of Pébay (2008, SAND2008-6212, Eqs. 2.1 and 3.1)."""
        n_a, n_b = self.count, count
        n = n_a + n_b
        delta = np.float64(
            mean - self.mean
        )  # a NumPy float: its powers overflow to infinity, not to an error
        m2_a, m3_a, m4_a = self.powers
        m2_b, m3_b, m4_b = powers
        m2 = m2_a + m2_b + delta**2 * n_a * n_b / n
        m3 = m3_a + m3_b + delta**3 * n_a * n_b * (n_a - n_b) / n**2
        m3 += 3 * delta * (n_a * m2_b - n_b * m2_a) / n
        m4 = m4_a + m4_b + delta**4 * n_a * n_b * (n_a**2 - n_a * n_b + n_b**2) / n**3
        m4 += (
            6 * delta**2 * (n_a**2 * m2_b + n_b**2 * m2_a) / n**2 + 4 * delta * (n_a * m3_b - n_b * m3_a) / n
        )
        self.count, self.mean = n, float(self.mean + delta * n_b / n)
        self.powers = np.array([m2, m3, m4])
