"""Bodies that the supports do not hold, or hold in part: rigid motions are no mechanisms.

A body under no load is the same whether it is held in space by six coordinates, by some of them or not at
all: no support carries anything, and K holds what six supports hold. Loads change that: they stiffen the
motions across them, or find nothing that balances them.
"""

import numpy as np
import pytest
import random_structures
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tensegra.mechanics import PathSettings, solve_batch, solve_path
from tensegra.structure import Material, Member, Stage, Structure, library

SAME_TENSION = 1e-10
"""Of the largest: both are polished to rounding, which the stiffest strut takes for force, 1e6 × 1e-16."""

UNLOADED = 1e-7
"""Of the largest tension: where a support carries more, it holds more than a rigid motion."""

SAME_PLACE = 1e-9
"""Of the size: positions to rounding, over a lowest eigenvalue a thousandth of the stiffness or more."""

CLOSED_FORM = 1e-9
"""Relative: what the residual of 1e-9 allows."""

DOUBTFUL = 4e-4
"""Of the size: a snap shorter than this is near the threshold, and its word is not compared."""

BODIES = {
    "ball": random_structures.ball,
    "kite": random_structures.kite,
    "kite near its equilibrium": lambda rng, n: random_structures.kite(rng, n, balanced=False),
    "d_bar": random_structures.d_bar,
}

plain = settings(
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],  # a smaller seed is no smaller body
    suppress_health_check=[HealthCheck.too_slow],
)


def coordinates_held(structure):
    return [(node, axis) for node, axes in structure.supports.items() for axis in axes]


def held_at(structure, coordinates):
    """Return the structure with these coordinates as its only supports."""
    supports = {}
    for node, axis in coordinates:
        supports[node] = supports.get(node, "") + axis
    return structure.replace(supports=supports)


def reactions(structure, equilibrium):
    """Return the force of the members on every held coordinate where nothing else acts."""
    ids = list(structure.nodes)
    force = np.zeros((len(ids), 3))
    for member, tension in zip(structure.members.values(), equilibrium.tensions, strict=True):
        for i, j in member.segments:
            span = equilibrium.node(j) - equilibrium.node(i)
            pull = tension * span / np.linalg.norm(span)
            force[ids.index(i)] += pull
            force[ids.index(j)] -= pull
    return np.array([force[ids.index(node), "xyz".index(axis)] for node, axis in coordinates_held(structure)])


def is_beyond_doubt(path):
    """Tell whether a path has no snap near the threshold, and its supports have held rigid motions alone."""
    size = np.ptp(path.structure.coordinates, axis=0).max()
    if any(0.0 < point.snap < DOUBTFUL * size for point in path.critical_points):
        return False
    largest = max(np.abs(end.tensions).max() for end in (*path.stages, path.final))
    return np.abs(reactions(path.structure, path.final)).max() <= UNLOADED * largest


def fitted(nodes, reference):
    """Return `nodes` turned and shifted to lie as near to `reference` as they can, by least squares."""
    centre, other = nodes.mean(axis=0), reference.mean(axis=0)
    turn, _ = Rotation.align_vectors(reference - other, nodes - centre)
    return (nodes - centre) @ turn.as_matrix().T + other


@pytest.mark.parametrize("body", BODIES)
@settings(plain, max_examples=12)
@example(seed=0, held=0)
@example(seed=1, held=63)
@example(seed=2, held=1)
@given(seed=st.integers(0, 2**32 - 1), held=st.integers(0, 63))
def test_tensions_and_word_are_those_of_the_held_body(body, seed, held):
    check_body(BODIES[body](np.random.default_rng(seed), 2), held)


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_a_thousand_bodies(body):
    n_checked = sum(
        check_body(BODIES[body](np.random.default_rng(seed), 4), seed % 64) for seed in range(250)
    )
    assert n_checked > 500


