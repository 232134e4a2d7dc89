"""structure: what a tensegrity structure is, how it is read, written and changed."""

from tensegra.structure import library
from tensegra.structure.changes import apply_changes
from tensegra.structure.fileformat import parse_structure, read_structure, write_structure
from tensegra.structure.mapping import structure_to_mapping
from tensegra.structure.parts import STRAIN_LIMIT, Actuator, Material, Member, Stage
from tensegra.structure.structure import Structure
from tensegra.units import Units

__all__ = [
    "STRAIN_LIMIT",
    "Actuator",
    "Material",
    "Member",
    "Stage",
    "Structure",
    "Units",
    "apply_changes",
    "library",
    "parse_structure",
    "read_structure",
    "structure_to_mapping",
    "write_structure",
]
