"""Inputs that once drew a wrong word or a wrong number, each with its right value.

Right values are closed forms, or come from a walk in steps too small to leap (`continuation.py`).
"""

import re
from collections import Counter
from dataclasses import fields
from itertools import product

import numpy as np
import pandas as pd
import pytest
from continuation import Model, Walker
from typer.testing import CliRunner

import tensegra as tg
from tensegra.cli import app
from tensegra.errors import TensegraError
from tensegra.mechanics import PathSettings, solve_batch, solve_path
from tensegra.mechanics.vibration import natural_frequencies
from tensegra.structure import Actuator, Material, Member, Stage, Structure, library

CLOSED_FORM = 1e-9
"""Relative: what the residual of 1e-9 allows."""

EIGENVALUE = 1e-6
"""Relative: a certificate, not a measurement; the values it is compared with lie much farther apart."""

LOCATION = 1e-5
"""Of the way: the follower locates the end of a branch to 1e-6."""

SAME = 1e-8
"""Of the size or of the largest tension: one equilibrium found twice."""


def strut(first, second, rest_length, stiffness):
    return Member("strut", (first, second), rest_length, stiffness=stiffness)


def cable(path, rest_length, stiffness):
    return Member("cable", tuple(path), rest_length, stiffness=stiffness)


# A step that leaves its branch.


def test_a_beam_that_leaps_is_never_called_stable():
    # The tip leaps by 22 cm from a fold at 94.6 % of this way: some ends lie before it.
    base = {"A14": 0.34, "A23": 0.35, "A1": 0.04, "A4": 0.21, "A2": 0.26, "A3": 0.13}
    beam, shares = library.paper_beam(), np.linspace(0.92, 1.0, 9)
    actuation = {name: value * shares for name, value in base.items()}
    walk = Walker(beam, base).walk(solve_path(beam).final.nodes)
    expected = ["stable" if share < walk.leaps[0] else "snapped" for share in shares]
    assert len(set(expected)) == 2
    runs = solve_batch(beam, actuation=actuation, threads=1)
    assert [str(status) for status in runs.status] == expected
    alone = [solve_path(beam, {n: float(v[i]) for n, v in actuation.items()}) for i in range(len(shares))]
    assert [str(path.status) for path in alone] == expected
    for path, nodes in zip(alone, runs.nodes, strict=True):
        size = np.ptp(beam.coordinates, axis=0).max()
        np.testing.assert_allclose(nodes, path.final.nodes, rtol=0.0, atol=SAME * size)


def test_the_same_way_in_one_run_and_in_twenty():
    base = {"A14": 0.34, "A23": 0.35, "A1": 0.04, "A4": 0.21, "A2": 0.26, "A3": 0.13}
    shares = np.round(np.linspace(0.95, 1.05, 21), 3)
    actuation = {name: np.round(value * shares, 4) for name, value in base.items()}
    runs = solve_batch(library.paper_beam(), actuation=actuation, threads=1)
    differ = []
    for i, share in enumerate(shares):
        path = solve_path(library.paper_beam(), {name: float(v[i]) for name, v in actuation.items()})
        if str(path.status) != str(runs.status[i]):
            differ.append((share, str(path.status), str(runs.status[i]), path.reason))
    assert differ == []


def leaping_frame():
    """Return a frame of four struts and two cables; on its way both are slack until it has leapt."""
    h, length = 0.5473, 1.14
    return Structure(
        name="frame",
        nodes={"a": (-1, 0, 0), "b": (1, 0, 0), "c": (0, 0, h), "d": (0, 0, -h)},
        members={
            "s1": strut("a", "c", length, 10875.0),
            "s2": strut("c", "b", length, 5620.0),
            "s3": strut("b", "d", length, 2867.0),
            "s4": strut("d", "a", length, 76462.0),
            "h": cable("ab", 1.96027, 361.0),
            "v": cable("cd", 1.08813, 194.0),
        },
        supports={"a": "xyz", "b": "yz", "c": "y", "d": "y"},
        stages=[Stage("load", loads={"b": (0.426, 0, 0), "d": (0.204, 0, 0.212)})],
        actuators={"A": Actuator(("h",), "shorten"), "B": Actuator(("v",), "lengthen")},
    )


