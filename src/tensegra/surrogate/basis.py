"""Polynomials that are orthonormal under the laws of the inputs, and the products of them.

Each input's polynomials satisfy the three-term recurrence √b_{j+1} p_{j+1} = (z − a_j) p_j − √b_j p_{j−1};
its coefficients are all that is kept of the law (Gautschi, *Orthogonal Polynomials: Computation and
Approximation*, 2004, section 2.2). Under the uniform law these are Legendre's, under the normal law
Hermite's polynomials. A law of n values has n of them; b_j = 0 says that there is none of degree j.
"""

from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.study.quadrature import law_quadrature
from tensegra.surrogate.terms import margin, total_degree

__all__ = [
    "Basis",
    "highest_degrees",
    "law_quadrature",
    "margin",
    "recurrence",
    "total_degree",
    "uniform_quadrature",
    "univariate",
]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

PANEL_ORDER = 32  # Gauss points of the uniform law
NO_MORE = 1e-13  # norm of what a further polynomial adds, over the spread of the law: below, it is rounding
# What lies at points this improbable, relative to the most probable one, cannot be told from what lies beyond
# them: a polynomial that is felt there is not known. It is the high degrees of laws with very heavy tails.
FAINT, FELT = 1e-250, 1e-12


class Basis:
    """Products of univariate polynomials.

    Parameters
    ----------
    coefficients
        Recurrence coefficients a and b of each input, shape (n_inputs, 2, max_degree + 1).
    indices
        Degrees of each product, shape (n_terms, n_inputs); the first row is the constant.
    """

    def __init__(self, coefficients: Array, indices: Indices) -> None:
        self.coefficients = coefficients
        self.indices = indices
        self._n_degrees = int(indices.max(initial=0)) + 1
        rows = indices.tolist()
        row = {tuple(alpha): i for i, alpha in enumerate(rows)}
        # A product is its parent (the last degree that is not zero set to zero) times one polynomial; where
        # the parent is not among those before it, it is the product of all its factors.
        self._factors: list[tuple[int, list[tuple[int, int]]]] = []
        for i, alpha in enumerate(rows):
            active = [(j, degree) for j, degree in enumerate(alpha) if degree]
            parent = list(alpha)
            if active:
                parent[active[-1][0]] = 0
            known = row.get(tuple(parent), i)
            alone = known >= i
            self._factors.append((0 if alone else known, active if alone else active[-1:]))

    def __len__(self) -> int:
        return len(self.indices)

    def values(self, Z: Array) -> Array:
        """Return the products at standardised points, shape (n_terms, n_points)."""
        p, _ = univariate(self.coefficients, Z, self._n_degrees)
        return self._products(p)

    def derivatives(self, Z: Array) -> tuple[Array, Array]:
        """Return the products and their derivatives, shape (n_inputs, n_terms, n_points)."""
        p, slope = univariate(self.coefficients, Z, self._n_degrees, slopes=True)
        values = self._products(p)
        slopes = np.zeros((Z.shape[1], *values.shape))
        for i, alpha in enumerate(self.indices.tolist()):
            active = [(j, degree) for j, degree in enumerate(alpha) if degree]
            for j, degree in active:
                np.copyto(slopes[j, i], slope[j, degree])
                for other, power in active:
                    if other != j:
                        slopes[j, i] *= p[other, power]
        return values, slopes

    def sums(self, Z: Array, coefficients: Array) -> Array:
        """Return the sums of the products times coefficients (n_terms, n_outputs), (n_points, n_outputs).

        It is compiled, for very many points; see `values`.
        """
        from tensegra.surrogate.summation import expansion

        out = np.empty((len(Z), coefficients.shape[1]))
        expansion(np.ascontiguousarray(Z), *self._tables, np.ascontiguousarray(coefficients), out)
        return out

    @cached_property
    def _tables(self) -> list[NDArray[Any]]:
        """The recurrences and the factors of all terms, as the compiled sum takes them."""
        a, root_b = self.coefficients[:, 0], np.sqrt(self.coefficients[:, 1])
        k = self._n_degrees - 1
        inverse = np.divide(1.0, root_b, out=np.zeros_like(root_b), where=root_b > 0)[:, 1 : k + 1]
        row, axis = np.nonzero(self.indices)
        starts = np.searchsorted(row, np.arange(len(self) + 1))
        tables = [a[:, :k], inverse, root_b[:, :k] * inverse, starts, axis, self.indices[row, axis]]
        return [np.ascontiguousarray(table) for table in tables]

    def _products(self, p: Array) -> Array:
        values = np.ones((len(self), p.shape[2]))
        for i, (parent, factors) in enumerate(self._factors):
            if not factors:
                continue
            (axis, degree), *others = factors
            np.multiply(values[parent], p[axis, degree], out=values[i])
            for axis, degree in others:
                values[i] *= p[axis, degree]
        return values


