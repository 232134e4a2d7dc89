"""The sum of an expansion at very many points, compiled: the table of polynomials stays in the cache."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.mechanics.compiled import njit

__all__ = ["expansion"]

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]

LANES = 64  # points at once: the polynomials of eight inputs to degree 12 are 53 kB


@njit
def expansion(
    Z: Array,
    shift: Array,
    scale: Array,
    before: Array,
    starts: Integers,
    axes: Integers,
    degrees: Integers,
    coefficients: Array,
    out: Array,
) -> None:
    """Write the sums of products of polynomials, shape (n_points, n_outputs), to `out`.

    Parameters
    ----------
    Z
        Points, shape (n_points, n_inputs).
    shift, scale, before
        Of p_{j+1} = (z − shift_j) scale_j p_j − before_j p_{j−1}, shape (n_inputs, n_degrees − 1).
    starts, axes, degrees
        The factors of all terms, one after the other, and where each term's begin; shapes (n_terms + 1,) and
        (n_factors,).
    coefficients
        Shape (n_terms, n_outputs).
    """
    n, d = Z.shape
    n_outputs = coefficients.shape[1]
    p = np.ones((d, shift.shape[1] + 1, LANES))
    term = np.empty(LANES)
    total = np.empty((n_outputs, LANES))
    for first in range(0, n, LANES):
        width = min(LANES, n - first)
        _polynomials(Z[first : first + width], shift, scale, before, p)
        total[:] = 0.0
        for m in range(len(starts) - 1):
            term[:] = 1.0
            for f in range(starts[m], starts[m + 1]):
                factor = p[axes[f], degrees[f]]
                for i in range(LANES):
                    term[i] *= factor[i]
            for output in range(n_outputs):
                c = coefficients[m, output]
                for i in range(LANES):
                    total[output, i] += c * term[i]
        for i in range(width):
            for output in range(n_outputs):
                out[first + i, output] = total[output, i]


@njit
def _polynomials(Z: Array, shift: Array, scale: Array, before: Array, p: Array) -> None:
    """Write the polynomials of each input to `p`, shape (n_inputs, n_degrees, LANES)."""
    for j in range(Z.shape[1]):
        for k in range(shift.shape[1]):
            for i in range(len(Z)):
                p[j, k + 1, i] = (Z[i, j] - shift[j, k]) * scale[j, k] * p[j, k, i]
            if k:
                for i in range(len(Z)):
                    p[j, k + 1, i] -= before[j, k] * p[j, k - 1, i]
