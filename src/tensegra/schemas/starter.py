"""Files to begin with: a structure and a study with a remark on every section, which run as they are."""

import json
import textwrap
from collections.abc import Mapping
from typing import Any

from tensegra.schemas.published import schema_text
from tensegra.structure import Structure, structure_to_mapping
from tensegra.structure.text import dump_line
from tensegra.study.schema import SCHEMA

__all__ = ["starter_structure", "starter_study"]

WIDTH = 100
"""Letters of a line of a remark."""

_ABSENT = {
    "structure": {
        "materials": "materials: {steel: {youngs_modulus: 210 GPa, thermal_expansion: 1.2e-5}}",
        "supports": "supports: {1: xyz, 2: z}",
        "gravity": "gravity: [0, 0, -1]",
        "actuators": "actuators: {A: {members: [K1, K2], effect: shorten}}",
        "stages": "stages: [{name: load, loads: {1: [0, 0, -10]}}]",
    },
    "study": {
        "changes": "changes: {gravity: [0, 0, 0]}",
        "correlation": "correlation: [[1, 0.5], [0.5, 1]]",
        "solver": "solver: {policy: stop}",
        "derivatives": "derivatives: true",
    },
}
"""What a section could look like that a file does not need, by format."""

_PARTS = {
    "materials": "MaterialSchema",
    "members": "MemberSchema",
    "actuators": "ActuatorSchema",
    "stages": "StageSchema",
}
"""Sections of a structure whose entries have keys of their own."""


def starter_structure(structure: Structure) -> str:
    """Return the text of a structure file with a remark on every section; `read_structure` gives it back.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> print(starter_structure(library.prism()).splitlines()[0])
    # A structure for tensegra. `tensegra check FILE` tells whether it stands, `tensegra solve FILE` where.
    """
    head = (
        "# A structure for tensegra. `tensegra check FILE` tells whether it stands, "
        "`tensegra solve FILE` where.\n"
        "# Numbers are in the units below; one may carry its own, such as 255 mm^2.\n"
        "# `tensegra schema structure` prints what every key means, for editors that check as one writes.\n"
    )
    return head + _text("structure", structure_to_mapping(structure))


def starter_study(structure: Structure, reference: str) -> str:
    """Return the text of a study of a structure, with a remark on every section.

    Parameters
    ----------
    structure
        The structure.
    reference
        How the study names it: a file relative to the study's, or ``library:NAME``.
    """
    variables = _variables(structure)
    first = next(iter(variables))
    content = {
        "schema": SCHEMA,
        "name": f"{structure.name}-study",
        "structure": reference,
        "seed": 1,
        "variables": variables,
        "outputs": _outputs(structure),
        "design": {"sampler": "sobol", "sizes": 64},
        "selection": {"method": "certificate"},
        "surrogates": {"poly": {"kind": "pce"}},
        "analyses": [
            {"propagation": {"name": "How far it scatters", "model": "poly", "samples": 10_000}},
            {"sensitivity": {"name": "Which input matters", "model": "poly", "samples": 1024}},
            {
                "optimisation": {
                    "name": "Where it moves most",
                    "model": "poly",
                    "objective": "abs(move)",
                    "search": [first],
                    "starts": 20,
                }
            },
        ],
    }
    head = (
        "# A study for tensegra. `tensegra run FILE -o runs/first` runs it, or what of it is missing;\n"
        "# `tensegra report runs/first` makes its page, `tensegra run FILE --dry-run` tells how long.\n"
        "# `tensegra schema study` prints what every key means, for editors that check as one writes.\n"
    )
    return head + _text("study", content)


ACTUATION = 0.02
"""Value of an actuator up to which a first study goes: enough to be seen, and safe for what stands."""

SHARE = 0.01
"""Load at the end of a first study's range, a share of what stretches its softest member by 1 %."""


def _variables(structure: Structure) -> dict[str, Any]:
    """Return what a first study varies: the actuators, or a load on the node of the outputs."""
    if structure.actuators:
        names = list(structure.actuators)[:3]
        return {
            _column(name, i): {"actuator": name, "distribution": {"uniform": [0.0, ACTUATION]}}
            for i, name in enumerate(names)
        }
    node = _moving_node(structure)
    axis = _free_axis(structure, node)
    force = SHARE * 0.01 * min(map(structure.axial_stiffness, structure.members))
    load = {"load": {"node": node, "axis": axis}, "distribution": {"uniform": [0.0, float(f"{force:.2g}")]}}
    return {"load": load}


def _outputs(structure: Structure) -> dict[str, Any]:
    node = _moving_node(structure)
    axis = _free_axis(structure, node)
    cable = next(
        (name for name, member in structure.members.items() if member.is_cable), next(iter(structure.members))
    )
    return {"move": {"displacement": axis, "nodes": [node]}, "pull": {"tension": cable}}


def _moving_node(structure: Structure) -> str:
    """Return the last node that is free to move up or down, else any that is free to move."""
    free = [node for node in structure.node_ids if "z" not in structure.supports.get(node, "")]
    return (free or [node for node in structure.node_ids if structure.supports.get(node) != "xyz"])[-1]


def _free_axis(structure: Structure, node: str) -> str:
    return next(axis for axis in "zxy" if axis not in structure.supports.get(node, ""))


def _column(name: str, i: int) -> str:
    """Return the name of a variable: the actuator's own where it can be one."""
    return name if name.isidentifier() and name not in {"move", "pull"} else f"a{i + 1}"


def _text(kind: str, content: Mapping[str, Any]) -> str:
    """Return YAML with the description of each section above it; sections left out stand as remarks."""
    schema = json.loads(schema_text(kind))
    lines: list[str] = []
    order = [key for key in schema["properties"] if key in content or key in _ABSENT[kind]]
    for key in ["schema", *(key for key in order if key != "schema")]:
        if key != "schema":
            lines += ["", *_remark(schema["properties"][key])]
            if kind == "structure" and key in _PARTS:
                lines += _keys(schema["$defs"][_PARTS[key]])
        if key in content:
            lines += _section(key, content[key])
        else:
            lines.append(f"# {_ABSENT[kind][key]}")
    return "\n".join(lines) + "\n"


def _section(key: str, value: Any) -> list[str]:  # noqa: ANN401 — any plain value
    """Return a section with a line for each of its entries."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [f"{key}:", *(f"  - {dump_line(entry)}" for entry in value)]
    if isinstance(value, dict) and any(isinstance(entry, dict | list) for entry in value.values()):
        return [f"{key}:", *(f"  {dump_line(name)}: {dump_line(entry)}" for name, entry in value.items())]
    return [f"{key}: {dump_line(value)}"]


def _remark(entry: Mapping[str, Any]) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(entry["description"], WIDTH)]


def _keys(definition: Mapping[str, Any]) -> list[str]:
    """Return a line or two for each key of an entry."""
    lines = []
    for key, entry in definition["properties"].items():
        unit = f" [{entry['unit']}]" if entry.get("unit", "1") != "1" else ""
        wrapped = textwrap.wrap(f"{key}: {entry['description']}{unit}", WIDTH - 4, subsequent_indent="  ")
        lines += [f"#   {line}" for line in wrapped]
    return lines
