"""A table of nodes and a table of members, two CSV files that stand beside each other.

``tower_nodes.csv`` and ``tower_members.csv`` make the structure ``tower``; either of the two names it, or
``tower.csv``, whether or not there is a file of that name.
"""

import csv
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tensegra.errors import ModelError
from tensegra.exchange.files import replacing, require_file
from tensegra.exchange.said import Content, Said
from tensegra.exchange.scene import Scene

__all__ = ["read", "table_files", "write"]

NODE_COLUMNS = ("node", "x", "y", "z", "supports")
MATERIAL_COLUMNS = ("youngs_modulus", "weight", "thermal_expansion")
MEMBER_COLUMNS = (
    *("member", "kind", "nodes", "start", "end", "material", "area", "stiffness", "rest_length"),
    *("groups", "section_inertia", "strength", "tension", *MATERIAL_COLUMNS),
)
_NUMBERS = ("area", "stiffness", "rest_length", "section_inertia", "strength", "tension")

_PART = re.compile(r"(?i)(.*?)[ _.-]?(?:nodes|members)$")

Row = dict[str, str]


def table_files(path: Path) -> tuple[Path, Path]:
    """Return the names of the two tables that a name stands for.

    Examples
    --------
    >>> [file.name for file in table_files(Path("tower.csv"))]
    ['tower_nodes.csv', 'tower_members.csv']
    >>> [file.name for file in table_files(Path("Members.csv"))]
    ['Nodes.csv', 'Members.csv']
    """
    part = _PART.fullmatch(path.stem)
    if part is None:
        return (
            path.with_name(f"{path.stem}_nodes{path.suffix}"),
            path.with_name(f"{path.stem}_members{path.suffix}"),
        )
    before, word = path.stem[: _word_at(path.stem)], path.stem[_word_at(path.stem) :]
    form = str.upper if word.isupper() else (str.capitalize if word[0].isupper() else str.lower)
    return (
        path.with_name(f"{before}{form('nodes')}{path.suffix}"),
        path.with_name(f"{before}{form('members')}{path.suffix}"),
    )


def _word_at(stem: str) -> int:
    return len(stem) - (len("nodes") if stem.lower().endswith("nodes") else len("members"))


def read(path: Path, said: Said) -> Content:  # noqa: ARG001 — what is said fills in later
    """Read the two tables that a name stands for."""
    node_file, member_file = table_files(path)
    nodes: dict[str, list[str]] = {}
    supports: dict[str, str] = {}
    for line, row in _rows(node_file, NODE_COLUMNS, ("node", "x", "y", "z")):
        place = f"{node_file.name}, line {line}"
        name = row["node"]
        if name in nodes or not name:
            raise ModelError.at(place, name, "the id of another node")
        nodes[name] = [row[axis] for axis in "xyz"]
        if row.get("supports"):
            supports[name] = row["supports"]
    members: dict[str, Content] = {}
    materials: dict[str, Content] = {}
    for line, row in _rows(member_file, MEMBER_COLUMNS, ("member", "kind")):
        place = f"{member_file.name}, line {line}"
        if row["member"] in members or not row["member"]:
            raise ModelError.at(place, row["member"], "the id of another member")
        members[row["member"]] = _member(row, materials, place)
    return {"nodes": nodes, "members": members, "materials": materials, "supports": supports}


def _member(row: Row, materials: dict[str, Content], place: str) -> Content:
    if row.get("nodes"):
        nodes = _ids(row["nodes"], f"{place}, nodes")
    else:
        nodes = [row.get("start", ""), row.get("end", "")]
        if not all(nodes):
            raise ModelError.at(place, "no nodes", "nodes such as '1 5 9', or a start and an end")
    member: Content = {"kind": row["kind"], "nodes": nodes}
    member |= {name: _number(row[name], f"{place}, {name}") for name in _NUMBERS if row.get(name)}
    if row.get("groups"):
        member["groups"] = _ids(row["groups"], f"{place}, groups")
    properties = {name: _number(row[name], f"{place}, {name}") for name in MATERIAL_COLUMNS if row.get(name)}
    if properties and not row.get("material"):
        known = [name for name, material in materials.items() if material == properties]
        member["material"] = known[0] if known else f"material{len(materials) + 1}"
    elif row.get("material"):
        member["material"] = row["material"]
    if properties and materials.setdefault(member["material"], properties) != properties:
        expected = (
            f"one set of values for the material {member['material']!r}: {materials[member['material']]}"
        )
        raise ModelError.at(place, properties, expected)
    return member