def check_body(case, held):
    """Compare every run of a body held at some of its six coordinates; return how many were compared."""
    six = coordinates_held(case.structure)
    assert len(six) == 6
    freed = held_at(case.structure, [at for bit, at in enumerate(six) if held >> bit & 1])
    runs = solve_batch(freed, **case.batch(slice(None)), threads=1)
    n_checked = 0
    for run in range(case.n_runs):
        expected = solve_path(case.structure, **case.inputs(run))
        if not is_beyond_doubt(expected):
            continue
        n_checked += 1
        found = solve_path(freed, **case.inputs(run))
        assert [str(s.status) for s in found.stages] == [str(s.status) for s in expected.stages], found.reason
        assert str(found.status) == str(expected.status), found.reason
        assert str(runs.status[run]) == str(expected.status), runs.reason[run]
        if not expected.final.succeeded:
            continue
        largest = np.abs(expected.final.tensions).max()
        for tensions in (found.final.tensions, runs.tensions[run]):
            np.testing.assert_allclose(
                tensions, expected.final.tensions, rtol=0.0, atol=SAME_TENSION * largest
            )
        # Every eigenvalue but those of the rigid motions is that of a body that stands.
        assert found.final.lowest_eigenvalue > 0.0
        assert runs.lowest_eigenvalue[run] == pytest.approx(found.final.lowest_eigenvalue, rel=1e-6)
    return n_checked


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("seed", range(3))
def test_the_displacements_of_a_body_free_in_space_are_in_the_frame_of_least_squares(body, seed):
    case = BODIES[body](np.random.default_rng(seed), 1)
    inputs = case.inputs(0)
    held, free = solve_path(case.structure, **inputs), solve_path(held_at(case.structure, []), **inputs)
    assert str(held.final.status) == "stable"
    runs = solve_batch(held_at(case.structure, []), **case.batch(slice(None)))
    expected = fitted(held.final.nodes, free.stages[-1].nodes) - free.stages[-1].nodes
    tolerance = SAME_PLACE * case.size
    np.testing.assert_allclose(free.displacements, expected, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(runs.displacements[0], free.displacements, rtol=0.0, atol=tolerance)
    assert np.abs(expected).max() > 1e-3 * case.size  # it moves at all


RIGID_MOTIONS = {f"{kind} {axis}" for kind, axis in [("translation along", a) for a in "xyz"]} | {
    f"rotation about {axis}" for axis in "xyz"
}


def test_the_rigid_motions_that_the_supports_leave_are_named():
    kite = random_structures.kite(np.random.default_rng(0), 1).structure
    motions = {
        name: solve_path(kite.replace(supports=supports))
        for name, supports in {
            "": {"a": "xyz", "c": "yz", "b": "z"},
            "rotation about x": {"a": "xyz", "c": "yz"},
            "translation along z": {"a": "xy", "c": "y"},
        }.items()
    }
    assert {str(path.status) for path in motions.values()} == {"stable"}
    assert motions[""].to_dict()["rigid_motions"] == []
    assert motions["rotation about x"].to_dict()["rigid_motions"] == ["rotation about x"]
    # Held in x and y along a line, it may also turn about that line and tilt about y.
    assert "translation along z" in motions["translation along z"].to_dict()["rigid_motions"]
    free = solve_path(held_at(kite, []))
    assert set(free.to_dict()["rigid_motions"]) == RIGID_MOTIONS
    assert str(free.status) == "stable"


@pytest.mark.parametrize("n_struts", [3, 4, 5, 6])
@pytest.mark.parametrize("prestress", [500.0, 1000.0, 3000.0])
def test_a_prism_that_floats_stands(n_struts, prestress):
    prism = library.prism(n_struts, prestress=prestress)
    held, free = solve_path(prism), solve_path(prism.replace(supports={}))
    assert str(free.status) == str(held.status) == "stable"
    largest = np.abs(held.final.tensions).max()
    np.testing.assert_allclose(
        free.final.tensions, held.final.tensions, rtol=0.0, atol=SAME_TENSION * largest
    )


def test_a_prism_that_topples_topples_also_where_it_floats():
    high = library.prism(4, height=2.0, clustered=True)
    assert str(solve_path(high).status) == "unstable"
    assert str(solve_path(high.replace(supports={})).status) == "unstable"


def test_two_bodies_in_one_structure_are_each_free():
    # Apart from each other, each with a support of its own: a part without one is refused by the format.
    given, shift = library.prism(3), (5.0, 0.0, 0.0)
    nodes = {f"{name}'": tuple(np.add(at, shift)) for name, at in given.nodes.items()}
    members = {
        f"{name}'": Member(
            m.kind,
            tuple(f"{node}'" for node in m.nodes),
            m.rest_length,
            stiffness=given.axial_stiffness(name),
        )
        for name, m in given.members.items()
    }
    first = next(iter(given.nodes))
    hung = {first: "xyz", f"{first}'": "xyz"}
    for supports in (hung, {first: "x", f"{first}'": "xyz"}, {first: "z", f"{first}'": "y"}):
        structure = given.replace(
            nodes={**given.nodes, **nodes}, members={**given.members, **members}, supports=supports
        )
        path = solve_path(structure)
        assert str(path.status) == "stable", path.reason
        one = solve_path(given).final.tensions
        np.testing.assert_allclose(
            path.final.tensions, [*one, *one], rtol=0.0, atol=SAME_TENSION * np.abs(one).max()
        )


# Loads on bodies that can move.

WEIGHTS = (7.0, 3.0)
LENGTHS = (1.5, 0.8)
EA = 1e4


def pendulum(n_rods, angle, *, kind="strut"):
    """Hang one rod or two, end to end, at an angle to the vertical; the load comes with the first stage."""
    direction = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    nodes, members, at = {"0": (0.0, 0.0, 0.0)}, {}, np.zeros(3)
    for i in range(n_rods):
        at = at + LENGTHS[i] * direction
        nodes[str(i + 1)] = tuple(at)
        members[f"rod{i}"] = Member(kind, (str(i), str(i + 1)), LENGTHS[i], stiffness=EA)
    loads = {str(i + 1): (0.0, 0.0, -WEIGHTS[i]) for i in range(n_rods)}
    return Structure(
        name="pendulum",
        nodes=nodes,
        members=members,
        supports={"0": "xyz"},
        stages=[Stage("hang", loads=loads)],
    )


def hanging(n_rods):
    """Return tensions, lengths and the lowest eigenvalue of K, which swings it sideways."""
    tension = np.cumsum(WEIGHTS[:n_rods][::-1])[::-1]
    length = np.array(LENGTHS[:n_rods]) * (1.0 + tension / EA)
    sideways = np.zeros((n_rods, n_rods))
    for i, stiffness in enumerate(tension / length):
        sideways[i, i] += stiffness
        if i:
            sideways[i - 1, i - 1] += stiffness
            sideways[i - 1, i] -= stiffness
            sideways[i, i - 1] -= stiffness
    return tension, length, np.linalg.eigvalsh(sideways)[0]


@pytest.mark.parametrize("n_rods", [1, 2])
@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.3, 1.2, 2.5])
def test_a_pendulum_hangs_with_the_stiffness_of_its_load(n_rods, angle):
    structure = pendulum(n_rods, angle)
    path, runs = solve_path(structure), solve_batch(structure, loads={("1", "z"): [0.0, 0.0]})
    tension, length, lowest = hanging(n_rods)
    assert str(path.status) == "stable", path.reason
    assert [str(status) for status in runs.status] == ["stable", "stable"]
    for tensions, nodes, value in (
        (path.final.tensions, path.final.nodes, path.final.lowest_eigenvalue),
        (runs.tensions[1], runs.nodes[1], runs.lowest_eigenvalue[1]),
    ):
        np.testing.assert_allclose(tensions, tension, rtol=CLOSED_FORM)
        np.testing.assert_allclose(nodes[1:, 2], -np.cumsum(length), rtol=CLOSED_FORM)
        # Sideways the residual over the stiffness is a distance: 1e-9 W over W/ℓ.
        np.testing.assert_allclose(nodes[:, :2], 0.0, atol=2 * CLOSED_FORM * sum(LENGTHS))
        assert value == pytest.approx(lowest, rel=10 * CLOSED_FORM)


