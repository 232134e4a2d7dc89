"""From a beam to the nearest one that misses less: damped Gauss–Newton steps on what the fit may see."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Descent", "descend"]

Array: TypeAlias = NDArray[np.float64]

ABSENT = 100.0
"""Miss of what a beam cannot answer."""

STEP = 2e-4
"""Of the difference quotients, in the numbers of a candidate (logarithms, radians, 30 cm)."""

DAMPINGS = (1e-8, 1e-6, 1e-4, 1e-2, 1.0)
"""Shares of the mean squared slope, all tried: a slope costs a solution for each way, a step one."""

CORRECTION = 1e-3
"""Damping of the second part of a step."""

LONGEST = 0.15
"""Of a step, in the same: shapes further away need not be of the same branch."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent has come to.

    Attributes
    ----------
    numbers, misses, cost
        At its end; the cost is the sum of squares of arsinh of the misses.
    n_steps
        Taken.
    """

    numbers: Array
    misses: Array
    cost: float
    n_steps: int


def cost_of(misses: Array) -> float:
    """Return the sum of squares of arsinh of the misses: quadratic near agreement, slower far from it."""
    return float(np.sum(np.arcsinh(misses) ** 2))


def descend(
    miss: Callable[[Array], Array],
    start: Array,
    directions: Callable[[Array], Array],
    *,
    max_steps: int = 12,
    good: float = 0.01,
) -> Descent:
    """Follow damped Gauss–Newton steps.

    Parameters
    ----------
    miss
        Returns the misses of numbers.
    start
        Numbers to start from.
    directions
        Returns the ways to move from numbers, as rows.
    max_steps
        Steps at most.
    good
        Cost at which it ends.
    """
    numbers, found = start, miss(start)
    cost, taken = cost_of(found), 0
    for _ in range(max_steps):
        if cost < good:
            break
        ways = directions(numbers)
        if not len(ways):
            break
        moved = np.stack([miss(numbers + STEP * way) for way in ways])
        # What cannot be answered here or there has no slope.
        slopes = np.where(np.abs(moved - found) < 1.0, (moved - found) / STEP, 0.0).T
        # Weights for which the sum of squares is the cost here: the step aims at agreement itself.
        weight = np.where(found == 0.0, 1.0, np.arcsinh(found) / np.where(found == 0.0, 1.0, found))
        slopes, here = weight[:, None] * slopes, weight * found
        steps, tried = [], []
        for damping in DAMPINGS:
            step = _step(slopes, here, damping, ways)
            there = miss(numbers + step)
            steps.append(step)
            tried.append(there)
            if np.abs(there - found).max() < ABSENT / 2:
                # Some findings bend far more along a step than others move: they are brought back.
                bent = weight * there - (here + slopes @ (ways @ step))
                steps.append(step + _step(slopes, bent, CORRECTION, ways))
                tried.append(miss(numbers + steps[-1]))
        costs = [cost_of(there) for there in tried]
        best = int(np.argmin(costs))
        better = cost - costs[best]
        if better <= 0.0:
            break
        numbers, found, cost, taken = numbers + steps[best], tried[best], costs[best], taken + 1
        if better < 1e-3 * cost:
            break
    return Descent(numbers, found, cost, taken)


def _step(slopes: Array, here: Array, damping: float, ways: Array) -> Array:
    """Return the step of least length that the damped linear model asks for."""
    n = len(here)
    shift: Array = -slopes.T @ np.linalg.solve(
        slopes @ slopes.T + damping * np.trace(slopes @ slopes.T) / n * np.eye(n), here
    )
    shift = shift @ ways
    shortened: Array = shift * min(1.0, LONGEST / np.abs(shift).max())
    return shortened
