"""The variables of a study: what each acts on, its law, and whether the structure can take it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeAlias

from tensegra.errors import StudyError
from tensegra.structure import Stage, Structure
from tensegra.structure.checks import LONGEST_FACTOR
from tensegra.structure.overlaps import find_overlaps, member_parts
from tensegra.study.distributions import Distribution, as_distribution
from tensegra.study.entry import Entry, Examples, Identifier, OneOf
from tensegra.study.law_entries import DistributionEntry
from tensegra.units import LARGEST, SMALLEST, Dimension, is_sane

__all__ = [
    "Axis",
    "Coordinate",
    "Prestress",
    "Target",
    "Variable",
    "VariableEntry",
    "bind_variable",
    "require_distinct_targets",
    "require_range",
]

Axis = Literal["x", "y", "z"]


class Coordinate(Entry):
    """One coordinate of a node."""

    examples: ClassVar[Examples] = ({"node": 9, "axis": "z"},)

    node: Identifier
    """Id of the node."""
    axis: Axis
    """Axis of the coordinate."""

    def __str__(self) -> str:
        return f"{self.node}.{self.axis}"


class Prestress(Entry):
    """The change of rest length that a stage gives to members, one value for all of them."""

    examples: ClassVar[Examples] = ({"stage": "prestress", "members": ["K1", "K2"]},)

    stage: Identifier
    """Name of the stage."""
    members: tuple[Identifier, ...]
    """Ids of the members that the stage gives this change of rest length."""

    def __str__(self) -> str:
        return f"{self.stage}: {', '.join(self.members)}"


Target: TypeAlias = str | Coordinate | Prestress

DIMENSIONS: dict[str, Dimension] = {
    "actuator": "ratio",
    "temperature": "temperature",
    "youngs_modulus": "stress",
    "area": "area",
    "rest_length": "length",
    "rest_length_error": "ratio",
    "load": "force",
    "position": "length",
    "prestress": "ratio",
}
"""What a variable can act on, and the dimension that its values then have."""


class VariableEntry(OneOf):
    """A variable as a study file writes it: what it acts on, and its distribution."""

    examples: ClassVar[Examples] = (
        {"actuator": "A14", "distribution": {"uniform": [0.09, 0.1]}, "label": "actuation of the top cables"},
        {"temperature": "top", "distribution": {"uniform": [0, 150]}},
        {"youngs_modulus": "steel", "distribution": {"normal": {"mean": 11500, "std": 200}}},
        {"area": "top", "distribution": {"normal": [0.5, 0.01]}},
        {"rest_length": "K1", "distribution": {"uniform": [295, 300]}},
        {"rest_length_error": "top", "distribution": {"normal": [0, 0.001]}},
        {"load": {"node": 9, "axis": "z"}, "distribution": {"uniform": [-1, 0]}},
        {"position": {"node": 1, "axis": "z"}, "distribution": {"normal": [0, 0.1]}},
        {"prestress": {"stage": "prestress", "members": ["K1"]}, "distribution": {"uniform": [-0.03, -0.02]}},
    )

    actuator: Identifier | None = None
    """Actuator whose value this is, a relative change of rest length. Unit of its law: 1."""
    temperature: Identifier | None = None
    """Member or group whose difference of temperature this is, added to that of the stages. Unit of its law:
    temperature."""
    youngs_modulus: Identifier | None = None
    """Material whose modulus this is. Unit of its law: force/length^2."""
    area: Identifier | None = None
    """Member or group whose cross-section this is. Unit of its law: length^2."""
    rest_length: Identifier | None = None
    """Member whose rest length before all stages this is. Unit of its law: length."""
    rest_length_error: Identifier | None = None
    """Member or group of which this is the relative error of the rest lengths before all stages, as they were
    cut: 0.001 is a thousandth too long. Unit of its law: 1."""
    load: Coordinate | None = None
    """Node and axis of a force that is added to the last stage's. Unit of its law: force."""
    position: Coordinate | None = None
    """Node and axis of a support that is shifted by this. Unit of its law: length."""
    prestress: Prestress | None = None
    """Stage and members whose entry in `rest_length_changes` this is. Unit of its law: 1."""
    distribution: DistributionEntry
    """Law of the variable, which for a question about the best value is the range to look in."""
    label: str = ""
    """Text for axes and tables; the name if left out."""

    @classmethod
    def _alternatives(cls) -> list[str]:
        return list(DIMENSIONS)