def test_a_pendulum_follows_its_load_to_the_side():
    # What acts after the stage turns the load by 45 degrees: it swings along with it, without a leap.
    structure = pendulum(1, 0.0)
    path = solve_path(structure, loads={("1", "x"): WEIGHTS[0]})
    assert str(path.status) == "stable", path.reason
    tension = np.sqrt(2.0) * WEIGHTS[0]
    length = LENGTHS[0] * (1.0 + tension / EA)
    assert path.final.tension("rod0") == pytest.approx(tension, rel=CLOSED_FORM)
    np.testing.assert_allclose(
        path.final.node("1"),
        length / np.sqrt(2.0) * np.array([1.0, 0.0, -1.0]),
        atol=2 * CLOSED_FORM * length,
    )
    assert path.final.lowest_eigenvalue == pytest.approx(tension / length, rel=10 * CLOSED_FORM)


def slider():
    """Return a ball that slides along z and is held otherwise."""
    ball = random_structures.ball(np.random.default_rng(0), 1).structure
    return ball.replace(supports={"z++": "xy", "z+-": "xy", "z-+": "y"})


@pytest.mark.parametrize("when", ["in a stage", "after the stages", "as gravity"])
def test_a_force_along_a_translation_that_nothing_holds_fails_by_that_name(when):
    structure = slider()
    if when == "in a stage":
        structure = structure.replace(
            stages=(*structure.stages, Stage("push", loads={"x++": (0.0, 0.0, -1.0)}))
        )
        path, runs = (
            solve_path(structure),
            solve_batch(structure, actuation={_an_actuator(structure): [0.01]}),
        )
    elif when == "after the stages":
        path = solve_path(structure, loads={("x++", "z"): -1.0})
        runs = solve_batch(structure, loads={("x++", "z"): [-1.0, -2.0]})
    else:
        structure = heavy(structure)
        path = solve_path(structure)
        runs = solve_batch(structure, actuation={_an_actuator(structure): [0.01]})
    assert str(path.status) == "failed"
    assert "translation along z" in path.reason
    assert np.all(np.isnan(path.final.nodes))
    assert {str(status) for status in runs.status} == {"failed"}
    assert all("translation along z" in reason for reason in runs.reason)


