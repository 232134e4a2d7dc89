"""VTK's unstructured grids, .vtu, and .pvd, which plays many of them: what ParaView opens.

Each segment is a line. Its data are the number of its member, tension, rest length, stiffness, kind and
whether it is slack; a point's are its displacement from the first frame, the axes that are held and the
force that acts. The status of the frame is a number of the field, its place in `STATUSES`. Units and names
stand in a remark at the head of the file. Format: "VTK XML file formats", docs.vtk.org.
"""

from pathlib import Path
from typing import cast
from xml.etree.ElementTree import Comment, Element, ElementTree, SubElement, indent

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError
from tensegra.exchange.files import replacing
from tensegra.exchange.scene import Frame, Scene

__all__ = ["write_pvd", "write_vtu"]

LINE = 3
"""VTK's number of a line of two points."""

STATUSES = ("failed", "stable", "snapped", "collapsed", "unstable", "on the way", "drawn")
"""Where a status stands here is its number in the data ``status``."""

_TYPES = {"f": "Float64", "i": "Int64", "u": "UInt8"}


def write_vtu(scene: Scene, path: Path) -> None:
    """Write the last frame."""
    _write_frame(scene, scene.last, path)


def write_pvd(scene: Scene, path: Path) -> None:
    """Write every frame to a folder beside the file and of its name, and the list of them."""
    folder = path.with_suffix("")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise ModelError(f"{folder}: cannot be written ({(error.strerror or str(error)).lower()})") from None
    root = Element("VTKFile", type="Collection", version="1.0", byte_order="LittleEndian")
    collection = SubElement(root, "Collection")
    for i, frame in enumerate(scene.frames):
        file = folder / f"{folder.name}_{i:04d}.vtu"
        _write_frame(scene, frame, file)
        SubElement(
            collection, "DataSet", timestep=repr(frame.time), part="0", file=f"{folder.name}/{file.name}"
        )
    _write(root, path)


def _write_frame(scene: Scene, frame: Frame, path: Path) -> None:
    structure = scene.structure
    pairs, owners = scene.segments()
    root = Element("VTKFile", type="UnstructuredGrid", version="1.0", byte_order="LittleEndian")
    root.append(cast("Element", Comment(_remark(scene, frame))))
    grid = SubElement(root, "UnstructuredGrid")
    field = SubElement(grid, "FieldData")
    _add(field, "TimeValue", np.array([frame.time]))
    _add(field, "status", np.array([STATUSES.index(frame.status)]))
    piece = SubElement(grid, "Piece", NumberOfPoints=str(structure.n_nodes), NumberOfCells=str(len(pairs)))
    held = np.array(
        [[axis in structure.supports.get(node, "") for axis in "xyz"] for node in structure.node_ids]
    )
    points = SubElement(piece, "PointData")
    _add(points, "displacement", frame.nodes - scene.frames[0].nodes)
    _add(points, "held", held.astype(np.uint8))
    if frame is scene.last:
        _add(points, "force", scene.forces)
    cells = SubElement(piece, "CellData", Scalars="tension")
    _add(cells, "tension", frame.tensions[owners])
    _add(cells, "member", owners)
    members = list(structure.members.values())
    kinds = np.array([member.is_cable + member.is_clustered for member in members], dtype=np.int64)
    _add(cells, "kind", kinds[owners])
    slack = np.array([member.is_cable for member in members]) & (frame.tensions == 0.0)
    _add(cells, "slack", slack[owners].astype(np.uint8))
    if frame is scene.last and scene.rest_length is not None and scene.stiffness is not None:
        _add(cells, "rest_length", scene.rest_length[owners])
        _add(cells, "stiffness", scene.stiffness[owners])
    _add(SubElement(piece, "Points"), "Points", frame.nodes)
    topology = SubElement(piece, "Cells")
    _add(topology, "connectivity", pairs.ravel())
    _add(topology, "offsets", 2 * np.arange(1, len(pairs) + 1))
    _add(topology, "types", np.full(len(pairs), LINE, dtype=np.uint8))
    _write(root, path)


def _remark(scene: Scene, frame: Frame) -> str:
    """Return what VTK has no place for that all its readers know: units, and the names behind numbers."""
    structure = scene.structure
    text = (
        f" {structure.name}, {frame.label}, {frame.status}; "
        f"lengths in {structure.units.length}, forces in {structure.units.force}; "
        f"nodes {' '.join(structure.node_ids)}; members {' '.join(structure.member_ids)} "
    )
    return text.replace("-", "\N{HYPHEN}")  # two hyphens would end it


def _add(
    parent: Element, name: str, values: NDArray[np.float64] | NDArray[np.int64] | NDArray[np.uint8]
) -> None:
    """Add an array in decimals that give each float back."""
    array = SubElement(parent, "DataArray", type=_TYPES[values.dtype.kind], Name=name, format="ascii")
    if parent.tag == "FieldData":
        array.set("NumberOfTuples", str(len(values)))
    elif values.ndim == 2:
        array.set("NumberOfComponents", str(values.shape[1]))
    array.text = " ".join(map(repr, values.ravel().tolist()))


def _write(root: Element, path: Path) -> None:
    tree = ElementTree(root)
    indent(tree, " ")
    with replacing(path) as draft:
        tree.write(draft, encoding="utf-8", xml_declaration=True)
