from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.errors import StudyError
from tensegra.mechanics import solve_batch
from tensegra.study import parse_study
from tensegra.study.evaluate import batch_inputs

# Both sides come from the same solver and the same inputs, rounded differently.
SAME_SOLUTION = 1e-7


def test_columns_become_outputs_in_order(study, solver):
    X = np.array([[0.090, 0.07], [0.095, 0.09]])
    runs = study.evaluate(X, solver=solver)
    assert_allclose(runs.Y, np.stack([100 * X.sum(axis=1), X.sum(axis=1)], axis=1))
    assert_array_equal(runs.status, ["stable", "snapped"])
    assert len(runs) == 2


def test_a_failed_run_has_a_reason_and_no_number(study, solver):
    runs = study.evaluate([[0.099, 0.08], [0.09, 0.08]], solver=solver)
    assert_array_equal(runs.failed, [True, False])
    assert_array_equal(runs.valid, [False, True])
    assert np.isnan(runs.Y[0]).all()
    assert np.isnan([runs.residual[0], runs.lowest_eigenvalue[0]]).all()
    assert runs.reason[0] == "no equilibrium was found"
    assert runs.reason[1] == ""


def test_every_output_is_taken_from_the_runs(content, solver):
    content["outputs"] = {
        "v": {"displacement": "y", "nodes": [18]},
        "z": {"coordinate": "z", "nodes": [18, 23]},
        "gap": {"distance": True, "nodes": [18, 23]},
        "top": {"max_tension": "top"},
        "least": {"min_tension": "all"},
        "one": {"max_tension": "K1"},
        "slack": {"slack_cables": "all"},
        "k": {"lowest_eigenvalue": True},
    }
    study = parse_study(content)
    Y = study.evaluate([[0.09, 0.07], [0.099, 0.07]], solver=solver).Y
    tip = study.structure.coordinates[[17, 22]]
    gap = np.linalg.norm(tip[0] - tip[1])
    assert_allclose(Y[0], [1.6, tip[:, 2].mean() + 16, gap, 0.16, 0.16, 0.16, 0, 0.02])
    assert np.isnan(Y[1]).all()


def test_every_kind_of_variable_reaches_its_argument(content):
    law = {"uniform": [1, 2]}
    content["variables"] = {
        "a": {"actuator": "A14", "distribution": {"uniform": [0, 0.1]}},
        "t": {"temperature": "top", "distribution": law},
        "E": {"youngs_modulus": "steel", "distribution": law},
        "A": {"area": "clustered", "distribution": law},
        "l": {"rest_length": "K2", "distribution": law},
        "p": {"load": {"node": 18, "axis": "z"}, "distribution": law},
        "q": {"load": {"node": 18, "axis": "y"}, "distribution": law},
        "s": {"position": {"node": 1, "axis": "x"}, "distribution": law},
    }
    study = parse_study(content)
    X = np.arange(8.0)[None]
    arguments = batch_inputs(study.structure, study.variables, X)
    assert {
        name: {key: float(column[0]) for key, column in group.items()} for name, group in arguments.items()
    } == {
        "actuation": {"A14": 0},
        "temperature": {"top": 1},
        "youngs_modulus": {"steel": 2},
        "area": {"clustered": 3},
        "rest_length": {"K2": 4},
        "loads": {("18", "z"): 5, ("18", "y"): 6},
        "positions": {("1", "x"): 7},
    }


def test_a_prestress_is_the_change_that_its_stage_makes(content):
    prestress = {"stage": "prestress", "members": ["K1", "K4"]}
    content["variables"] = {"c": {"prestress": prestress, "distribution": {"uniform": [-0.04, -0.02]}}}
    content["outputs"] = {"T": {"tension": "K1"}, "z": {"coordinate": "z", "nodes": [18, 23]}}
    study = parse_study(content)
    changed = {"stages": [{"name": "prestress", "rest_length_changes": {"K1": -0.03, "K4": -0.03}}]}
    direct = parse_study(content | {"changes": changed}).structure
    runs = solve_batch(direct)
    expected = [runs.tension("K1")[0], runs.coordinate("z", nodes=["18", "23"])[0]]
    assert_allclose(study.evaluate([[-0.03]]).Y[0], expected, rtol=SAME_SOLUTION)


def test_an_error_of_rest_length_is_a_member_cut_wrongly(content):
    """The same as a structure whose members are that much longer, whatever a stage then does to them."""
    law = {"uniform": [-0.002, 0.002]}
    content["variables"] = {"e": {"rest_length_error": "clustered", "distribution": law}}
    content["outputs"] = {"T": {"tension": "K1"}, "z": {"coordinate": "z", "nodes": [18, 23]}}
    study = parse_study(content)
    cut = {
        name: replace(member, rest_length=1.001 * member.rest_length) if member.is_clustered else member
        for name, member in study.structure.members.items()
    }
    runs = solve_batch(study.structure.replace(members=cut))
    expected = [runs.tension("K1")[0], runs.coordinate("z", nodes=["18", "23"])[0]]
    assert_allclose(study.evaluate([[0.001]]).Y[0], expected, rtol=SAME_SOLUTION)
    assert abs(study.evaluate([[0.0]]).Y[0, 0] - expected[0]) > 1.0


def test_the_real_solver_moves_the_tip_as_the_reconstruction_does(content):
    content["outputs"] = {"w": {"displacement": "z", "nodes": [18, 23]}}
    study = parse_study(content)
    runs = study.evaluate([[0.10, 0.10]])
    assert runs.status[0] == "stable"
    # The issue that set the project up states it with six digits.
    assert runs.Y[0, 0] == pytest.approx(53.1467, abs=1e-4)


@pytest.mark.parametrize(
    ("X", "message"),
    [
        (np.zeros((2, 3)), r"found \(2, 3\), expected a row per point, 2 columns"),
        (np.zeros(2), "a row per point"),
        ([[0.09, np.nan]], "row 0, A23: found nan, expected a finite number"),
    ],
)
def test_points_that_cannot_be_are_refused(study, solver, X, message):
    with pytest.raises(StudyError, match=message):
        study.evaluate(X, solver=solver)
