"""Intervals that hold: whatever the design, and whatever the standard deviation was before."""

import numpy as np
import pytest
from scipy.stats import qmc

from tensegra.study.data import TrainingData
from tensegra.surrogate import fit
from tensegra.surrogate.basis import Basis, recurrence, total_degree, uniform_quadrature
from tensegra.surrogate.calibration import cross_calibrated
from tensegra.surrogate.design import fresh_ratio, fresh_to_left_out
from tensegra.surrogate.leastsquares import LeastSquares, Rows
from tensegra.surrogate.problem import Problem

SPREAD = (
    0.04  # of the mean coverage of three surrogates with two outputs: 0.02 is one standard deviation of one
)


def rough(X):
    return np.stack([np.exp(np.sin(4 * X[:, 0]) + X[:, 1]), 1 / (1.2 + X[:, 0] * X[:, 1] + X[:, 2])], axis=1)


@pytest.mark.parametrize("design", ["sobol", "random"])
@pytest.mark.parametrize(("kind", "options"), [("pce", {"degree": 6}), ("gpr", {})])
def test_intervals_hold_for_space_filling_and_for_random_designs(design, kind, options):
    fresh = np.random.default_rng(100).uniform(size=(1000, 3))
    coverage = []
    for seed in range(3):
        X = (
            qmc.Sobol(3, seed=seed).random(256)
            if design == "sobol"
            else np.random.default_rng(50 + seed).uniform(size=(256, 3))
        )
        data = TrainingData(X=X, Y=rough(X), bounds=[[0, 1]] * 3)
        coverage += fit(data, kind, validation=(fresh, rough(fresh)), **options).validation.coverage_90
    assert np.mean(coverage) == pytest.approx(0.9, abs=SPREAD)


def system(Z, degree):
    nodes, weights = uniform_quadrature(-1, 1)
    coefficients = np.stack([recurrence(nodes, weights, degree + 1)] * Z.shape[1])
    basis = Basis(coefficients, total_degree(Z.shape[1], degree))
    return basis, LeastSquares.of(Rows(Z, np.zeros((len(Z), 1)), None), basis).factor


def test_a_run_left_out_of_a_space_filling_design_misses_more_than_a_fresh_point():
    fresh = np.random.default_rng(7).uniform(-1, 1, size=(1000, 2))
    ratios = {}
    for name, Z in {
        "sobol": 2 * qmc.Sobol(2, seed=1).random(128) - 1,
        "random": np.random.default_rng(3).uniform(-1, 1, size=(128, 2)),
    }.items():
        basis, factor = system(Z, 8)
        ratios[name] = fresh_to_left_out(basis, factor, Z, fresh, np.random.default_rng(0))
    assert 0.6 < ratios["sobol"] < 0.95
    assert ratios["sobol"] < ratios["random"] <= 1


def test_with_many_runs_one_hardly_matters():
    Z = 2 * qmc.Sobol(2, seed=1).random(1024) - 1
    basis, factor = system(Z, 2)
    assert fresh_to_left_out(basis, factor, Z, Z[:100], np.random.default_rng(0)) == 1.0


def test_the_ratio_is_one_at_most():
    assert fresh_ratio(np.ones((10, 3)), np.full((10, 3), 2.0)) == 0.5
    assert fresh_ratio(np.ones((10, 3)), np.full((10, 3), 0.5)) == 1.0


def test_folds_scale_what_was_not_calibrated():
    """A predictor that errs by a normal law and claims a thousandth of it."""
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(2000, 1))
    noise = rng.normal(size=2000)
    problem = Problem.of(TrainingData(X=X, Y=noise))

    def train(part, _):
        assert len(part.Z) == 1500
        return lambda Z: (np.zeros((len(Z), 1)), np.full((len(Z), 1), 1e-3))

    factor = cross_calibrated(problem, train, np.random.default_rng(1))
    assert factor == pytest.approx(1e3, rel=0.06)
