"""The opening between the fingertips of a gripper: plane geometry of the lines through their edges."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["corners", "edge_distance", "opening", "radius_for"]

Array: TypeAlias = NDArray[np.float64]


def radius_for(gap: float, edge: Array) -> float:
    """Return the radius of the gripper whose opposite tips have a given clear distance.

    Parameters
    ----------
    gap
        Clear distance between the lines of opposite edges, cm.
    edge
        Inward and sideways coordinates of the ends of one beam's edge, shape (2, 2).

    Examples
    --------
    >>> float(radius_for(20.0, np.array([[50.0, -10.0], [50.0, 10.0]])))
    60.0
    """
    along = edge[1] - edge[0]
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    normal *= np.sign(normal[0])
    return float((gap / 2.0 + edge[0] @ normal) / normal[0])


def edge_distance(edge: Array) -> float:
    """Return the distance of the line through an edge from the origin.

    Parameters
    ----------
    edge
        Its ends, shape (2, 2).
    """
    (x0, y0), (x1, y1) = edge
    return float(abs(x0 * y1 - x1 * y0) / np.hypot(x1 - x0, y1 - y0))


def corners(edges: Array) -> Array:
    """Return the corners of the opening around the origin that the lines through edges enclose.

    Parameters
    ----------
    edges
        Ends of each edge, shape (n_edges, 2, 2).

    Returns
    -------
    numpy.ndarray
        In order, shape (n_corners, 2).
    """
    far = 100.0 * float(np.abs(edges).max())
    polygon = far * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for first, second in edges:
        along = second - first
        normal = np.array([along[1], -along[0]])
        # The side on which the origin lies is kept.
        height = (polygon - first) @ normal * -np.sign(first @ normal)
        kept = []
        for point, here, other, there in zip(
            polygon, height, np.roll(polygon, -1, axis=0), np.roll(height, -1), strict=True
        ):
            if here >= 0.0:
                kept.append(point)
            if here * there < 0.0:
                kept.append(point + (other - point) * here / (here - there))
        polygon = np.array(kept)
    return polygon


def opening(edges: Array) -> float:
    """Return the area around the origin that the lines through edges enclose.

    Parameters
    ----------
    edges
        Ends of each edge, shape (n_edges, 2, 2).

    Examples
    --------
    >>> square = np.array([[[1, -1], [1, 1]], [[1, 1], [-1, 1]], [[-1, 1], [-1, -1]], [[-1, -1], [1, -1]]])
    >>> round(opening(square), 12)
    4.0
    """
    x, y = corners(edges).T
    return float(0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))))
