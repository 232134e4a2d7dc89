"""The state of a page in words that do the same elsewhere: a command, Python, JSON, a structure file."""

import json
from typing import Any

import numpy as np

from tensegra.mechanics.arrays import AXES
from tensegra.structure import Stage, Structure, structure_to_mapping
from tensegra.structure.text import dump_yaml
from tensegra.studio.desk import Desk
from tensegra.studio.knobs import ALTERING, actuation_of

__all__ = ["as_command", "as_json", "as_python", "standing_structure", "structure_text"]


def as_command(desk: Desk, source: str) -> str:
    """Return the command that solves the state from the beginning.

    What the command line has no option for is told in a comment; the structure saved as it stands has it all.
    """
    run = actuation_of(desk.session.structure, desk.knobs, desk.values)
    options = [f" -a {_quoted(f'{name}={value!r}')}" for name, value in run.actuation.items() if value]
    options += [f" -t {_quoted(f'{name}={value!r}')}" for name, value in run.temperature.items() if value]
    options += [f" -l {_quoted(f'{n}.{a}={v!r}')}" for (n, a), v in run.loads.items() if v]
    rest = [f"position {n}.{a} = {v!r}" for (n, a), v in run.positions.items() if v]
    rest += [f"{key} = {desk.values[key]!r}" for key in _altering(desk)]
    command = f"tensegra solve {_quoted(source)}{''.join(options)}"
    return f"{command}  # without {', '.join(rest)}: save the structure for that" if rest else command


def as_python(desk: Desk, source: str) -> str:
    """Return the Python that solves the state from the beginning."""
    run = actuation_of(desk.session.structure, desk.knobs, desk.values)
    read = f"tg.library.{source.removeprefix('library:')}()" if source.startswith("library:") else ""
    given = ", ".join(
        f"{name}={ ({key: v for key, v in values.items() if v})!r}"
        for name, values in zip(("actuation", "temperature", "loads", "positions"), run.groups(), strict=True)
        if any(values.values())
    )
    lines = [
        "import tensegra as tg",
        f"structure = {read or f'tg.read_structure({source!r})'}",
        *(f"# {key} = {desk.values[key]!r}: set in the structure's file" for key in _altering(desk)),
        f"path = tg.solve_path(structure{', ' if given else ''}{given})",
    ]
    return "\n".join(lines)


def as_json(desk: Desk, source: str) -> str:
    """Return the state with its certificate, as `tensegra solve --json` writes an equilibrium."""
    content: dict[str, Any] = {"structure": source, "inputs": desk.values, **desk.found.to_dict()}
    moved = desk.found.nodes - desk.reference
    content["displacements"] = dict(zip(desk.structure.node_ids, moved.tolist(), strict=True))
    return json.dumps(content, indent=1, allow_nan=False)


def standing_structure(desk: Desk) -> Structure:
    """Return the structure with a stage more, that takes it to where it stands.

    Its displacements are then measured from there, as from every last stage.
    """
    structure, base, now = desk.session.structure, desk.session.base, desk.session.standing.inputs
    arrays = desk.found.arrays
    members, nodes = structure.member_ids, structure.node_ids
    lengths = np.flatnonzero(now.rest_length != base.rest_length)
    heated = np.flatnonzero(now.temperature != base.temperature)
    loaded = np.flatnonzero(np.any(now.loads != base.loads, axis=1))
    shifted = np.flatnonzero(np.any((now.positions != base.positions) & ~arrays.free, axis=1))
    held = now.positions + arrays.origin
    names = {stage.name for stage in structure.stages}
    name = next(name for name in ("studio", *(f"studio {i}" for i in range(2, 10**6))) if name not in names)
    stage = Stage(
        name,
        rest_lengths={members[e]: float(now.rest_length[e]) for e in lengths},
        temperatures={members[e]: float(now.temperature[e]) for e in heated},
        loads={nodes[n]: tuple(now.loads[n].tolist()) for n in loaded},
        positions={nodes[n]: _held_at(structure, nodes[n], held[n]) for n in shifted},
    )
    if not (len(lengths) or len(heated) or len(loaded) or len(shifted)):
        return structure
    # A structure without stages has one that is not named; it is the first of two now.
    first = structure.stages or (Stage("as given"),)
    return structure.replace(stages=(*first, stage))


def _held_at(structure: Structure, node: str, position: np.ndarray) -> tuple[float, float, float]:
    """Return where a node is held: along free axes, as a stage wants it, the coordinate of the drawing."""
    held, drawn = structure.supports[node], structure.nodes[node]
    x, y, z = (float(p) if axis in held else d for axis, p, d in zip(AXES, position, drawn, strict=True))
    return x, y, z


def structure_text(structure: Structure) -> str:
    """Return a structure as the YAML of its file."""
    return dump_yaml(structure_to_mapping(structure))


def _altering(desk: Desk) -> list[str]:
    return [
        key
        for key, value in desk.values.items()
        if desk.knobs[key].quantity in ALTERING and value is not None
    ]


def _quoted(text: str) -> str:
    from shlex import quote

    return quote(text)
