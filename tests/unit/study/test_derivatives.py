"""Derivative columns against central differences of the same solver, for everything that can vary."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.errors import StudyError
from tensegra.study import parse_study

# Central differences of a solver that converges to 1e-9 of its forces: with a step of 1e-4 of the
# box both their errors, of order step² and of residual/step, stay below this share of the largest.
DIFFERENCE_ERROR = 1e-5
STEP = 1e-4

OUTPUTS = {
    "w": {"displacement": "z", "nodes": [18, 23]},
    "z": {"coordinate": "z", "nodes": [18, 23]},
    "gap": {"distance": True, "nodes": [3, 18]},
    "T": {"tension": "K1"},
    "R": {"reaction": "z", "nodes": [1, 4]},
    "least": {"min_tension": "all"},
}
N_DIFFERENTIABLE = 5
"""All outputs but the last, which has kinks."""

VARIABLES = {
    "actuator": ({"actuator": "A14"}, [0.02, 0.06]),
    "group": ({"temperature": "top"}, [0, 100]),
    "member": ({"temperature": "c5"}, [0, 100]),
    "modulus": ({"youngs_modulus": "steel"}, [11000, 12000]),
    "area": ({"area": "clustered"}, [0.45, 0.55]),
    "rest_length": ({"rest_length": "K2"}, [300, 302]),
    "error": ({"rest_length_error": "K2"}, [-0.002, 0.002]),
    "errors": ({"rest_length_error": "clustered"}, [-0.001, 0.001]),
    "load": ({"load": {"node": 18, "axis": "z"}}, [-0.2, 0.2]),
    "position": ({"position": {"node": 1, "axis": "z"}}, [-1, 1]),
    "prestress": ({"prestress": {"stage": "prestress", "members": ["K1", "K4"]}}, [-0.03, -0.02]),
}


def study_of(content, names):
    content["variables"] = {
        name: {**VARIABLES[name][0], "distribution": {"uniform": VARIABLES[name][1]}} for name in names
    }
    content["outputs"] = OUTPUTS
    return parse_study(content)


def central_differences(study, X):
    steps = STEP * np.ptp(study.space.bounds, axis=1)
    columns = []
    for j, step in enumerate(steps):
        move = step * np.eye(len(steps))[j]
        columns.append((study.evaluate(X + move).Y - study.evaluate(X - move).Y) / (2 * step))
    return np.stack(columns, axis=2)


@pytest.mark.parametrize(
    "names",
    [
        *([name, "actuator"] for name in VARIABLES if name != "actuator"),
        ["rest_length", "prestress", "actuator"],
        ["errors", "rest_length", "prestress", "actuator"],
        ["modulus", "group", "load", "actuator"],
    ],
    ids="+".join,
)
def test_derivatives_are_those_of_the_outputs(content, names):
    study = study_of(content, names)
    X = study.space.from_unit(np.random.default_rng(1).uniform(0.1, 0.9, (3, len(names))))
    runs = study.evaluate(X, derivatives=True)
    assert set(runs.status) == {"stable"}
    expected = central_differences(study, X)
    for i in range(N_DIFFERENTIABLE):
        scale = np.abs(expected[:, i]).max(axis=0)
        assert (scale > 0).all()
        assert_allclose(runs.dY[:, i] / scale, expected[:, i] / scale, atol=DIFFERENCE_ERROR)
    assert np.isnan(runs.dY[:, N_DIFFERENTIABLE]).all()


def test_a_load_on_a_support_goes_into_its_reaction_alone(content):
    content["variables"] = {
        "p": {"load": {"node": 4, "axis": "z"}, "distribution": {"uniform": [-1, 1]}},
        "a": {"actuator": "A23", "distribution": {"uniform": [0, 0.1]}},
    }
    content["outputs"] = OUTPUTS
    runs = parse_study(content).evaluate([[0.3, 0.05], [-0.3, 0.05]], derivatives=True)
    assert_allclose(runs.dY[:, :N_DIFFERENTIABLE, 0], [[0, 0, 0, 0, -1]] * 2, atol=DIFFERENCE_ERROR)
    assert_allclose(runs.Y[0, 4] - runs.Y[1, 4], -0.6, rtol=DIFFERENCE_ERROR)


def test_a_rest_length_with_a_prestress_upon_it(content):
    content["variables"] = {
        "l": {"rest_length": "K1", "distribution": {"uniform": [299, 301]}},
        "a": {"actuator": "A23", "distribution": {"uniform": [0, 0.1]}},
        "c": {
            "prestress": {"stage": "prestress", "members": ["K1"]},
            "distribution": {"uniform": [-0.03, -0.02]},
        },
    }
    content["outputs"] = OUTPUTS
    study = parse_study(content)
    X = np.array([[300.4, 0.05, -0.024], [299.7, 0.02, -0.028]])
    expected = central_differences(study, X)[:, :N_DIFFERENTIABLE]
    assert_allclose(study.evaluate(X, derivatives=True).dY[:, :N_DIFFERENTIABLE], expected, rtol=1e-4)


def test_which_runs_go_together_makes_no_difference(content):
    study = study_of(content, ["actuator", "group", "load"])
    X = study.space.from_unit(np.random.default_rng(2).uniform(size=(50, 3)))
    whole = study.evaluate(X, derivatives=True)
    for part in (slice(0, 1), slice(13, 31), slice(None, None, -1)):
        runs = study.evaluate(X[part], derivatives=True, threads=1)
        for name in ("Y", "dY", "status", "residual", "lowest_eigenvalue", "steps", "iterations"):
            assert_array_equal(getattr(runs, name), getattr(whole, name)[part], err_msg=name)


def test_names_of_columns(content):
    content["derivatives"] = True
    study = study_of(content, ["actuator", "load"])
    assert study.derivative_names == (
        "dw/dactuator", "dw/dload", "dz/dactuator", "dz/dload",
        "dgap/dactuator", "dgap/dload", "dT/dactuator", "dT/dload", "dR/dactuator", "dR/dload",
    )  # fmt: skip
    content["derivatives"] = False
    assert study_of(content, ["actuator"]).derivative_names == ()


def test_a_study_without_an_output_to_differentiate_is_refused(content):
    content["derivatives"] = True
    content["outputs"] = {"n": {"slack_cables": "all"}}
    with pytest.raises(StudyError, match=r"outputs: found \['slack_cables'\], expected an output that has"):
        parse_study(content)