def _an_actuator(structure):
    return next(iter(structure.actuators))


def heavy(structure):
    """Give every strut a weight."""
    members = {
        name: member
        if member.is_cable
        else Member("strut", member.nodes, member.rest_length, material="steel", area=1.0)
        for name, member in structure.members.items()
    }
    materials = {"steel": Material(youngs_modulus=1e6, weight=0.1)}
    return structure.replace(members=members, materials=materials, gravity=(0.0, 0.0, -1.0))


def test_forces_that_cancel_along_a_translation_are_carried():
    structure = slider()
    held = structure.replace(supports={**structure.supports, "z++": "xyz"})
    loads = {("x++", "z"): -5.0, ("x+-", "z"): 3.0, ("z++", "z"): 2.0}
    free, expected = solve_path(structure, loads=loads), solve_path(held, loads=loads)
    assert str(free.status) == str(expected.status) == "stable", free.reason
    largest = np.abs(expected.final.tensions).max()
    np.testing.assert_allclose(
        free.final.tensions, expected.final.tensions, rtol=0.0, atol=SAME_TENSION * largest
    )


def test_a_force_on_a_body_free_in_space_fails_by_the_name_of_a_translation():
    ball = random_structures.ball(np.random.default_rng(0), 1).structure.replace(supports={})
    path = solve_path(ball, loads={("x++", "y"): 1.0})
    assert str(path.status) == "failed"
    assert "translation along y" in path.reason


def test_loads_along_the_axis_of_a_free_rotation_leave_it_free():
    # ω × p = 0: such loads neither turn the body nor hold it. The one along the axis goes into the support.
    kite = random_structures.kite(np.random.default_rng(0), 1).structure
    loads = {("b", "x"): 20.0, ("d", "x"): -5.0}
    free, held = (
        solve_path(kite.replace(supports=supports), loads=loads)
        for supports in ({"a": "xyz", "c": "yz"}, {"a": "xyz", "c": "yz", "b": "z"})
    )
    assert str(held.status) == str(free.status) == "stable", free.reason
    largest = np.abs(held.final.tensions).max()
    np.testing.assert_allclose(
        free.final.tensions, held.final.tensions, rtol=0.0, atol=SAME_TENSION * largest
    )


def test_a_moment_about_a_free_axis_is_never_called_balanced():
    # Dead loads turn the body until their lines meet the axis: there it hangs. Found or not, either is an
    # honest answer; a body that stands askew in its load is not.
    kite = random_structures.kite(np.random.default_rng(0), 1).structure
    free = kite.replace(supports={"a": "xyz", "c": "yz"})
    path = solve_path(free, loads={("b", "z"): -20.0})
    if str(path.status) == "failed":
        assert "rotation about x" in path.reason
    else:
        assert path.final.succeeded
        hung = path.final.node("b")
        assert hung[1] == pytest.approx(0.0, abs=1e-6)
        assert hung[2] < -0.9


# Far from the origin.

FAR = (1e5, 1e7)
"""Sizes of a structure away from the origin."""

FAR_TENSION = 1e-8
"""Of the largest: coordinates are rounded alike here and there, so that only the arithmetic differs."""

