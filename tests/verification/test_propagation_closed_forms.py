"""Propagation against closed forms, and its intervals against the rate at which they must cover."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, propagate

# y = 1 + 2a − 3b with a ~ N(1, 2), b ~ N(−1, 0.5): mean 6, variance 16 + 2.25.
LINEAR = FunctionModel(lambda X: 1 + X @ [2.0, -3.0], ("a", "b"), ("y",))
LAWS = {"a": stats.norm(1, 2), "b": stats.norm(-1, 0.5)}
TRUTH = stats.norm(6, np.sqrt(16 + 2.25))

# Of 200 intervals of 95 %, a binomial number covers: 190 ± 3.1. Four deviations on the low side; on the high
# side all may, since order statistics and Clopper-Pearson intervals are conservative by construction.
REPEATS, FEWEST = 200, 178


def estimates(result):
    return {
        "mean": (result.outputs["y"].mean, TRUTH.mean()),
        "std": (result.outputs["y"].std, TRUTH.std()),
        "median": (result.outputs["y"].q50, TRUTH.ppf(0.5)),
        "upper quartile": (result.outputs["y"].q75, TRUTH.ppf(0.75)),
        "95 % quantile": (result.quantile("y", 0.95), TRUTH.ppf(0.95)),
        "exceedance": (result.exceedance("y", 10.0), TRUTH.sf(10.0)),
    }


@pytest.mark.parametrize("method", ["monte_carlo", "quasi_monte_carlo"])
def test_intervals_cover_the_truth_as_often_as_they_say(method):
    covered = dict.fromkeys(estimates(propagate(LINEAR, LAWS, samples=10)), 0)
    for seed in range(REPEATS):
        result = propagate(LINEAR, LAWS, samples=256, method=method, seed=seed)
        for name, (estimate, truth) in estimates(result).items():
            covered[name] += estimate.low <= truth <= estimate.high
    assert min(covered.values()) >= FEWEST, covered


def test_the_interval_of_the_deviation_holds_for_a_skewed_law():
    # The textbook χ² interval supposes a normal law and covers an exponential one in only some 75 of 100
    # cases.
    model = FunctionModel(lambda X: X[:, 0], ("a",), ("y",))
    covered = 0
    for seed in range(REPEATS):
        std = propagate(model, {"a": stats.expon()}, samples=1000, seed=seed).outputs["y"].std
        covered += std.low <= 1.0 <= std.high
    assert covered >= 174  # the fourth moment of so skewed a law is itself estimated: some 93 %


def test_quasi_monte_carlo_is_closer_and_knows_it():
    methods = ("monte_carlo", "quasi_monte_carlo")
    plain, even = (propagate(LINEAR, LAWS, samples=4096, method=m).outputs["y"].mean for m in methods)
    assert abs(even.value - 6) < 4e-3  # 32 sets of 128 points; independent samples err by 0.03
    assert even.high - even.low < (plain.high - plain.low) / 10


def test_the_mean_converges_at_the_rate_of_monte_carlo():
    def error(n):
        found = [propagate(LINEAR, LAWS, samples=n, seed=seed).outputs["y"].mean.value for seed in range(40)]
        return np.sqrt(np.mean((np.array(found) - 6) ** 2))

    sizes = [2**k for k in (8, 10, 12, 14)]
    slope = np.polyfit(np.log(sizes), np.log([error(n) for n in sizes]), 1)[0]
    assert_allclose(slope, -0.5, atol=0.1)  # 40 repeats know each error to 11 %, the slope to 0.05


def test_the_papers_exponential_error_through_a_linear_model():
    # A = 0.1 − φ, φ exponential of mean 0.001: w = 500 A has mean 49.5, deviation 0.5, and a lower tail.
    box = np.array([[0.09, 0.1]] * 2)
    model = FunctionModel(lambda X: 250 * X.sum(axis=1), ("A14", "A23"), ("w",), box)
    law = {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}}
    inputs = {"A14": law, "A23": {"same_as": "A14"}}
    result = propagate(model, inputs, samples=2**14, method="quasi_monte_carlo")
    w = result.outputs["w"]
    assert_allclose([w.mean.value, w.std.value, w.q50.value], [49.5, 0.5, 50 - 0.5 * np.log(2)], rtol=5e-3)
    assert w.maximum <= 50.0
    assert_allclose(result.n_outside / result.n_samples, np.exp(-10), atol=2e-4)  # P(φ > 0.01)
