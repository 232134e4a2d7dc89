"""What is known of a result, what happened on the way to it, and how its parts are named."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import AXES, FloatArray


class Status(StrEnum):
    """What is known of a result."""

    STABLE = "stable"
    """Reached along a continuous path of stable equilibria."""
    SNAPPED = "snapped"
    """Stable, but the path left its branch at least once; where and how far is told."""
    COLLAPSED = "collapsed"
    """The prestress is lost: K is singular and the position is not unique."""
    UNSTABLE = "unstable"
    """An equilibrium that does not stand: K has a negative eigenvalue."""
    FAILED = "failed"
    """No equilibrium was found; no number is reported."""


SEVERITY = (Status.STABLE, Status.SNAPPED, Status.UNSTABLE, Status.COLLAPSED, Status.FAILED)
"""From the best to the worst."""


@dataclass(frozen=True)
class CriticalPoint:
    """Where a path lost its stability, and what became of it.

    Attributes
    ----------
    stage
        Name of the stage.
    parameter
        Path parameter λ in [0, 1] within the stage.
    kind
        ``limit point``, ``bifurcation``, ``slack`` (a cable went slack and took the stiffness with
        it), ``collapse`` (the last prestress went) or ``unstable start``.
    lowest_eigenvalue
        Of K at the last stable point before it.
    moved_nodes
        Nodes that the critical mode moves most.
    snap
        Largest displacement of a node in the jump that followed, 0 where the path stopped.
    energy_released
        Fall of the potential energy in that jump.
    """

    stage: str
    parameter: float
    kind: str
    lowest_eigenvalue: float
    moved_nodes: tuple[str, ...]
    snap: float = 0.0
    energy_released: float = 0.0

    def __str__(self) -> str:
        text = f"{self.kind} at {100 * self.parameter:.4g} % of stage '{self.stage}'"
        if self.snap > 0.0:
            text += f", snap of {self.snap:.4g}"
        return text


@dataclass(frozen=True)
class SlackEvent:
    """A cable that went slack, or came taut again, along a stage."""

    stage: str
    parameter: float
    member: str
    becomes: str


@dataclass(frozen=True, eq=False)
class PathPoint:
    """One accepted step: the state at a value of the path parameter."""

    stage: str
    parameter: float
    nodes: FloatArray
    tensions: FloatArray
    iterations: int


def axis_index(axis: str) -> int:
    """Return 0, 1 or 2 for x, y or z.

    Raises
    ------
    ModelError
        For any other axis.
    """
    if axis not in ("x", "y", "z"):
        raise ModelError.at("axis", axis, "x, y or z")
    return AXES.index(axis)


def names_in(names: str | int | Sequence[str | int]) -> Sequence[str | int]:
    """Return the names as a sequence: one alone is a sequence of itself."""
    return [names] if isinstance(names, str | int) else names


def index_of(names: Iterable[str], name: str | int, what: str) -> int:
    """Return the place of a name among the ids of a structure's nodes or members.

    Raises
    ------
    ModelError
        Where it is none of them.
    """
    ids = list(names)
    try:
        return ids.index(str(name))
    except ValueError:
        raise ModelError.at(what, name, f"the id of a {what}", candidates=ids) from None


def most_moved(node_ids: tuple[str, ...], motion: FloatArray) -> tuple[str, ...]:
    """Return up to four nodes that move most, none below a third of the largest motion."""
    return most_moved_of_each(node_ids, motion[None])[0]


def most_moved_of_each(node_ids: tuple[str, ...], motions: FloatArray) -> tuple[tuple[str, ...], ...]:
    """Return `most_moved` for each row of `motions`, ``(n, n_nodes)``."""
    most = np.argsort(-motions, axis=1, kind="stable")[:, :4]
    moved = np.take_along_axis(motions, most, axis=1)
    counts = (moved > motions.max(axis=1, keepdims=True, initial=0.0) / 3.0).sum(axis=1)
    return tuple(
        tuple(node_ids[n] for n in row[:count])
        for row, count in zip(most.tolist(), counts.tolist(), strict=True)
    )
