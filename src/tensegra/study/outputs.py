"""The outputs of a study: the quantities of interest, taken from solved runs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tensegra.errors import StudyError
from tensegra.structure import Structure
from tensegra.study.entry import Examples, Identifier, OneOf
from tensegra.study.variables import Axis
from tensegra.units import Dimension

if TYPE_CHECKING:
    from tensegra.mechanics import Batch

__all__ = ["Output", "OutputEntry", "bind_output"]

Array: TypeAlias = NDArray[np.float64]
Nodes: TypeAlias = tuple[Identifier, ...]

ALL = "all"
"""In place of a group: every member."""


class OutputEntry(OneOf):
    """An output as a study file writes it; exactly one quantity."""

    examples: ClassVar[Examples] = (
        {"displacement": "z", "nodes": [18, 23], "label": "lift of the tip"},
        {"coordinate": "x", "nodes": [18]},
        {"distance": True, "nodes": [1, 18]},
        {"tension": "K1"},
        {"reaction": "z", "nodes": [1]},
        {"max_tension": "all"},
        {"min_tension": "top"},
        {"slack_cables": "all"},
        {"largest_strain": "all"},
        {"lowest_eigenvalue": True},
    )

    displacement: Axis | None = None
    """Axis of a displacement from the last stage's equilibrium, the mean over `nodes`. Unit: length."""
    coordinate: Axis | None = None
    """Axis of a coordinate, the mean over `nodes`. Unit: length."""
    distance: Literal[True] | None = None
    """Distance between the two `nodes`. Unit: length."""
    tension: Identifier | None = None
    """Member whose tension this is, or group for the mean over its members. Unit: force."""
    reaction: Axis | None = None
    """Axis of the supports' force on the structure, the sum over `nodes`, which are held along it. Unit:
    force."""
    max_tension: Identifier | None = None
    """Group, or `all`, of whose members this is the largest tension. Unit: force."""
    min_tension: Identifier | None = None
    """Group, or `all`, of whose members this is the smallest tension. Unit: force."""
    slack_cables: Identifier | None = None
    """Group, or `all`, of which this is the number of slack cables. Unit: 1."""
    largest_strain: Identifier | None = None
    """Group, or `all`, of whose members this is the largest strain T/EA in magnitude. Unit: 1."""
    lowest_eigenvalue: Literal[True] | None = None
    """Lowest eigenvalue of the tangent stiffness. Unit: force/length."""
    nodes: Nodes | None = Field(default=None, min_length=1)
    """Ids of the nodes that the quantity is taken at."""
    label: str = ""
    """Text for axes and tables; the name if left out."""

    @classmethod
    def _alternatives(cls) -> list[str]:
        return list(DIMENSIONS)


DIMENSIONS: dict[str, Dimension] = {
    "displacement": "length",
    "coordinate": "length",
    "distance": "length",
    "tension": "force",
    "reaction": "force",
    "max_tension": "force",
    "min_tension": "force",
    "slack_cables": "ratio",
    "largest_strain": "ratio",
    "lowest_eigenvalue": "force per length",
}
"""The quantities that can be an output, and their dimensions."""


