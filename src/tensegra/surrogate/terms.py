"""Sets of products of polynomials: which terms an expansion may have.

How many there are is computed, never found by listing them: C(d + n, n) products of a sum of degrees up to n
in d inputs are more than fit anywhere where d is 30.
"""

import heapq
from itertools import accumulate
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["largest", "margin", "n_total_degree", "total_degree"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]


def n_total_degree(highest: ArrayLike, degree: int) -> int:
    """Return the number of products of a sum of degrees up to `degree`, one input after the other.

    Parameters
    ----------
    highest
        Highest degree of each input, shape (n_inputs,).
    degree
        Limit to the sum.

    Examples
    --------
    >>> n_total_degree([12] * 30, 12), n_total_degree([6] * 5, 6), n_total_degree([1, 6], 2)
    (11058116888, 462, 5)
    """
    counts = [1] + [0] * degree  # products of each sum, of the inputs so far
    for limit in np.asarray(highest).tolist():
        totals = list(accumulate(counts))
        counts = [totals[n] - (totals[n - limit - 1] if n > limit else 0) for n in range(degree + 1)]
    return sum(counts)


def total_degree(n_inputs: int, degree: int, highest: ArrayLike | None = None) -> Indices:
    """Return all degrees of a sum up to `degree`, sorted by that sum.

    Parameters
    ----------
    n_inputs, degree
        Number of inputs, and limit to the sum.
    highest
        Highest degree of each input, shape (n_inputs,), where there are limits to them.

    Examples
    --------
    >>> total_degree(2, 1).tolist()
    [[0, 0], [0, 1], [1, 0]]
    """
    limits = [degree] * n_inputs if highest is None else np.asarray(highest).tolist()
    rows: list[tuple[int, ...]] = [()]
    for limit in limits:
        rows = [(*row, j) for row in rows for j in range(min(degree - sum(row), limit) + 1)]
    return np.array(sorted(rows, key=lambda row: (sum(row), row)), dtype=np.int64).reshape(-1, n_inputs)


def largest(weights: Array, n_terms: int) -> Indices:
    """Return the products of the largest weights, the largest first.

    Parameters
    ----------
    weights
        Weight of each degree of each input from the first degree on, shape (n_inputs, max_degree); the
        weight of a product is the product of those of its degrees, and that of the constant is one. Degrees
        of weight zero are left out.
    n_terms
        Their number, if there are so many.

    Examples
    --------
    >>> largest(np.array([[0.5, 0.1], [0.4, 0.3]]), 5).tolist()
    [[0, 0], [1, 0], [0, 1], [0, 2], [1, 1]]
    """
    # Best first: a product's successors take one more step in the order of falling weights, of the input
    # that was last to take one or of a later one. Inputs in the order of their largest weight, so that each
    # successor's weight is at most its predecessor's.
    d = len(weights)
    order = np.argsort(-weights, axis=1, kind="stable")
    falling = np.take_along_axis(weights, order, axis=1)
    falling = np.minimum(falling, 1.0)
    heap: list[tuple[float, tuple[tuple[int, int], ...]]] = [(-1.0, ())]
    found: list[tuple[tuple[int, int], ...]] = []
    while heap and len(found) < n_terms:
        size, steps = heapq.heappop(heap)
        found.append(steps)
        if steps:
            j, k = steps[-1]
            if k + 1 < weights.shape[1] and falling[j, k + 1] > 0:
                further = size * falling[j, k + 1] / falling[j, k]
                heapq.heappush(heap, (further, (*steps[:-1], (j, k + 1))))
        for j in range(steps[-1][0] + 1 if steps else 0, d):
            if falling[j, 0] > 0:
                heapq.heappush(heap, (size * falling[j, 0], (*steps, (j, 0))))
    indices = np.zeros((len(found), d), dtype=np.int64)
    for i, steps in enumerate(found):
        for j, k in steps:
            indices[i, j] = order[j, k] + 1
    return indices


def margin(indices: Indices, highest: ArrayLike) -> Indices:
    """Return the products outside a downward-closed set all of whose divisors are inside.

    Parameters
    ----------
    indices
        The set, shape (n_terms, n_inputs).
    highest
        Highest degree of each input, shape (n_inputs,), or of all of them.

    Examples
    --------
    >>> margin(np.array([[0, 0], [0, 1], [1, 0]]), 5).tolist()
    [[0, 2], [1, 1], [2, 0]]
    """
    inside = set(map(tuple, indices.tolist()))
    outside = set()
    limits = np.broadcast_to(highest, indices.shape[1]).tolist()
    for alpha in inside:
        for j, degree in enumerate(alpha):
            beta = (*alpha[:j], degree + 1, *alpha[j + 1 :])
            if degree < limits[j] and beta not in inside and beta not in outside:
                divisors = ((*beta[:i], d - 1, *beta[i + 1 :]) for i, d in enumerate(beta) if d)
                if all(divisor in inside for divisor in divisors):
                    outside.add(beta)
    return np.array(sorted(outside), dtype=np.int64).reshape(-1, indices.shape[1])