def univariate(coefficients: Array, Z: Array, n_degrees: int, *, slopes: bool = False) -> tuple[Array, Array]:
    """Return the polynomials of each input, and their derivatives if they are asked for.

    Parameters
    ----------
    coefficients
        Recurrence coefficients, as of `Basis`.
    Z
        Points, shape (n_points, n_inputs).
    n_degrees
        Number of degrees, the constant among them.
    slopes
        Whether to return the derivatives; without, the polynomials are returned twice.

    Returns
    -------
    tuple of ndarray
        Shape (n_inputs, n_degrees, n_points) each; zero from the degree on of which there is none.
    """
    a, root_b = coefficients[:, 0], np.sqrt(coefficients[:, 1])
    inverse = np.divide(1.0, root_b, out=np.zeros_like(root_b), where=root_b > 0)
    z = np.ascontiguousarray(Z.T)
    p = np.zeros((len(z), n_degrees, len(Z)))
    slope = np.zeros_like(p) if slopes else p
    p[:, 0] = 1.0
    for j in range(n_degrees - 1):
        scale = inverse[:, j + 1, None]
        shifted = (z - a[:, j, None]) * scale
        np.multiply(shifted, p[:, j], out=p[:, j + 1])
        before = root_b[:, j, None] * scale
        if j:
            p[:, j + 1] -= before * p[:, j - 1]
        if slopes:
            slope[:, j + 1] = scale * p[:, j] + shifted * slope[:, j]
            if j:
                slope[:, j + 1] -= before * slope[:, j - 1]
    return p, slope


def uniform_quadrature(lower: float, upper: float) -> tuple[Array, Array]:
    """Return nodes and weights under the uniform law, exact to degree 2·`PANEL_ORDER` − 1."""
    x, w = np.polynomial.legendre.leggauss(PANEL_ORDER)
    return 0.5 * (lower + upper) + 0.5 * (upper - lower) * x, 0.5 * w


def recurrence(nodes: Array, weights: Array, degree: int) -> Array:
    """Return the recurrence coefficients of a discrete law by Lanczos' procedure, shape (2, degree + 1).

    It is that of Stieltjes with vectors that hold √w p, so that no high power in a far tail is too large for
    a number, and with each new one made orthogonal to all before it (Gautschi 2004, section 2.2.3).

    Parameters
    ----------
    nodes, weights
        The law; the weights sum to one.
    degree
        Highest degree.

    Returns
    -------
    ndarray
        The coefficients a and b; zero from the degree on of which the law has no polynomial.
    """
    a, b = np.zeros(degree + 1), np.zeros(degree + 1)
    b[0] = 1.0
    faint = weights < FAINT * weights.max()
    basis = np.zeros((degree + 2, len(nodes)))
    basis[0] = np.sqrt(weights)
    spread = 0.0
    for j in range(degree + 1):
        step = nodes * basis[j]
        a[j] = step @ basis[j]
        step -= a[j] * basis[j]
        for _ in range(2):
            step -= (basis[: j + 1] @ step) @ basis[: j + 1]
        norm = float(np.linalg.norm(step))
        spread = spread or norm
        if j == degree or j + 1 >= len(nodes) or norm <= NO_MORE * max(spread, abs(a[j])):
            break
        basis[j + 1] = step / norm
        if np.sum(basis[j + 1, faint] ** 2) > FELT:
            break
        b[j + 1] = norm**2
    return np.stack([a, b])


def highest_degrees(coefficients: Array) -> Indices:
    """Return the highest degree of which each input's law has a polynomial, shape (n_inputs,).

    Examples
    --------
    >>> highest_degrees(recurrence(np.array([0.0, 1.0, 2.0]), np.full(3, 1 / 3), 5)[None]).tolist()
    [2]
    """
    there = coefficients[:, 1] > 0
    return np.asarray(np.logical_and.accumulate(there, axis=1).sum(axis=1) - 1, dtype=np.int64)
