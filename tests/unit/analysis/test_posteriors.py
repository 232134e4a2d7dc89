"""Posteriors of every shape beside those of a grid: tails, curves, peaks, ends."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, calibrate
from tensegra.analysis.priors import prior_of
from tensegra.study.distributions import as_distribution
from tensegra.surrogate import fit

NORMAL = {"normal": {"mean": 0, "std": 1}}
# Of 3,200 draws: means to 5 % of a deviation, deviations to 5 %.
WITHIN = 0.05


def compared(found, grid_mean, grid_std):
    mean, std = (np.array([getattr(p, key) for p in found.parameters]) for key in ("mean", "std"))
    assert_allclose((mean - grid_mean) / grid_std, 0.0, atol=WITHIN)
    assert_allclose(std, grid_std, rtol=WITHIN)


@pytest.mark.parametrize("measured", [7.5, -7.5, 9.0, -9.0, 12.0, -12.0, 30.0, -30.0])
def test_both_tails_of_a_prior_reach_as_far(measured):
    line = FunctionModel(lambda X: X[:, 0] + 0.0 * X[:, 1], ("a", "x"), ("y",))
    data = {"x": [0.0, 0.3, 0.6, 1.0], "y": [measured] * 4, "y_std": [0.2] * 4}
    found = calibrate(line, data, inputs={"a": NORMAL})
    compared(found, measured * 100 / 101, 101**-0.5)
    assert found.success


LAWS = [
    NORMAL,
    {"lognormal": {"mean": 1, "std": 0.5}},
    {"exponential": {"mean": 1}},
    {"exponential": {"mean": 1, "reflected": True}},
    stats.logistic(),
    stats.gumbel_r(),
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: getattr(getattr(law, "dist", None), "name", str(law)))
def test_the_normal_space_of_a_prior_has_both_of_its_tails(law):
    model = FunctionModel(lambda X: X[:, 0], ("a",), ("y",))
    law = as_distribution(law) if isinstance(law, dict) else law
    z = np.array([[-12.0], [-8.5], [-3.0], [0.0], [3.0], [8.5], [12.0]])
    x = prior_of(model, (), {"a": law}).values(z)[0][:, 0]
    exact = getattr(law, "_law", law)
    assert np.all(np.diff(x) > 0)
    below, above = z[:, 0] <= 0, z[:, 0] > 0
    assert_allclose(exact.ppf(stats.norm.cdf(z[below, 0])), x[below], rtol=1e-9)
    assert_allclose(exact.isf(stats.norm.sf(z[above, 0])), x[above], rtol=1e-9)


def test_a_posterior_at_the_end_of_its_prior_is_said():
    model = FunctionModel(lambda X: X[:, 0] + 0.0 * X[:, 1], ("a", "b"), ("y",))
    inputs = {"a": {"uniform": [0, 1]}, "b": NORMAL}
    for y, side in ((2.0, "upper"), (-1.0, "lower")):
        found = calibrate(model, {"y": [y], "y_std": [0.05]}, inputs=inputs, draws=100)
        assert f"the posterior of a lies at the {side} end of its prior" in found.reason
        assert "posterior of b" not in found.reason
    inside = calibrate(model, {"y": [0.5], "y_std": [0.05]}, inputs=inputs, draws=100)
    assert inside.notes == ()


def test_a_posterior_outside_the_surrogates_box_is_said():
    X = np.random.default_rng(0).uniform(-1, 1, (60, 2))
    pce = fit((X, X[:, 0] + 0.1 * X[:, 1]), "pce", validation=None)
    laws = {"x1": {"normal": {"mean": 0, "std": 2}}, "x2": {"uniform": [-1, 1]}}
    found = calibrate(pce, {"y1": [3.0], "y1_std": [0.1]}, inputs=laws, draws=100)
    assert "100 % of the posterior of x1 lies outside the surrogate's box" in found.reason
    assert "of x2 lies outside" not in found.reason


def ridge(sigma, y):
    """Mean and standard deviation of a and b with normal priors where a + b² was measured, on a grid."""
    a, b = np.linspace(-7, 7, 2801)[:, None], np.linspace(-4, 4, 1601)
    log_p = -0.5 * (a**2 + b**2) - 0.5 * ((a + b**2 - y) / sigma) ** 2
    weight = np.exp(log_p - log_p.max())
    weight /= weight.sum()
    means = np.array([(weight * a).sum(), (weight * b).sum()])
    return means, np.sqrt([(weight * (a - means[0]) ** 2).sum(), (weight * (b - means[1]) ** 2).sum()])


@pytest.mark.parametrize("sigma", [0.5, 0.1])
@pytest.mark.parametrize("y", [1.0, 4.0])
def test_a_curved_posterior_is_that_of_a_grid(sigma, y):
    model = FunctionModel(lambda X: X[:, 0] + X[:, 1] ** 2, ("a", "b"), ("y",))
    found = calibrate(model, {"y": [y], "y_std": [sigma]}, inputs={"a": NORMAL, "b": NORMAL}, seed=3)
    compared(found, *ridge(sigma, y))
    assert found.success


@pytest.mark.parametrize(("middle", "sigma"), [(0.0, 0.05), (0.3, 0.05), (0.3, 0.01), (0.5, 0.2)])
def test_a_posterior_of_two_peaks_is_that_of_a_grid(middle, sigma):
    square = FunctionModel(lambda X: X[:, 0] ** 2, ("a",), ("y",))
    prior = {"normal": {"mean": middle, "std": 1}}
    found = calibrate(square, {"y": [1.0], "y_std": [sigma]}, inputs={"a": prior}, seed=1)
    a = np.linspace(-4, 4, 400_001)
    weight = np.exp(-0.5 * (a - middle) ** 2 - 0.5 * ((a**2 - 1) / sigma) ** 2)
    weight /= weight.sum()
    mean = weight @ a
    compared(found, mean, np.sqrt(weight @ (a - mean) ** 2))
    assert found.success


def test_no_easy_posterior_is_called_unconverged():
    line = FunctionModel(lambda X: X[:, 0], ("a",), ("y",))
    rng = np.random.default_rng(0)
    for seed in range(40):
        y, sigma = rng.normal(0, 1.2), rng.uniform(0.05, 2.0)
        found = calibrate(line, {"y": [y], "y_std": [sigma]}, inputs={"a": NORMAL}, seed=seed)
        assert found.success, found.reason
        precision = 1 + sigma**-2
        compared(found, y * sigma**-2 / precision, precision**-0.5)


def test_two_parameters_and_four_measurements_take_few_evaluations():
    rng = np.random.default_rng(1)
    X = rng.uniform([1, 0, 0], [3, 2, 5], (120, 3))
    gpr = fit((X, X[:, 1] + X[:, 2] / X[:, 0]), "gpr", validation=None)
    force = np.arange(1.0, 5.0)
    data = {"x3": force, "y1": 1.0 + force / 2.0 + [0.01, -0.02, 0.0, 0.01], "y1_std": [0.02] * 4}
    found = calibrate(gpr, data)
    assert found.success
    assert found.n_evaluations < 2_000_000  # of rows of the surrogate; chains asked for tens of millions
    assert_allclose(found.parameter("x1").mean, 2.0, atol=0.05)
