"""Aiming again: waypoints that a surrogate reaches and the true model misses.

At a waypoint the surrogate is off by a known amount, truth less surrogate. Shifted by that it is right there
and keeps its slopes, so the search of the shifted surrogate is a step of Newton's method on the truth with
the surrogate's derivatives. A few of them, each one solve of the truth, lead there where the slopes are of
any use.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.model import Evaluation, Model
from tensegra.analysis.waypoints import REACHED, WaypointSearch

if TYPE_CHECKING:
    from tensegra.study.space import Space

Array = NDArray[np.float64]

# Steps after which a surrogate whose slopes are of any use has led there.
MOST_ROUNDS = 8


@dataclass(frozen=True)
class Shifted:
    """A model with a constant (n_outputs,) added to its outputs."""

    model: Model
    by: Array

    @property
    def name(self) -> str:
        """The name of the model."""
        return self.model.name

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.model.input_names

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.model.output_names

    @property
    def bounds(self) -> Array | None:
        """The box of the model."""
        return self.model.bounds

    @property
    def space(self) -> "Space | None":
        """The joint law of the inputs."""
        return self.model.space

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name."""
        return self.model.units

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the shifted outputs."""
        found = self.model.evaluate(X)
        return replace(found, values=found.values + self.by)

    def gradient(self, X: ArrayLike) -> Array:
        """Return the derivatives, which a constant leaves as they are."""
        return self.model.gradient(X)

    def uncertainty(self, X: ArrayLike) -> Array | None:
        """Return the model's own standard deviation."""
        return self.model.uncertainty(X)


@dataclass(frozen=True)
class Truth:
    """What the true model says of designs.

    Attributes
    ----------
    values
        Of all outputs, (n, n_outputs).
    valid, status
        Whether, and how, each design stands, (n,).
    miss
        The largest miss of a target or a condition, of what is allowed, (n,): 1 or less where the waypoint is
        reached, infinite where there is no result.
    """

    values: Array
    valid: NDArray[np.bool_]
    status: NDArray[np.str_]
    miss: Array

    @classmethod
    def of(
        cls, solved: WaypointSearch, X: Array, targets: Array, allowed: Array, columns: Sequence[int]
    ) -> "Truth":
        """Ask the model of `solved` at designs (n, n_designed) with a row of targets each."""
        inputs = solved.inputs(X)
        found = solved.model.evaluate(inputs)
        misses = np.abs(found.values[:, columns] - targets) / allowed
        misses = np.where(np.isnan(targets), 0.0, misses)
        margins, _ = solved.margins(inputs, found.values)
        broken = np.maximum(-margins, 0.0) / (REACHED * solved.room)
        miss = np.concatenate([misses, broken], axis=1).max(axis=1)
        return cls(
            found.values, found.valid, found.status, np.where(found.valid & np.isfinite(miss), miss, np.inf)
        )

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Which of the designs are where they are wanted."""
        return np.asarray(self.miss <= 1.0)

    def put(self, rows: NDArray[np.intp], other: "Truth") -> None:
        """Take the answers of others in place of some."""
        for name in ("values", "valid", "status", "miss"):
            getattr(self, name)[rows] = getattr(other, name)


def aim_again(
    way: WaypointSearch,
    solved: WaypointSearch,
    X: Array,
    targets: Array,
    allowed: Array,
    columns: Sequence[int],
) -> tuple[Array, Truth]:
    """Return designs that the true model is led to, from those of its surrogate, and what it says of them.

    Parameters
    ----------
    way, solved
        The search on the surrogate, and the same with the true model.
    X, targets
        Designs (n_waypoints, n_designed) and what is wanted there (n_waypoints, n_targets).
    allowed
        By how much each output may miss.
    columns
        The targets among the true model's outputs.
    """
    X, truth = X.copy(), Truth.of(solved, X, targets, allowed, columns)
    truth = replace(truth, status=truth.status.astype(object))  # a status may be replaced by a longer one
    names = solved.model.output_names
    shared = [name in names for name in way.model.output_names]
    order = [names.index(name) for name in way.model.output_names if name in names]
    going = ~truth.reached & truth.valid
    for _ in range(MOST_ROUNDS):
        rows = np.flatnonzero(going)
        if not rows.size:
            break
        off = np.zeros((len(rows), len(shared)))
        off[:, shared] = truth.values[rows][:, order]
        off[:, shared] -= way.model.evaluate(way.inputs(X[rows])).values[:, shared]
        moved = np.array(
            [
                replace(way, model=Shifted(way.model, shift)).solve(targets[i], X[i])
                for i, shift in zip(rows, off, strict=True)
            ]
        )
        found = Truth.of(solved, moved, targets[rows], allowed, columns)
        better = found.miss < truth.miss[rows]
        X[rows[better]] = moved[better]
        truth.put(
            rows[better],
            Truth(found.values[better], found.valid[better], found.status[better], found.miss[better]),
        )
        going[rows] = better & (found.miss > 1.0)
    return X, truth
