import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from tensegra.analysis import FunctionModel, morris_screening
from tensegra.errors import StudyError

BOX = np.array([[0.0, 1.0], [-1.0, 3.0], [0.0, 1.0]])
LINEAR = FunctionModel(
    lambda X: np.stack([3 * X[:, 0] - 2 * X[:, 1], X[:, 2]], axis=1), ("a", "b", "c"), ("y", "z"), BOX
)


def test_of_a_linear_model_the_effects_are_its_slopes_over_the_range():
    found = morris_screening(LINEAR, seed=3)
    effects = found.effects["y"]
    assert_allclose(effects.mu, [3.0, -8.0, 0.0], atol=1e-12)
    assert_allclose(effects.mu_star, [3.0, 8.0, 0.0], atol=1e-12)
    assert_allclose(effects.sigma, 0.0, atol=1e-7)
    assert found.ranking("y") == ("b", "a", "c")
    assert found.n_runs == 20 * 4
    assert found.effects["z"].mu_star.argmax() == 2


def test_sigma_tells_an_interaction():
    product = FunctionModel(lambda X: X[:, 0] * X[:, 2], ("a", "b", "c"), ("y",), BOX)
    effects = morris_screening(product, trajectories=50).effects["y"]
    assert effects.sigma[0] > 0.3
    assert_allclose(effects.mu_star[0], 0.5, atol=0.1)  # the mean of c over the grid
    assert_allclose(effects.mu_star[1], 0.0, atol=1e-12)


def test_a_trajectory_with_a_failed_run_is_dropped_and_reported():
    holed = FunctionModel(
        lambda X: np.where(X[:, 0] * X[:, 2] >= 1.0, np.nan, X[:, 1]), ("a", "b", "c"), ("y",), BOX
    )
    found = morris_screening(holed, trajectories=40)
    assert 0 < found.n_trajectories < 40
    assert_allclose(found.share_dropped, 1 - found.n_trajectories / 40)
    assert found.statuses == {"evaluated": found.n_runs - found.n_failed, "failed": found.n_failed}
    assert_allclose(found.effects["y"].mu_star, [0.0, 4.0, 0.0], atol=1e-12)


def test_where_hardly_any_survives_there_are_no_effects():
    dead = FunctionModel(lambda X: np.full(len(X), np.nan), ("a", "b", "c"), ("y",), BOX)
    effects = morris_screening(dead, trajectories=5).effects["y"]
    assert np.isnan(effects.mu_star).all()
    assert "only 0 trajectories" in effects.reason


def test_infinite_laws_are_cut_and_ties_count_as_one():
    found = morris_screening(LINEAR, {"a": stats.norm(0, 1), "b": {"same_as": "a"}, "c": 0.5}, outputs=["y"])
    assert found.input_names == ("a",)
    width = stats.norm.ppf(0.99) - stats.norm.ppf(0.01)
    # Of a normal law the elementary effects differ: the quantiles are no straight line.
    assert 0.5 * width < found.effects["y"].mu[0] < width


def test_the_same_seed_gives_the_same_and_json_can_hold_it():
    one, two = (morris_screening(LINEAR, trajectories=6, seed=4) for _ in range(2))
    assert_array_equal(one.effects["y"].mu_star_half, two.effects["y"].mu_star_half)
    assert json.loads(json.dumps(one.to_dict(), allow_nan=False))["kind"] == "morris"
    assert [row["input"] for row in one.table()] == ["a", "b", "c"] * 2
    assert "b > a > c" in str(one)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"trajectories": 3}, "4 or more"),
        ({"levels": 3}, "an even number"),
        ({"outputs": ["x"]}, "found 'x'"),
        ({"inputs": {"d": 1.0}}, "a variable of the model"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        morris_screening(LINEAR, **arguments)
