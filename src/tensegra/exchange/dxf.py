"""Drawings, from and to DXF: a line is a member, and its layer says which kind.

A line of two points is a strut or a cable, a polyline on a layer of cables is one clustered cable. The
name of a layer begins with the kind (``cables``, ``cable top``); what follows it is the member's group.
Names of nodes and members, rest lengths and stiffnesses travel as extended data of the application
TENSEGRA, which every program keeps and none shows.
"""

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.errors import OTHER_WORDS, ModelError
from tensegra.exchange.files import library, replacing, require_file
from tensegra.exchange.said import Content, Said
from tensegra.exchange.scene import Scene
from tensegra.exchange.weld import weld

__all__ = ["read", "write"]

APPLICATION = "TENSEGRA"
NODES, SUPPORTS = "nodes", "supports"
"""Layers of points: the names of nodes, and which of them are held."""

KINDS = ("strut", "cable")
_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km"}
"""Codes of $INSUNITS."""

_COLOURS = {"struts": 7, "cables": 5, "clustered cables": 1, NODES: 8, SUPPORTS: 3}

_LAYER = re.compile(r"(?i)(?:clustered[ _-]*)?([a-z]+?)s?(?:[ _-]+(.*))?")


def read(path: Path, said: Said) -> Content:
    """Read the lines and polylines of a drawing's model space."""
    ezdxf = library("ezdxf", "DXF")
    require_file(path)
    log = logging.getLogger("ezdxf")
    level = log.level
    log.setLevel(logging.CRITICAL)  # one message is enough
    try:
        drawing = ezdxf.readfile(path)
        lines = list(_lines(drawing, said, path.name))
    except (ModelError, MemoryError):
        raise
    except Exception as error:  # noqa: BLE001 — ezdxf tells a broken file by whatever it trips over
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise ModelError(f"{path.name}: this is not a drawing in DXF ({reason})") from None
    finally:
        log.setLevel(level)
    if not lines:
        raise ModelError.at(path.name, "no lines in the model space", "a line for each member")
    points = np.array([point for _, _, line in lines for point in line], dtype=np.float64)
    if not np.isfinite(points).all():
        raise ModelError.at(path.name, "a coordinate that is not finite", "finite coordinates")
    nodes, which = weld(points)
    named = _named_points(drawing, nodes)
    ids = _free_names([named.get(n, {}).get("id") for n in range(len(nodes))])
    members: dict[str, Content] = {}
    counts = dict.fromkeys(KINDS, 0)
    at = 0
    for entity, (kind, group), line in lines:
        steps = which[at : at + len(line)]
        at += len(line)
        data = _data_of(entity)
        counts[kind] += 1
        name = data.pop("id", None) or f"{kind[0]}{counts[kind]}"
        if name in members:
            raise ModelError.at(f"{path.name}, layer {entity.dxf.layer!r}", name, "the id of another member")
        groups = {"groups": [group]} if group else {}
        members[name] = {
            "kind": kind,
            "nodes": [ids[n] for n in steps],
            **groups,
            **_numbers(data, path.name),
        }
    supports = {ids[n]: data["supports"] for n, data in named.items() if data.get("supports")}
    unit = _UNITS.get(drawing.header.get("$INSUNITS", 0))
    return {
        "nodes": dict(zip(ids, nodes.tolist(), strict=True)),
        "members": members,
        "supports": supports,
        "units": {"length": unit} if unit else {},
    }


def _lines(drawing: Any, said: Said, source: str) -> Iterator[tuple[Any, tuple[str, str], list[Any]]]:  # noqa: ANN401 — ezdxf's
    """Yield each member's entity, its kind and group, and its points."""
    for entity in drawing.modelspace().query("LINE POLYLINE LWPOLYLINE"):
        match entity.dxftype():
            case "LINE":
                points = [entity.dxf.start, entity.dxf.end]
            case "POLYLINE":
                points = list(entity.points())
            case _:
                points = list(entity.vertices_in_wcs())
        points = [tuple(point) for point in points]
        if getattr(entity, "is_closed", False) and len(points) > 2:
            points.append(points[0])
        kind, group = _kind_of(entity.dxf.layer, said, source)
        yield entity, (kind, group), points


def _kind_of(layer: str, said: Said, source: str) -> tuple[str, str]:
    """Return the kind and the group of the lines on a layer."""
    for kind, layers in (("strut", said.struts), ("cable", said.cables)):
        if layer.casefold() in {name.casefold() for name in layers}:
            return kind, layer
    found = _LAYER.fullmatch(layer)
    if found:
        word = found[1].lower()
        meant = [word, *OTHER_WORDS.get(word, ())]
        for kind in KINDS:
            if kind in meant:
                return kind, (found[2] or "").strip()
    raise ModelError.at(
        f"{source}, layer",
        layer,
        "a name that begins with 'strut' or 'cable', or the layer to be said: --struts LAYER or "
        "--cables LAYER, in Python struts and cables",
    )


