"""glTF 2.0, a scene for browsers, slides and Blender: a cylinder for each segment, a point for each node.

Places are numbers of JSON, so nothing of their digits is lost; only the one cylinder that all segments
share is in single precision, as the format has it. The scene is in metres with y upwards, as glTF demands:
its root turns and scales the structure's own axes. Format: Khronos Group, "glTF 2.0 specification".
"""

import json
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.exchange.files import replacing
from tensegra.exchange.scene import Scene
from tensegra.structure import Units

__all__ = ["scene_description", "write"]

SIDES = 12
"""Sides of a cylinder."""

RADII = {"strut": 0.008, "cable": 0.003, "clustered": 0.004}
"""Radii of the cylinders, as shares of the structure's size: a drawing's, not the members'."""

_COLOURS = {"strut": (0.1, 0.1, 0.1), "cable": (0.0, 0.45, 0.7), "clustered": (0.84, 0.37, 0.0)}

UPRIGHT = (-(0.5**0.5), 0.0, 0.0, 0.5**0.5)
"""Quaternion (x, y, z, w) that turns z upwards into y upwards."""

FLOAT, INDEX = 5126, 5123
"""Codes of single precision and of 16 bit."""


def write(scene: Scene, path: Path) -> None:
    """Write the last frame."""
    with replacing(path) as draft:
        draft.write_text(
            json.dumps(scene_description(scene), ensure_ascii=False, allow_nan=False), encoding="utf-8"
        )


def scene_description(scene: Scene) -> dict[str, Any]:
    """Return the description of the scene, its buffer within it."""
    structure = scene.structure
    at = dict(zip(structure.node_ids, scene.last.nodes, strict=True))
    size = float(np.ptp(scene.last.nodes, axis=0).max())
    kinds = list(RADII)
    nodes: list[dict[str, Any]] = [
        {"name": f"node {node}", "translation": place.tolist()} for node, place in at.items()
    ]
    for e, (name, member) in enumerate(structure.members.items()):
        kind = "clustered" if member.is_clustered else member.kind
        extras = {"member": name, "kind": member.kind, "tension": float(scene.last.tensions[e])}
        for number, (start, end) in enumerate(member.segments):
            label = f"{name} segment {number + 1}" if member.is_clustered else name
            placed = _placed(at[start], at[end], RADII[kind] * size)
            nodes.append({"name": label, "mesh": kinds.index(kind), "extras": extras, **placed})
    metres = Units().number(f"1 {structure.units.length}", "length")
    root = {
        "name": structure.name,
        "rotation": list(UPRIGHT),
        "scale": [metres] * 3,
        "children": list(range(1, len(nodes) + 1)),
        "extras": {
            "units": {"length": structure.units.length, "force": structure.units.force},
            "status": scene.last.status,
        },
    }
    return {
        "asset": {"version": "2.0", "generator": "tensegra"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [root, *nodes],
        "materials": [
            {
                "name": kind,
                "pbrMetallicRoughness": {"baseColorFactor": [*_COLOURS[kind], 1.0], "metallicFactor": 0.0},
            }
            for kind in kinds
        ],
        "meshes": [
            {
                "name": kind,
                "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2, "material": i}],
            }
            for i, kind in enumerate(kinds)
        ],
        **_cylinder(),
    }


def _placed(start: NDArray[np.float64], end: NDArray[np.float64], radius: float) -> dict[str, Any]:
    """Return what brings the unit cylinder along z from one point to another."""
    along = end - start
    length = float(np.linalg.norm(along))
    if length == 0.0:  # its ends have met
        return {"translation": start.tolist(), "scale": [radius, radius, 0.0]}
    x, y, z = along / length
    # Half of the turn from z to the direction; straight down there are many, about any horizontal axis.
    turn = np.array([-y, x, 0.0, 1.0 + z]) if z > -1.0 + 1e-12 else np.array([1.0, 0.0, 0.0, 0.0])
    return {
        "translation": start.tolist(),
        "rotation": (turn / np.linalg.norm(turn)).tolist(),
        "scale": [radius, radius, length],
    }


def _cylinder() -> dict[str, Any]:
    """Return the buffer of a cylinder of radius 1 from z = 0 to z = 1, open at its ends."""
    angles = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)], axis=1)
    positions = np.concatenate([ring, ring + np.array([0.0, 0.0, 1.0])]).astype("<f4")
    normals = np.concatenate([ring, ring]).astype("<f4")
    near = np.arange(SIDES)
    after = (near + 1) % SIDES
    faces = np.concatenate(
        [
            np.stack([near, after, near + SIDES], axis=1),
            np.stack([after, after + SIDES, near + SIDES], axis=1),
        ]
    ).astype("<u2")
    parts = [positions.tobytes(), normals.tobytes(), faces.tobytes()]
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
        for start, part in zip(starts, parts, strict=False)
    ]
    vectors = {"componentType": FLOAT, "count": len(positions), "type": "VEC3"}
    bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    return {
        "buffers": [
            {
                "byteLength": starts[-1],
                "uri": "data:application/octet-stream;base64," + b64encode(b"".join(parts)).decode(),
            }
        ],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, **vectors, **bounds},
            {"bufferView": 1, **vectors},
            {"bufferView": 2, "componentType": INDEX, "count": faces.size, "type": "SCALAR"},
        ],
    }
