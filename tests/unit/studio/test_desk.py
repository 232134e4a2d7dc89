"""What a page has before it: moves are solves, what is taken back is exact, what cannot be is refused."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegra.cli import main
from tensegra.errors import ModelError
from tensegra.mechanics import Status, solve_path
from tensegra.structure import Stage, library, parse_structure
from tensegra.structure.text import load_yaml
from tensegra.studio import export
from tensegra.studio.desk import Desk
from tensegra.studio.knobs import knobs_of_structure, knobs_of_study
from tensegra.study import parse_study

SAME = 1e-8
"""Of the structure's size: ways that end in the same equilibrium, polished to rounding."""


def desk_of(structure):
    return Desk(structure, {knob.key: knob for knob in knobs_of_structure(structure)})


@pytest.fixture
def desk():
    return desk_of(library.paper_beam())


def assert_same(nodes, expected):
    np.testing.assert_allclose(nodes, expected, rtol=0.0, atol=SAME * np.ptp(expected, axis=0).max())


def test_a_move_is_a_certified_solve(desk):
    answer = desk.move({"actuator:A14": 0.08, "temperature:top": 50.0})
    expected = solve_path(library.paper_beam(), {"A14": 0.08}, {"top": 50.0}).final
    assert answer.moved
    assert answer.found.residual < 1e-9
    assert_same(answer.found.nodes, expected.nodes)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 3), st.floats(0.0, 0.1)), min_size=1, max_size=4))
def test_what_is_taken_back_is_the_same_to_the_last_bit(drags):
    desk = desk_of(library.paper_beam())
    kept = []
    for gesture, (_, value) in enumerate(drags):
        kept.append((desk.found.nodes, dict(desk.values)))
        for share in (0.5, 1.0):  # a drag is many moves and one gesture
            desk.move({"actuator:A14": share * value}, gesture)
    for nodes, values in reversed(kept):
        desk.undo()
        np.testing.assert_array_equal(desk.found.nodes, nodes)
        assert desk.values == values
    with pytest.raises(ModelError, match="nothing is left"):
        desk.undo()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"actuator:A144": 0.1}, "did you mean 'actuator:A14'"),
        ({"actuator:A14": float("nan")}, "finite"),
        ({"actuator:A14": "0.1"}, "finite number"),
        ({"actuator:A14": True}, "finite number"),
        ({"actuator:A14": 1.5}, "rest length"),
        (["actuator:A14"], "a value by name"),
        (None, "a value by name"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_moves(desk, values, message):
    stands = desk.found.nodes
    with pytest.raises(ModelError, match=message):
        desk.move(values)
    np.testing.assert_array_equal(desk.found.nodes, stands)
    assert desk.told(desk.move({}))["undo"] <= 1


def test_desks_of_one_structure_share_nothing():
    beam = library.paper_beam()
    first, second = desk_of(beam), desk_of(beam)
    stands = second.found.nodes.copy()
    first.move({"actuator:A14": 0.1})
    np.testing.assert_array_equal(second.found.nodes, stands)
    assert first.structure is not second.structure


def test_a_snap_is_told_with_both_its_states():
    truss = library.von_mises_truss()
    desk = desk_of(truss)
    desk.add_load("apex", "z")
    before = desk.found.nodes.copy()
    answer = desk.move({"load:apex.z": -20_000.0})
    assert answer.found.status is Status.SNAPPED
    np.testing.assert_array_equal(answer.before, before)
    told = desk.told(answer)
    assert "limit point" in told["snaps"][0]
    assert desk.found.node("apex")[2] < 0.0  # it hangs through


def test_a_load_is_offered_once_and_only_at_a_node(desk):
    desk.add_load("18", "z")
    with pytest.raises(ModelError, match="already"):
        desk.add_load("18", "z")
    with pytest.raises(ModelError, match="a node"):
        desk.add_load("nowhere", "z")
    with pytest.raises(ModelError, match="an axis"):
        desk.add_load("18", "w")


def test_the_load_factor_scales_the_loads_of_the_stages():
    pressed = Stage("pressed", loads={"apex": (0.0, 0.0, -1000.0)})
    desk = desk_of(library.von_mises_truss().replace(stages=(pressed,)))
    desk.move({"load_factor": 2.0})
    twice = Stage("pressed", loads={"apex": (0.0, 0.0, -2000.0)})
    expected = solve_path(library.von_mises_truss().replace(stages=(twice,))).final
    assert_same(desk.found.nodes, expected.nodes)
    desk.move({"load_factor": 0.0})
    assert_same(desk.found.nodes, library.von_mises_truss().coordinates)


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ({"youngs_modulus": "steel", "distribution": {"uniform": [10000, 20000]}}, 12000.0),
        ({"area": "classical", "distribution": {"uniform": [0.4, 0.6]}}, 0.45),
        ({"rest_length": "c26", "distribution": {"uniform": [56.0, 57.0]}}, 56.3),
        (
            {
                "prestress": {"stage": "prestress", "members": ["K1"]},
                "distribution": {"uniform": [-0.03, -0.02]},
            },
            -0.022,
        ),
        ({"load": {"node": "18", "axis": "z"}, "distribution": {"uniform": [-1.0, 1.0]}}, -0.4),
        ({"position": {"node": "1", "axis": "z"}, "distribution": {"uniform": [-1.0, 1.0]}}, 0.3),
    ],
)
def test_every_kind_of_variable_does_what_the_study_does(entry, value):
    study = parse_study(
        {
            "schema": "tensegra/study/1",
            "name": "s",
            "structure": "library:paper_beam",
            "seed": 1,
            "variables": {
                "A14": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.1]}},
                "other": entry,
            },
            "outputs": {"w": {"displacement": "z", "nodes": [18]}},
            "design": {"sampler": "sobol", "sizes": 8},
        }
    )
    desk = Desk(study.structure, {knob.key: knob for knob in knobs_of_study(study.variables)})
    start = desk.displacement(["18"], "z")
    desk.move({"A14": 0.07, "other": value})
    row = study.evaluate(np.array([[0.07, value]]))
    assert desk.displacement(["18"], "z") == pytest.approx(float(row.Y[0, 0]), rel=1e-7)
    desk.undo()
    assert desk.displacement(["18"], "z") == start


def test_the_state_does_the_same_elsewhere(desk, capsys):
    desk.add_load("18", "z")
    desk.move({"actuator:A14": 0.06, "temperature:top": -20.0, "load:18.z": -0.4})
    expected = desk.found.nodes - desk.reference
    # Python
    names = {}
    exec(export.as_python(desk, "library:paper_beam"), names)  # noqa: S102 - what the page offers to be run
    assert_same(names["path"].final.nodes, desk.found.nodes)
    # The command line
    command = export.as_command(desk, "library:paper_beam").split()
    with pytest.raises(SystemExit) as left:
        main([*command[1:], "--json"])
    assert left.value.code == 0
    solved = json.loads(capsys.readouterr().out)
    moved = np.array(list(solved["actuation"]["displacements"].values()))
    np.testing.assert_allclose(moved, expected, atol=1e-6)
    # JSON
    told = json.loads(export.as_json(desk, "library:paper_beam"))
    np.testing.assert_allclose(list(told["displacements"].values()), expected)
    # A structure file
    text = export.structure_text(export.standing_structure(desk))
    again = solve_path(parse_structure(load_yaml(text)))
    assert_same(again.final.nodes, desk.found.nodes)


def test_a_structure_that_did_not_move_is_saved_as_it_is(desk):
    assert export.standing_structure(desk) == library.paper_beam()
