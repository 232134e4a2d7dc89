"""Changes to a structure by hand, and whether it stands after them."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from tensegra.errors import ModelError
from tensegra.report.check import check_structure
from tensegra.structure import Member, Structure
from tensegra.structure.coerce import vector
from tensegra.structure.structure import path_length

__all__ = ["CHANGES", "changed", "verdict"]


def move_node(structure: Structure, node: str, position: list[float]) -> Structure:
    """Move a node in the drawing; rest lengths stay as they are."""
    _known(structure.nodes, node, "a node")
    return structure.replace(nodes={**structure.nodes, node: position})


def add_node(
    structure: Structure, node: str, position: list[float], to: list[str], kind: str, like: str
) -> Structure:
    """Add a node and the members that join it to others: a node that nothing joins is no part of a structure.

    Parameters
    ----------
    structure
        To which it is added.
    node, position
        Its name and where it is.
    to, kind, like
        Nodes to each of which a member leads, as those of `add_member`; it is named by both its ends.
    """
    if node in structure.nodes:
        raise ModelError.at("node", node, "a name that no node has")
    if not to:
        raise ModelError.at("to", to, "one node or more that it is joined to")
    _known(structure.members, like, "a member")
    nodes = {**structure.nodes, node: position}
    members = dict(structure.members)
    for other in to:
        _known(structure.nodes, other, "a node")
        length = path_length({**structure.nodes, node: vector(position)}, (node, other))
        members[f"{node}-{other}"] = _like(structure.members[like], kind, length, [node, other])
    return structure.replace(nodes=nodes, members=members)


def add_member(
    structure: Structure, member: str, kind: str, nodes: list[str], like: str, strain: float = 0.0
) -> Structure:
    """Add a member with the material and area of another, prestrained.

    Parameters
    ----------
    structure
        To which it is added.
    member, kind, nodes
        Its name, ``strut`` or ``cable``, and its path.
    like
        The member whose material, area or stiffness it takes.
    strain
        Of its length along the drawing over its rest length, less one.
    """
    if member in structure.members:
        raise ModelError.at("member", member, "a name that no member has")
    _known(structure.members, like, "a member")
    for node in nodes:
        _known(structure.nodes, node, "a node")
    if not strain > -1.0:
        raise ModelError.at("prestrain", strain, "a number above -1")
    rest_length = path_length(structure.nodes, nodes) / (1.0 + strain)
    made = _like(structure.members[like], kind, rest_length, nodes)
    return structure.replace(members={**structure.members, member: made})


def _like(model: Member, kind: str, rest_length: float, nodes: list[str]) -> Member:
    return Member(
        kind,  # type: ignore[arg-type] # the structure checks it
        tuple(nodes),
        rest_length,
        material=model.material,
        area=model.area,
        stiffness=model.stiffness,
    )


def remove_member(structure: Structure, member: str) -> Structure:
    """Remove a member, from actuators and stages too; an actuator left with none goes with it."""
    _known(structure.members, member, "a member")
    left = {name: m for name, m in structure.members.items() if name != member}
    groups = {group for m in left.values() for group in m.groups}
    actuators = {
        name: replace(actuator, members=tuple(m for m in actuator.members if m != member))
        for name, actuator in structure.actuators.items()
        if set(actuator.members) != {member}
    }

    def without(values: Mapping[str, float]) -> dict[str, float]:
        return {name: value for name, value in values.items() if name in left or name in groups}

    stages = tuple(
        replace(
            stage,
            rest_length_changes=without(stage.rest_length_changes),
            rest_lengths=without(stage.rest_lengths),
            temperatures=without(stage.temperatures),
        )
        for stage in structure.stages
    )
    return structure.replace(members=left, actuators=actuators, stages=stages)


def set_member(structure: Structure, member: str, quantity: str, value: float) -> Structure:
    """Set the area, the rest length or the stiffness of a member."""
    _known(structure.members, member, "a member")
    if quantity not in ("area", "rest_length", "stiffness"):
        raise ModelError.at("quantity", quantity, "area, rest_length or stiffness")
    changes: dict[str, Any] = {quantity: value}
    members = dict(structure.members)
    members[member] = replace(members[member], **changes)
    return structure.replace(members=members)


def set_support(structure: Structure, node: str, axes: str) -> Structure:
    """Hold a node along some axes, none for an empty text."""
    _known(structure.nodes, node, "a node")
    supports = {name: held for name, held in structure.supports.items() if name != node}
    return structure.replace(supports=supports | ({node: axes} if axes else {}))


CHANGES: dict[str, Callable[..., Structure]] = {
    change.__name__: change
    for change in (move_node, add_node, add_member, remove_member, set_member, set_support)
}
"""By the names that a page may use."""


def changed(structure: Structure, change: object, given: object) -> Structure:
    """Return a structure after one of `CHANGES`.

    Raises
    ------
    ModelError
        There is no such change, it is not given what it needs, or the structure cannot be so.
    """
    if not isinstance(change, str) or change not in CHANGES:
        raise ModelError.at("change", change, "a change", candidates=CHANGES)
    if not isinstance(given, Mapping):
        raise ModelError.at(change, given, "values by name")
    try:
        return CHANGES[change](structure, **{str(name): _plain(value) for name, value in given.items()})
    except TypeError as error:
        raise ModelError(f"{change}: {error}") from None


def _plain(value: Any) -> Any:  # noqa: ANN401 - what a page sends
    """Return a value that is a number, a text or a list of these."""
    if isinstance(value, list) and all(isinstance(item, str | float | int) for item in value):
        return value
    if isinstance(value, str | float | int):
        return value
    raise ModelError.at("change", value, "a number, a text or a list of these")


def verdict(structure: Structure) -> dict[str, Any]:
    """Tell whether a structure stands, and what holds it up."""
    check = check_structure(structure)
    statics = check.statics
    return {
        "stands": check.stands,
        "verdict": check.verdict,
        "self_stress": None if statics is None else statics.n_self_stress,
        "mechanisms": None if statics is None else statics.n_mechanisms,
        "rigid_motions": list(check.path.final.rigid_motions),
        "warnings": check.slips,
    }


def _known(names: Mapping[str, Any], name: str, what: str) -> None:
    if name not in names:
        raise ModelError.at("change", name, what, candidates=names)
