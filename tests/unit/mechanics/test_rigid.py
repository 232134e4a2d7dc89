"""Rigid motions by their names, and against finite motions that a body on its supports can make."""

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tensegra.mechanics.arrays import AXES, structure_arrays
from tensegra.mechanics.rigid import align, freedom_under, held_for, in_frame, rigid_motions
from tensegra.structure import Member, Structure, library
from tensegra.structure.structure import path_length

ROUNDING = 1e-12
"""Of sizes of about one: products of a few numbers, and a decomposition of six columns."""

ALIGNED = 1e-9
"""Of the size: Gauss-Newton converges quadratically, to rounding."""

SMALL = 1e-3
"""Size of the finite motions by which directions are told: they turn by as much on the way."""

APART = 0.02
"""Share of `SMALL` above which a motion is one: twenty times what curvature makes of it."""

STEP = 1e-5
"""Of central differences over motions of about one: truncation 1e-10, rounding 1e-11."""

DIFFERENCE = 1e-8
"""What they leave, with a margin for frames that turn fast."""

TRANSLATIONS = tuple(f"translation along {axis}" for axis in AXES)
ROTATIONS = tuple(f"rotation about {axis}" for axis in AXES)

CUBE = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
"""Nodes 0 to 7; node 4 + 2 j + k is at x = 1."""


def body(points, supports, tied=None):
    """Build struts between all pairs of the points, or those that are tied."""
    nodes = {str(i): tuple(map(float, point)) for i, point in enumerate(points)}
    pairs = combinations(nodes, 2) if tied is None else [(str(i), str(j)) for i, j in tied]
    members = {
        f"{i}-{j}": Member("strut", (i, j), path_length(nodes, (i, j)), stiffness=1.0) for i, j in pairs
    }
    return structure_arrays(Structure(name="body", nodes=nodes, members=members, supports=supports))


ROD = [(0, 0, 0), (1, 0, 0), (3, 0, 0)]
OBLIQUE_ROD = [(0, 0, 0), (1, 1, 0), (2, 2, 0)]

NAMED = {
    "free in space": (CUBE, {}, (*TRANSLATIONS, *ROTATIONS)),
    "one coordinate": (CUBE, {"0": "x"}, ("translation along y", "translation along z", *ROTATIONS)),
    "a hinge": (CUBE, {"0": "xyz"}, ROTATIONS),
    "two hinges": (CUBE, {"0": "xyz", "1": "xyz"}, ("rotation about z",)),
    "two hinges across": (CUBE, {"1": "xyz", "6": "xyz"}, ("rotation about (0.577, 0.577, -0.577)",)),
    "three hinges": (CUBE, {"0": "xyz", "1": "xyz", "2": "xyz"}, ()),
    "a floor": (
        CUBE,
        dict.fromkeys("0246", "z"),
        ("translation along x", "translation along y", "rotation about z"),
    ),
    "a rail": (CUBE, {"0": "yz", "4": "yz"}, ("translation along x", "rotation about x")),
    "a rail and a wall": (CUBE, {"0": "yz", "4": "yz", "2": "z"}, ("translation along x",)),
    "six coordinates": (CUBE, {"0": "xyz", "4": "yz", "2": "z"}, ()),
    # What is left to first order only: the second order lets a wall ahead hold the turns.
    "a hinge and a wall ahead": ([*ROD, (0, 1, 1)], {"0": "xyz", "2": "x"}, ("rotation about x",)),
    "two walls ahead": (
        [*ROD, (0, 1, 1)],
        {"0": "x", "2": "x"},
        ("translation along y", "translation along z", "rotation about x"),
    ),
    "a wall beside": ([*ROD, (0, 1, 1)], {"0": "xyz", "2": "y"}, ("rotation about x", "rotation about y")),
    "two walls that face each other": (
        [(-1, 0, 0), (1, 0, 0), (0, 1, 2)],
        {"0": "x", "1": "x"},
        ("translation along y", "translation along z", "rotation about x"),
    ),
    # Three normals that meet in a point: the turn about it goes on where all three pull it back alike.
    "three rollers through a point": (
        [(1, 0, 0), (0, 1, 0), (2, 0, 0), (0, 0, 0)],
        {"0": "xz", "1": "yz", "2": "xz"},
        (),
    ),
    "three rollers beside a hinge": (
        [(0, 1, 0), (0, -2, 0), (0, 0, 0)],
        {"0": "xz", "1": "xz", "2": "xyz"},
        (),
    ),
    # A straight rod turns about itself without a motion.
    "a rod": (ROD, {}, (*TRANSLATIONS, "rotation about y", "rotation about z")),
    "a rod on a hinge": (ROD, {"0": "xyz"}, ("rotation about y", "rotation about z")),
    "a rod on a hinge and a wall ahead": (ROD, {"0": "xyz", "2": "x"}, ()),
    "a rod on a hinge and a wall beside": (ROD, {"0": "xyz", "2": "y"}, ("rotation about y",)),
    "a rod between two walls": (ROD, {"0": "x", "2": "x"}, ("translation along y", "translation along z")),
    "a rod between two hinges": (ROD, {"0": "xyz", "2": "xyz"}, ()),
}


