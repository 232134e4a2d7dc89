import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis import Model, TrueModel, optimise, propagate, run_analyses, sobol_indices
from tensegra.analysis.model import as_model
from tensegra.errors import StudyError
from tensegra.mechanics import solve_batch
from tensegra.study import TrainingData, parse_study
from tensegra.surrogate import fit

# Derivatives by central differences of a thousandth of the box, on a path that bends by some percent over it.
DIFFERENCES = 1e-3

CONTENT = {
    "structure": "library:paper_beam",
    "seed": 5,
    "variables": {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.09, 0.10]}},
        "A23": {"actuator": "A23", "distribution": {"uniform": [0.09, 0.10]}},
    },
    "outputs": {
        "v": {"displacement": "y", "nodes": [18, 23]},
        "w": {"displacement": "z", "nodes": [18, 23]},
    },
    "design": {"sampler": "sobol", "sizes": 16},
}


def study(**changes):
    return parse_study({**CONTENT, **changes})


@pytest.fixture(scope="module")
def truth():
    return TrueModel(study())


@pytest.fixture(scope="module")
def surrogate(truth):
    X = np.random.default_rng(0).uniform(0.09, 0.10, (40, 2))
    data = TrainingData(
        X=X,
        Y=truth.evaluate(X).values,
        input_names=truth.input_names,
        output_names=truth.output_names,
        input_units=("", ""),
        output_units=("cm", "cm"),
        bounds=truth.bounds,
    )
    return fit(data, "gpr", validation=None)


def test_the_structure_itself_is_a_model(truth):
    assert isinstance(truth, Model)
    assert as_model(truth.study) == truth
    assert (truth.input_names, truth.output_names) == (("A14", "A23"), ("v", "w"))
    assert truth.units == {"A14": "", "A23": "", "v": "cm", "w": "cm"}
    found = truth.evaluate([[0.10, 0.10]])
    assert_array_equal(found.status, ["stable"])
    assert_allclose(found.values, [[13.8088, 53.1467]], atol=1e-3)


def test_its_derivatives_are_the_slopes_of_its_values(truth):
    X, step = np.array([[0.095, 0.096]]), np.array([[2e-4, -1e-4]])
    ahead, behind = truth.evaluate(X + step).values, truth.evaluate(X - step).values
    assert_allclose((ahead - behind)[0], 2 * truth.gradient(X)[0] @ step[0], rtol=DIFFERENCES)


def test_a_run_that_is_not_certified_is_no_result():
    def solver(structure, **inputs):
        status = np.array(["stable", "collapsed", "failed"])
        return replace(solve_batch(structure, **inputs), status=status)

    found = TrueModel(study(), solver=solver).evaluate(np.full((3, 2), 0.095))
    assert_array_equal(found.valid, [True, False, False])
    assert np.isnan(found.values[1:]).all()
    assert found.tally() == {"stable": 1, "collapsed": 1, "failed": 1}


def test_the_truth_answers_every_question_itself(truth):
    spread = propagate(truth, {"A23": {"same_as": "A14"}}, samples=64)
    assert spread.n_failed == spread.n_outside == 0
    beyond = propagate(truth, {"A14": 0.085, "A23": {"uniform": [0.085, 0.09]}}, samples=8)
    assert beyond.n_outside == 0  # the box is where surrogates learn; the structure itself has no such limit
    assert 46.0 < spread.outputs["w"].minimum < spread.outputs["w"].maximum < 53.2
    indices = sobol_indices(truth, samples=64, second_order=False).indices["w"]
    assert_allclose(indices.total.sum(), 1.0, atol=0.2)
    best = optimise(truth, "w", starts=4)
    assert_allclose(best.x, [0.10, 0.10], atol=1e-9)


def test_a_studys_list_is_carried_out_in_its_order(surrogate):
    analyses = [
        {
            "propagation": {
                "model": "gpr",
                "compare_with": "truth",
                "samples": 100,
                "inputs": {"A23": {"same_as": "A14"}},
            }
        },
        {"sensitivity": {"name": "shares", "model": "gpr", "samples": 64, "outputs": ["w"]}},
        {
            "optimisation": {
                "model": "gpr",
                "objective": "w",
                "constraints": ["v <= 13.5"],
                "methods": ["slsqp", "bfgs", "bayesian"],
                "starts": 6,
                "evaluations": 12,
            }
        },
    ]
    listed = study(surrogates={"gpr": {"kind": "gpr"}}, analyses=analyses)
    told = set()
    results = run_analyses(listed, None, {"gpr": surrogate}, progress=lambda name, *_: told.add(name))
    assert [r.kind for r in results] == ["propagation", "sensitivity"] + ["optimisation"] * 3
    spread, shares, *optima = results
    assert (spread.other.model, spread.seed) == ("truth", 5)
    assert abs(spread.differences["w"].largest) < 0.05
    assert list(shares.indices) == ["w"]
    assert spread.outputs["w"].unit == "cm"
    for best in optima:
        assert best.true_status == "stable"
        assert abs(best.gap) < 0.05
        assert_allclose(best.objective, optima[0].objective, rtol=1e-3)
    assert {"propagation", "shares", "optimisation (bayesian)"} <= told
    json.dumps([r.to_dict() for r in results], allow_nan=False)
    assert all(r.table() for r in results)


def test_a_surrogate_that_is_not_there_is_named():
    listed = study(
        surrogates={"gpr": {"kind": "gpr"}}, analyses=[{"propagation": {"model": "gpr", "samples": 10}}]
    )
    with pytest.raises(StudyError, match="found 'gpr', expected one of nn, truth"):
        run_analyses(listed, None, {"nn": None})


def test_runs_of_another_study_are_refused(tmp_path):
    campaign = study(design={"sampler": "sobol", "sizes": 2}).run(tmp_path, workers=1)
    other = study(outputs={"w": {"displacement": "z", "nodes": [18]}})
    with pytest.raises(StudyError, match="runs of the study"):
        run_analyses(other, campaign, {})
    assert run_analyses(campaign.study, campaign, {}) == []
