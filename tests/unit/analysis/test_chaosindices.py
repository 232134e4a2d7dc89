import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tensegra.analysis import SurrogateModel, chaos_indices, sobol_indices
from tensegra.errors import StudyError
from tensegra.study import TrainingData, parse_study
from tensegra.surrogate import fit

STUDY = parse_study(
    {
        "structure": "library:paper_beam",
        "variables": {
            "A14": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.1]}},
            "T": {"temperature": "top", "distribution": {"normal": {"mean": 0, "std": 10}}},
        },
        "outputs": {"w": {"displacement": "z", "nodes": [18, 23]}},
        "design": {"sampler": "sobol", "sizes": 8},
    }
)


def trained(noise=0.0, distributions=STUDY.space.distributions):
    X = STUDY.space.from_unit(np.random.default_rng(2).random((200, 2)))
    w = 100 * X[:, 0] + 0.1 * X[:, 1] + 0.5 * X[:, 0] * X[:, 1]
    w = w + noise * np.random.default_rng(3).standard_normal(200)
    data = TrainingData(
        X=X,
        Y=w,
        input_names=("A14", "T"),
        output_names=("w",),
        bounds=STUDY.space.bounds,
        distributions=distributions,
    )
    return fit(data, "pce", degree=2, validation=None)


def test_the_shares_are_those_of_the_formula():
    # Var = (100 + 0.5·0)² σ_a² + (0.1 + 0.5·0.05)² σ_t² + 0.5² σ_a² σ_t², with σ_a² = 0.01/12, σ_t = 10.
    a, t = 0.01 / 12, 100.0
    parts = np.array([1e4 * a, 0.125**2 * t, 0.25 * a * t])
    found = chaos_indices(SurrogateModel(trained(), "pce", STUDY.space)).indices["w"]
    assert_allclose(found.variance, parts.sum(), rtol=1e-6)
    assert_allclose(found.first, parts[:2] / parts.sum(), rtol=1e-6)
    assert_allclose(found.total, (parts[:2] + parts[2]) / parts.sum(), rtol=1e-6)
    assert_allclose(found.second[0, 1], parts[2] / parts.sum(), rtol=1e-5)
    assert np.all(found.first_half < 1e-6)  # the fit is exact


def test_the_interval_grows_with_the_noise_and_covers():
    exact = chaos_indices(trained()).indices["w"].first
    halves = []
    for noise in (0.1, 1.0):
        found = chaos_indices(trained(noise)).indices["w"]
        assert np.all(np.abs(found.first - exact) < 2 * found.first_half)
        halves.append(found.first_half)
    assert np.all(halves[1] > 3 * halves[0])


def test_it_agrees_with_saltellis_design_on_the_same_surrogate():
    model = SurrogateModel(trained(), "pce", STUDY.space)
    closed, sampled = chaos_indices(model).indices["w"], sobol_indices(model, samples=2048).indices["w"]
    assert_allclose(closed.first, sampled.first, atol=0.05)
    assert_allclose(closed.total, sampled.total, atol=0.05)


def test_laws_that_it_was_not_trained_with_are_refused():
    with pytest.raises(StudyError, match="the law that the expansion was trained with"):
        chaos_indices(SurrogateModel(trained(distributions=None), "pce", STUDY.space))


def test_other_kinds_have_no_coefficients():
    gpr = fit((np.random.default_rng(0).random((20, 2)), np.arange(20.0)), "gpr", validation=None)
    with pytest.raises(StudyError, match="of kind 'pce'"):
        chaos_indices(gpr)


def test_the_result_is_a_sensitivity_without_runs():
    found = chaos_indices(trained(), second_order=False)
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert content["method"] == "chaos"
    assert content["share_dropped"] == 0.0
    assert content["convergence"] == {}
    assert found.indices["w"].second is None
    assert "in closed form" in str(found)