@dataclass(frozen=True)
class Variable:
    """An uncertain or free input of a structure.

    Parameters
    ----------
    name
        Name of its column.
    quantity
        What it acts on: a key of `VariableEntry`.
    target
        Which of them: a name, a node's coordinate, or the members of a stage.
    distribution
        Its law.
    unit
        Unit of its values, ``""`` for a ratio.
    label
        Text for axes; the name, if it is empty.
    """

    name: str
    quantity: str
    target: Target
    distribution: Distribution
    unit: str = ""
    label: str = ""

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry that a study file would hold, all explicit."""
        target = self.target if isinstance(self.target, str) else self.target.written()
        entry = {self.quantity: target, "distribution": self.distribution.to_mapping()}
        return {**entry, "label": self.label} if self.label else entry


def bind_variable(name: str, entry: VariableEntry, structure: Structure, place: str) -> Variable:
    """Join a variable's entry with the structure that it acts on.

    Parameters
    ----------
    name
        Name of the variable.
    entry
        What the study file says of it.
    structure
        What it acts on.
    place
        Where the entry stands, the beginning of every message.

    Raises
    ------
    StudyError
        If the structure has no such actuator, group, member, material, node or stage, or cannot take
        every value of the distribution's box.
    """
    dimension = DIMENSIONS[entry.kind]
    target = entry.value
    if isinstance(target, Prestress):
        named = [structure.groups.get(member, (member,)) for member in target.members]
        target = Prestress(stage=target.stage, members=tuple(member for group in named for member in group))
    variable = Variable(
        name=name,
        quantity=entry.kind,
        target=target,
        distribution=as_distribution(entry.distribution, f"{place}.distribution"),
        unit="" if dimension == "ratio" else structure.units.of(dimension),
        label=entry.label,
    )
    _require_target(variable, structure, f"{place}.{entry.kind}")
    require_range(variable, structure, variable.distribution.box, f"{place}.distribution")
    return variable


def _require_target(variable: Variable, structure: Structure, place: str) -> None:
    target = variable.target
    if isinstance(target, Coordinate):
        _require_coordinate(variable.quantity, target, structure, place)
    elif isinstance(target, Prestress):
        _require_prestress(target, structure, place)
    else:
        expected, known = _targets(variable.quantity, structure)
        if target not in known:
            raise StudyError.at(place, target, expected, candidates=known)
    if variable.quantity in {"rest_length", "rest_length_error"}:
        _require_no_length_anew(structure.members_named(str(target)), structure.stages, place)
    if variable.quantity == "area":
        for member in structure.members_named(str(target)):
            if structure.members[member].area is None:
                raise StudyError(
                    f"{place}: member {member!r} has a stiffness instead of an area, expected an area"
                )


def _targets(quantity: str, structure: Structure) -> tuple[str, list[str]]:
    """Return what a quantity acts on, as a phrase, and the names that the structure has for it."""
    match quantity:
        case "actuator":
            return "an actuator", list(structure.actuators)
        case "youngs_modulus":
            used = {member.material for member in structure.members.values() if member.area is not None}
            return "a material that gives a member its stiffness", [
                name for name in structure.materials if name in used
            ]
        case "rest_length":
            return "a member", list(structure.members)
    return "a member or a group", [*structure.groups, *structure.members]


def _require_coordinate(quantity: str, target: Coordinate, structure: Structure, place: str) -> None:
    if target.node not in structure.nodes:
        raise StudyError.at(f"{place}.node", target.node, "a node", candidates=structure.nodes)
    held = structure.supports.get(target.node, "")
    if quantity == "position" and target.axis not in held:
        raise StudyError.at(
            f"{place}.axis", target.axis, f"an axis that supports node {target.node} ({held or 'none does'})"
        )


def _require_prestress(target: Prestress, structure: Structure, place: str) -> None:
    names = [stage.name for stage in structure.stages]
    if target.stage not in names:
        raise StudyError.at(f"{place}.stage", target.stage, "a stage of the structure", candidates=names)
    index = names.index(target.stage)
    changed = structure.stages[index].rest_length_changes
    for member in target.members:
        if member not in changed:
            raise StudyError.at(
                f"{place}.members",
                member,
                f"a member that stage {target.stage!r} changes",
                candidates=changed,
            )
    _require_no_length_anew(target.members, structure.stages[index:], f"{place}.members")


def _require_no_length_anew(members: Sequence[str], stages: Sequence[Stage], place: str) -> None:
    """Refuse a variable that a later stage makes to be without effect."""
    for stage in stages:
        for member in members:
            if member in stage.rest_lengths:
                raise StudyError(
                    f"{place}: stage {stage.name!r} sets the rest length of {member!r} anew, "
                    "expected a member on which the variable still acts"
                )


def require_range(variable: Variable, structure: Structure, values: tuple[float, float], place: str) -> None:
    """Refuse values, given by the least and the greatest, of which the structure cannot take all.

    Raises
    ------
    StudyError
        If an actuation, a temperature or a prestress leaves no rest length or an absurd one, a modulus,
        an area or a rest length is not positive, or a number is too large or too small to compute with.
    """
    low, high = values
    found = f"values from {low:.6g} to {high:.6g}"
    if variable.quantity in {"youngs_modulus", "area", "rest_length"} and low <= 0:
        raise StudyError(f"{place}: found {found}, expected a positive {variable.quantity}")
    for limit in values:
        if not is_sane(limit):
            raise StudyError.at(place, float(limit), f"values from {SMALLEST:g} to {LARGEST:g} in size, or 0")
    factors = [factor for value in values for factor in _factors(variable, structure, float(value))]
    if factors and min(factors) <= 0:
        raise StudyError(f"{place}: found {found}, expected values {_limit(variable, structure)}")
    if factors and max(factors) >= LONGEST_FACTOR:
        expected = f"values that lengthen a member less than {LONGEST_FACTOR:g}-fold"
        raise StudyError(f"{place}: found {found}, expected {expected}")


def _factors(variable: Variable, structure: Structure, value: float) -> list[float]:
    """Return by what a value multiplies the rest lengths of the members that it acts on."""
    match variable.quantity:
        case "actuator":
            return [structure.actuators[str(variable.target)].factor(value)]
        case "prestress" | "rest_length_error":
            return [1.0 + value]
        case "temperature":
            members = (structure.members[name] for name in structure.members_named(str(variable.target)))
            materials = {structure.materials[member.material] for member in members if member.material}
            return [1.0 + material.thermal_expansion * value for material in materials]
    return []


def _limit(variable: Variable, structure: Structure) -> str:
    """Return, in words, which values leave a member a rest length."""
    if variable.quantity == "actuator":
        shortens = structure.actuators[str(variable.target)].effect == "shorten"
        return f"{'below 1' if shortens else 'above -1'} that leave a rest length"
    return (
        "that leave a rest length"
        if variable.quantity == "temperature"
        else "above -1 that leave a rest length"
    )


def require_distinct_targets(variables: Mapping[str, Variable], structure: Structure, place: str) -> None:
    """Refuse two variables that give one quantity its value, directly or through a group.

    Temperatures of a group and of its member are differences and add up.

    Parameters
    ----------
    variables
        By their names.
    structure
        Whose groups, members and nodes they name.
    place
        Where they stand, the beginning of the message.

    Raises
    ------
    StudyError
        Naming both.
    """
    for quantity in DIMENSIONS:
        acting = [variable for variable in variables.values() if variable.quantity == quantity]
        named = ((variable.name, _changed_parts(variable, structure)) for variable in acting)
        for overlap in find_overlaps(named):
            target = str(variables[overlap.name].target)
            raise StudyError.at(f"{place}.{overlap.name}", target, overlap.expected(quantity))


def _changed_parts(variable: Variable, structure: Structure) -> list[str]:
    """Return all that a variable changes, as `find_overlaps` takes it."""
    target = variable.target
    if isinstance(target, Prestress):
        return [f"member {member!r} in stage {target.stage!r}" for member in target.members]
    if isinstance(target, Coordinate):
        return [f"node {target.node} along {target.axis}"]
    if variable.quantity in {"area", "rest_length_error"}:
        return member_parts(structure, target)
    return [repr(target)]
