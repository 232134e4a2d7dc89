"""Bootstrap of Sobol' indices: every resample of the blocks at once, as one matrix product.

An index is a ratio of means over blocks. A resample weights each block by how often it was drawn, so the
means of all resamples are the matrix of these numbers times the terms of the blocks. The estimators are
SALib's, as in `tensegra.analysis.sensitivity`.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Numbers of one product's left factor that are held at a time: 128 MB.
MOST_NUMBERS = 2**24


def half_widths(
    blocks: Array, rng: np.random.Generator, *, resamples: int, confidence: float, second_order: bool
) -> tuple[Array, Array, Array | None]:
    """Return the half-widths of the first, total and second order indices, normal bootstrap.

    Parameters
    ----------
    blocks
        Outputs (n_blocks, runs per block): A, the points with one column of B each, those of B with one of A
        where the second order is wanted, and B.
    rng, resamples, confidence, second_order
        Of the resamples; how many; level of the intervals; whether the second order is wanted.

    Returns
    -------
    first, total, second
        Shape (d,) twice and (d, d), the upper triangle filled, or None.
    """
    from scipy.special import ndtri

    n = len(blocks)
    terms, finish = _terms((blocks - blocks.mean()) / blocks.std(), second_order=second_order)
    rows = max(1, MOST_NUMBERS // n)
    drawn = []
    for start in range(0, resamples, rows):
        size = min(rows, resamples - start)
        place = rng.integers(n, size=(size, n)) + n * np.arange(size)[:, None]
        counts = np.bincount(place.ravel(), minlength=size * n).reshape(size, n)
        drawn.append(counts.astype(float) @ terms / n)
    with np.errstate(divide="ignore", invalid="ignore"):
        indices = finish(np.concatenate(drawn))
    factor = ndtri(0.5 + confidence / 2)
    first, total, second = (
        None if index is None else factor * index.std(axis=0, ddof=1) for index in indices
    )
    assert first is not None and total is not None  # noqa: PT018, S101 - only the second order may be missing
    return first, total, second


def _terms(
    Y: Array, *, second_order: bool
) -> tuple[Array, Callable[[Array], tuple[Array, Array, Array | None]]]:
    """Return the terms (n_blocks, n_terms) whose means give the indices, and the function that makes them."""
    d = (Y.shape[1] - 2) // 2 if second_order else Y.shape[1] - 2
    A, B, AB = Y[:, :1], Y[:, -1:], Y[:, 1 : d + 1]
    parts = [A + B, A**2 + B**2, B * (AB - A), 0.5 * (A - AB) ** 2]
    pairs = np.triu_indices(d, 1)
    if second_order:
        BA = Y[:, d + 1 : 2 * d + 1]
        parts.append(BA[:, pairs[0]] * AB[:, pairs[1]] - A * B)

    def finish(means: Array) -> tuple[Array, Array, Array | None]:
        variance = (0.5 * means[:, 1] - 0.25 * means[:, 0] ** 2)[:, None]
        first, total = means[:, 2 : d + 2] / variance, means[:, d + 2 : 2 * d + 2] / variance
        if not second_order:
            return first, total, None
        second = np.full((len(means), d, d), np.nan)
        second[:, pairs[0], pairs[1]] = (
            means[:, 2 * d + 2 :] / variance - first[:, pairs[0]] - first[:, pairs[1]]
        )
        return first, total, second

    return np.concatenate(parts, axis=1), finish