@pytest.mark.parametrize("case", NAMED)
def test_names_of_what_the_supports_leave(case):
    points, supports, names = NAMED[case]
    arrays = body(points, supports)
    motions = rigid_motions(arrays)
    assert motions.names == names
    assert_they_are_rigid(arrays, motions)


def test_an_oblique_rod_turns_about_two_axes_across_it():
    arrays = body(OBLIQUE_ROD, {"0": "xyz"})
    motions = rigid_motions(arrays)
    assert len(motions) == 2
    assert_they_are_rigid(arrays, motions)
    along = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    spins = motions.spin[:, 0]
    assert np.linalg.matrix_rank(spins - np.outer(spins @ along, along)) == 2


def assert_they_are_rigid(arrays, motions):
    """Check that no held coordinate moves, no segment changes its length, and none is made of the others."""
    x = arrays.coordinates
    fields = motions.fields(x)
    assert fields.shape == (len(motions), *x.shape)
    scale = 1.0 + np.abs(fields).max(initial=0.0)
    assert np.abs(fields[:, ~arrays.free]).max(initial=0.0) <= ROUNDING * scale
    first, second = arrays.segment_nodes.T
    stretch = np.einsum("qsi,si->qs", fields[:, second] - fields[:, first], x[second] - x[first])
    assert np.abs(stretch).max(initial=0.0) <= ROUNDING * scale * max(1.0, np.abs(x).max()) ** 2
    if len(motions):
        singular = np.linalg.svd(fields.reshape(len(motions), -1), compute_uv=False)
        assert singular[-1] > 0.05 * singular[0]


def moved_by(x, motion):
    """Move positions by a translation and a turn, ``(6,)``."""
    return x @ Rotation.from_rotvec(motion[3:]).as_matrix().T + motion[:3]


def six_fields(x):
    return np.concatenate(
        [np.broadcast_to(np.eye(3)[:, None], (3, *x.shape)), np.cross(np.eye(3)[:, None], x)]
    )


def back_to_the_supports(arrays, start):
    """Move a body by Newton's method to where its supports are again, from near its place."""
    x, held = arrays.coordinates, ~arrays.free
    y = start
    for _ in range(80):
        away = (y - x)[held]
        if not away.size or np.abs(away).max() < 1e-15:
            break
        change = -np.linalg.pinv(six_fields(y)[:, held].T, rcond=1e-13) @ away
        y = moved_by(y, change * min(1.0, SMALL / np.linalg.norm(change)))
    return y


def finite_motions(arrays, directions):
    """Return where a body comes to rest on its supports after small motions, ``(n, 6)``."""
    x = arrays.coordinates
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    places = [back_to_the_supports(arrays, moved_by(x, SMALL * one)) for one in unit]
    return (np.array(places) - x).reshape(len(unit), x.size) / SMALL


