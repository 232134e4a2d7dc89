import numpy as np
import pytest

from tensegra.mechanics.arrays import structure_arrays
from tensegra.structure import Material, Member, Structure, library

ROUNDING = 1e-14
"""Sums of a few dozen numbers of one size."""


@pytest.fixture(scope="module")
def loop():
    """Build a closed triangle of cable, of sides 3, 4 and 5, on a strut."""
    return Structure(
        name="loop",
        nodes={"a": (0, 0, 0), "b": (3, 0, 0), "c": (3, 4, 0), "d": (3, 4, 2)},
        materials={"rope": Material(youngs_modulus=100.0, weight=2.0, thermal_expansion=1e-3)},
        members={
            "loop": Member("cable", ("a", "b", "c", "a"), 12.0, material="rope", area=0.5),
            "mast": Member("strut", ("c", "d"), 2.0, stiffness=70.0),
            "mixed": Member("cable", ("a", "d"), 5.0, material="rope", stiffness=30.0),
        },
        supports={"a": "xyz", "c": "y", "d": "xz"},
    )


def test_free_coordinates_are_those_that_no_support_holds(loop):
    arrays = structure_arrays(loop)
    expected = [[False] * 3, [True] * 3, [True, False, True], [False, True, False]]
    assert arrays.free.tolist() == expected
    assert arrays.n_free == loop.n_free == 6


def test_names_keep_the_order_of_the_structure(loop):
    arrays = structure_arrays(loop)
    assert arrays.node_ids == ("a", "b", "c", "d")
    assert arrays.member_ids == ("loop", "mast", "mixed")
    assert arrays.node_index == {"a": 0, "b": 1, "c": 2, "d": 3}
    assert arrays.member_index == {"loop": 0, "mast": 1, "mixed": 2}
    np.testing.assert_array_equal(arrays.coordinates, loop.coordinates)


def test_a_closed_loop_has_its_closing_segment(loop):
    arrays = structure_arrays(loop)
    assert arrays.segment_nodes.tolist() == [[0, 1], [1, 2], [2, 0], [2, 3], [0, 3]]
    assert arrays.segment_start.tolist() == [0, 3, 4, 5]
    assert arrays.n_segments.tolist() == [3, 1, 1]


def test_member_constants(loop):
    arrays = structure_arrays(loop)
    assert arrays.is_cable.tolist() == [True, False, True]
    assert arrays.stiffness.tolist() == [50.0, 70.0, 30.0]
    assert arrays.rest_length.tolist() == [12.0, 2.0, 5.0]
    assert arrays.thermal_expansion.tolist() == [1e-3, 0.0, 1e-3]
    assert arrays.size == 4.0


def test_a_segment_gives_half_its_weight_to_each_end(loop):
    # The loop weighs 2 · 0.5 = 1 a length; its segments are 3, 4 and 5 long. Without area no weight.
    expected = [1.5 + 2.5, 1.5 + 2.0, 2.0 + 2.5, 0.0]
    np.testing.assert_allclose(structure_arrays(loop).nodal_weight, expected, rtol=ROUNDING)


@pytest.mark.parametrize("build", [library.paper_beam, library.paper_beam_slender])
def test_lumped_weights_sum_to_the_weight_of_the_members(build):
    structure = build()
    total = sum(
        structure.weight_per_length(name)
        * sum(np.linalg.norm(np.subtract(structure.nodes[i], structure.nodes[j])) for i, j in member.segments)
        for name, member in structure.members.items()
    )
    assert total > 0.0
    assert structure_arrays(structure).nodal_weight.sum() == pytest.approx(total, rel=ROUNDING)
