"""The knobs of a page: what may be set, in which unit and range, and what it does to the structure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from tensegra.errors import ModelError
from tensegra.mechanics.inputs import Actuation
from tensegra.structure import Structure
from tensegra.study.variables import Coordinate, Prestress, Variable

__all__ = ["Knob", "actuation_of", "checked", "knobs_of_structure", "knobs_of_study", "varied"]

WIDEST_ACTUATION = 0.15
"""Range of an actuator's slider where no study says one; its number field takes what the structure takes."""

HEAT = 100.0
"""Range of a temperature's slider, either way, in the structure's unit."""

LOAD_FACTORS = (0.0, 3.0)
FACTOR = "load_factor"
ALTERING = ("youngs_modulus", "area", "rest_length", "prestress")
"""What alters the structure before its first stage: it is then solved from there."""


@dataclass(frozen=True)
class Knob:
    """One thing that may be set.

    Attributes
    ----------
    key
        Its name on the page, unique: a study's variable, or the quantity and its target.
    label, group
        What a person reads, and under which heading.
    quantity, target
        As those of `tensegra.study.variables.Variable`; ``load_factor`` scales all loads of the last stage.
    unit
        Of its values, ``""`` for a ratio.
    low, high
        Ends of its slider.
    value
        Where it begins.
    """

    key: str
    label: str
    group: str
    quantity: str
    target: Any
    unit: str
    low: float
    high: float
    value: float = 0.0

    @property
    def at_rest(self) -> float:
        """Its value where the stages end and nothing acts after them."""
        if self.quantity in ALTERING:
            return self.value
        return 1.0 if self.quantity == FACTOR else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return what the page needs."""
        shown = ("key", "label", "group", "quantity", "unit", "low", "high", "value")
        return {name: getattr(self, name) for name in shown}


def knobs_of_structure(structure: Structure) -> tuple[Knob, ...]:
    """Return a knob for each actuator, each group of members that heat changes, and the loads as a whole."""
    knobs = [
        Knob(
            f"actuator:{name}",
            name,
            "Actuators",
            "actuator",
            name,
            "",
            -WIDEST_ACTUATION,
            WIDEST_ACTUATION,
        )
        for name in structure.actuators
    ]
    heat = structure.units.temperature
    knobs += [
        Knob(f"temperature:{name}", name, "Temperatures", "temperature", name, heat, -HEAT, HEAT)
        for name, members in structure.groups.items()
        if any(structure.thermal_expansion(member) for member in members)
    ]
    if _loads(structure):
        knobs.append(Knob(FACTOR, "load factor", "Loads", FACTOR, "", "", *LOAD_FACTORS, value=1.0))
    return tuple(knobs)


def knobs_of_study(variables: Sequence[Variable]) -> tuple[Knob, ...]:
    """Return a knob for each variable of a study, over its box, in the middle of which it begins."""
    knobs = []
    for variable in variables:
        low, high = map(float, variable.distribution.box)
        knobs.append(
            Knob(
                variable.name,
                variable.label or variable.name,
                "Variables of the study",
                variable.quantity,
                variable.target,
                variable.unit,
                low,
                high,
                (low + high) / 2.0,
            )
        )
    return tuple(knobs)


def load_knob(structure: Structure, node: str, axis: str, most: float) -> Knob:
    """Return a knob for a force on a node along an axis, added to that of the stages.

    Raises
    ------
    ModelError
        There is no such node or axis.
    """
    if node not in structure.nodes:
        raise ModelError.at("load", node, "a node", candidates=structure.nodes)
    if axis not in ("x", "y", "z"):
        raise ModelError.at("load", axis, "an axis: x, y or z")
    target = Coordinate(node=node, axis=axis)
    unit = structure.units.force
    return Knob(f"load:{node}.{axis}", f"load {node}.{axis}", "Loads", "load", target, unit, -most, most)


def checked(knobs: Mapping[str, Knob], values: object) -> dict[str, float]:
    """Return the values that a page sends, after a look at each.

    Raises
    ------
    ModelError
        A name that is no knob's, or what is no finite number.
    """
    if not isinstance(values, Mapping):
        raise ModelError.at("values", values, "a value by name")
    for key, value in values.items():
        if key not in knobs:
            raise ModelError.at("values", key, "one of the page's inputs", candidates=knobs)
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            raise ModelError.at(str(key), value, "a finite number")
    return {str(key): float(value) for key, value in values.items()}


def actuation_of(structure: Structure, knobs: Mapping[str, Knob], values: Mapping[str, float]) -> Actuation:
    """Return what the knobs do after the stages."""
    actuation, temperature = {}, {}
    loads: dict[tuple[str, str], float] = {}
    positions = {}
    for key, value in values.items():
        knob = knobs[key]
        match knob.quantity:
            case "actuator":
                actuation[knob.target] = value
            case "temperature":
                temperature[knob.target] = value
            case "position":
                positions[knob.target.node, knob.target.axis] = value
            case "load":
                place = knob.target.node, knob.target.axis
                loads[place] = loads.get(place, 0.0) + value
            case "load_factor":
                for place, force in _loads(structure).items():
                    loads[place] = loads.get(place, 0.0) + (value - 1.0) * force
    return Actuation(actuation, temperature, loads, positions)


def varied(structure: Structure, knobs: Mapping[str, Knob], values: Mapping[str, float]) -> Structure:
    """Return the structure with what the knobs alter before its first stage; itself where they alter nothing.

    Raises
    ------
    ModelError
        It cannot be altered so.
    """
    for key, value in values.items():
        knob = knobs[key]
        match knob.quantity:
            case "youngs_modulus":
                materials = dict(structure.materials)
                materials[knob.target] = replace(materials[knob.target], youngs_modulus=value)
                structure = structure.replace(materials=materials)
            case "area" | "rest_length" as quantity:
                changes: dict[str, Any] = {quantity: value}
                members = dict(structure.members)
                for name in structure.members_named(knob.target):
                    members[name] = replace(members[name], **changes)
                structure = structure.replace(members=members)
            case "prestress":
                structure = _prestressed(structure, knob.target, value)
    return structure


def _prestressed(structure: Structure, target: Prestress, value: float) -> Structure:
    stages = [
        replace(
            stage,
            rest_length_changes={**stage.rest_length_changes, **dict.fromkeys(target.members, value)},
        )
        if stage.name == target.stage
        else stage
        for stage in structure.stages
    ]
    return structure.replace(stages=tuple(stages))


def _loads(structure: Structure) -> dict[tuple[str, str], float]:
    """Return the loads after the last stage, by node and axis, without those that are zero."""
    forces: dict[str, Any] = {}
    for stage in structure.stages:
        forces |= stage.loads
    return {
        (node, axis): float(value)
        for node, force in forces.items()
        for axis, value in zip("xyz", force, strict=True)
        if value
    }
