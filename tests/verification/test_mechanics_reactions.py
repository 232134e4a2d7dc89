"""Balance of the whole body: reactions and loads sum to nothing, and so do their moments."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegra.mechanics import solve_batch, solve_path
from tensegra.structure import library, parse_structure

BALANCE = 1e-8
"""Of the largest force, times the size for moments: the residuals of 1e-9 of all nodes together."""

STRUCTURES = {
    "beam": library.paper_beam(),
    "prism": library.prism(),
    "loop": library.prism(4, clustered=True),
    "tower": library.tower(),
    "dome": library.levy_dome(),
    "net": library.grid(4, 4, rise=0.3),
    "chain": library.hanging_chain(),
    "truss": library.von_mises_truss(),
    "d-bar": library.d_bar(),
}


def assert_balanced(structure, nodes, tensions, forces, reactions):
    total = forces + reactions
    largest = max(np.abs(tensions).max(), np.abs(forces).max())
    size = np.ptp(structure.coordinates, axis=0).max()
    np.testing.assert_allclose(total.sum(axis=0), 0.0, atol=BALANCE * largest)
    np.testing.assert_allclose(np.cross(nodes, total).sum(axis=0), 0.0, atol=BALANCE * largest * size)


@pytest.mark.parametrize("name", STRUCTURES)
@settings(max_examples=4, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_supports_carry_what_acts(name, seed):
    structure = STRUCTURES[name]
    rng = np.random.default_rng(seed)
    largest = np.abs(solve_path(structure).final.tensions).max()
    node, axis = rng.choice(structure.node_ids), rng.choice(list("xyz"))
    loads = {(str(node), str(axis)): 0.01 * largest * rng.uniform(-1.0, 1.0)}
    path = solve_path(structure, loads=loads)
    if path.final.status == "failed":
        return
    final = path.final
    assert_balanced(structure, final.nodes, final.tensions, final.forces, final.reactions)
    runs = solve_batch(structure, loads={name: [value] for name, value in loads.items()})
    assert_balanced(structure, runs.nodes[0], runs.tensions[0], final.forces, runs.reactions[0])


def test_two_supports_share_a_load_by_the_lever():
    # A stiff bar of length 4 on two supports, a load of 8 at its quarter: 6 and 2.
    def strut(*nodes):
        return {"kind": "strut", "nodes": list(nodes), "stiffness": 1e9}

    truss = parse_structure(
        {
            "nodes": {"l": [0, 0, 0], "q": [1, 0, 0], "r": [4, 0, 0], "t": [1, 0, 1]},
            "members": {
                "a": strut("l", "q"), "b": strut("q", "r"), "c": strut("l", "t"),
                "d": strut("t", "r"), "e": strut("q", "t"),
            },
            "supports": {"l": "xyz", "r": "yz", "q": "y", "t": "y"},
            "stages": [{"name": "load", "loads": {"q": [0, 0, -8]}}],
        }
    )  # fmt: skip
    reactions = solve_path(truss).final.to_dict()["reactions"]
    # The deflection of some 1e-8 shifts the lever by as much.
    np.testing.assert_allclose([reactions["l"][2], reactions["r"][2]], [6.0, 2.0], rtol=1e-6)
