"""Search variables that take certain values only: relax, then enumerate or branch.

A few combinations are all tried, each with starts of its own in the variables that are left. Of many, the
relaxed search says where to look: the combinations around its ends are tried, and from the best of them one
variable after the other moves to the value beside it, as long as that is better.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Combinations that are all tried; more are branched over.
MOST_COMBINATIONS = 128
# Variables of which a relaxed end is rounded both ways in every combination; of more only one at a time.
MOST_ROUNDED = 5
# Two numbers of the unit cube this near to each other are the same value of a variable.
SAME_VALUE = 1e-9


@dataclass(frozen=True)
class Levels:
    """The values of the discrete variables, in the unit cube and as written; None for a continuous one."""

    values: tuple[Array | None, ...]
    exact: tuple[Array | None, ...]

    @classmethod
    def of(cls, names: tuple[str, ...], box: Array, levels: Mapping[str, Array]) -> "Levels":
        """Place the values in the unit cube of a box (d, 2).

        Raises
        ------
        StudyError
            If a variable has no value within its bounds.
        """
        found: list[Array | None] = []
        exact: list[Array | None] = []
        for name, (low, high) in zip(names, box, strict=True):
            values = levels.get(name)
            if values is None or low == high:
                found.append(None)
                exact.append(None)
                continue
            slack = SAME_VALUE * (high - low)
            inside = values[(values >= low - slack) & (values <= high + slack)]
            if not inside.size:
                expected = f"bounds that hold one of its values ({', '.join(f'{v:g}' for v in values)})"
                raise StudyError.at(f"bounds.{name}", [float(low), float(high)], expected)
            found.append(np.clip((inside - low) / (high - low), 0.0, 1.0))
            exact.append(inside)
        return cls(tuple(found), tuple(exact))

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which variables are discrete, shape (d,)."""
        return np.array([values is not None for values in self.values], dtype=bool)

    @property
    def n_combinations(self) -> int:
        """Number of combinations of values; 1 where nothing is discrete."""
        count = 1
        for values in self.values:
            count *= 1 if values is None else len(values)
        return count

    def combinations(self) -> Array:
        """Return all combinations, shape (n_combinations, d); a continuous variable is NaN."""
        axes = [np.array([np.nan]) if values is None else values for values in self.values]
        return np.array(list(itertools.product(*axes)), dtype=float).reshape(-1, len(self.values))

    def snap(self, Z: Array) -> Array:
        """Move points (n, d) of the unit cube to the nearest values."""
        snapped = np.array(Z, dtype=float)
        for column, values in enumerate(self.values):
            if values is not None:
                nearest = np.abs(snapped[:, column, None] - values).argmin(axis=1)
                snapped[:, column] = values[nearest]
        return snapped

    def hold(self, Z: Array) -> NDArray[np.bool_]:
        """Tell which points (n, d) of the unit cube stand on values."""
        return np.asarray((np.abs(Z - self.snap(Z)) <= SAME_VALUE).all(axis=1))

    def restore(self, Z: Array, X: Array) -> Array:
        """Return inputs `X` (n, d) of the points `Z` with the exact values where a point stands on one."""
        restored = np.array(X)
        for column, (values, exact) in enumerate(zip(self.values, self.exact, strict=True)):
            if values is not None and exact is not None:
                distance = np.abs(Z[:, column, None] - values)
                place = distance.argmin(axis=1)
                there = distance.min(axis=1) <= SAME_VALUE
                restored[:, column] = np.where(there, exact[place], restored[:, column])
        return restored

    def around(self, z: Array) -> Array:
        """Return the combinations (n, d) of the values on either side of a point, the nearest first."""
        nearest = self.snap(z[None])[0]
        sides = [self._sides(column, z[column]) for column in np.flatnonzero(self.mask).tolist()]
        open_ = [pair for pair in sides if len(pair[1]) > 1]
        found = [nearest]
        if len(open_) <= MOST_ROUNDED:
            for choice in itertools.product(*(values for _, values in open_)):
                point = nearest.copy()
                point[[column for column, _ in open_]] = choice
                found.append(point)
        else:
            for column, values in open_:
                for value in values:
                    point = nearest.copy()
                    point[column] = value
                    found.append(point)
        return np.unique(found, axis=0)

    def beside(self, z: Array) -> Array:
        """Return the points (n, d) at which one discrete variable has the value beside its own."""
        found = []
        for column in np.flatnonzero(self.mask):
            values = self.values[column]
            assert values is not None  # noqa: S101 - the mask says so
            place = int(np.abs(values - z[column]).argmin())
            for other in (place - 1, place + 1):
                if 0 <= other < len(values):
                    point = z.copy()
                    point[column] = values[other]
                    found.append(point)
        return np.array(found).reshape(-1, z.size)

    def _sides(self, column: int, z: float) -> tuple[int, Array]:
        values = self.values[column]
        assert values is not None  # noqa: S101 - the mask says so
        above = int(np.searchsorted(values, z - SAME_VALUE))
        if above < len(values) and abs(values[above] - z) <= SAME_VALUE:
            return column, values[[above]]
        return column, values[max(above - 1, 0) : above + 1]
