from dataclasses import fields, replace

import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.mechanics import PathSettings
from tensegra.study import SolverEntry, parse_study


def test_what_is_left_out_is_as_in_mechanics():
    assert SolverEntry().settings == PathSettings()
    assert set(SolverEntry.model_fields) == {field.name for field in fields(PathSettings)}


def test_the_study_file_sets_the_solver_and_its_fingerprint(content):
    plain = parse_study(content)
    content["solver"] = {"policy": "stop", "max_steps": 50}
    study = parse_study(content)
    assert study.solver.settings == replace(PathSettings(), policy="stop", max_steps=50)
    assert study.fingerprint != plain.fingerprint
    resolved = study.to_mapping()
    assert resolved["solver"]["policy"] == "stop"
    assert resolved["solver"]["first_step"] == 0.5
    assert parse_study(resolved).fingerprint == study.fingerprint
    content["solver"] = {}
    assert parse_study(content).fingerprint == plain.fingerprint


def test_the_settings_reach_the_solver(content):
    content["outputs"] = {"w": {"displacement": "z", "nodes": [18, 23]}}
    X = [[0.05, 0.05]]
    adaptive = parse_study(content).evaluate(X)
    content["solver"] = {"path": "stepped", "increment": 0.005}
    fine = parse_study(content).evaluate(X)
    content["solver"]["increment"] = 0.01
    coarse = parse_study(content).evaluate(X)
    # Both procedures end in the same equilibrium, the stepped one in the steps it is told.
    np.testing.assert_allclose(fine.Y, adaptive.Y, rtol=1e-7)
    assert fine.steps[0] == 2 * coarse.steps[0]
    assert fine.steps[0] > adaptive.steps[0]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"polcy": "stop"}, "did you mean 'policy'"),
        ({"policy": "stopp"}, "solver.policy: found 'stopp', .*did you mean 'stop'"),
        ({"path": "arc"}, "solver.path: found 'arc', expected one of adaptive, stepped"),
        ({"first_step": 2.0}, "solver.first_step: found 2.0, expected a number less than or equal to 1"),
        ({"max_steps": 0}, "solver.max_steps"),
        ({"contraction": "half"}, "solver.contraction: found 'half'"),
    ],
)
def test_settings_that_cannot_be_are_refused(content, entry, message):
    content["solver"] = entry
    with pytest.raises(StudyError, match=message):
        parse_study(content)
