"""Words at the edges of what stands: rounding, turning bodies, bends sharper than any step, plain increments.

Each word has to be that of the structure, whatever the steps, the place, the direction and the units.
"""

from dataclasses import replace

import numpy as np
import pytest
import random_structures
from scipy.spatial.transform import Rotation

from tensegra.mechanics import PathSettings, solve_batch, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.rigid import align, rigid_motions
from tensegra.structure import Actuator, Member, Stage, Structure, library

STEPS = [(0.5, 0.15), (0.1, 0.05), (0.02, 0.02), (0.003, 0.15)]
"""First step and largest move."""


def by_steps(structure, **inputs):
    """Return the paths of a structure for several controls of the step."""
    controls = [PathSettings(first_step=first, largest_move=move) for first, move in STEPS]
    return [solve_path(structure, settings=control, **inputs) for control in controls]


def cable(nodes, rest_length, stiffness=1e3):
    return Member("cable", nodes, rest_length, stiffness=stiffness)


@pytest.mark.parametrize(
    ("top", "end", "load"),
    [((0, 0, 0), (0, 0, -1), (0, 0, -1)), ((0.1, 0.2, 0.3), (0.3, 0.7, -1), (0.1, 0.3, -1))],
)
def test_a_cable_that_is_taut_by_rounding_holds_nothing(top, end, load):
    rope = Structure(
        name="rope",
        nodes={1: top, 2: end},
        members={"c": cable((1, 2), 1.0)},
        supports={1: "xyz"},
        stages=[Stage("load", loads={2: load}), Stage("unload", loads={2: (0, 0, 0)})],
    )
    for path in by_steps(rope):
        assert path.stages[0].status == "stable"
        assert path.status == "collapsed"
        assert path.final.tension("c") == 0.0
        assert path.final.slack_members == ("c",)


def crossed_square(loads):
    """Return two struts that cross in a square of four cables, free in space, with loads in a last stage."""
    ring = [(1, 2), (2, 3), (3, 4), (4, 1)]
    members = {f"c{i}{j}": cable((i, j), 0.95) for i, j in ring}
    members |= {f"s{i}{j}": Member("strut", (i, j), 2**0.5, stiffness=1e5) for i, j in ((1, 3), (2, 4))}
    return Structure(
        name="square",
        nodes={1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0)},
        members=members,
        stages=[Stage("prestress"), Stage("load", loads=loads)],
        actuators={"A": Actuator(("c12",), "shorten")},
    )


def test_a_body_that_loads_turn_about_is_where_they_hold_it():
    # The loads push nodes 1 and 3 towards each other along x: the square turns by 135 degrees until they
    # pull. What was held for the rotation about x tells nothing of it there.
    square = crossed_square({1: (1, 0, 0), 3: (-1, 0, 0)})
    for path in by_steps(square):
        assert path.status == "snapped", path.reason
        along = path.final.node(1) - path.final.node(3)
        np.testing.assert_allclose(along / np.linalg.norm(along), (1, 0, 0), atol=1e-6)
        # In the plane the load turns it with the stiffness P times the diagonal over its inertia.
        np.testing.assert_allclose(path.final.lowest_eigenvalue, 0.7073756, rtol=1e-6)
    runs = solve_batch(square, actuation={"A": [0.0, 0.0, 0.01]})
    assert [str(word) for word in runs.status] == ["snapped"] * 3
    np.testing.assert_allclose(runs.lowest_eigenvalue[:2], 0.7073756, rtol=1e-6)


@pytest.mark.parametrize("runs", [1, 9])
def test_a_node_with_all_its_coordinates_held_for_rigid_motions_still_moves(runs):
    # Out of its plane the square is as stiff as its prestress: 207.6, against 2,001 in the plane.
    square = replace(crossed_square({}), stages=())
    batch = solve_batch(square, actuation={"A": np.zeros(runs)})
    held = solve_path(square.replace(supports={1: "xyz", 2: "yz", 3: "z"}))
    np.testing.assert_allclose(batch.tensions, np.tile(held.final.tensions, (runs, 1)), rtol=1e-9)
    np.testing.assert_allclose(batch.lowest_eigenvalue, 207.59054219, rtol=1e-7)
    assert solve_path(square).final.lowest_eigenvalue == pytest.approx(207.59054219, rel=1e-7)


def pair(last):
    """Return two cables in a line, their middle loaded across by −10 and then by `last`."""
    return Structure(
        name="pair",
        nodes={1: (-1, 0, 0), 2: (1, 0, 0), 3: (0, 0, 0)},
        members={"a": cable((1, 3), 1.0), "b": cable((2, 3), 1.0)},
        supports={1: "xyz", 2: "xyz", 3: "y"},
        stages=[Stage("load", loads={3: (0, 0, -10)}), Stage("on", loads={3: (0, 0, last)})],
    )


@pytest.mark.parametrize("last", [-1e-3, -1e-6, 1e-3, 10.0])
def test_a_bend_sharper_than_any_step_is_no_leap(last):
    # P = EA z³ near z = 0: the middle moves by a tenth of its way in a thousandth of the load, but moves on.
    for path in by_steps(pair(last)):
        assert path.status == "stable", path.reason
        height = path.final.node(3)[2]
        length = np.hypot(1.0, height)
        np.testing.assert_allclose(2e3 * (length - 1.0) * height / length, last, rtol=1e-6)


