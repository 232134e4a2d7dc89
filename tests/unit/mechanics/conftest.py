"""Structures without any order to them: whatever holds for these holds for all."""

from collections.abc import Callable

import numpy as np
import pytest

from tensegra.structure import Member, Structure
from tensegra.structure.structure import path_length

STRETCHES = (0.90, 0.97, 1.03, 1.10)
"""Rest length over length: no cable is so near to going slack that a finite difference meets the kink."""


def build_random_structure(seed: int, n_nodes: int = 8, n_clustered: int = 4) -> Structure:
    """Struts, cables, open, closed and crossing clustered cables, whole and partial supports."""
    rng = np.random.default_rng(seed)
    nodes = {str(i): tuple(rng.uniform(-1.0, 1.0, 3)) for i in range(n_nodes)}
    paths = [("strut" if rng.random() < 0.5 else "cable", (i, i + 1)) for i in range(n_nodes - 1)]
    # Three struts to each further node: no node is free to move without a change of length.
    paths += [("strut", (i, j)) for i in range(n_nodes) for j in rng.permutation(n_nodes)[:3] if i != j]
    for kind in range(n_clustered):
        a, b, c, d = rng.permutation(n_nodes)[:4]
        paths.append(("cable", ((a, b, c, d), (a, b, c, a), (a, b, a, c), (a, b, c, a, d))[kind % 4]))
    members = {}
    for e, (kind, path) in enumerate(paths):
        names = tuple(str(node) for node in path)
        rest_length = path_length(nodes, names) * rng.choice(STRETCHES)
        members[f"m{e}"] = Member(kind, names, rest_length, stiffness=10.0 ** rng.uniform(1.0, 3.0))
    supports = {"0": "xyz", "1": "xz", str(n_nodes - 1): "y"}
    return Structure(name=f"random {seed}", nodes=nodes, members=members, supports=supports)


@pytest.fixture(scope="session")
def random_structure() -> Callable[..., Structure]:
    return build_random_structure