def null_space(matrix):
    _, singular, right = np.linalg.svd(matrix)
    return right[int(np.sum(singular > 1e-9)) :]


def at_random_on_a_grid(rng):
    """Build a body on a grid of three by three by three, so that many supports are in a line or a plane."""
    n = int(rng.integers(2, 6))
    points = rng.permutation(np.argwhere(np.ones((3, 3, 3))))[:n] - 1
    held = rng.random((n, 3)) < 0.3
    held[0] &= not held.all()  # a body that is held whole is none
    supports = {str(i): "".join(AXES[c] for c in np.flatnonzero(held[i])) for i in range(n) if held[i].any()}
    return body(points, supports)


@pytest.mark.parametrize("seed", range(8))
def test_they_are_the_motions_that_a_body_can_really_make(seed):
    rng = np.random.default_rng(seed)
    found, n_second_order = set(), 0
    for _ in range(20):
        arrays = at_random_on_a_grid(rng)
        motions = rigid_motions(arrays)
        assert_they_are_rigid(arrays, motions)
        found.add(len(motions))
        x = arrays.coordinates
        held = six_fields(x)[:, ~arrays.free].T
        left = null_space(held) if held.size else np.eye(6)
        still = np.abs(np.tensordot(left, six_fields(x), axes=1)).max(axis=(1, 2), initial=0.0)
        # All that is found can be made, and is not given back: it is no motion of the first order alone.
        fields = motions.fields(x).reshape(len(motions), x.size)
        made = made_of(arrays, fields)
        np.testing.assert_allclose(made, fields, rtol=0, atol=APART * 3.0)
        if not len(left):
            assert not len(motions)
            continue
        # What else the first order leaves is given back, so far as motions make a space at all.
        places = finite_motions(arrays, rng.standard_normal((16, len(left))) @ left)
        n_finite = int(np.sum(np.linalg.svd(places, compute_uv=False) > APART * np.sqrt(len(places))))
        n_second_order += n_finite < np.sum(still > ROUNDING)
        if n_finite != len(motions):
            assert n_finite > len(motions)
            assert do_not_make_a_space(places, n_finite)
    assert len(found) > 3
    assert n_second_order > 0


def made_of(arrays, fields):
    """Return the fields again as finite motions."""
    x, six = arrays.coordinates, six_fields(arrays.coordinates).reshape(6, -1)
    directions = np.linalg.lstsq(six.T, fields.T, rcond=None)[0].T
    sizes = np.linalg.norm(directions, axis=1, keepdims=True)
    return finite_motions(arrays, directions) * sizes if len(fields) else fields.reshape(0, x.size)


def do_not_make_a_space(places, n_finite):
    """Tell whether motions lie on a few lines that cross, where their sums are no motions."""
    unit = places / np.linalg.norm(places, axis=1, keepdims=True)
    parallel = np.abs(unit @ unit.T) > 1.0 - 1e-4
    return np.linalg.matrix_rank(parallel.astype(float)) <= n_finite


def test_motions_of_several_bodies_are_told_apart():
    # Two bars that a wall between them parts, and a node that only held ones are tied to.
    points = [(0, 0, 0), (1, 0, 0), (5, 0, 0), (6, 0, 0), (6, 1, 0), (5, 5, 0), (5, 5, 1)]
    tied = [(0, 1), (2, 3), (3, 4), (2, 4), (5, 6)]
    arrays = body(points, {"0": "xyz", "2": "xyz", "3": "xyz", "5": "xyz"}, tied)
    motions = rigid_motions(arrays)
    assert motions.names == (
        "rotation about y of the part with node 1",
        "rotation about z of the part with node 1",
        "rotation about x of the part with node 4",
        "rotation about x of the part with node 6",
        "rotation about y of the part with node 6",
    )
    moving = np.abs(motions.fields(arrays.coordinates)).max(axis=2) > ROUNDING
    assert [np.flatnonzero(row).tolist() for row in moving] == [[1], [1], [4], [6], [6]]


