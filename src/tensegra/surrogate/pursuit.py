"""Orthogonal matching pursuit: which of many candidate terms an expansion needs, one after the other.

There may be many more candidates than runs. Each step takes the term that lowers the residual most, once what
the terms before it explain is taken out of both (orthogonal least squares: Chen, Billings and Luo,
*International Journal of Control* 50, 1989); the residuals without each run in turn come with it. It was
measured against LARS and against pursuit by plain correlation (`benchmarks/sparse_chaos.py`).
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.terms import largest

__all__ = ["hyperbolic", "pursue"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

DEPENDENT = 1e-8  # of a candidate's square, left when those before it are taken out: nothing but rounding
LARGEST_LEVERAGE = 1.0 - 1e-9
PATIENCE, PATIENCE_SHARE = 20, 0.1  # terms, or share of the runs, without a smaller error before it ends
EXACT = 1e-26  # mean square error over variance: rounding is reached


def hyperbolic(highest: Indices, norm: float, n_terms: int) -> Indices:
    """Return the products of the smallest Σ α_j^norm, as many as asked for.

    With a norm of one these are total degrees; a smaller one favours high degrees of few inputs over products
    of many (Blatman and Sudret, *Journal of Computational Physics* 230, 2011).

    Parameters
    ----------
    highest
        Highest degree of each input, shape (n_inputs,).
    norm
        From 0 to 1.
    n_terms
        Their number, if there are so many: it is bounded whatever the number of inputs.

    Examples
    --------
    >>> hyperbolic(np.array([3, 3]), 0.5, 6).tolist()
    [[0, 0], [1, 0], [0, 1], [2, 0], [0, 2], [3, 0]]
    """
    degree = np.arange(1, int(highest.max(initial=0)) + 1)
    weights = np.where(degree <= highest[:, None], np.exp(-(degree**norm)), 0.0)
    return largest(weights, n_terms)


def pursue(values: Array, T: Array, limit: int) -> tuple[NDArray[np.intp], int]:
    """Return the candidates in the order taken, and how many of them serve best.

    Parameters
    ----------
    values
        The candidates at the runs, shape (n_terms, n_runs); the first is the constant.
    T
        Outputs, shape (n_runs, n_outputs). A term counts by the share of each residual that it explains.
    limit
        Most terms.

    Returns
    -------
    tuple
        Places among the candidates, shape (n_taken,), and the number of them with the smallest leave-one-out
        error, corrected for the number of terms by n/(n − n_terms).
    """
    n = T.shape[0]
    square = np.einsum("ij,ij->i", values, values)
    left = square.copy()
    directions = np.empty((limit, n))
    residual = T - 0.0
    variance = np.maximum(np.var(T, axis=0), np.finfo(float).tiny)
    pull = values @ residual
    leverage = np.zeros(n)
    taken: list[int] = []
    best, smallest = 1, np.inf
    free = square > 0
    while len(taken) < limit:
        k = len(taken)
        gain = np.sum(pull**2 / np.maximum(np.sum(residual**2, axis=0), np.finfo(float).tiny), axis=1)
        gain = np.where(free, gain / np.where(free, left, 1.0), -1.0)
        chosen = int(np.argmax(gain)) if taken else 0
        if gain[chosen] < 0:
            break
        free[chosen] = False
        direction = values[chosen].copy()
        for _ in range(2):
            direction -= (directions[:k] @ direction) @ directions[:k]
        norm = np.linalg.norm(direction)
        if norm**2 <= DEPENDENT * square[chosen]:  # `left`, a difference, does not tell it to rounding
            continue
        direction /= norm
        directions[k] = direction
        taken.append(chosen)
        share = direction @ residual
        residual -= np.outer(direction, share)
        along = values @ direction
        left -= along**2
        pull -= np.outer(along, share)
        free &= left > DEPENDENT * square
        leverage += direction**2
        without = residual / np.maximum(1.0 - leverage, 1.0 - LARGEST_LEVERAGE)[:, None]
        relative = np.mean(without**2, axis=0) / variance
        error = float(np.mean(np.log(relative + EXACT))) + np.log(n / max(n - k - 1, 1))
        if error < smallest:
            best, smallest = k + 1, error
        if k + 1 - best > max(PATIENCE, PATIENCE_SHARE * n) or np.all(relative <= EXACT):
            break
    return np.array(taken, dtype=np.intp), best
