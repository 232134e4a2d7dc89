"""A structure as the plain mapping that its file holds."""

from tensegra.structure.parts import Actuator, Material, Member, Stage
from tensegra.structure.structure import Structure

__all__ = ["SCHEMA", "structure_to_mapping"]

SCHEMA = "tensegra/structure/1"

Plain = dict[str, object]


def structure_to_mapping(structure: Structure) -> Plain:
    """Return the content of a structure file: plain numbers in the structure's units, no defaults.

    `parse_structure` of the result gives the structure back.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> structure_to_mapping(library.prism())["supports"]
    {'b0': 'xyz', 'b1': 'yz', 'b2': 'z'}
    """
    units = structure.units
    mapping: Plain = {
        "schema": SCHEMA,
        "name": structure.name,
        "description": structure.description,
        "units": {"length": units.length, "force": units.force, "temperature": units.temperature},
        "nodes": {node: list(position) for node, position in structure.nodes.items()},
        "materials": {name: _material(material) for name, material in structure.materials.items()},
        "members": {name: _member(member) for name, member in structure.members.items()},
        "supports": dict(structure.supports),
        "gravity": list(structure.gravity) if any(structure.gravity) else None,
        "actuators": {name: _actuator(actuator) for name, actuator in structure.actuators.items()},
        "stages": [_stage(stage) for stage in structure.stages],
    }
    return _without_empty(mapping)


def _material(material: Material) -> Plain:
    return {
        "youngs_modulus": material.youngs_modulus,
        **_without_zero(weight=material.weight, thermal_expansion=material.thermal_expansion),
        **({} if material.strain_limit is None else {"strain_limit": material.strain_limit}),
    }


def _member(member: Member) -> Plain:
    return _without_empty(
        {
            "kind": member.kind,
            "nodes": list(member.nodes),
            "material": member.material,
            "area": member.area,
            "stiffness": member.stiffness,
            "rest_length": member.rest_length,
            "groups": list(member.groups),
            "section_inertia": member.section_inertia,
            "strength": member.strength,
        }
    )


def _actuator(actuator: Actuator) -> Plain:
    return {"members": list(actuator.members), "effect": actuator.effect}


def _stage(stage: Stage) -> Plain:
    return _without_empty(
        {
            "name": stage.name,
            "rest_length_changes": dict(stage.rest_length_changes),
            "rest_lengths": dict(stage.rest_lengths),
            "loads": {node: list(load) for node, load in stage.loads.items()},
            "temperatures": dict(stage.temperatures),
            "positions": {node: list(position) for node, position in stage.positions.items()},
            "gravity": None if stage.gravity is None else list(stage.gravity),
        }
    )


def _without_empty(mapping: Plain) -> Plain:
    return {key: value for key, value in mapping.items() if value not in (None, "", [], {})}


def _without_zero(**numbers: float) -> Plain:
    return {key: value for key, value in numbers.items() if value != 0.0}
