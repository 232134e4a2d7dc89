"""A structure as flat arrays: the form in which the kernels read it.

Nothing is copied out of the structure twice: everything that a solver needs to know, apart from the
inputs that change along a path (`tensegra.mechanics.inputs`), stands in one `StructureArrays`.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tensegra.structure import Structure

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

AXES = "xyz"

FAR = 10.0
"""Sizes from the origin beyond which a structure is measured about a point of its own."""


@dataclass(frozen=True, eq=False)
class StructureArrays:
    """Topology and constants of a structure.

    A member over the nodes n₀, n₁, …, nₘ has m segments; the segments of member ``e`` are the rows
    ``segment_start[e]`` to ``segment_start[e + 1]`` of `segment_nodes`.

    Attributes
    ----------
    node_ids, member_ids
        Names, in the order of the arrays.
    coordinates
        Given positions about `origin`, shape ``(n_nodes, 3)``, unit of length.
    free
        True where a coordinate may move, shape ``(n_nodes, 3)``.
    segment_nodes
        First and second node of each segment, shape ``(n_segments, 2)``.
    segment_start
        Row of the first segment of each member, shape ``(n_members + 1,)``.
    moving
        True for a member that touches a node that can move, shape ``(n_members,)``.
    is_cable
        True for a member that carries no compression, shape ``(n_members,)``.
    stiffness
        Axial stiffness EA, shape ``(n_members,)``, unit of force.
    rest_length
        Rest lengths before any stage, shape ``(n_members,)``.
    thermal_expansion
        Coefficient per unit of temperature, shape ``(n_members,)``.
    nodal_weight
        Weight lumped to the nodes by the given segment lengths, shape ``(n_nodes,)``, unit of force.
    size
        Largest extent of the given coordinates: the length to which moves are compared.
    origin
        What has been taken off all coordinates, ``(3,)``: nothing, but of a structure far from the origin,
        whose lengths would lose their digits.
    """

    node_ids: tuple[str, ...]
    member_ids: tuple[str, ...]
    coordinates: FloatArray
    free: BoolArray
    segment_nodes: IndexArray
    segment_start: IndexArray
    moving: BoolArray
    is_cable: BoolArray
    stiffness: FloatArray
    rest_length: FloatArray
    thermal_expansion: FloatArray
    nodal_weight: FloatArray
    size: float
    origin: FloatArray
    node_index: dict[str, int] = field(repr=False)
    member_index: dict[str, int] = field(repr=False)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.node_ids)

    @property
    def n_members(self) -> int:
        """Number of members."""
        return len(self.member_ids)

    @property
    def n_free(self) -> int:
        """Number of free degrees of freedom."""
        return int(self.free.sum())

    @property
    def n_segments(self) -> IndexArray:
        """Number of segments of each member, shape ``(n_members,)``."""
        return np.diff(self.segment_start)


def structure_arrays(structure: Structure) -> StructureArrays:
    """Flatten a structure.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> arrays = structure_arrays(library.paper_beam())
    >>> arrays.n_nodes, arrays.n_members, arrays.n_free
    (24, 48, 60)
    """
    node_ids = tuple(structure.nodes)
    member_ids = tuple(structure.members)
    node_index = {node: i for i, node in enumerate(node_ids)}
    coordinates = np.array([structure.nodes[node] for node in node_ids], dtype=np.float64)

    size = float(np.ptp(coordinates, axis=0).max())
    centre = coordinates.mean(axis=0)
    origin = np.where(np.abs(centre) > FAR * size, centre, 0.0)
    coordinates = coordinates - origin

    free = np.ones((len(node_ids), 3), dtype=np.bool_)
    for node, axes in structure.supports.items():
        for axis in axes:
            free[node_index[node], AXES.index(axis)] = False

    segments: list[tuple[int, int]] = []
    segment_start = [0]
    for member in structure.members.values():
        path = [node_index[node] for node in member.nodes]
        segments.extend(pairwise(path))
        segment_start.append(len(segments))
    segment_nodes = np.array(segments, dtype=np.int64)
    starts = np.array(segment_start, dtype=np.int64)

    arrays = StructureArrays(
        node_ids=node_ids,
        member_ids=member_ids,
        coordinates=coordinates,
        free=free,
        segment_nodes=segment_nodes,
        segment_start=starts,
        moving=np.logical_or.reduceat(np.any(free[segment_nodes], axis=(1, 2)), starts[:-1]),
        is_cable=np.array([member.kind == "cable" for member in structure.members.values()]),
        stiffness=np.array([structure.axial_stiffness(member) for member in member_ids]),
        rest_length=np.array([member.rest_length for member in structure.members.values()]),
        thermal_expansion=np.array([structure.thermal_expansion(member) for member in member_ids]),
        nodal_weight=np.zeros(len(node_ids)),
        size=size,
        origin=origin,
        node_index=node_index,
        member_index={member: e for e, member in enumerate(member_ids)},
    )
    weight = np.array([structure.weight_per_length(member) for member in member_ids])
    return replace(arrays, nodal_weight=lumped_weight(arrays, weight))


def segment_spans(arrays: StructureArrays, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the vectors along the segments, ``(n_segments, 3)``, and their lengths, ``(n_segments,)``."""
    first, second = arrays.segment_nodes.T
    along = nodes[second] - nodes[first]
    return along, np.linalg.norm(along, axis=1)


def path_lengths(arrays: StructureArrays, nodes: FloatArray) -> FloatArray:
    """Return the path lengths ℓ of the members at a position, shape ``(n_members,)``."""
    _, lengths = segment_spans(arrays, nodes)
    return np.add.reduceat(lengths, arrays.segment_start[:-1])


def lumped_weight(arrays: StructureArrays, weight_per_length: FloatArray) -> FloatArray:
    """Lump the members' weights to the nodes, half and half by the given segment lengths.

    Parameters
    ----------
    arrays
        The structure.
    weight_per_length
        Force per length, shape ``(…, n_members)``.

    Returns
    -------
    ndarray
        Shape ``(…, n_nodes)``, unit of force.
    """
    _, lengths = segment_spans(arrays, arrays.coordinates)
    half = 0.5 * np.repeat(weight_per_length, arrays.n_segments, axis=-1) * lengths
    nodal = np.zeros((arrays.n_nodes, *half.shape[:-1]))
    np.add.at(nodal, arrays.segment_nodes, np.moveaxis(half, -1, 0)[:, None])
    return np.moveaxis(nodal, 0, -1)
