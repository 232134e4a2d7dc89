"""Counts in bins of one dyadic width 2^e, aligned to multiples of it.

When the range outgrows the number of bins, e goes up by one and neighbours are added together. Nothing is
ever approximated: a value is known to lie in its bin, whatever came before or after, and two sets of bins
merge without loss.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

N_BINS = 2**16


class DyadicBins:
    """Counts of values in [i 2^e, (i + 1) 2^e) for consecutive i.

    Parameters
    ----------
    low, high
        The range that is known so far; it only settles the first width.
    n_bins
        Most bins there can be; the width is such that the range takes at least half of them.

    Attributes
    ----------
    exponent, first
        The width is 2^exponent; `first` is the number i of the first bin.
    counts
        Values in each bin, shape (n,).

    Examples
    --------
    >>> bins = DyadicBins(0.0, 4.0, n_bins=8)
    >>> bins.add(np.array([0.1, 0.2, 3.9]))
    >>> bins.width, bins.counts.tolist()
    (1.0, [2, 0, 0, 1])
    """

    def __init__(self, low: float, high: float, n_bins: int = N_BINS) -> None:
        span = max(high - low, float(np.finfo(float).tiny))
        self.n_bins = n_bins
        self.exponent = max(int(np.frexp(span / n_bins)[1]), _least_exponent(low, high))
        self.first = int(self._number(low)[0])
        self.counts = np.zeros(1, dtype=np.int64)

    @property
    def width(self) -> float:
        """Width of a bin."""
        return float(np.ldexp(1.0, self.exponent))

    def edge(self, index: ArrayLike) -> Array:
        """Return the lower edge of the bin at `index`; fractions lie inside the bin."""
        return np.asarray(np.ldexp(self.first + np.asarray(index, dtype=float), self.exponent))

    def index(self, value: float) -> int:
        """Return where the bin of `value` stands, which may be outside the counts."""
        return int(self._number(value)[0]) - self.first

    def add(self, values: Array) -> None:
        """Count finite values (n,)."""
        if values.size:
            self._cover(float(values.min()), float(values.max()))
            self.counts += np.bincount(self._number(values) - self.first, minlength=self.counts.size)

    def merge(self, other: "DyadicBins") -> None:
        """Add the counts of `other`, which is left as it is."""
        copy = DyadicBins(0.0, 1.0, other.n_bins)
        copy.exponent, copy.first, copy.counts = other.exponent, other.first, other.counts
        while copy.exponent < self.exponent:
            copy.coarsen()
        while self.exponent < copy.exponent:
            self.coarsen()
        self._cover(float(copy.edge(0)), float(copy.edge(copy.counts.size - 1)))
        while copy.exponent < self.exponent:
            copy.coarsen()
        offset = copy.first - self.first
        self.counts[offset : offset + copy.counts.size] += copy.counts

    def coarsen(self) -> None:
        """Double the width; bins 2i and 2i + 1 become bin i."""
        padded = np.pad(self.counts, (self.first & 1, 0))
        padded = np.pad(padded, (0, padded.size & 1))
        self.first, self.counts = self.first >> 1, padded.reshape(-1, 2).sum(axis=1)
        self.exponent += 1

    def _number(self, values: ArrayLike) -> NDArray[np.int64]:
        values = np.atleast_1d(np.asarray(values, dtype=float))
        scaled = np.floor(np.ldexp(values, -self.exponent))
        # A negative number too small to be scaled becomes −0; it lies below zero all the same.
        return np.asarray(np.where((values < 0.0) & (scaled == 0.0), -1.0, scaled), dtype=np.int64)

    def _cover(self, low: float, high: float) -> None:
        """Extend the counts to the bins of `low` and `high`, coarsening until they fit into `n_bins`."""
        while self.exponent < _least_exponent(low, high):
            self.coarsen()
        while True:
            first = min(int(self._number(low)[0]), self.first)
            last = max(int(self._number(high)[0]), self.first + self.counts.size - 1)
            if last - first < self.n_bins:
                break
            self.coarsen()
        grown = np.zeros(last - first + 1, dtype=np.int64)
        offset = self.first - first
        grown[offset : offset + self.counts.size] = self.counts
        self.first, self.counts = first, grown


def _least_exponent(low: float, high: float) -> int:
    """Return the finest width 2^e for which bin numbers stay exact in 45 bits."""
    return int(np.frexp(max(abs(low), abs(high), float(np.finfo(float).tiny)))[1]) - 45
