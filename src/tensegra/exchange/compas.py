"""Graphs of the COMPAS framework (networks, until version 2), from and to its JSON.

A node is a node and an edge a segment. The members stand in the graph's attributes, under ``members``, as
they do in a structure file: an edge has two nodes, and a clustered cable more. A graph of other programs
has no such entry; there each edge is a member, whose kind is told by its attribute ``kind`` or by the sign
of its force density ``q`` or force ``f``. Layout: ``compas.data`` of COMPAS 2, documented at compas.dev.
"""

import ast
import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from tensegra.errors import ModelError
from tensegra.exchange.files import replacing, require_file
from tensegra.exchange.said import Content, Said
from tensegra.exchange.scene import Scene
from tensegra.structure.text import TextError, load_json
from tensegra.units import is_number

__all__ = ["is_compas", "read", "write"]

DTYPES = ("compas.datastructures/Graph", "compas.datastructures/Network")

HELD = ("is_support", "is_anchor", "is_fixed")
"""Attributes with which other programs of the framework hold a node in all directions."""

_NUMBERS = ("rest_length", "stiffness", "area")


def is_compas(path: Path) -> bool:
    """Tell whether a JSON file says that it is of COMPAS; one that cannot be read does not."""
    try:
        value = _load(path)
    except ModelError:
        return False
    return str(value.get("dtype", "")).startswith("compas")


def read(path: Path, said: Said) -> Content:  # noqa: ARG001 — what is said fills in later
    """Read a graph or network."""
    value = _load(path)
    if value.get("dtype") not in DTYPES:
        raise ModelError.at(f"{path.name}: dtype", value.get("dtype"), f"one of {', '.join(DTYPES)}")
    data = _mapping(value.get("data", value.get("value")), f"{path.name}: data")
    attributes = _mapping(data.get("attributes", {}), f"{path.name}: data.attributes")
    nodes, supports = _nodes(data, path.name)
    edges = _edges(data, nodes, path.name)
    if "members" in attributes:
        members = {
            key: dict(_mapping(m, f"{path.name}: member {key}"))
            for key, m in _mapping(attributes["members"], f"{path.name}: data.attributes.members").items()
        }
        _require_edges(members, edges, path.name)
    else:
        members = _members(edges, _mapping(data.get("default_edge_attributes", {}), path.name), path.name)
    content: Content = {"nodes": nodes, "members": members, "supports": supports}
    for key in ("materials", "units"):
        if key in attributes:
            content[key] = _mapping(attributes[key], f"{path.name}: data.attributes.{key}")
    name = value.get("name") or attributes.get("name")
    return content | ({"name": name} if isinstance(name, str) and name else {})


def _load(path: Path) -> dict[str, Any]:
    require_file(path)
    try:
        value = load_json(path.read_text(encoding="utf-8-sig"))
    except (UnicodeDecodeError, TextError) as error:
        raise ModelError(f"{path.name}: {error}") from None
    except OSError as error:
        raise ModelError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    return _mapping(value, path.name)