LEAP_AT, LEAP = 0.4796, 0.0204
"""Of the way, and a length: both found in steps of 1e-6 to 1e-8, and told to their last digit."""


def frame_inputs(shares):
    return (
        {"A": 0.00168865 * shares, "B": 0.215394 * shares},
        {("c", "x"): -2.94358 * shares},
    )


def test_a_walk_in_small_steps_leaps_where_the_frame_does():
    frame = leaping_frame()
    walk = Walker(frame, *frame_inputs(1.0)).walk(solve_path(frame).final.nodes)
    assert walk.leaps == [pytest.approx(LEAP_AT, abs=5e-5)]


@pytest.mark.parametrize(
    "control",
    [PathSettings(), PathSettings(first_step=0.01, largest_move=0.01), PathSettings(first_step=0.5)],
    ids=["default", "small steps", "large steps"],
)
def test_a_frame_that_leaps_while_its_cables_are_slack_has_snapped_at_every_end_beyond(control):
    frame = leaping_frame()
    shares = np.linspace(0.5, 1.0, 101)
    actuation, loads = frame_inputs(shares)
    runs = solve_batch(frame, actuation=actuation, loads=loads, threads=1, settings=control)
    assert Counter(map(str, runs.status)) == {"snapped": 101}
    paths = []
    for share in shares:
        actuation, loads = frame_inputs(float(share))
        paths.append(solve_path(frame, actuation, loads=loads, settings=control))
    assert Counter(str(path.status) for path in paths) == {"snapped": 101}
    for share, path in zip(shares, paths, strict=True):
        (point,) = path.critical_points
        assert share * point.parameter == pytest.approx(LEAP_AT, abs=5e-5)
        assert point.snap == pytest.approx(LEAP, abs=5e-5)


@pytest.mark.parametrize("height", [1e-3, 3e-3])
def test_a_leap_too_short_for_a_snap_is_listed_with_its_size(height):
    # A shallow truss beside a post far away: the leap of √3 times its height is nothing to the whole.
    rest_length = float(np.hypot(1.0, height))
    truss = Structure(
        name="shallow truss",
        nodes={"l": (-1, 0, 0), "r": (1, 0, 0), "t": (0, 0, height), "far": (200, 0, 0)},
        members={
            "a": strut("l", "t", rest_length, 1e6),
            "b": strut("t", "r", rest_length, 1e6),
            "c": cable(("r", "far"), 199.0, 1.0),
        },
        supports={"l": "xyz", "r": "xyz", "t": "xy", "far": "xyz"},
    )
    limit = 2e6 * (height / np.sqrt(3.0)) * (height**2 - height**2 / 3.0) / 2.0
    path = solve_path(truss, loads={("t", "z"): -1.5 * limit})
    runs = solve_batch(truss, loads={("t", "z"): [-0.5 * limit, -1.5 * limit]})
    assert str(path.status) == "stable"
    assert [str(status) for status in runs.status] == ["stable", "stable"]
    (point,) = path.critical_points
    # The load of a shallow truss is EA (h² − z²) z/a³ to the square of its slope, 1e-5.
    assert point.parameter == pytest.approx(1.0 / 1.5, rel=1e-4)
    # The landing under the limit load lies at −2 h/√3; near the fold the root of the location counts.
    assert point.snap == pytest.approx(np.sqrt(3.0) * height, rel=5e-3)
    assert path.final.node("t")[2] < -height


# Certificates.


