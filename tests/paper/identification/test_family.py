"""The family: printed counts, shapes that balance, structures that carry their self-stress."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tensegra as tg
from tensegra_paper.identification.candidate import N_SHAPE, Candidate, reference
from tensegra_paper.identification.layout import Layout, all_layouts, mirrored, node_id, reconstruction
from tensegra_paper.identification.shape import Shape, balance, free_directions, shape_of
from tensegra_paper.identification.starts import random_candidate

BALANCED = 1e-10
"""Forces left at a node over that of a clustered cable."""

ROUNDED = 1e-5
"""Of a coordinate: the file of the library has six digits after the point."""


def balanced_candidates(seed, n):
    rng = np.random.default_rng(seed)
    drawn = (random_candidate(rng) for _ in range(20 * n))
    found = [candidate for candidate in drawn if candidate.shape is not None]
    return found[:n]


@pytest.mark.parametrize("candidate", balanced_candidates(3, 6), ids=lambda c: c.layout.name)
def test_every_beam_has_the_printed_counts(candidate):
    beam = candidate.structure()
    kinds = [(member.kind, len(member.nodes) > 2) for member in beam.members.values()]
    assert (kinds.count(("strut", False)), kinds.count(("cable", False)), kinds.count(("cable", True))) == (
        12,
        32,
        4,
    )
    assert beam.n_nodes == 24
    assert {beam.members["K1"].nodes[-1], beam.members["K4"].nodes[-1]} == {"18", "23"}
    assert {len(beam.groups[name]) for name in ("struts", "classical")} == {12, 32}


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_a_shape_that_is_found_balances_and_keeps_roll_place_and_size(seed):
    candidate = random_candidate(np.random.default_rng(seed))
    shape = candidate.shape
    if shape is None:
        return
    vector = shape.to_vector()
    assert np.abs(balance(candidate.layout, vector[None])).max() < BALANCED
    wanted = candidate.numbers[:N_SHAPE]
    assert vector[6] == pytest.approx(wanted[6], abs=1e-9)
    assert vector[:6].sum() == pytest.approx(wanted[:6].sum(), abs=1e-8)


def test_the_drawn_beam_carries_the_forces_of_its_shape():
    candidate = random_candidate(np.random.default_rng(0))
    while candidate.shape is None or candidate.held != "section":
        candidate = random_candidate(np.random.default_rng(int(candidate.numbers[0] * 1e6) % 2**31))
    alike = candidate.numbers.copy()
    alike[N_SHAPE + 2 :] = 0.0
    candidate = candidate.moved(alike)
    drawn = candidate.structure().replace(stages=(), gravity=(0, 0, 0))
    final = tg.solve_path(drawn).final
    expected = candidate.shape.force / candidate.shape.force[-1] * candidate.self_stress
    assert final.tension("K1") == pytest.approx(candidate.self_stress, rel=1e-4)
    assert final.tension("s1") == pytest.approx(-expected[0], rel=1e-4)
    assert final.tension("c1") == pytest.approx(expected[3], rel=1e-4)


def test_the_beam_of_the_library_is_one_of_the_family():
    rebuilt, known = reference().structure(), tg.library.paper_beam()
    for node, place in known.nodes.items():
        np.testing.assert_allclose(rebuilt.nodes[node], place, rtol=0.0, atol=ROUNDED)
    paths = [tg.solve_path(beam, {"A14": 0.10, "A23": 0.10}) for beam in (rebuilt, known)]
    first, second = (path.displacement("z", nodes=[18, 23]) for path in paths)
    assert first == pytest.approx(second, abs=1e-3)


def test_free_directions_keep_the_balance_to_first_order():
    shape = reference().shape
    vector = shape.to_vector()
    for way in free_directions(reconstruction(), vector):
        moved = balance(reconstruction(), np.stack([vector + 1e-4 * way, vector]))
        # What is left is of second order: a way that broke the balance would leave 1e-4.
        assert np.abs(moved[0]).max() < 2e-6


def test_a_shape_far_from_any_balance_is_none_and_no_error():
    vector = reference().numbers[:N_SHAPE].copy()
    vector[:6] = np.log([1.0, 1e3, 1.0, 1e3, 1.0, 1e3])
    found = shape_of(reconstruction(), vector)
    assert found is None or np.abs(balance(reconstruction(), found.to_vector()[None])).max() < BALANCED


@given(side=st.integers(0, 3), section=st.integers(0, 5))
def test_nodes_have_the_printed_numbers(side, section):
    assert 1 <= int(node_id(section, side)) <= 24
    assert node_id(section, side) == node_id(section, side + 4)


def test_the_nodes_are_24_and_those_of_the_free_end_are_printed():
    assert len({node_id(s, k) for s in range(6) for k in range(4)}) == 24
    assert {"18", "23"} < {node_id(5, k) for k in range(4)}


def test_layouts_are_different_and_alike_from_both_ends():
    layouts = all_layouts()
    assert len(set(layouts)) == len(layouts) > 1000
    assert reconstruction() in {Layout(x.shifts, tuple(sorted(x.ties)), x.route) for x in layouts} | set(
        layouts
    )
    for layout in layouts[::97]:
        ties = {frozenset([(s, t, m % 4), (t, s, -m % 4)]) for s, t, m in layout.ties}
        turned = {frozenset([(s, t, m % 4), (t, s, -m % 4)]) for s, t, m in map(mirrored, layout.ties)}
        assert ties == turned


@pytest.mark.parametrize("ties", [((0, 0, 1),) * 8, ((0, 1, 1), *((s, s, 1) for s in range(6)), (0, 2, 0))])
def test_a_layout_with_double_cables_or_one_along_a_strut_is_refused(ties):
    with pytest.raises(ValueError, match=r"expected 8 different|along a strut"):
        Layout((1, 1, 1), ties)


def test_a_candidate_survives_its_file():
    candidate = random_candidate(np.random.default_rng(5))
    again = Candidate.of_dict(candidate.to_dict())
    assert again.to_dict() == candidate.to_dict()
    assert again.layout == candidate.layout


def test_a_shape_survives_its_vector():
    shape = reference().shape
    again = Shape.of_vector(shape.to_vector())
    np.testing.assert_allclose(again.x, shape.x, atol=1e-12)
    np.testing.assert_allclose(again.force, shape.force, rtol=1e-12)