def test_an_increment_that_leaps_is_not_stable():
    truss = library.von_mises_truss()
    top = next(node for node in truss.nodes if node not in truss.supports or truss.supports[node] != "xyz")
    snaps = None
    for load in -np.logspace(0, 12, 60):
        path = solve_path(truss, loads={(top, "z"): load})
        if path.status == "snapped":
            snaps = load
            break
    assert snaps is not None
    stepped = solve_path(truss, loads={(top, "z"): snaps}, path="stepped")
    assert stepped.status in ("snapped", "failed", "unstable")
    np.testing.assert_allclose(stepped.final.nodes, path.final.nodes, rtol=1e-6)
    assert stepped.status == "snapped"
    assert "an increment left the path" in stepped.reason
    before = solve_path(truss, loads={(top, "z"): 0.5 * snaps}, path="stepped")
    assert before.status == "stable"
    runs = solve_batch(truss, loads={(top, "z"): [0.5 * snaps, snaps]}, path="stepped")
    assert [str(word) for word in runs.status] == ["stable", "snapped"]


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -2, 0.5)])
@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, 3.0])
def test_a_body_half_a_turn_off_is_brought_to_where_it_is_nearest(axis, angle):
    square = crossed_square({})
    arrays, motions = structure_arrays(square), rigid_motions(structure_arrays(square))
    bent = arrays.coordinates + 0.02 * np.random.default_rng(1).standard_normal((4, 3))
    turn = Rotation.from_rotvec(angle * np.array(axis) / np.linalg.norm(axis))
    found = align(np.array([1, -2, 3]) + turn.apply(bent), arrays.coordinates, motions)
    centred = bent - bent.mean(axis=0), arrays.coordinates - arrays.coordinates.mean(axis=0)
    best, _ = Rotation.align_vectors(centred[1], centred[0])
    np.testing.assert_allclose(found - found.mean(axis=0), best.apply(centred[0]), atol=1e-9)


def elsewhere(structure, seed):
    """Return a structure turned, moved, and told in other units of length and force, with these units."""
    rng = np.random.default_rng(seed)
    turn, away = Rotation.random(random_state=seed), rng.standard_normal(3) * 10 ** rng.uniform(0, 4)
    length, force = 10 ** rng.uniform(-3, 3, 2)
    nodes = {n: tuple(length * (turn.apply(np.array(x)) + away)) for n, x in structure.nodes.items()}
    members = {
        name: replace(member, rest_length=member.rest_length * length, stiffness=member.stiffness * force)
        for name, member in structure.members.items()
    }
    stages = [
        replace(stage, loads={n: tuple(force * turn.apply(np.array(p))) for n, p in stage.loads.items()})
        for stage in structure.stages
    ]
    return structure.replace(nodes=nodes, members=members, stages=stages), length, force


def loaded_body(seed):
    """Return a random body free in space, with two opposite loads in its last stage, and an actuation."""
    rng = np.random.default_rng(seed)
    name = rng.choice(["ball", "kite", "d_bar"])
    case = getattr(random_structures, name)(rng, 1)
    body, ids = case.structure.replace(supports={}), list(case.structure.nodes)
    first, second = rng.choice(len(ids), 2, replace=False)
    size = 50 * 10 ** rng.uniform(-2, 1)
    if rng.random() < 0.5:
        force = rng.standard_normal(3) * size
    else:
        force = np.subtract(body.nodes[ids[first]], body.nodes[ids[second]]) * size * rng.choice([-1, 1])
    loads = {ids[first]: tuple(force), ids[second]: tuple(-force)}
    return body.replace(stages=[*body.stages, Stage("load", loads=loads)])


def check_loaded_body(seed):
    """Compare a body with itself elsewhere, in other units, with other steps: its word and its shape."""
    body = loaded_body(seed)
    seen = []
    for k, (first_step, largest_move) in enumerate(STEPS[:3]):
        there, length, _ = elsewhere(body, 7 * seed + k) if k else (body, 1.0, 1.0)
        control = PathSettings(first_step=first_step, largest_move=largest_move)
        path = solve_path(there, settings=control)
        nodes = path.final.nodes / length
        between = np.linalg.norm(nodes[:, None] - nodes[None], axis=-1)
        seen.append((str(path.status), between, [point.snap / length for point in path.critical_points]))
    words = {word for word, _, _ in seen}
    assert "failed" not in words
    if any(2e-5 < snap / 2.0 < 8e-4 for _, _, snaps in seen for snap in snaps):
        return  # a snap near the threshold: units and steps round it to either side
    assert len(words) == 1, words
    if words != {"collapsed"}:
        for _, between, _ in seen[1:]:
            np.testing.assert_allclose(between, seen[0][1], atol=1e-5)


@pytest.mark.parametrize("seed", range(12))
def test_a_loaded_body_is_the_same_anywhere(seed):
    check_loaded_body(seed)


@pytest.mark.slow
def test_five_hundred_loaded_bodies_are_the_same_anywhere():
    for seed in range(100, 600):
        check_loaded_body(seed)
