"""The surface on which the lift is straight, v = 0, and slices of the lift over the actuations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import Model
from tensegra_paper.models import LIFT_INPUTS
from tensegra_paper.setting import Setting

__all__ = ["Slice", "Surface", "crossings", "slices", "straight_surface"]

Array: TypeAlias = NDArray[np.float64]

N_GRID, FEWEST = 61, 25
"""Points along each side of the grid on which the surrogate is asked, at full and at small scale."""

SECANTS = 3
"""Steps of the secant method from the ends of a cell in which v changes its sign."""

SLICES = (0.1, 0.2, 0.3)
"""Values of A23 that are shown."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Points of the surface v = 0, solved by FEM.

    Attributes
    ----------
    X
        Actuations (A1, A23, A4), shape (n_points, 3).
    w
        Lift, shape (n_points,), cm.
    largest_v
        Largest magnitude of v at these points, by FEM: how well the surrogate places the surface, cm.
    """

    X: Array
    w: Array
    largest_v: float


@dataclass(frozen=True, eq=False)
class Slice:
    """Displacements over A1 and A4 at one A23; NaN where the structure collapses.

    Attributes
    ----------
    value
        Of A23.
    grid
        Values of A1 and of A4, shape (n,).
    v, w
        Shape (n, n), A1 along the rows; cm.
    """

    value: float
    grid: Array
    v: Array
    w: Array


def straight_surface(setting: Setting, model: Model) -> Surface:
    """Trace v = 0 along A4 on a grid of A1 and A23, and solve what was found by FEM."""
    grid = _grid(setting, model)
    A1, A23 = (each.ravel() for each in np.meshgrid(grid, grid, indexing="ij"))

    def v(rows: NDArray[np.intp], A4: Array) -> Array:
        return model.evaluate(np.column_stack([A1[rows], A23[rows], A4])).values[:, 0]

    every = np.arange(len(A1))
    values = np.stack([v(every, np.full(len(every), A4)) for A4 in grid], axis=1)
    rows, A4 = crossings(values, grid, v)
    X = np.column_stack([A1[rows], A23[rows], A4])
    runs = setting.runs("straight", setting.without_gravity, dict(zip(LIFT_INPUTS, X.T, strict=True)))
    stands = runs.stands
    return Surface(X[stands], runs.w[stands], float(np.abs(runs.v[stands]).max()))


def _grid(setting: Setting, model: Model) -> Array:
    assert model.bounds is not None  # noqa: S101 - it has the box of the study
    low, high = model.bounds[0]
    return np.linspace(low, high, setting.count(N_GRID, least=FEWEST))


def crossings(
    values: Array, grid: Array, function: Callable[[NDArray[np.intp], Array], Array]
) -> tuple[NDArray[np.intp], Array]:
    """Return where rows of values change their sign along a grid, refined by secants.

    Parameters
    ----------
    values
        Shape (n_rows, n_grid); no crossing is sought beside a NaN.
    grid
        Shape (n_grid,).
    function
        Takes row numbers and places, both (n,), and returns the values there.

    Returns
    -------
    rows, places
        Shape (n_crossings,) each.

    Examples
    --------
    >>> grid = np.linspace(0.0, 1.0, 5)
    >>> rows, places = crossings((grid**2 - 0.3)[None], grid, lambda rows, x: x**2 - 0.3)
    >>> rows, places.round(4)
    (array([0]), array([0.5477]))
    """
    rows, cells = np.nonzero(values[:, :-1] * values[:, 1:] < 0.0)
    low, high = grid[cells], grid[cells + 1]
    at_low, at_high = values[rows, cells], values[rows, cells + 1]
    places = low - at_low * (high - low) / (at_high - at_low)
    for _ in range(SECANTS):
        found = function(rows, places)
        below = np.sign(found) == np.sign(at_low)
        low, at_low = np.where(below, places, low), np.where(below, found, at_low)
        high, at_high = np.where(below, high, places), np.where(below, at_high, found)
        step = np.where(at_high == at_low, 1.0, at_high - at_low)
        places = low - at_low * (high - low) / step
    kept = np.isfinite(places)
    return rows[kept], places[kept]


def slices(setting: Setting, model: Model) -> tuple[Slice, ...]:
    """Ask the surrogate for v and w over A1 and A4, at some values of A23."""
    grid = _grid(setting, model)
    found = []
    for value in SLICES:
        A1, A4 = (each.ravel() for each in np.meshgrid(grid, grid, indexing="ij"))
        Y = model.evaluate(np.column_stack([A1, np.full(len(A1), value), A4])).values
        v, w = (Y[:, list(model.output_names).index(name)].reshape(len(grid), -1) for name in ("v", "w"))
        found.append(Slice(value, grid, v, w))
    return tuple(found)
