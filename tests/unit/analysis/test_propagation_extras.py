import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import Draws, FunctionModel, propagate
from tensegra.errors import StudyError

MODEL = FunctionModel(lambda X: np.stack([X[:, 0], X[:, 0] - X[:, 1]], axis=1), ("a", "b"), ("y", "z"))
LAWS = {"a": stats.norm(0, 1), "b": stats.norm(0, 1)}


def test_quantiles_and_limits_stand_in_the_table():
    found = propagate(MODEL, LAWS, samples=20_000, quantiles=[0.9], limits={"y": [1.0, 2.0]}, seed=1)
    assert_allclose(found.quantiles()["y"][0.9].value, stats.norm.ppf(0.9), atol=0.03)
    exceeded = found.exceedances()
    assert list(exceeded) == ["y"]
    for limit, estimate in exceeded["y"].items():
        assert estimate.low < stats.norm.sf(limit) < estimate.high
    rows = {(row["output"], row["statistic"]) for row in found.table()}
    assert {("y", "quantile 0.9"), ("z", "quantile 0.9"), ("y", "P(> 1)"), ("y", "P(> 2)")} <= rows
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert set(content["exceedances"]["y"]) == {"1.0", "2.0"}
    assert content["quantiles"]["z"]["0.9"]["low"] < content["quantiles"]["z"]["0.9"]["high"]


def test_the_interval_of_a_limit_holds_whatever_failed_runs_did():
    holed = FunctionModel(lambda X: np.where(X[:, 0] > 2, np.nan, X[:, 0]), ("a",), ("y",))
    found = propagate(holed, {"a": stats.norm(0, 1)}, samples=5000, limits={"y": 1.0})
    estimate = found.exceedances()["y"][1.0]
    assert estimate.low < stats.norm.sf(1.0) < estimate.high
    assert estimate.high - estimate.low > stats.norm.sf(2.0)


def test_draws_of_one_source_are_drawn_by_rows():
    rng = np.random.default_rng(0)
    a = rng.standard_normal(500)
    source = object()
    tied = {"a": Draws(a, source), "b": Draws(a + 1.0, source)}
    for method in ("monte_carlo", "quasi_monte_carlo"):
        found = propagate(MODEL, tied, samples=2000, method=method)
        assert_allclose(found.outputs["z"].mean.value, -1.0)
        assert_allclose(found.outputs["z"].std.value, 0.0, atol=1e-12)
        assert_allclose(found.outputs["y"].mean.value, a.mean(), atol=0.1)
    other = propagate(MODEL, {"a": Draws(a, "one"), "b": Draws(a, "two")}, samples=4000)
    assert_allclose(other.outputs["z"].std.value, np.sqrt(2) * a.std(), rtol=0.1)
    assert found.laws["a"].startswith("500 draws of mean")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"quantiles": [1.0]}, "a probability between 0 and 1"),
        ({"limits": {"x": 1.0}}, "found 'x'"),
        ({"limits": {"y": np.inf}}, "finite numbers"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        propagate(MODEL, LAWS, samples=10, **arguments)


def test_samples_that_differ_by_rounding_alone_have_a_histogram():
    found = propagate(FunctionModel(lambda X: 1.0 + 1e-16 * X[:, 0], ("a",), ("y",)), {"a": stats.norm()})
    assert found.outputs["y"].histogram.counts.sum() == 10_000