def posts():
    """Return four posts apart from each other, each held by two stays of its own tension."""
    nodes, members, supports, actuators = {}, {}, {}, {}
    for i, tension in enumerate((10.0, 20.0, 30.0, 40.0)):
        nodes |= {
            f"a{i}": (-1.0, 10.0 * i, 0.0),
            f"b{i}": (0.0, 10.0 * i, 0.0),
            f"c{i}": (1.0, 10.0 * i, 0.0),
        }
        supports |= {f"a{i}": "xyz", f"c{i}": "xyz"}
        members |= {
            f"p{i}": cable((f"a{i}", f"b{i}"), 1.0 / (1.0 + tension / 1e3), 1e3),
            f"q{i}": cable((f"b{i}", f"c{i}"), 1.0 / (1.0 + tension / 1e3), 1e3),
        }
        actuators[f"A{i}"] = Actuator((f"p{i}", f"q{i}"), "lengthen")
    return Structure(name="posts", nodes=nodes, members=members, supports=supports, actuators=actuators)


@pytest.mark.parametrize("slackened", range(4))
def test_the_lowest_eigenvalue_of_posts_is_that_of_the_slackest(slackened):
    prestress = np.array([10.0, 20.0, 30.0, 40.0])
    full = prestress[slackened] / 1e3  # the lengthening that takes all of its tension
    values = full * np.array([0.0, 0.4, 0.75, 0.9, 0.99, 0.9975])
    runs = solve_batch(posts(), actuation={f"A{slackened}": values}, threads=1)
    assert {str(status) for status in runs.status} == {"stable"}
    for value, found in zip(values, runs.lowest_eigenvalue, strict=True):
        tension = prestress.copy()
        tension[slackened] = 1e3 * ((1.0 + full) / (1.0 + value) - 1.0)
        expected = 2.0 * tension.min()  # 2 T/ℓ, with ℓ = 1
        assert found == pytest.approx(expected, rel=EIGENVALUE)
        alone = solve_path(posts(), {f"A{slackened}": float(value)}).final.lowest_eigenvalue
        assert alone == pytest.approx(expected, rel=EIGENVALUE)


@pytest.mark.parametrize("n_pulleys", [1, 2, 22, 23, 24, 25, 30, 48])
def test_a_weight_on_a_cable_over_many_held_pulleys(n_pulleys):
    stiffness, weight = 1e4, 10.0
    nodes = {"F": (0.0, 0.0, -1.0), **{f"p{i}": (float(i), 0.0, 0.0) for i in range(n_pulleys)}}
    structure = Structure(
        name="weight on a long cable",
        nodes=nodes,
        members={"K": cable(nodes, float(n_pulleys), stiffness)},
        supports={f"p{i}": "xyz" for i in range(n_pulleys)},
        stages=[Stage("load", loads={"F": (0.0, 0.0, -weight)})],
    )
    path = solve_path(structure)
    assert str(path.status) == "stable", path.reason
    assert path.final.tension("K") == pytest.approx(weight, rel=CLOSED_FORM)
    hanging = 1.0 + weight * n_pulleys / stiffness
    np.testing.assert_allclose(path.final.node("F"), [0.0, 0.0, -hanging], atol=10 * CLOSED_FORM)
    # Along the cable k = EA/l₀, across it the pendulum's T/ℓ.
    along, across = stiffness / n_pulleys, weight / hanging
    assert path.final.lowest_eigenvalue == pytest.approx(min(along, across), rel=EIGENVALUE)
    by_load = path.derivative(("F", "z"), of="load")
    np.testing.assert_allclose(by_load.nodes[0], [0.0, 0.0, 1.0 / along], atol=EIGENVALUE / along)
    runs = solve_batch(structure, loads={("F", "z"): [0.0, -weight]}, threads=1)
    assert [str(status) for status in runs.status] == ["stable", "stable"]
    np.testing.assert_allclose(runs.tensions[:, 0], [weight, 2.0 * weight], rtol=CLOSED_FORM)
    assert runs.lowest_eigenvalue[0] == pytest.approx(min(along, across), rel=EIGENVALUE)