def _named_points(drawing: Any, nodes: "np.ndarray[Any, np.dtype[np.float64]]") -> dict[int, dict[str, str]]:  # noqa: ANN401 — idem
    """Return what the points of the layers of nodes and supports say, by the node that stands there."""
    named: dict[int, dict[str, str]] = {}
    size = float(np.ptp(nodes, axis=0).max())
    for point in drawing.modelspace().query("POINT"):
        apart = np.linalg.norm(nodes - np.array(tuple(point.dxf.location)), axis=1)
        n = int(np.argmin(apart))
        if apart[n] <= 1e-6 * size:
            data = _data_of(point)
            if point.dxf.layer.casefold() == SUPPORTS:
                data.setdefault("supports", "xyz")
            named.setdefault(n, {}).update({key: str(value) for key, value in data.items()})
    return named


def _free_names(names: list[str | None]) -> list[str]:
    """Return the names that points have, and numbers for the others."""
    taken = {name for name in names if name is not None}
    if len(taken) < sum(name is not None for name in names):
        return [str(n + 1) for n in range(len(names))]
    numbers = (str(n) for n in range(1, 2 * len(names) + 1) if str(n) not in taken)
    return [next(numbers) if name is None else name for name in names]


def _data_of(entity: Any) -> dict[str, Any]:  # noqa: ANN401 — idem
    """Return the pairs of our extended data."""
    if not entity.has_xdata(APPLICATION):
        return {}
    tags = [tag.value for tag in entity.get_xdata(APPLICATION) if tag.code != 1001]
    keys = ("id", "supports", "rest_length", "stiffness")
    return {str(key): value for key, value in zip(tags[::2], tags[1::2], strict=False) if key in keys}


def _numbers(data: dict[str, Any], source: str) -> dict[str, float]:
    numbers: dict[str, float] = {}
    for key in ("rest_length", "stiffness"):
        if key in data:
            try:
                numbers[key] = float(data[key])
            except (TypeError, ValueError):
                raise ModelError.at(f"{source}: {key}", data[key], "a number") from None
    return numbers


def write(scene: Scene, path: Path) -> None:
    """Write a drawing of the last frame, one layer for each kind and group."""
    ezdxf = library("ezdxf", "DXF")
    structure = scene.structure
    rest_length, stiffness = scene.members
    drawing = ezdxf.new("R2010")
    drawing.appids.new(APPLICATION)
    drawing.header["$INSUNITS"] = next((c for c, u in _UNITS.items() if u == structure.units.length), 0)
    space = drawing.modelspace()
    position = dict(zip(structure.node_ids, scene.last.nodes.tolist(), strict=True))
    for e, (name, member) in enumerate(structure.members.items()):
        kind = "clustered cables" if member.is_clustered else f"{member.kind}s"
        layer = _layer(drawing, kind, member.groups)
        points = [position[node] for node in member.nodes]
        if member.is_clustered:
            entity = space.add_polyline3d(points, dxfattribs={"layer": layer})
        else:
            entity = space.add_line(*points, dxfattribs={"layer": layer})
        _attach(entity, id=name, rest_length=float(rest_length[e]), stiffness=float(stiffness[e]))
    for node, place in position.items():
        held = structure.supports.get(node)
        layer = _layer(drawing, SUPPORTS if held else NODES, ())
        entity = space.add_point(place, dxfattribs={"layer": layer})
        _attach(entity, id=node, **({"supports": held} if held else {}))
    with replacing(path) as draft:
        drawing.saveas(draft)


def _layer(drawing: Any, kind: str, groups: tuple[str, ...]) -> str:  # noqa: ANN401 — ezdxf's
    # What a layer's name may not have, in any program: a group with such a name has no layer of its own.
    group = groups[0] if groups and not re.search(r'[<>/\\":;?*|=`]', groups[0]) else ""
    name = f"{kind} {group}".strip()
    if name not in drawing.layers:
        drawing.layers.add(name, color=_COLOURS[kind])
    return name


def _attach(entity: Any, **data: float | str) -> None:  # noqa: ANN401 — idem
    """Attach pairs as extended data; texts are cut where the format does."""
    tags: list[tuple[int, Any]] = []
    for key, value in data.items():
        tags += [(1000, key), (1000, value[:250]) if isinstance(value, str) else (1040, value)]
    entity.set_xdata(APPLICATION, tags)
