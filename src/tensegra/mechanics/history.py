"""The accepted steps of a path as arrays: what its tables and data sets are made of."""

from collections.abc import Sequence

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.status import PathPoint
from tensegra.structure import Structure

__all__ = ["history_arrays"]


def history_arrays(structure: Structure, history: Sequence[PathPoint]) -> tuple[FloatArray, FloatArray]:
    """Return the positions, ``(n_steps, n_nodes, 3)``, and tensions, ``(n_steps, n_members)``, of all steps.

    A path without a step (its first stage failed) gives arrays of their full shape without a row.
    """
    n_steps = len(history)
    nodes = np.array([point.nodes for point in history], dtype=np.float64)
    tensions = np.array([point.tensions for point in history], dtype=np.float64)
    return nodes.reshape(n_steps, structure.n_nodes, 3), tensions.reshape(n_steps, structure.n_members)