@pytest.mark.parametrize(
    "n",
    [8, pytest.param(24, marks=pytest.mark.slow), pytest.param(40, marks=pytest.mark.slow)],
)
def test_the_lowest_eigenvalue_of_a_clustered_grid_under_one_load(n):
    grid = library.grid(n, n, clustered=True)
    node = f"{n // 2}_{n // 2}"
    node = node if node in grid.nodes else list(grid.nodes)[len(grid.nodes) // 2]
    path = solve_path(grid, loads={(node, "z"): -100.0})
    assert str(path.status) == "stable", path.reason
    model = Model(grid)
    rest_length, _ = model.inputs_after_stages(grid)
    expected = model.lowest_eigenvalue(path.final.nodes, rest_length)
    assert path.final.lowest_eigenvalue == pytest.approx(expected, rel=1e-4)
    assert path.final.lowest_eigenvalue <= expected * (1.0 + EIGENVALUE)  # nothing lies below a certificate


def test_a_collapse_names_what_is_free():
    # A rope drawn at its rest length between two hooks carries nothing: its knot is free to move.
    path = solve_path(rope().replace(stages=()))
    assert str(path.status) == "collapsed"
    assert path.final.mechanisms
    assert "b" in path.reason
    assert "0 free mechanisms" not in path.reason


# Masses.


@pytest.mark.parametrize("length", [0.5, 1.0, 20.0])
@pytest.mark.parametrize("kind", ["strut", "cable"])
def test_a_uniform_rod_hung_from_its_end_swings_as_a_rod(length, kind):
    modulus, weight = 210e9, 78.5e3
    rod = Structure(
        name="rod",
        nodes={"1": (0, 0, 0), "2": (0, 0, -length)},
        materials={"steel": Material(youngs_modulus=modulus, weight=weight)},
        members={"rod": Member(kind, ("1", "2"), length, material="steel", area=1e-4)},
        supports={"1": "xyz"},
        gravity=(0, 0, -1),
    )
    path = solve_path(rod)
    assert str(path.status) == "stable", path.reason
    vibration = natural_frequencies(path, 3)
    gravity = 9.80665
    swing = np.sqrt(1.5 * gravity / length) / (2.0 * np.pi)
    # The rod hangs longer by its own weight, w L/2 E, 2e-7 of 1 m.
    np.testing.assert_allclose(vibration.frequencies[:2], swing, rtol=2.0 * weight * length / modulus)
    # Along its axis one linear element has K = EA/ℓ and m/3 at its end.
    mass = weight * 1e-4 * length / gravity
    stretch = np.sqrt(modulus * 1e-4 / length / (mass / 3.0)) / (2.0 * np.pi)
    assert vibration.frequencies[2] == pytest.approx(stretch, rel=1e-4)


# One meaning of one quantity.


def hung_rope():
    """Return a rope in three parts with two weights, all of them in one group."""
    nodes = {"a": (0, 0, 0), "b": (2, 0, 0), "c": (0.6, 0, -0.5), "d": (1.4, 0, -0.5)}
    lengths = {"k": ("a", "c"), "l": ("c", "d"), "q": ("d", "b")}
    return Structure(
        name="rope",
        nodes=nodes,
        materials={"m": Material(youngs_modulus=1e4, weight=1.0)},
        members={
            name: Member(
                "cable",
                path,
                float(np.linalg.norm(np.subtract(nodes[path[0]], nodes[path[1]]))),
                material="m",
                area=0.1,
                groups=("g",),
            )
            for name, path in lengths.items()
        },
        supports={"a": "xyz", "b": "xyz"},
        stages=[Stage("load", loads={"c": (0, 0, -5), "d": (0, 0, -5)})],
    )


def outcome_of(asked):
    """Return what is found, or the error with which it is refused."""
    try:
        return asked()
    except TensegraError as error:
        return error


def names_both(error, *names):
    """Tell whether a message names these as words."""
    return all(re.search(rf"\b{name}\b", str(error)) for name in names)


def test_overlapping_areas_mean_one_thing_or_are_refused_by_both_names():
    area = {"g": np.full(3, 0.2), "k": np.full(3, 0.3)}
    ways = ({}, {"path": "stepped"}, {"policy": "trace"}, {"settings": PathSettings(first_step=0.1)})
    found = [
        outcome_of(lambda way=way: solve_batch(hung_rope(), area=area, threads=1, **way)) for way in ways
    ]
    if any(isinstance(outcome, TensegraError) for outcome in found):
        assert all(isinstance(outcome, TensegraError) and names_both(outcome, "g", "k") for outcome in found)
        return
    members = hung_rope().members
    meant = {
        name: Member("cable", m.nodes, m.rest_length, material="m", area=0.3 if name == "k" else 0.2)
        for name, m in members.items()
    }
    expected = solve_path(hung_rope().replace(members=meant)).final
    for runs in found:
        np.testing.assert_allclose(runs.nodes[1], expected.nodes, rtol=0.0, atol=SAME * 2.0)


def test_a_study_of_overlapping_areas_is_refused_when_it_is_read_or_means_one_thing(tmp_path):
    tg.write_structure(hung_rope(), tmp_path / "rope.yaml")
    content = {
        "schema": "tensegra/study/1",
        "structure": str(tmp_path / "rope.yaml"),
        "seed": 1,
        "variables": {
            "Ag": {"area": "g", "distribution": {"uniform": [0.19, 0.21]}},
            "Ak": {"area": "k", "distribution": {"uniform": [0.29, 0.31]}},
        },
        "outputs": {"z": {"displacement": "z", "nodes": ["c"]}, "T": {"tension": "k"}},
        "design": {"sampler": "sobol", "sizes": 8},
    }
    study = outcome_of(lambda: tg.parse_study(content))
    if isinstance(study, TensegraError):
        assert names_both(study, "Ag", "Ak")
        return
    one = study.evaluate([[0.2, 0.3]])
    many = study.evaluate([[0.2, 0.3]] * 16)
    stepped = tg.parse_study({**content, "solver": {"path": "stepped"}}).evaluate([[0.2, 0.3]])
    np.testing.assert_allclose(many.Y, np.repeat(one.Y, 16, axis=0), rtol=SAME)
    np.testing.assert_allclose(stepped.Y, one.Y, rtol=1e-6)


# Structures that carry nothing.


def unloaded_trusses():
    """Return two trusses one above the other with a cable between their tops that soon goes slack."""
    first, second = 0.2647, 0.384
    long, short = float(np.hypot(1.0, first)), float(np.hypot(1.0, second))
    return Structure(
        name="unloaded trusses",
        nodes={
            "l0": (-1, 0, 0),
            "r0": (1, 0, 0),
            "t0": (0, 0, first),
            "l1": (-1, 0, 2),
            "r1": (1, 0, 2),
            "t1": (0, 0, 2.0 + second),
        },
        members={
            "a0": strut("l0", "t0", long, 500.87),
            "b0": strut("t0", "r0", 1.003 * long, 500.87),
            "a1": strut("l1", "t1", short, 170.8),
            "b1": strut("t1", "r1", short, 170.8),
            "c1": cable(("t0", "t1"), 2.092, 143.44),
        },
        supports={"l0": "xyz", "r0": "xyz", "t0": "y", "l1": "xyz", "r1": "xyz", "t1": "y"},
        actuators={"B": Actuator(("a0",), "lengthen"), "C": Actuator(("b0",), "lengthen")},
        stages=[Stage("drawn")],
    )


def where_arcs_meet(left, right):
    """Return the top of two struts of these lengths over a span of two."""
    x = (left**2 - right**2) / 4.0
    return np.array([x, 0.0, np.sqrt(left**2 - (1.0 + x) ** 2)])


@pytest.mark.parametrize("path", ["stepped", "adaptive"])
def test_trusses_that_carry_nothing_stand(path):
    trusses = unloaded_trusses()
    values = np.linspace(0.15, 0.35, 11)
    rest_length = {name: member.rest_length for name, member in trusses.members.items()}
    tops = [where_arcs_meet((1.0 + value) * rest_length["a0"], rest_length["b0"]) for value in values]
    upper = np.add(where_arcs_meet(rest_length["a1"], rest_length["b1"]), (0.0, 0.0, 2.0))
    assert all(np.linalg.norm(upper - top) < rest_length["c1"] for top in tops)  # the cable is slack
    runs = solve_batch(trusses, actuation={"B": values}, path=path, threads=1)
    assert Counter(map(str, runs.status)) == {"stable": len(values)}
    # A residual of 1e-9 relative to nothing is one of EA: rounding of the coordinates.
    np.testing.assert_allclose(runs.tensions, 0.0, atol=1e-9 * 500.0)
    assert np.all(runs.lowest_eigenvalue > 1.0)
    np.testing.assert_allclose(runs.nodes[:, 2], tops, atol=SAME)
    for value in values[::5]:
        alone = solve_path(trusses, {"B": float(value)}, path=path)
        assert str(alone.status) == "stable", alone.reason
        np.testing.assert_allclose(alone.final.tensions, 0.0, atol=1e-9 * 500.0)


# Settings act.

CONTROLS = (
    {},
    {"first_step": 0.005},
    {"largest_move": 1e-3},
    {"contraction": 1e-6},
    {"smallest_step": 0.3},
    {"max_steps": 1},
    {"policy": "stop"},
    {"path": "stepped"},
    {"path": "stepped", "increment": 0.002},
)


@pytest.mark.parametrize("control", CONTROLS, ids=str)
def test_settings_act_on_a_batch_as_on_a_path(control):
    actuation, chosen = {"A14": 0.09, "A23": 0.08}, PathSettings(**control)
    path = solve_path(library.paper_beam(), actuation, settings=chosen)
    runs = solve_batch(
        library.paper_beam(), actuation={n: [0.5 * v, v] for n, v in actuation.items()}, settings=chosen
    )
    assert str(runs.status[1]) == str(path.status)
    assert runs.steps[1] == path.final.steps
    assert runs.iterations[1] == path.final.iterations


def test_small_steps_are_many_steps_in_a_batch():
    actuation = {"A14": [0.09], "A23": [0.08]}
    default, fine = (
        solve_batch(library.paper_beam(), actuation=actuation, settings=PathSettings(**control)).steps[0]
        for control in ({}, {"largest_move": 1e-3})
    )
    # The tip moves by about a fifth of the beam's length.
    assert fine > 100 > default


def beam_study(**solver):
    return tg.parse_study(
        {
            "schema": "tensegra/study/1",
            "structure": "library:paper_beam",
            "seed": 1,
            "variables": {
                name: {"actuator": name, "distribution": {"uniform": [0.05, 0.10]}} for name in ("A14", "A23")
            },
            "outputs": {"w": {"displacement": "z", "nodes": [18, 23]}},
            "design": {"sampler": "sobol", "sizes": 4},
            **({"solver": solver} if solver else {}),
        }
    )


@pytest.mark.parametrize("control", CONTROLS[:6], ids=str)
def test_settings_of_a_study_act_on_its_campaign(control, tmp_path):
    study = beam_study(**control)
    frame = study.run(tmp_path / "campaign").frame()
    for row in frame.itertuples():
        path = solve_path(study.structure, {"A14": row.A14, "A23": row.A23}, settings=PathSettings(**control))
        assert row.status == str(path.status)
        assert row.steps == path.final.steps


def test_a_setting_that_changes_nothing_changes_no_fingerprint():
    plain = beam_study().fingerprint
    assert beam_study(first_step=PathSettings().first_step).fingerprint == plain
    # The increment is the stepped procedure's alone, and the step control the adaptive one's.
    assert beam_study(increment=0.002).fingerprint == plain
    assert beam_study(path="stepped", increment=0.002).fingerprint != beam_study(path="stepped").fingerprint
    assert beam_study(path="stepped", first_step=0.1).fingerprint == beam_study(path="stepped").fingerprint
    for field in fields(PathSettings):
        assert field.name in {"policy", "path", "increment"} or (
            beam_study(**{field.name: {"max_steps": 7}.get(field.name, 0.1)}).fingerprint != plain
        )


# Every stage has its history.


def rope():
    """Return a straight rope in two parts, drawn without tension."""
    return Structure(
        name="rope",
        nodes={"a": (0, 0, 0), "b": (1, 0, 0), "c": (2, 0, 0)},
        members={"r": cable("ab", 1.0, 1e5), "q": cable("bc", 1.0, 1e5)},
        supports={"a": "xyz", "c": "xyz"},
        stages=[Stage("prestress", rest_length_changes={"r": -0.01})],
    )


def one_stage_structures():
    ring = Structure(
        name="ring on a rope",
        nodes={"a": (0, 0, 0), "ring": (1.7, 0.3, -2.5), "b": (4, 0, 0)},
        members={"rope": cable(("a", "ring", "b"), 5.0, 50.0)},
        supports={"a": "xyz", "b": "xyz"},
        stages=[Stage("hang", loads={"ring": (0, 0, -4.0)})],
    )
    return {"rope": rope(), "ring": ring, "toppling prism": library.prism(4, height=2.0, clustered=True)}


@pytest.mark.parametrize("name", one_stage_structures())
@pytest.mark.parametrize("procedure", ["adaptive", "stepped"])
def test_a_stage_solved_in_one_go_has_a_history(name, procedure):
    structure = one_stage_structures()[name]
    path = solve_path(structure, path=procedure)
    frame = path.to_dataframe()
    assert list(frame.columns[:3]) == ["stage", "parameter", "iterations"]
    if (name, procedure) == ("rope", "stepped"):
        # The halves take turns to be slack: the plain procedure finds nothing, and shows nothing.
        assert str(path.status) == "failed"
        assert len(frame) == 0
        return
    assert len(frame) >= 1
    last = frame.iloc[-1]
    assert last["parameter"] == 1.0
    for (node, at), (k, axis) in product(
        zip(structure.nodes, path.final.nodes, strict=True), enumerate("xyz")
    ):
        assert last[f"{axis}_{node}"] == pytest.approx(at[k], abs=SAME)
    for member, tension in zip(structure.members, path.final.tensions, strict=True):
        assert last[f"T_{member}"] == pytest.approx(tension, rel=SAME, abs=1e-6)


def test_a_rope_prestressed_in_one_go_is_right():
    path = solve_path(rope())
    # Both parts carry T: 0.99 (1 + T/EA) + (1 + T/EA) = 2.
    tension = 1e5 * (2.0 / 1.99 - 1.0)
    assert str(path.status) == "stable", path.reason
    np.testing.assert_allclose(path.final.tensions, tension, rtol=1e-8)
    assert path.final.lowest_eigenvalue == pytest.approx(
        tension * (1.0 / path.final.node("b")[0] + 1.0 / (2.0 - path.final.node("b")[0])), rel=EIGENVALUE
    )


def test_a_table_and_an_xarray_of_a_rope(tmp_path):
    tg.write_structure(rope(), tmp_path / "rope.yaml")
    table = tmp_path / "rope.parquet"
    result = CliRunner().invoke(app, ["solve", str(tmp_path / "rope.yaml"), "-o", str(table)])
    assert result.exit_code == 0, result.output
    assert len(pd.read_parquet(table)) >= 1
    pytest.importorskip("xarray")
    assert solve_path(rope()).to_xarray().sizes["step"] >= 1
