"""Ends of lines that meet, made into nodes."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["WELD", "weld"]

WELD = 1e-6
"""Distance of ends that are one node, as a share of the size of the drawing: drawn ends that were picked
apart are a thousand times that, and no program's rounding is as much."""


def weld(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the different points of many, and which of them each one is.

    Points within `WELD` of each other, directly or over others, are one: the first of them.

    Parameters
    ----------
    points
        Shape ``(n_points, 3)``.

    Returns
    -------
    tuple
        The different points in the order of their first appearance, ``(n_nodes, 3)``, and for each point
        the row of its node, ``(n_points,)``.

    Examples
    --------
    >>> nodes, which = weld(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-9, 0], [0, 0, 0]]))
    >>> len(nodes), which
    (2, array([0, 1, 1, 0]))
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    size = float(np.ptp(points, axis=0).max())
    near = cKDTree(points).query_pairs(WELD * size, output_type="ndarray")
    touching = coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(points), len(points)))
    _, labels = connected_components(touching, directed=False)
    _, first, which = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return points[first[order]], np.asarray(rank[which], dtype=np.int64)