def test_a_held_node_does_not_join_two_bodies():
    points = [(0, 0, 0), (1, 0, 0), (0, 0, 2)]
    arrays = body(points, {"0": "xyz"}, [(0, 1), (0, 2)])
    assert len(rigid_motions(arrays)) == 4
    free = body(points, {}, [(0, 1), (0, 2)])
    assert len(rigid_motions(free)) == 6  # as one body: that it folds is a mechanism of its own


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_neither_the_unit_nor_the_place_of_the_origin_matters(scale):
    for points, supports, names in NAMED.values():
        away = scale * (np.array(points) + np.array([3.0, -7.0, 5.0]))
        assert rigid_motions(body(away, supports)).names == names


CASES = [(points, supports) for points, supports, names in NAMED.values() if names]


@pytest.mark.parametrize("number", range(len(CASES)))
def test_coordinates_held_for_them_leave_none(number):
    arrays = body(*CASES[number])
    motions = rigid_motions(arrays)
    held = held_for(arrays, motions, arrays.coordinates)
    assert held.n_free == arrays.n_free - len(motions)
    assert not np.any(held.free & ~arrays.free)
    assert len(rigid_motions(held)) == 0
    more = arrays.free & ~held.free
    singular = np.linalg.svd(motions.fields(arrays.coordinates)[:, more], compute_uv=False)
    assert singular[-1] > 0.05 * singular[0]  # and leave none nearly


def test_coordinates_are_chosen_where_the_structure_is():
    # As given the bar lies along x; where it is now it stands along y.
    arrays = body([(0, 0, 0), (2, 0, 0)], {"0": "xyz", "1": "z"})
    motions = rigid_motions(arrays)
    now = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    lying, standing = held_for(arrays, motions, arrays.coordinates), held_for(arrays, motions, now)
    assert lying.free[1].tolist() == [True, False, False]
    assert standing.free[1].tolist() == [False, True, False]


def cloud(seed, n_runs=5):
    """Return a cube's corners, moved about at random, and the same turned, shifted and moved a little."""
    rng = np.random.default_rng(seed)
    reference = np.array(CUBE) + 0.3 * rng.standard_normal((8, 3))
    turns = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, (n_runs, 3))).as_matrix()
    nodes = np.einsum("rij,nj->rni", turns, reference) + rng.uniform(-2.0, 2.0, (n_runs, 1, 3))
    return reference, nodes + 0.05 * rng.standard_normal(nodes.shape)


@pytest.mark.parametrize("seed", range(5))
def test_the_frame_of_a_free_body_is_that_of_least_squares(seed):
    reference, nodes = cloud(seed)
    found = align(nodes, reference, rigid_motions(body(CUBE, {})))
    for one, aligned in zip(nodes, found, strict=True):
        centre, other = one.mean(axis=0), reference.mean(axis=0)
        turn, _ = Rotation.align_vectors(reference - other, one - centre)
        np.testing.assert_allclose(aligned, turn.apply(one - centre) + other, rtol=0, atol=ALIGNED)
        np.testing.assert_allclose(
            align(one, reference, rigid_motions(body(CUBE, {}))), aligned, atol=ALIGNED
        )


@pytest.mark.parametrize("seed", range(5))
def test_the_frame_of_a_hinged_body_turns_about_the_hinge(seed):
    reference, nodes = cloud(seed)
    hinge = np.array(CUBE[0], dtype=float)
    nodes = nodes + (hinge - nodes[:, :1])
    found = align(nodes, reference, rigid_motions(body(CUBE, {"0": "xyz"})))
    for one, aligned in zip(nodes, found, strict=True):
        turn, _ = Rotation.align_vectors(reference - hinge, one - hinge)
        np.testing.assert_allclose(aligned, turn.apply(one - hinge) + hinge, rtol=0, atol=ALIGNED)