def _mapping(value: object, place: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ModelError.at(place, value, "a mapping of names to values")
    return dict(value)


def _id(key: str) -> str:
    """Return a key as a text; COMPAS writes each as Python does, a text within quotes."""
    if key[:1] in {"'", '"'} and len(key) < 1000:
        try:
            value = ast.literal_eval(key)
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            return key
        return str(value)
    return key


def _key(name: str) -> str:
    return name if name.isdecimal() and str(int(name)) == name else repr(name)


def _nodes(data: Content, source: str) -> tuple[dict[str, list[Any]], dict[str, str]]:
    default = _mapping(data.get("default_node_attributes", {}), f"{source}: data.default_node_attributes")
    nodes: dict[str, list[Any]] = {}
    supports: dict[str, str] = {}
    for key, own in _mapping(data.get("node"), f"{source}: data.node").items():
        attributes = {**default, **_mapping(own or {}, f"{source}: data.node.{key}")}
        name = _id(key)
        nodes[name] = [attributes.get(axis, 0.0) for axis in "xyz"]
        if isinstance(attributes.get("supports"), str):
            supports[name] = attributes["supports"]
        elif any(attributes.get(word) is True for word in HELD):
            supports[name] = "xyz"
    return nodes, {node: axes for node, axes in supports.items() if axes}


def _edges(data: Content, nodes: Mapping[str, Any], source: str) -> dict[tuple[str, str], Content]:
    edges: dict[tuple[str, str], Content] = {}
    for start, ends in _mapping(data.get("edge"), f"{source}: data.edge").items():
        for end, attributes in _mapping(ends or {}, f"{source}: data.edge.{start}").items():
            pair = (_id(start), _id(end))
            for node in pair:
                if node not in nodes:
                    raise ModelError.at(f"{source}: data.edge", node, "the key of a node", candidates=nodes)
            edges[pair] = _mapping(attributes or {}, f"{source}: data.edge.{start}.{end}")
    return edges


def _require_edges(members: Mapping[str, Content], edges: Mapping[tuple[str, str], Any], source: str) -> None:
    """Refuse members that do not run along the edges: the graph was changed after it was written."""
    present = {frozenset(pair) for pair in edges}
    paths = [list(map(str, m["nodes"])) for m in members.values() if isinstance(m.get("nodes"), list)]
    run_along = {frozenset(pair) for path in paths for pair in pairwise(path)}
    for pair in present ^ run_along:
        found = "an edge without a member" if pair in present else "a member without its edge"
        expected = "attributes.members and edges that agree; without attributes.members each edge is a member"
        raise ModelError.at(f"{source}: data.edge {'–'.join(sorted(pair))}", found, expected)


def _members(edges: Mapping[tuple[str, str], Content], default: Content, source: str) -> dict[str, Content]:
    members: dict[str, Content] = {}
    counts = {"strut": 0, "cable": 0}
    for pair, own in edges.items():
        attributes = {**default, **own}
        place = f"{source}: data.edge.{pair[0]}.{pair[1]}"
        force = next(
            (attributes[word] for word in ("q", "f", "force") if is_number(attributes.get(word))), None
        )
        kind = attributes.get("kind")
        if kind is None and force is not None and force != 0.0:
            kind = "strut" if force < 0.0 else "cable"
        if kind not in counts:
            raise ModelError.at(place, kind, "a kind, 'strut' or 'cable', or a force density q that is not 0")
        counts[kind] += 1
        member = {name: attributes[name] for name in _NUMBERS if attributes.get(name) is not None}
        tension = next((attributes[word] for word in ("f", "force") if is_number(attributes.get(word))), None)
        if tension is not None:
            member["tension"] = tension
        members[f"{kind[0]}{counts[kind]}"] = {"kind": kind, "nodes": list(pair), **member}
    return members


def write(scene: Scene, path: Path) -> None:
    """Write the last frame as a graph."""
    with replacing(path) as draft:
        draft.write_text(json.dumps(graph_of(scene), ensure_ascii=False, allow_nan=False), encoding="utf-8")


def graph_of(scene: Scene) -> Content:
    """Return the plain values of a graph, as `compas.data` writes and reads them."""
    structure = scene.structure
    rest_length, stiffness = scene.members
    nodes = {
        _key(node): {
            **dict(zip("xyz", scene.last.nodes[n].tolist(), strict=True)),
            "supports": structure.supports.get(node, ""),
        }
        for n, node in enumerate(structure.node_ids)
    }
    edges: dict[str, dict[str, Content]] = {key: {} for key in nodes}
    members: dict[str, Content] = {}
    for e, (name, member) in enumerate(structure.members.items()):
        numbers = {"rest_length": float(rest_length[e]), "stiffness": float(stiffness[e])}
        members[name] = {
            "kind": member.kind,
            "nodes": list(member.nodes),
            **numbers,
            "groups": list(member.groups),
        }
        for start, end in member.segments:
            edge = {"member": name, "kind": member.kind, **numbers, "f": float(scene.last.tensions[e])}
            edges[_key(start)][_key(end)] = edge
    units = structure.units
    attributes = {
        "name": structure.name,
        "units": {"length": units.length, "force": units.force, "temperature": units.temperature},
        "members": members,
    }
    return {
        "dtype": DTYPES[0],
        "data": {
            "attributes": attributes,
            "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "default_edge_attributes": {},
            "node": nodes,
            "edge": edges,
            "max_node": max((int(name) for name in structure.node_ids if _key(name) == name), default=-1),
        },
        "name": structure.name,
    }
