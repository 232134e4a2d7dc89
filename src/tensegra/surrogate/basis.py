"""Polynomials that are orthonormal under the laws of the inputs, and the products of them.

Each input's polynomials satisfy the three-term recurrence √b_{j+1} p_{j+1} = (z − a_j) p_j − √b_j p_{j−1};
its coefficients are all that is kept of the law (Gautschi, *Orthogonal Polynomials: Computation and
Approximation*, 2004, section 2.2). Under the uniform law these are Legendre's, under the normal law
Hermite's polynomials.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.study.data import Distribution

__all__ = ["Basis", "law_quadrature", "margin", "recurrence", "total_degree", "uniform_quadrature"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

PANEL_ORDER = 32  # Gauss points per panel: with the panels below, smooth densities are exact to rounding
# Panels between quantiles, fine towards the ends where densities may be steep.
PANEL_LEVELS = np.array([0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5])
TAIL_DENSITY = 1e-100  # relative to the largest: beyond it no polynomial of a usable degree is felt


class Basis:
    """Products of univariate polynomials, for a downward-closed set of degrees.

    Parameters
    ----------
    coefficients
        Recurrence coefficients a and b of each input, shape (n_inputs, 2, max_degree + 1).
    indices
        Degrees of each product, shape (n_terms, n_inputs), with every divisor of a product before it; the
        first row is the constant.
    """

    def __init__(self, coefficients: Array, indices: Indices) -> None:
        self.coefficients = coefficients
        self.indices = indices
        row = {tuple(alpha): i for i, alpha in enumerate(indices.tolist())}
        # A product is its parent (the last degree that is not zero set to zero) times one polynomial.
        self._axis = [
            max((j for j, degree in enumerate(alpha) if degree), default=0) for alpha in indices.tolist()
        ]
        self._parent = [
            row[(*alpha[:axis], *[0] * (len(alpha) - axis))]
            for alpha, axis in zip(indices.tolist(), self._axis, strict=True)
        ]

    def __len__(self) -> int:
        return len(self.indices)

    def values(self, Z: Array) -> Array:
        """Return the products at standardised points, shape (n_terms, n_points)."""
        p, _ = self._univariate(Z)
        return self._products(p)

    def derivatives(self, Z: Array) -> tuple[Array, Array]:
        """Return the products and their derivatives, shape (n_inputs, n_terms, n_points)."""
        p, slope = self._univariate(Z)
        values = self._products(p)
        return values, np.stack([self._product_slopes(p, slope, values, j) for j in range(Z.shape[1])])

    def _products(self, p: Array) -> Array:
        values = np.ones((len(self), p.shape[2]))
        for i, (parent, axis) in enumerate(zip(self._parent, self._axis, strict=True)):
            if i:
                np.multiply(values[parent], p[axis, self.indices[i, axis]], out=values[i])
        return values

    def _product_slopes(self, p: Array, slope: Array, values: Array, j: int) -> Array:
        """Return the derivatives by input `j`, shape (n_terms, n_points)."""
        slopes = np.zeros_like(values)
        for i, (parent, axis) in enumerate(zip(self._parent, self._axis, strict=True)):
            degree = self.indices[i, axis]
            if axis == j:
                np.multiply(values[parent], slope[j, degree], out=slopes[i])
            elif self.indices[i, j]:
                np.multiply(slopes[parent], p[axis, degree], out=slopes[i])
        return slopes

    def _univariate(self, Z: Array) -> tuple[Array, Array]:
        """Return the polynomials and their derivatives, shape (n_inputs, max_degree + 1, n_points)."""
        a, root_b = self.coefficients[:, 0], np.sqrt(self.coefficients[:, 1])
        z, n_degrees = Z.T, int(self.indices.max()) + 1
        p = np.zeros((len(z), n_degrees, len(Z)))
        slope = np.zeros_like(p)
        p[:, 0] = 1.0
        for j in range(n_degrees - 1):
            shifted = z - a[:, j, None]
            p[:, j + 1] = shifted * p[:, j]
            slope[:, j + 1] = p[:, j] + shifted * slope[:, j]
            if j:
                p[:, j + 1] -= root_b[:, j, None] * p[:, j - 1]
                slope[:, j + 1] -= root_b[:, j, None] * slope[:, j - 1]
            p[:, j + 1] /= root_b[:, j + 1, None]
            slope[:, j + 1] /= root_b[:, j + 1, None]
        return p, slope


def uniform_quadrature(lower: float, upper: float) -> tuple[Array, Array]:
    """Return nodes and weights under the uniform law, exact to degree 2·`PANEL_ORDER` − 1."""
    x, w = np.polynomial.legendre.leggauss(PANEL_ORDER)
    return 0.5 * (lower + upper) + 0.5 * (upper - lower) * x, 0.5 * w


def law_quadrature(law: Distribution) -> tuple[Array, Array]:
    """Return nodes and weights under a law: Gauss panels between its quantiles.

    Parameters
    ----------
    law
        A density and a quantile function. An infinite tail is followed until it is negligible.

    Returns
    -------
    tuple of ndarray
        Nodes and weights; the weights sum to one.
    """
    levels = np.concatenate([PANEL_LEVELS, 1.0 - PANEL_LEVELS[-2::-1]])
    edges = np.asarray(law.ppf(levels), dtype=np.float64)
    finite = np.unique(edges[np.isfinite(edges)])
    left = [] if np.isfinite(edges[0]) else _tail(law, finite[0], finite[0] - finite[-1])
    right = [] if np.isfinite(edges[-1]) else _tail(law, finite[-1], finite[-1] - finite[0])
    edges = np.unique(np.concatenate([left, finite, right]))
    x, w = np.polynomial.legendre.leggauss(PANEL_ORDER)
    half = 0.5 * np.diff(edges)[:, None]
    nodes: Array = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * x).ravel()
    weights = np.asarray(law.pdf(nodes), dtype=np.float64) * (half * w).ravel()
    return nodes, weights / weights.sum()


def _tail(law: Distribution, end: float, width: float) -> list[float]:
    """Return further panel edges from `end` on, an eighth of `width` apart, as far as the law is felt."""
    edges: Array = end + width / 8 * np.arange(65.0)
    density = np.asarray(law.pdf(edges))
    felt = density[1:] > TAIL_DENSITY * density[0]
    n_edges = int(np.logical_and.accumulate(felt).sum())
    return list(edges[1 : 1 + max(1, n_edges)])


def recurrence(nodes: Array, weights: Array, degree: int) -> Array:
    """Return the recurrence coefficients of a discrete law by Stieltjes' procedure, shape (2, degree + 1).

    Parameters
    ----------
    nodes, weights
        The law; the weights sum to one.
    degree
        Highest degree.
    """
    a, b = np.zeros(degree + 1), np.ones(degree + 1)
    previous, current = np.zeros_like(nodes), np.ones_like(nodes)
    for j in range(degree + 1):
        a[j] = np.sum(weights * nodes * current**2)
        step = (nodes - a[j]) * current - (np.sqrt(b[j]) * previous if j else 0.0)
        if j < degree:
            b[j + 1] = np.sum(weights * step**2)
            previous, current = current, step / np.sqrt(b[j + 1])
    return np.stack([a, b])


def total_degree(n_inputs: int, degree: int) -> Indices:
    """Return all degrees of a sum up to `degree`, sorted by that sum.

    Examples
    --------
    >>> total_degree(2, 1).tolist()
    [[0, 0], [0, 1], [1, 0]]
    """
    rows: list[tuple[int, ...]] = [()]
    for _ in range(n_inputs):
        rows = [(*row, j) for row in rows for j in range(degree - sum(row) + 1)]
    return np.array(sorted(rows, key=lambda row: (sum(row), row)), dtype=np.int64)


def margin(indices: Indices, max_degree: int) -> Indices:
    """Return the products outside a downward-closed set all of whose divisors are inside.

    Examples
    --------
    >>> margin(np.array([[0, 0], [0, 1], [1, 0]]), 5).tolist()
    [[0, 2], [1, 1], [2, 0]]
    """
    inside = set(map(tuple, indices.tolist()))
    outside = set()
    for alpha in inside:
        for j, degree in enumerate(alpha):
            beta = (*alpha[:j], degree + 1, *alpha[j + 1 :])
            divisors = ((*beta[:i], d - 1, *beta[i + 1 :]) for i, d in enumerate(beta) if d)
            if degree < max_degree and beta not in inside and all(divisor in inside for divisor in divisors):
                outside.add(beta)
    return np.array(sorted(outside), dtype=np.int64).reshape(-1, indices.shape[1])