@dataclass(frozen=True)
class Output:
    """A quantity of interest.

    Parameters
    ----------
    name
        Name of its column.
    quantity
        A key of `OutputEntry`.
    target
        The axis, member or group; empty where the quantity needs none.
    nodes, members
        The nodes or members that it is taken at; empty where it is about the others or the whole.
    unit
        Unit of its values, ``""`` for a number.
    label
        Text for axes; the name, if it is empty.
    """

    name: str
    quantity: str
    target: str = ""
    nodes: Nodes = ()
    members: tuple[str, ...] = ()
    unit: str = ""
    label: str = ""

    def of(self, runs: "Batch") -> Array:
        """Return the output of every run, shape (n_runs,); NaN where a run has none."""
        return np.asarray(_VALUES[self.quantity](self, runs), dtype=np.float64)

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry that a study file would hold."""
        entry: dict[str, Any] = {self.quantity: self.target or True}
        if self.nodes:
            entry["nodes"] = list(self.nodes)
        if self.label:
            entry["label"] = self.label
        return entry


def bind_output(name: str, entry: OutputEntry, structure: Structure, place: str) -> Output:
    """Join an output's entry with the structure that it is taken from.

    Raises
    ------
    StudyError
        If the structure has no such node, member or group, or the nodes do not fit the quantity.
    """
    _require_nodes(entry, structure, place)
    dimension = DIMENSIONS[entry.kind]
    return Output(
        name=name,
        quantity=entry.kind,
        target="" if entry.value is True else str(entry.value),
        nodes=entry.nodes or (),
        members=_members(entry, structure, f"{place}.{entry.kind}"),
        unit="" if dimension == "ratio" else structure.units.of(dimension),
        label=entry.label,
    )


def _members(entry: OutputEntry, structure: Structure, place: str) -> tuple[str, ...]:
    """Return the members that an output is about; none for an output about nodes or the whole."""
    if entry.kind == "tension":
        if entry.value not in structure.members and entry.value not in structure.groups:
            known = [*structure.members, *structure.groups]
            raise StudyError.at(place, entry.value, "a member or a group", candidates=known)
        return structure.members_named(str(entry.value))
    if entry.kind not in {"max_tension", "min_tension", "slack_cables", "largest_strain"}:
        return ()
    name = str(entry.value)
    if name == ALL:
        return structure.member_ids
    if name not in structure.members and name not in structure.groups:
        known = [ALL, *structure.groups, *structure.members]
        raise StudyError.at(place, name, "a group, a member or 'all'", candidates=known)
    return structure.members_named(name)


def _require_nodes(entry: OutputEntry, structure: Structure, place: str) -> None:
    about_nodes = entry.kind in {"displacement", "coordinate", "distance", "reaction"}
    if about_nodes and entry.nodes is None:
        raise StudyError(f"{place}.nodes: the key is missing")
    if not about_nodes and entry.nodes is not None:
        raise StudyError(f"{place}.nodes: found nodes, which {entry.kind} does not take")
    if entry.kind == "distance" and len(entry.nodes or ()) != 2:
        raise StudyError.at(f"{place}.nodes", list(entry.nodes or ()), "two nodes")
    for i, node in enumerate(entry.nodes or ()):
        if node not in structure.nodes:
            raise StudyError.at(f"{place}.nodes[{i}]", node, "a node", candidates=structure.nodes)
    if entry.kind == "reaction":
        _require_supports(entry.nodes or (), str(entry.value), structure, place)


def _require_supports(nodes: Nodes, axis: str, structure: Structure, place: str) -> None:
    """Refuse nodes of a sum of reactions that are not held along the axis, or would count twice."""
    held = [node for node, axes in structure.supports.items() if axis in axes]
    for i, node in enumerate(nodes):
        if node not in held:
            raise StudyError.at(f"{place}.nodes[{i}]", node, f"a node held along {axis}", candidates=held)
        if node in nodes[:i]:
            raise StudyError.at(f"{place}.nodes[{i}]", node, "each node once, for the reactions are summed")


def _distance(output: Output, runs: "Batch") -> Array:
    first, second = (list(runs.node_ids).index(node) for node in output.nodes)
    separation: Array = np.linalg.norm(runs.nodes[:, second] - runs.nodes[:, first], axis=1)
    return separation


def _tensions(output: Output, runs: "Batch") -> Array:
    return runs.tensions[:, _rows(output, runs)]


def _rows(output: Output, runs: "Batch") -> list[int]:
    row = {member: i for i, member in enumerate(runs.member_ids)}
    return [row[member] for member in output.members]


def _slack_cables(output: Output, runs: "Batch") -> Array:
    count = runs.slack[:, _rows(output, runs)].sum(axis=1)
    return np.where(np.isnan(runs.tensions).any(axis=1), np.nan, count)


_VALUES: dict[str, Callable[[Output, "Batch"], Array]] = {
    "displacement": lambda output, runs: runs.displacement(output.target, nodes=output.nodes),
    "coordinate": lambda output, runs: runs.coordinate(output.target, nodes=output.nodes),
    "distance": _distance,
    "tension": lambda output, runs: _tensions(output, runs).mean(axis=1),
    "reaction": lambda output, runs: runs.reaction(output.target, nodes=output.nodes),
    "max_tension": lambda output, runs: _tensions(output, runs).max(axis=1),
    "min_tension": lambda output, runs: _tensions(output, runs).min(axis=1),
    "slack_cables": _slack_cables,
    "largest_strain": lambda output, runs: np.abs(runs.strains[:, _rows(output, runs)]).max(axis=1),
    "lowest_eigenvalue": lambda _, runs: runs.lowest_eigenvalue,
}
"""How each quantity is taken from the solved runs."""
