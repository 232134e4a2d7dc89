"""Does it stand: free mechanisms of a tangent stiffness, named by the nodes that they move."""

import numpy as np

from tensegra.mechanics.follow import most_moved
from tensegra.mechanics.tangent import Tangent

SINGULAR = 1e-9
"""Eigenvalues of K below this share of the largest diagonal entry belong to free mechanisms."""

LARGEST_LISTED = 64
"""At most this many mechanisms are looked for in a large structure."""


def free_mechanisms(tangent: Tangent) -> tuple[tuple[str, ...], ...]:
    """Name the nodes that each zero-stiffness mode moves most, at the last measure of `tangent`.

    Modes of a multiple eigenvalue are not unique; together they span the free motions.
    """
    spectrum = tangent.spectrum(min(tangent.arrays.n_free, LARGEST_LISTED))
    named = []
    for value, mode in zip(spectrum.values, spectrum.vectors, strict=True):
        if abs(value) > SINGULAR * tangent.stiffness_scale:
            continue
        named.append(most_moved(tangent.arrays.node_ids, np.linalg.norm(mode, axis=1)))
    return tuple(named)