def test_the_frame_on_a_floor_is_that_of_the_plane():
    reference, nodes = cloud(3)
    found = align(nodes, reference, rigid_motions(body(CUBE, dict.fromkeys("0246", "z"))))
    for one, aligned in zip(nodes, found, strict=True):
        p, q = one[:, :2] - one[:, :2].mean(axis=0), reference[:, :2] - reference[:, :2].mean(axis=0)
        angle = np.arctan2(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]), np.sum(p * q))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        expected = p @ turn.T + reference[:, :2].mean(axis=0)
        np.testing.assert_allclose(aligned[:, :2], expected, rtol=0, atol=ALIGNED)
        np.testing.assert_array_equal(aligned[:, 2], one[:, 2])


def test_aligning_moves_as_a_body_and_rests_where_it_is_aligned():
    reference, nodes = cloud(4)
    motions = rigid_motions(body(CUBE, {}))
    found = align(nodes, reference, motions)
    for before, after in zip(nodes, found, strict=True):
        for i, j in combinations(range(8), 2):
            length = np.linalg.norm(before[j] - before[i])
            assert np.linalg.norm(after[j] - after[i]) == pytest.approx(length, rel=ROUNDING)
    np.testing.assert_allclose(align(found, reference, motions), found, rtol=0, atol=ALIGNED)
    nothing = rigid_motions(body(CUBE, {"0": "xyz", "4": "yz", "2": "z"}))
    assert align(nodes, reference, nothing) is nodes


def test_nodes_on_a_line_are_aligned_too():
    # FAILS: the normal matrix is singular, and what is added to it, 1e-18 of its trace, is lost in rounding.
    # The turn about the line moves nothing, though as it was given the body had it.
    motions = rigid_motions(body([(0, 0, 0), (1, 0, 0), (2, 1, 0)], {}))
    assert len(motions) == 6
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    reference = Rotation.from_rotvec([0.0, 0.2, 0.5]).apply(line) + np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(align(line, reference, motions), reference, rtol=0, atol=ALIGNED)


@pytest.mark.parametrize("supports", [{}, {"0": "xyz"}, {"0": "xyz", "1": "xyz"}, dict.fromkeys("0246", "z")])
def test_rates_in_the_frame_are_those_of_the_aligned_positions(supports):
    arrays = body(CUBE, supports)
    motions = rigid_motions(arrays)
    reference, nodes = cloud(5)
    nodes = align(nodes, reference, motions)
    references = np.broadcast_to(reference, nodes.shape)
    rates = np.random.default_rng(0).standard_normal((len(nodes), 2, nodes[0].size))
    found = in_frame(rates, nodes, references, motions)
    for q in range(2):
        change = STEP * rates[:, q].reshape(nodes.shape)
        up, down = (align(nodes + sign * change, reference, motions) for sign in (1.0, -1.0))
        difference = (up - down).reshape(len(nodes), -1) / (2.0 * STEP)
        np.testing.assert_allclose(found[:, q], difference, rtol=0, atol=DIFFERENCE)


def forces(arrays, **by_node):
    loads = np.zeros((arrays.n_nodes, 3))
    for node, force in by_node.items():
        loads[int(node[1:])] = force
    return loads


UNDER_LOADS = {
    "nothing": ({}, (*TRANSLATIONS, *ROTATIONS), ()),
    "a force": ({"n0": (0, 0, -1)}, ("translation along x", "translation along y", "rotation about z"), (
        "translation along z",)),
    "a pull at both ends": ({"n0": (0, 0, -1), "n1": (0, 0, 1)}, (*TRANSLATIONS, "rotation about z"), ()),
    "two pulls across": (
        {"n0": (0, 0, -1), "n1": (0, 0, 1), "n2": (0, -1, 0), "n3": (0, 1, 0)}, TRANSLATIONS, ()
    ),
    "a couple": ({"n0": (0, 1, 0), "n4": (0, -1, 0)}, (*TRANSLATIONS, "rotation about y"), ()),
}  # fmt: skip