def _number(text: str, place: str) -> float | str:
    """Return a number; a quantity with its unit stays a text, which the reader of structures knows."""
    try:
        return float(text)
    except ValueError:
        if any(character.isdigit() for character in text):
            return text
        raise ModelError.at(place, text, "a number, or a quantity such as '5 mm'") from None


def _ids(text: str, place: str) -> list[str]:
    """Return ids that stand between blanks, commas or semicolons, or as a list of JSON's."""
    if not text.startswith("["):
        return re.split(r"[\s,;]+", text.strip())
    try:
        ids = json.loads(text)
    except (ValueError, RecursionError):
        ids = None
    if not isinstance(ids, list) or not all(isinstance(item, str) for item in ids):
        raise ModelError.at(place, text, 'ids such as 1 5 9, or ["1", "5", "9"]')
    return ids


def _rows(path: Path, known: Sequence[str], needed: Iterable[str]) -> list[tuple[int, Row]]:
    """Return the rows of a table with the lines that they end on; empty ones are left out."""
    require_file(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            head = file.readline()
            file.seek(0)
            # A program that writes commas in its numbers puts semicolons between them.
            reader = csv.reader(
                file, delimiter=";" if head.count(";") > head.count(",") else ",", strict=True
            )
            titles = [title.strip().lower() for title in next(reader, [])]
            _require_titles(titles, known, needed, path.name)
            rows = []
            for cells in reader:
                if any(cell.strip() for cell in cells):
                    if len(cells) > len(titles):
                        place = f"{path.name}, line {reader.line_num}"
                        raise ModelError.at(
                            place, f"{len(cells)} cells", f"at most {len(titles)}, as in the first line"
                        )
                    rows.append(
                        (
                            reader.line_num,
                            dict.fromkeys(titles, "")
                            | dict(zip(titles, map(str.strip, cells), strict=False)),
                        )
                    )
            return rows
    except UnicodeDecodeError:
        raise ModelError(f"{path.name}: this is not a text in UTF-8") from None
    except csv.Error as error:
        raise ModelError(f"{path.name}: this is not a table ({error})") from None
    except OSError as error:
        raise ModelError(f"{path}: {(error.strerror or str(error)).lower()}") from None


def _require_titles(titles: Sequence[str], known: Sequence[str], needed: Iterable[str], source: str) -> None:
    place = f"{source}, first line"
    for title in titles:
        if title not in known:
            raise ModelError.at(place, title, f"columns named {', '.join(known)}", candidates=known)
        if titles.count(title) > 1:
            raise ModelError.at(place, title, "each column once")
    for title in needed:
        if title not in titles:
            raise ModelError.at(place, ", ".join(titles), f"a column {title!r}")


def write(scene: Scene, path: Path) -> None:
    """Write the nodes and members at the last frame, with the tensions there."""
    structure = scene.structure
    rest_length, stiffness = scene.members
    node_file, member_file = table_files(path)
    _write_table(
        node_file,
        NODE_COLUMNS,
        [
            dict(
                zip(
                    NODE_COLUMNS,
                    (node, *scene.last.nodes[n].tolist(), structure.supports.get(node)),
                    strict=True,
                )
            )
            for n, node in enumerate(structure.node_ids)
        ],
    )
    rows = []
    for e, (name, member) in enumerate(structure.members.items()):
        row: dict[str, object] = {
            "member": name,
            "kind": member.kind,
            "nodes": _joined(member.nodes),
            "rest_length": float(rest_length[e]),
            "groups": _joined(member.groups),
            "section_inertia": member.section_inertia,
            "strength": member.strength,
            "tension": float(scene.last.tensions[e]),
        }
        if member.area is None or member.material is None:
            row["stiffness"] = float(stiffness[e])
        if member.material is not None:
            material = structure.materials[member.material]
            row |= {"material": member.material, "area": member.area}
            row |= {title: getattr(material, title) for title in MATERIAL_COLUMNS}
        rows.append(row)
    _write_table(
        member_file,
        [title for title in MEMBER_COLUMNS if any(row.get(title) is not None for row in rows)],
        rows,
    )


def _joined(ids: Sequence[str]) -> str | None:
    if any(re.search(r"[\s,;]", name) or not name or name.startswith("[") for name in ids):
        return json.dumps(list(ids), ensure_ascii=False)
    return " ".join(ids) or None


def _write_table(path: Path, titles: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> None:
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(titles)
        for row in rows:
            cells = [row.get(title) for title in titles]
            writer.writerow([repr(cell) if isinstance(cell, float) else cell for cell in cells])
