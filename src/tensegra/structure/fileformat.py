"""Reading and writing `tensegra/structure/1`, in YAML and JSON."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tensegra.errors import ModelError
from tensegra.files import write_text
from tensegra.structure.load import LOADERS, load_values
from tensegra.structure.mapping import SCHEMA, structure_to_mapping
from tensegra.structure.parts import Actuator, Material, Member, Stage
from tensegra.structure.plain import plain, value_at
from tensegra.structure.problems import NOTHING, InvalidStructureError, Place, Problem
from tensegra.structure.structure import Structure
from tensegra.structure.text import dump_json, dump_yaml
from tensegra.units import Units

if TYPE_CHECKING:
    from tensegra.structure.schema import StageSchema, StructureSchema

__all__ = ["parse_structure", "read_structure", "write_structure"]

_DUMPERS = {".yaml": dump_yaml, ".yml": dump_yaml, ".json": dump_json}


def read_structure(path: str | os.PathLike[str]) -> Structure:
    """Read a structure from a YAML or JSON file.

    Parameters
    ----------
    path
        A file in the format ``tensegra/structure/1``, named `.yaml`, `.yml` or `.json`.

    Raises
    ------
    ModelError
        The file cannot be read, or what it describes cannot be. The message gives the file, the keys
        that lead to the fault, what was found and what was expected.

    Examples
    --------
    >>> read_structure("beam.yml")
    Traceback (most recent call last):
    tensegra.errors.ModelError: beam.yml: no such file
    """
    path = Path(path)
    raw = load_values(path, ModelError)
    return build(raw, source=path.name, name=path.name.partition(".")[0], needs_schema=True)


def parse_structure(mapping: Mapping[Any, Any]) -> Structure:
    """Build a structure from a mapping with the content of a structure file.

    This is the short way to a structure of one's own: quantities may carry units, rest lengths may be
    left out, ids may be integers and coordinates arrays. The key `schema` may be left out too.

    Raises
    ------
    ModelError
        As for `read_structure`.

    Examples
    --------
    >>> parse_structure({
    ...     "name": "rope",
    ...     "units": {"length": "cm", "force": "kN"},
    ...     "nodes": {1: [0, 0, 0], 2: ["2 m", 0, 0]},
    ...     "members": {"K1": {"kind": "cable", "nodes": [1, 2], "stiffness": "5 MN"}},
    ...     "supports": {1: "xyz", 2: "yz"},
    ... }).members["K1"].rest_length
    200.0
    """
    return build(mapping, name="structure")


def write_structure(structure: Structure, path: str | os.PathLike[str]) -> None:
    """Write a structure to a YAML or JSON file, by its suffix; `read_structure` gives it back equal.

    The file appears complete or not at all.

    Raises
    ------
    ModelError
        The suffix is none of `.yaml`, `.yml` and `.json`, or the file cannot be written.
    """
    path = Path(path)
    dump = _DUMPERS.get(path.suffix.lower())
    if dump is None:
        raise _unknown_suffix(path)
    write_text(path, dump(structure_to_mapping(structure)), ModelError)


def build(
    raw: object,
    *,
    name: str,
    source: str = "",
    root: Place = (),
    written: object = None,
    needs_schema: bool = False,
) -> Structure:
    """Build a structure from plain values, and tell of faults in terms of where they were written.

    Parameters
    ----------
    raw
        The whole content.
    name
        The structure's name, if the content gives none.
    source, root
        Name of the file, and the keys above the content, for messages.
    written
        What the user wrote, if that is only a part of `raw`.
    needs_schema
        Whether the key `schema` must be there.
    """
    try:
        content = plain(raw)
        return _assemble({"name": name, **content}, needs_schema=needs_schema)
    except InvalidStructureError as error:
        seen = raw if written is None else written
        problems = [_as_written(problem, seen) for problem in error.problems]
        raise InvalidStructureError.of(problems, source=source, root=root) from None
    except ModelError as error:
        raise ModelError(f"{source}: {error}" if source else str(error)) from None


def _assemble(content: dict[str, Any], *, needs_schema: bool) -> Structure:
    from pydantic import ValidationError

    from tensegra.structure.schema import StructureSchema, UnitsSchema, problems_of

    schema = content.pop("schema", None if needs_schema else SCHEMA)
    if schema != SCHEMA:
        found = NOTHING if schema is None else schema
        raise InvalidStructureError.of([Problem(("schema",), found, repr(SCHEMA))])
    try:
        units_schema = UnitsSchema.model_validate(content.pop("units", {}))
    except ValidationError as error:
        raise InvalidStructureError.of(problems_of(error, ("units",))) from None
    units = Units(**units_schema.model_dump())
    try:
        checked = StructureSchema.model_validate(content, context={"units": units})
    except ValidationError as error:
        raise InvalidStructureError.of(problems_of(error)) from None
    return _structure(checked, units)


def _structure(content: "StructureSchema", units: Units) -> Structure:
    groups: dict[str, list[str]] = {}
    for name, member in content.members.items():
        for group in member.groups:
            groups.setdefault(group, []).append(name)
    return Structure(
        name=content.name,
        description=content.description,
        units=units,
        nodes=content.nodes,
        materials={name: Material(**dict(material)) for name, material in content.materials.items()},
        members={name: Member(**dict(vars(member))) for name, member in content.members.items()},
        supports=content.supports,
        gravity=content.gravity,
        actuators={
            name: Actuator(**{**dict(actuator), "members": _ungrouped(actuator.members, groups)})
            for name, actuator in content.actuators.items()
        },
        stages=tuple(_stage(stage, index, groups) for index, stage in enumerate(content.stages)),
    )


def _ungrouped(names: Sequence[str], groups: Mapping[str, Sequence[str]]) -> tuple[str, ...]:
    """Return names with those of groups replaced by their members."""
    return tuple(member for name in names for member in groups.get(name, [name]))


def _spread_over_groups(
    values: Mapping[str, float], groups: Mapping[str, Sequence[str]], place: Place
) -> dict[str, float]:
    """Return values by member, where they stand by member or by group.

    Raises
    ------
    InvalidStructureError
        Two of them set the same member to different values.
    """
    spread: dict[str, float] = {}
    set_by: dict[str, str] = {}
    for name, value in values.items():
        for member in groups.get(name, [name]):
            if spread.setdefault(member, value) != value:
                expected = f"one value for member {member!r}, which {set_by[member]!r} sets too"
                raise InvalidStructureError.of([Problem((*place, name), value, expected)])
            set_by.setdefault(member, name)
    return spread


def _stage(stage: "StageSchema", index: int, groups: Mapping[str, Sequence[str]]) -> Stage:
    values = dict(stage)
    if stage.name is None:
        values["name"] = f"stage {index + 1}"
    for key in ("rest_length_changes", "rest_lengths"):
        values[key] = _spread_over_groups(getattr(stage, key), groups, ("stages", index, key))
    return Stage(**values)


def _as_written(problem: Problem, raw: object) -> Problem:
    """Show a converted number as the quantity that was written."""
    written = value_at(raw, problem.place)
    if isinstance(problem.found, float) and isinstance(written, str):
        return Problem(problem.place, written, problem.expected, problem.candidates)
    return problem


def _unknown_suffix(path: Path) -> ModelError:
    return ModelError.at(path.name, path.suffix, "a file named .yaml, .yml or .json", candidates=LOADERS)
