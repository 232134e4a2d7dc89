"""Intervals hold as often as they say: a small version of `benchmarks/coverage.py`, truths in closed form."""

import numpy as np
import pytest

from benchmarks import coverage as benchmark
from tensegra.analysis import FunctionModel, propagate

# An interval that holds in 95 of 100 holds in fewer than 32 of 40 once in 5,000 times.
REPEATS, FEWEST = 40, 32 / 40
SAMPLES = 1024
CASES = (*benchmark.SMOOTH, *benchmark.counted(SAMPLES))


@pytest.mark.parametrize("method", ["monte_carlo", "quasi_monte_carlo"])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_intervals_hold(case, method):
    found = benchmark.coverage(case, method, SAMPLES, REPEATS)
    assert min(found.values()) >= FEWEST, found


@pytest.mark.parametrize("seed", range(3))
def test_value_and_interval_have_one_divisor(seed):
    # Quasi-random points know a variance to far better than 1/n, so that a wrong divisor lies outside.
    model = FunctionModel(lambda X: X[:, 0], ("x",), ("y",))
    std = (
        propagate(model, {"x": {"uniform": [0, 1]}}, samples=4096, method="quasi_monte_carlo", seed=seed)
        .outputs["y"]
        .std
    )
    assert std.low <= std.value <= std.high
    assert std.low <= 12**-0.5 <= std.high


def test_replicates_that_agree_have_a_width_and_the_right_value():
    model = FunctionModel(lambda X: (X > 0.5).sum(axis=1), tuple("abc"), ("y",))
    laws = {name: {"uniform": [0, 1]} for name in "abc"}
    found = propagate(model, laws, samples=256, method="quasi_monte_carlo").outputs["y"]
    for estimate, truth in ((found.mean, 1.5), (found.std, 0.75**0.5)):
        assert estimate.value == pytest.approx(truth, rel=1e-6)
        assert estimate.low < truth < estimate.high


def test_a_constant_output_is_known():
    model = FunctionModel(lambda X: 0 * X[:, 0] + 2.5, ("x",), ("y",))
    for method in ("monte_carlo", "quasi_monte_carlo"):
        found = propagate(model, {"x": {"uniform": [0, 1]}}, samples=64, method=method).outputs["y"]
        assert (found.mean.low, found.mean.value, found.mean.high) == (2.5, 2.5, 2.5)
        assert (found.std.low, found.std.value, found.std.high) == (0, 0, 0)


def test_the_skewness_of_few_events_is_in_the_interval():
    # 4 events of 1,000: the interval reaches further up than down.
    values = np.zeros(1000)
    values[:4] = [1, 1, 1, 2]
    model = FunctionModel(lambda X: values[np.arange(len(X))], ("x",), ("y",))
    found = propagate(model, {"x": {"uniform": [0, 1]}}, samples=1000).outputs["y"].mean
    assert 0 < found.low < found.value < found.high
    assert found.high - found.value > 1.5 * (found.value - found.low)
