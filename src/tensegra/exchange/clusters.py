"""Segments in any order, made into the path of a clustered member."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import ModelError

__all__ = ["path_of"]


def path_of(segments: NDArray[np.int64], place: str) -> list[int]:
    """Return the nodes of the one path that runs along each segment once.

    Segments that follow each other as they stand keep their order and sense. Others are walked by
    Hierholzer's algorithm, from an end of the path, or for a loop from the first node of the first
    segment.

    Parameters
    ----------
    segments
        The two nodes of each, ``(n_segments, 2)``.
    place
        Where they stand, for the message.

    Raises
    ------
    ModelError
        There is no such path.

    Examples
    --------
    >>> path_of(np.array([[2, 1], [3, 2], [3, 4]]), "S")
    [1, 2, 3, 4]
    """
    if np.array_equal(segments[:-1, 1], segments[1:, 0]):
        return [int(segments[0, 0]), *map(int, segments[:, 1])]
    at_node: dict[int, list[int]] = {}
    # Taken from their ends: the first segment first.
    for s, pair in reversed([*enumerate(segments.tolist())]):
        for node in pair:
            at_node.setdefault(node, []).append(s)
    odd = [node for node, touching in at_node.items() if len(touching) % 2]
    start = min(odd) if odd else int(segments[0, 0])
    path = _walk(start, at_node, segments.tolist())
    if len(odd) > 2 or len(path) != len(segments) + 1:
        found = ", ".join(f"{a + 1}–{b + 1}" for a, b in segments.tolist())
        raise ModelError.at(
            place, f"segments {found}", "segments that one cable runs along, one after the other"
        )
    return path


def _walk(start: int, at_node: dict[int, list[int]], segments: Sequence[Sequence[int]]) -> list[int]:
    used: set[int] = set()
    stack, path = [start], []
    while stack:
        node = stack[-1]
        left = at_node[node]
        while left and left[-1] in used:
            left.pop()
        if left:
            segment = left.pop()
            used.add(segment)
            first, second = segments[segment]
            stack.append(second if node == first else first)
        else:
            path.append(stack.pop())
    return path[::-1]