LIBRARY = {
    "paper_beam": library.paper_beam,
    "prism": library.prism,
    "clustered prism": lambda: library.prism(3, clustered=True),
    "d_bar": library.d_bar,
    "levy_dome": library.levy_dome,
    "tower": library.tower,
    "grid": lambda: library.grid(5, 5),
    "hanging_chain": library.hanging_chain,
    "gripper": library.gripper,
    "von_mises_truss": library.von_mises_truss,
}


def shifted(structure, sizes):
    """Return the structure as given but rounded, and the same one that many of its sizes away.

    Coordinates are rounded to what a number has digits for out there: both have the same shape exactly.
    """
    shift = sizes * np.ptp(structure.coordinates, axis=0).max()
    grain = np.spacing(2.0 * shift)
    away = np.round(shift * np.array([1.0, -0.7, 0.4]) / grain) * grain

    def moved(by):
        nodes = np.round(structure.coordinates / grain) * grain + by
        return structure.replace(nodes=dict(zip(structure.nodes, map(tuple, nodes.tolist()), strict=True)))

    return moved(np.zeros(3)), moved(away), away, grain


@pytest.mark.parametrize("sizes", FAR)
@pytest.mark.parametrize("name", LIBRARY)
def test_far_from_the_origin_nothing_is_different(name, sizes):
    here, there, away, grain = shifted(LIBRARY[name](), sizes)
    np.testing.assert_array_equal(there.coordinates - away, here.coordinates)
    actuation = {next(iter(here.actuators)): 0.01} if here.actuators else {}
    near, far = solve_path(here, actuation), solve_path(there, actuation)
    assert [str(s.status) for s in far.stages] == [str(s.status) for s in near.stages], far.reason
    assert str(far.status) == str(near.status), far.reason
    size = np.ptp(here.coordinates, axis=0).max()
    largest = np.abs(near.final.tensions).max()
    np.testing.assert_allclose(far.final.tensions, near.final.tensions, rtol=0.0, atol=FAR_TENSION * largest)
    np.testing.assert_allclose(
        far.final.nodes - away, near.final.nodes, rtol=0.0, atol=2 * grain + FAR_TENSION * size
    )
    if actuation:
        runs = solve_batch(there, actuation={name: [value] for name, value in actuation.items()})
        assert str(runs.status[0]) == str(near.status), runs.reason[0]
        np.testing.assert_allclose(
            runs.tensions[0], near.final.tensions, rtol=0.0, atol=FAR_TENSION * largest
        )


def test_far_from_the_origin_a_free_body_is_no_different_either():
    case = random_structures.ball(np.random.default_rng(0), 1)
    here, there, _, _ = shifted(held_at(case.structure, []), 1e7)
    near, far = solve_path(here, **case.inputs(0)), solve_path(there, **case.inputs(0))
    assert str(far.status) == str(near.status) == "stable", far.reason
    largest = np.abs(near.final.tensions).max()
    np.testing.assert_allclose(far.final.tensions, near.final.tensions, rtol=0.0, atol=FAR_TENSION * largest)


@pytest.mark.parametrize("supports", [{}, {1: "xy", 2: "y"}, {1: "x", 3: "y"}, {1: "yz"}, {1: "z"}], ids=str)
@pytest.mark.parametrize("first_step", [0.5, 0.03])
def test_nothing_lies_below_the_lowest_eigenvalue_of_a_free_square(supports, first_step):
    # Two struts crossed in a square of cables: the softest mode folds it, far below the next ones.
    ring = {"a": (1, 2), "b": (2, 3), "c": (3, 4), "d": (4, 1)}
    square = Structure(
        name="square",
        nodes={1: (0, 0, 0), 2: (1, 0, 0), 3: (1, 1, 0), 4: (0, 1, 0)},
        members={
            **{name: Member("cable", ends, 0.95, stiffness=1e3) for name, ends in ring.items()},
            "s": Member("strut", (1, 3), float(np.sqrt(2.0)), stiffness=1e5),
            "t": Member("strut", (2, 4), float(np.sqrt(2.0)), stiffness=1e5),
        },
        supports=supports,
    )
    found = solve_path(square, settings=PathSettings(first_step=first_step)).final
    assert str(found.status) == "stable"
    # The whole square has 207.59 on the complement of its six motions, by the dense spectrum of K.
    free = solve_path(square.replace(supports={})).final.lowest_eigenvalue
    assert free == pytest.approx(207.5905, rel=1e-5)
    if supports == {} or set(supports) == {1, 2}:
        assert found.lowest_eigenvalue == pytest.approx(207.5905, rel=1e-5)
