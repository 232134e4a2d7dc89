"""How well the coordinates that are held for neutral motions tell them apart.

Coordinates that are held for the rigid motions of a body carry nothing and change nothing, as long as no
neutral motion leaves them all where they are. A body that turns can bring them there: two nodes that are held
against a turn come to lie beside each other, and what is held then is a motion that is not rigid. Long before
that they are worn, and others are to be held.
"""

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray
from tensegra.mechanics.rigid import RigidMotions

WORN = 0.1
"""Share of the volume that the held rows of the neutral motions span at first, from which on down they are
worn."""


class Grip:
    """Watches what is held for neutral motions.

    Parameters
    ----------
    motions
        The neutral motions.
    held
        Coordinates that are held for them, as many as there are, ``(n_nodes, 3)``.
    nodes
        Where the structure was when they were chosen, ``(n_nodes, 3)``.
    """

    def __init__(self, motions: RigidMotions, held: BoolArray, nodes: FloatArray) -> None:
        self.motions, self.held = motions, held
        self._least = WORN * float(self._volume(nodes[None])[0]) if len(motions) else 0.0

    def is_worn(self, nodes: FloatArray) -> BoolArray:
        """Whether others have to be held at some positions ``(n, n_nodes, 3)`` or ``(n, 3 n_nodes)``."""
        if not len(self.motions) or not len(nodes):
            return np.zeros(len(nodes), dtype=np.bool_)
        return ~(self._volume(nodes.reshape(len(nodes), -1, 3)) >= self._least)

    def _volume(self, nodes: FloatArray) -> FloatArray:
        """Volume that the rows of the motions at the held coordinates span, ``(n,)``."""
        volume: FloatArray = np.abs(np.linalg.det(self.motions.fields(nodes)[..., self.held]))
        return volume
