"""Reactions: the forces that supports exert on a structure, and how they change.

At an equilibrium f = p + r: the internal force f = Σ T ∂ℓ/∂x of the members is balanced by the loads
p, weights included, and, where a coordinate is held, by the support's force r. All arrays may have
leading axes for many runs at once.
"""

import numpy as np

from tensegra.mechanics.arrays import FloatArray, StructureArrays

__all__ = ["internal_forces", "reaction_rates", "reactions"]


def reactions(
    arrays: StructureArrays, nodes: FloatArray, tensions: FloatArray, loads: FloatArray
) -> FloatArray:
    """Return the forces of the supports on the structure.

    Parameters
    ----------
    arrays
        The structure; its supports are the coordinates that are not free.
    nodes
        Positions, shape ``(…, n_nodes, 3)``, unit of length.
    tensions
        Tension positive, shape ``(…, n_members)``, unit of force.
    loads
        Nodal forces, weight included, shape ``(…, n_nodes, 3)``.

    Returns
    -------
    ndarray
        Shape ``(…, n_nodes, 3)``, unit of force: zero where a coordinate is free, NaN where there
        is no equilibrium. A support below a weight pushes up: its reaction is positive.
    """
    return _at_supports(arrays, internal_forces(arrays, nodes, tensions) - loads)


def internal_forces(arrays: StructureArrays, nodes: FloatArray, tensions: FloatArray) -> FloatArray:
    """Return f = Σ T ∂ℓ/∂x, shape ``(…, n_nodes, 3)``: minus what the members pull the nodes with."""
    unit, _ = _directions(arrays, nodes)
    return _sum_at_nodes(arrays, np.repeat(tensions, arrays.n_segments, axis=-1)[..., None] * unit)


def reaction_rates(
    arrays: StructureArrays,
    nodes: FloatArray,
    tensions: FloatArray,
    *,
    node_rates: FloatArray,
    tension_rates: FloatArray,
    load_rates: FloatArray,
) -> FloatArray:
    """Return the rates of the reactions with one parameter, shape ``(…, n_nodes, 3)``.

    Parameters
    ----------
    arrays, nodes, tensions
        The equilibrium, as for `reactions`.
    node_rates, tension_rates, load_rates
        Rates of positions, tensions and loads with the parameter, of the shapes of these.
    """
    unit, lengths = _directions(arrays, nodes)
    first, second = arrays.segment_nodes.T
    apart = node_rates[..., second, :] - node_rates[..., first, :]
    turn = (apart - np.sum(apart * unit, axis=-1, keepdims=True) * unit) / lengths[..., None]
    tension, tension_rate = (np.repeat(t, arrays.n_segments, axis=-1) for t in (tensions, tension_rates))
    pull_rates = tension_rate[..., None] * unit + tension[..., None] * turn
    return _at_supports(arrays, _sum_at_nodes(arrays, pull_rates) - load_rates)


def _directions(arrays: StructureArrays, nodes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit vectors along the segments, ``(…, n_segments, 3)``, and their lengths."""
    first, second = arrays.segment_nodes.T
    along = nodes[..., second, :] - nodes[..., first, :]
    lengths = np.linalg.norm(along, axis=-1)
    return along / lengths[..., None], lengths


def _sum_at_nodes(arrays: StructureArrays, pulls: FloatArray) -> FloatArray:
    """Sum the pulls of segments, ``(…, n_segments, 3)``, at their second nodes less those at their first."""
    ends = arrays.segment_nodes.ravel()
    order = np.argsort(ends, kind="stable")
    starts = np.searchsorted(ends[order], np.arange(arrays.n_nodes))
    sign = np.where(order % 2 == 0, -1.0, 1.0)[:, None]
    # Every node has a segment, as a structure checks of itself: no sum is empty.
    forces: FloatArray = np.add.reduceat(sign * pulls[..., order // 2, :], starts, axis=-2)
    return forces


def _at_supports(arrays: StructureArrays, unbalanced: FloatArray) -> FloatArray:
    return np.where(arrays.free & np.isfinite(unbalanced), 0.0, unbalanced)
