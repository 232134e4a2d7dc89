"""What is particular to each structure of the library: symmetry, self-stress, actuation and refusals."""

from itertools import pairwise
from math import hypot, pi

import numpy as np
import pytest
from drawn_statics import nodal_forces, tensions
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.mechanics import solve_path
from tensegra.mechanics.stability import self_stress
from tensegra.structure import library
from tensegra.units import is_sane

# Coordinates of size one go through a sine, a rotation and a sum.
SAME_PLACE = 1e-12

# Converged paths keep a symmetry to what Newton's residual of 1e-9 at most leaves of it.
SAME_AFTER_SOLVING = 1e-6

# A tension is a stiffness times a strain that is known to a few units in the last place.
STRAIN_ROUNDING = 1e-13


def rotated(points, angle):
    """Return points turned about z."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def assert_same_set(points, others, tolerance=SAME_PLACE):
    distances = np.linalg.norm(points[:, None] - others[None], axis=2)
    size = np.abs(points).max()
    assert distances.min(axis=0).max() <= tolerance * size
    assert distances.min(axis=1).max() <= tolerance * size


def rows(structure, names):
    return [structure.node_ids.index(name) for name in names]


@given(
    n_stages=st.integers(1, 6),
    n_struts=st.integers(3, 7),
    radius=st.floats(0.2, 5.0),
    stage_height=st.floats(0.2, 5.0),
    clustered=st.sampled_from(["none", "one", "full"]),
)
@settings(max_examples=30, deadline=None)
def test_a_tower_is_in_equilibrium_whatever_its_proportions(
    n_stages, n_struts, radius, stage_height, clustered
):
    tower = library.tower(
        n_stages,
        n_struts,
        radius,
        stage_height,
        clustered=clustered,
        prestress=1.0,
        strut_stiffness=1e4,
        cable_stiffness=1e4,
    )
    above_ground = nodal_forces(tower)[n_struts:]
    carried = tensions(tower)
    assert np.abs(above_ground).max() <= STRAIN_ROUNDING * 1e4 * (1.0 + radius / stage_height)
    assert carried["chain0" if clustered != "none" else "v0_0"] == pytest.approx(1.0, abs=1e-9)


def test_a_tower_is_symmetric_about_its_axis_and_every_other_ring_above_the_ground_ring():
    tower = library.tower(4, 5, radius=2.0)
    x = tower.coordinates
    assert_same_set(x, rotated(x, 2.0 * pi / 5))
    rings = x.reshape(5, 5, 3)
    np.testing.assert_array_equal(rings[0, :, :2], rings[2, :, :2])
    np.testing.assert_array_equal(rings[1, :, :2], rings[3, :, :2])
    np.testing.assert_allclose(np.hypot(*x[:, :2].T), 2.0)


@pytest.mark.parametrize(
    ("clustered", "n_self_stress", "n_mechanisms"),
    # Each further long cable over N stages takes N − 1 columns away; only one state remains.
    [("none", 6, 6), ("one", 1, 6), ("full", 1, 6 + 3 * 5)],
)
def test_a_tower_has_the_states_of_self_stress_of_its_prisms_and_one_over_long_cables(
    clustered, n_self_stress, n_mechanisms
):
    found = self_stress(library.tower(6, clustered=clustered))
    assert (found.n_self_stress, found.n_mechanisms) == (n_self_stress, n_mechanisms)


@pytest.mark.parametrize("clustered", ["none", "one", "full"])
def test_the_chains_of_a_tower_run_from_the_ground_to_the_top(clustered):
    tower = library.tower(5, 3, clustered=clustered)
    for i in range(3):
        members = [tower.members[name] for name in tower.members_named(f"chain{i}")]
        segments = [segment for member in members for segment in member.segments]
        assert segments == list(pairwise(f"r{j}_{i}" for j in range(6)))
        assert tower.actuators[f"chain{i}"].members == tower.members_named(f"chain{i}")
    assert set(tower.actuators["chains"].members) == set(tower.groups["vertical"])


def test_a_shortened_chain_bends_a_tower_towards_it_and_all_together_sink_it():
    tower = library.tower(5, clustered="full")
    top = [f"r5_{i}" for i in range(4)]
    # The foot of chain 0 is on the axis x, that of chain 1 on y.
    along_x, along_y = (solve_path(tower, {chain: 0.02}) for chain in ("chain0", "chain1"))
    assert along_x.displacement("x", top) > 0.1
    assert along_x.displacement("x", top) == pytest.approx(
        along_y.displacement("y", top), rel=SAME_AFTER_SOLVING
    )
    sunk = solve_path(tower, {"chains": 0.02})
    assert sunk.displacement("z", top) < -0.1
    assert abs(sunk.displacement("x", top)) < SAME_AFTER_SOLVING


def test_guides_hold_the_rings_named_sideways():
    tower = library.tower(10, 3, guided_every=5)
    assert {node: axes for node, axes in tower.supports.items() if axes == "xy"} == dict.fromkeys(
        [f"r{j}_{i}" for j in (5, 10) for i in range(3)], "xy"
    )


@pytest.mark.slow
@pytest.mark.parametrize("clustered", ["none", "full"])
def test_a_tower_of_thirty_thousand_nodes_stands(clustered):
    tower = library.tower(7500, clustered=clustered, guided_every=10)
    assert tower.n_nodes == 30_004
    equilibrium = solve_path(tower).raise_for_status().final
    assert equilibrium.lowest_eigenvalue > 0.0
    assert equilibrium.n_negative == 0


@pytest.mark.parametrize(
    ("half_width", "upper", "lower"), [(1.0, 1.0, 1.0), (0.6, 0.4, 0.9), (1.2, 2.0, 0.72)]
)
def test_a_d_bar_loses_its_stability_where_the_closed_form_says(half_width, upper, lower):
    border = (upper * lower) ** 0.5
    assert half_width == pytest.approx(border)
    lowest = [
        solve_path(library.d_bar(factor * border, upper, lower)).final.lowest_eigenvalue
        for factor in (0.98, 1.02)
    ]
    assert lowest[0] > 0.0 > lowest[1]


def test_a_d_bar_is_its_own_mirror_image():
    d_bar = library.d_bar(0.5, 0.7, 0.9)
    assert_same_set(d_bar.coordinates, d_bar.coordinates * [-1.0, 1.0, 1.0])
    raised = solve_path(d_bar, {"under": 0.05})
    x, y, z = raised.displacements[rows(d_bar, ["top"])[0]]
    # `left` is pinned and `right` slides: the mirror's line moves with half of what `right` does.
    assert x == pytest.approx(0.5 * raised.displacement("x", ["right"]), abs=SAME_AFTER_SOLVING)
    assert z == 0.0
    # The upright is pulled up through the crossing.
    assert y > 0.0


@pytest.mark.parametrize("clustered", [True, False])
def test_a_levy_dome_is_symmetric_and_its_hoops_are_closed(clustered):
    dome = library.levy_dome(6, 2, clustered=clustered)
    x = dome.coordinates
    assert_same_set(x, rotated(x, 2.0 * pi / 6))
    assert_same_set(x, x * [1.0, -1.0, 1.0])
    for j in (1, 2):
        loop = [f"b{j}_{i % 6}" for i in range(7)]
        members = [dome.members[name] for name in dome.members_named(f"hoop{j}")]
        assert [segment for member in members for segment in member.segments] == list(pairwise(loop))
        assert dome.actuators[f"hoop{j}"].members == dome.members_named(f"hoop{j}")
    carried = tensions(dome)
    assert carried[dome.members_named("hoop1")[0]] == pytest.approx(1e5, rel=1e-9)


def test_ridges_and_diagonals_of_a_levy_dome_come_in_mirrored_pairs():
    dome = library.levy_dome()
    carried = tensions(dome)
    for name in dome.groups["ridges"] + dome.groups["diagonals"]:
        if name.endswith("l"):
            assert carried[name] == pytest.approx(carried[f"{name[:-1]}r"], rel=1e-9)


def test_a_shortened_hoop_lifts_a_levy_dome_evenly():
    dome = library.levy_dome()
    moved = solve_path(dome, {"hoop1": 0.02})
    tops = moved.displacements[rows(dome, [f"t1_{i}" for i in range(8)])]
    assert tops[:, 2].min() > 0.0
    assert np.ptp(tops[:, 2]) <= SAME_AFTER_SOLVING * tops[:, 2].max()
    assert moved.displacement("z", ["ct"]) > tops[:, 2].max()


@given(
    nx=st.integers(3, 9),
    ny=st.integers(3, 9),
    rise=st.floats(-2.0, 2.0).filter(is_sane),
    spacing=st.floats(0.2, 5.0),
)
@settings(max_examples=30, deadline=None)
def test_a_saddle_net_is_in_equilibrium_whatever_its_proportions(nx, ny, rise, spacing):
    net = library.grid(nx, ny, spacing, rise, prestress=1.0, cable_stiffness=1e3)
    inner = [node not in net.supports for node in net.nodes]
    # Beside the strain itself, the rounding of steep cables grows with their slope.
    slope = hypot(1.0, 8.0 * rise / spacing)
    assert np.abs(nodal_forces(net)[inner]).max() <= STRAIN_ROUNDING * 1e3 * slope


def test_a_saddle_net_lies_on_its_surface_and_a_flat_one_carries_one_tension():
    saddle = library.grid(5, 7, rise=1.5)
    x, y, z = saddle.coordinates.T
    np.testing.assert_allclose(z, 1.5 * ((x / 2.0 - 1.0) ** 2 - (y / 3.0 - 1.0) ** 2), atol=SAME_PLACE)
    flat = library.grid(5, 7, prestress=80.0)
    np.testing.assert_allclose(list(tensions(flat).values()), 80.0)
    assert not {"n0_0", "n4_0", "n0_6", "n4_6"} & set(flat.nodes)


def test_lines_over_pulleys_carry_what_the_lines_of_segments_carry():
    pulleys, segments = library.grid(5, 4, clustered=True), library.grid(5, 4)
    assert pulleys.members["x1"].nodes == tuple(f"n{i}_1" for i in range(5))
    assert pulleys.members["x1"].rest_length == pytest.approx(4 * segments.members["x0_1"].rest_length)
    assert pulleys.nodes == segments.nodes


def test_a_pressed_net_dents():
    net = library.grid(9, 9)
    dented = solve_path(net, loads={("n4_4", "z"): -100.0})
    assert dented.displacement("z", ["n4_4"]) < dented.displacement("z", ["n4_2"]) < 0.0


def test_the_beams_of_a_gripper_are_the_paper_s_beam_turned_about_its_axis():
    beam, gripper = library.paper_beam(), library.gripper()
    x, drawn = beam.coordinates, gripper.coordinates.reshape(4, 24, 3)
    for k in range(4):
        np.testing.assert_allclose(
            drawn[k], rotated(np.column_stack([185.0 - x[:, 2], x[:, 1], x[:, 0]]), k * pi / 2), atol=1e-10
        )
    assert gripper.members["b3_K1"].nodes == tuple(f"b3_{node}" for node in beam.members["K1"].nodes)
    assert gripper.actuators["A14"].members == tuple(f"b{k}_{e}" for k in (1, 2, 3, 4) for e in ("K1", "K4"))
    assert gripper.members_named("beam2") == tuple(f"b2_{name}" for name in beam.members)
    assert len(gripper.members_named("clustered")) == 16
    assert not any(gripper.gravity)


def test_a_gripper_closes_and_each_of_its_beams_moves_as_the_beam_alone():
    actuation = {"A14": 0.10, "A23": 0.10}
    alone = solve_path(library.paper_beam().replace(gravity=(0, 0, 0)), actuation).final
    gripper = library.gripper()
    closed = solve_path(gripper, actuation).raise_for_status()
    distance = np.hypot(*np.moveaxis(closed.final.nodes.reshape(4, 24, 3)[..., :2], 2, 0))
    before = np.hypot(*np.moveaxis(closed.stages[-1].nodes.reshape(4, 24, 3)[..., :2], 2, 0))
    tips = rows(library.paper_beam(), ["18", "23"])
    assert (before - distance)[:, tips].min() > 30.0
    np.testing.assert_allclose(
        closed.final.tensions.reshape(4, 48), np.tile(alone.tensions, (4, 1)), rtol=SAME_AFTER_SOLVING
    )
    # The beam's x is the gripper's axis.
    np.testing.assert_allclose(
        closed.final.nodes.reshape(4, 24, 3)[..., 2],
        np.tile(alone.nodes[:, 0], (4, 1)),
        atol=SAME_AFTER_SOLVING * 185.0,
    )


def test_a_von_mises_truss_carries_the_load_of_the_closed_form():
    truss = library.von_mises_truss(1.0, 0.2, stiffness=1e6)
    z, l0 = 0.17, hypot(1.0, 0.2)
    load = 2e6 * (1.0 / hypot(1.0, z) - 1.0 / l0) * z
    pressed = solve_path(truss, loads={("apex", "z"): -load})
    assert pressed.final.node("apex")[2] == pytest.approx(z, rel=1e-9)


@pytest.mark.parametrize("length", [7.8, 10.0, 16.0])
def test_a_hanging_chain_is_drawn_where_it_hangs(length):
    chain = library.hanging_chain(9, 8.0, length, weight=3.0)
    x = chain.coordinates
    size = np.ptp(x, axis=0).max()
    np.testing.assert_allclose(solve_path(chain).final.nodes, x, rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(x, x[::-1] * [-1.0, 1.0, 1.0] + [8.0, 0.0, 0.0], rtol=0, atol=1e-9 * size)
    assert x[1:-1, 2].max() < 0.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: library.tower(0), "tower: n_stages: found 0, expected at least 1"),
        (lambda: library.tower(3, 2), "tower: n_struts: found 2, expected at least 3"),
        (lambda: library.tower(guided_every=0), "tower: guided_every: found 0, expected at least 1"),
        (lambda: library.tower(clustered="ful"), "found 'ful', .* did you mean 'full'"),
        (lambda: library.tower(radius=-1.0), "tower: radius: found -1.0"),
        (lambda: library.tower(prestress=1e9), "prestress from r0_0 to r1_1: found -"),
        (lambda: library.d_bar(lower=0.0), "d_bar: lower: found 0.0"),
        (lambda: library.levy_dome(2), "levy_dome: n_sides: found 2, expected at least 3"),
        (lambda: library.levy_dome(n_hoops=0), "levy_dome: n_hoops: found 0"),
        (lambda: library.levy_dome(4, 4), "expected more sides, fewer hoops or longer struts"),
        (lambda: library.levy_dome(strut_length=0.5), "expected more sides, fewer hoops or longer struts"),
        (lambda: library.grid(2, 5), "grid: nx: found 2, expected at least 3"),
        (lambda: library.grid(rise=1.0, clustered=True), "grid: rise: found 1.0, expected 0"),
        (lambda: library.grid(rise=float("nan")), "found nan, expected a finite number"),
        (lambda: library.gripper(1), "gripper: n_beams: found 1, expected at least 2"),
        (lambda: library.gripper(radius=0.0), "gripper: radius: found 0.0"),
        (lambda: library.von_mises_truss(height=0.0), "von_mises_truss: height: found 0.0"),
        (lambda: library.hanging_chain(1), "hanging_chain: n_links: found 1, expected at least 2"),
        (lambda: library.hanging_chain(weight=0.0), "hanging_chain: weight: found 0.0"),
    ],
)
def test_impossible_structures_are_refused(make, message):
    with pytest.raises(ModelError, match=message):
        make()