@pytest.mark.parametrize("factor", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize("case", UNDER_LOADS)
def test_what_loads_make_of_a_free_body(case, factor):
    by_node, neutral, unheld = UNDER_LOADS[case]
    arrays = body(CUBE, {})
    freedom = freedom_under(arrays, rigid_motions(arrays), factor * forces(arrays, **by_node))
    assert freedom.neutral.names == neutral
    assert freedom.unheld == unheld


def test_a_force_on_held_coordinates_does_nothing():
    arrays = body(CUBE, dict.fromkeys("0246", "z"))
    motions = rigid_motions(arrays)
    freedom = freedom_under(arrays, motions, forces(arrays, n0=(0, 0, -5)))
    assert freedom.neutral.names == motions.names
    assert freedom.unheld == ()


def test_of_several_loads_each_counts():
    arrays = body(CUBE, {})
    motions = rigid_motions(arrays)
    loads = np.stack([forces(arrays, n0=(0, 0, 1.0)), forces(arrays, n3=(0, 1e-3, 0))])
    freedom = freedom_under(arrays, motions, loads)
    assert freedom.unheld == ("translation along y", "translation along z")
    assert freedom.neutral.names == ("translation along x",)


def test_a_weight_turns_a_pendulum_and_not_one_about_its_axis():
    standing = [(0, 0, 0), (1, 0, -2), (0, 1, -2)]
    arrays = body(standing, {"0": "xyz"})
    freedom = freedom_under(arrays, rigid_motions(arrays), forces(arrays, n1=(0, 0, -1), n2=(0, 0, -1)))
    assert freedom.neutral.names == ("rotation about z",)
    assert freedom.unheld == ()
    across = body(standing, {"1": "xyz", "2": "xyz"})
    freedom = freedom_under(across, rigid_motions(across), forces(across, n0=(0, 0, -1)))
    assert len(freedom.neutral) == 0
    assert freedom.unheld == ()


@pytest.mark.parametrize("seed", range(5))
def test_along_neutral_motions_no_load_does_work_wherever_the_body_is(seed):
    rng = np.random.default_rng(seed)
    arrays = body(CUBE, {} if seed % 2 else {"3": "xyz"})
    motions = rigid_motions(arrays)
    along = rng.standard_normal(3)
    loads = np.outer(rng.standard_normal(8), along)  # all along one oblique line
    freedom = freedom_under(arrays, motions, loads)
    neutral = freedom.neutral
    assert len(neutral) == (3 if seed % 2 else 1)
    x = arrays.coordinates + 0.2 * rng.standard_normal((8, 3))
    powers = np.einsum("qni,ni->q", neutral.fields(x), np.where(arrays.free, loads, 0.0))
    np.testing.assert_allclose(powers, 0.0, atol=1e-8)
    spins = neutral.spin[:, 0]
    np.testing.assert_allclose(np.cross(spins, along), 0.0, atol=1e-8)
    assert_they_are_rigid(arrays, neutral)


def test_the_key_tells_freedoms_apart():
    arrays = body(CUBE, {})
    motions = rigid_motions(arrays)
    loads = [forces(arrays), forces(arrays, n0=(0, 0, 1.0)), forces(arrays, n0=(0, 1.0, 0))]
    keys = [freedom_under(arrays, motions, load).key for load in loads]
    assert len(set(keys)) == 3
    assert freedom_under(arrays, motions, 2.0 * loads[1]).key == keys[1]


@pytest.mark.parametrize(
    "build", [library.paper_beam, library.prism, library.levy_dome], ids=lambda one: one.__name__
)
def test_the_structures_of_the_library_are_held(build):
    assert len(rigid_motions(structure_arrays(build()))) == 0
    assert len(rigid_motions(structure_arrays(build().replace(supports={})))) == 6
