"""Turn bodies as their loads would, along the rigid motions that the supports leave.

A body that loads turn falls along a valley that is flat but for the loads and curved like a circle, between
walls as steep as its struts are stiff: a descent follows it in thousands of short steps. The rigid motions
are known, so the body is brought along them exactly to where the loads do no more work, and falls from there.
"""

import numpy as np

from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.rigid import NOTHING, RigidMotions, moved_along

FARTHEST_TURN = 0.3
"""Largest turn of one step, rad; a motion that turns nothing moves no node farther than this share of the
size."""

MOST_TURNS = 200
"""Steps after which the body is left as it is turned."""

PUSH = 0.01
"""Turn, rad, by which a body is pushed off a position from which loads turn it, though they balance there."""


def turned_by(nodes: FloatArray, force: FloatArray, motions: RigidMotions) -> FloatArray:
    """Move a structure along rigid motions to where the potential −p·x of its loads is least.

    Parameters
    ----------
    nodes
        Positions, ``(n_nodes, 3)``.
    force
        Loads p, ``(n_nodes, 3)``.
    motions
        That nothing but the loads stiffens.

    Returns
    -------
    FloatArray
        Positions, ``(n_nodes, 3)``: those that were given where loads do not turn the structure.
    """
    if not len(motions) or not force.any():
        return nodes
    size = float(np.ptp(nodes, axis=0).max(initial=NOTHING))
    scale = float(np.abs(force).max()) * size
    for _ in range(MOST_TURNS):
        fields = motions.fields(nodes)
        flat = fields.reshape(len(motions), -1)
        lengths = np.maximum(np.linalg.norm(flat, axis=1), NOTHING * size)
        form = -motions.bend(nodes, force) / np.outer(lengths, lengths) * size**2
        slope = -(flat @ force.ravel()) / lengths * size
        # In an orthonormal basis of what the motions move, so that none is counted twice.
        gram, basis = np.linalg.eigh(flat @ flat.T / np.outer(lengths, lengths))
        kept = gram > NOTHING
        basis = basis[:, kept] / np.sqrt(gram[kept])
        values, vectors = np.linalg.eigh(basis.T @ form @ basis)
        along = vectors.T @ (basis.T @ slope)
        if np.abs(along).max(initial=0.0) <= NOTHING * scale:
            if not len(values) or values[0] >= -NOTHING * scale:
                return nodes
            step = np.zeros(len(values))
            step[0] = np.sign(np.random.default_rng(0).standard_normal(len(values))[0]) * PUSH
        else:
            step = -along / np.maximum(np.abs(values), NOTHING * scale)
        shares = basis @ (vectors @ step) * size / lengths
        turn = np.abs(np.einsum("q,qni->ni", shares, motions.spin)).max(initial=0.0)
        shift = np.abs(np.einsum("q,qni->ni", shares, fields)).max(initial=0.0) / size
        shares *= min(1.0, FARTHEST_TURN / max(turn, shift, NOTHING))
        nodes = moved_along(nodes, motions, shares)
    return nodes
