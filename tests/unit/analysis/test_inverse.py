import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, reach
from tensegra.errors import StudyError

BOX = np.array([[0.0, 1.5], [0.0, 3.0]])


def arm(X):
    a, b = X.T
    return np.stack([np.cos(a) + np.cos(a + b), np.sin(a) + np.sin(a + b)], axis=1)


def arm_slope(X):
    a, b = X.T
    s, c = np.sin(a + b), np.cos(a + b)
    return np.stack([np.stack([-np.sin(a) - s, -s], axis=1), np.stack([np.cos(a) + c, c], axis=1)], axis=1)


ARM = FunctionModel(arm, ("a", "b"), ("x", "y"), BOX, arm_slope, name="arm")
STIFF = FunctionModel(
    lambda X: X[:, 0] + 2 * X[:, 1] - X[:, 2], ("a", "b", "c"), ("w",), np.array([[0.0, 1.0]] * 3)
)


def test_a_trajectory_is_followed_without_jumps():
    way = np.linspace(1.6, 0.8, 9)
    path = reach(ARM, {"x": way, "y": 1.0})
    assert path.success
    assert_allclose(path.outputs, np.stack([way, np.ones(9)], axis=1), atol=1e-4)
    assert_allclose(arm(path.x), path.outputs)
    assert np.abs(np.diff(path.x, axis=0)).max() < 0.3
    assert_allclose(path.low, path.outputs)  # nothing scatters
    assert path.reason == "9 of 9 waypoints reached"


def test_of_many_solutions_the_nearest_is_taken():
    # a + 2 b − c = w of least change: along (1, 2, −1), as long as the bounds leave it.
    path = reach(STIFF, {"w": [0.3, 0.6]})
    assert_allclose(path.x[0], [0.06, 0.12, 0.0], atol=1e-4)  # c may not fall below 0
    assert_allclose(path.x[1], [0.12, 0.24, 0.0], atol=1e-4)


def test_out_of_reach_is_told():
    path = reach(ARM, {"x": [1.0, 3.0], "y": [1.0, 0.0]})
    assert path.reached.tolist() == [True, False]
    assert not path.success
    assert "1 of 2 waypoints reached" in path.reason
    assert_allclose(path.outputs[1], [2.0, 0.0], atol=1e-3)


def test_the_interval_is_that_of_the_errors():
    error = {"normal": {"mean": 0.0, "std": 0.01}}
    path = reach(STIFF, {"w": [0.5, 1.0]}, errors={"a": error, "b": {"same_as": "a"}}, samples=4096)
    half = 0.03 * stats.norm.ppf(0.95)
    assert_allclose(path.low, path.outputs - half, rtol=1e-2)
    assert_allclose(path.high, path.outputs + half, rtol=1e-2)
    independent = reach(STIFF, {"w": 0.5}, errors={"a": error, "b": error}, samples=4096)
    half = 0.01 * np.sqrt(5) * stats.norm.ppf(0.95)
    assert_allclose(independent.high, independent.outputs + half, rtol=1e-2)


def test_an_output_without_target_at_a_waypoint_is_free():
    path = reach(ARM, {"x": [1.0, 1.2], "y": [1.0, np.nan]})
    assert path.success
    assert_allclose(path.outputs[:, 0], [1.0, 1.2], atol=1e-4)
    assert json.loads(json.dumps(path.to_dict(), allow_nan=False))["targets"][1] == [1.2, None]


def test_constraints_are_kept_along_the_way():
    path = reach(STIFF, {"w": [0.5, 1.0]}, constraints=["b <= 0.1 + 0.1 * a"])
    assert path.success
    assert np.all(path.x[:, 1] <= 0.1 + 0.1 * path.x[:, 0] + 1e-3)
    blocked = reach(STIFF, {"w": 2.0}, constraints=["a + b <= 0.5"])
    assert not blocked.success


def test_where_the_way_is_blocked_another_branch_is_taken():
    def hole(X):
        return np.where(np.abs(X[:, 0] - 0.5) < 0.05, np.nan, X[:, 0] + 0.5 * X[:, 1])

    model = FunctionModel(hole, ("a", "b"), ("w",), np.array([[0.0, 1.0], [0.0, 0.2]]))
    path = reach(model, {"w": [0.3, 0.9]}, starts=30)
    assert path.success
    assert path.x[0, 0] < 0.45
    assert path.x[1, 0] > 0.55


def test_where_the_true_model_misses_it_is_aimed_again():
    """The surrogate is off and its slopes are wrong by a tenth: each step leaves a tenth of the miss."""
    off = FunctionModel(lambda X: 1.1 * arm(X) + 0.01, ("a", "b"), ("x", "y"), BOX, name="truth")
    error = {"normal": {"mean": 0.0, "std": 0.001}}
    path = reach(ARM, {"x": [1.2, 1.4], "y": 1.2}, errors={"a": error}, true_model=off)
    assert path.success
    assert path.true_status == ("evaluated", "evaluated")
    assert_allclose(path.true_outputs, [[1.2, 1.2], [1.4, 1.2]], atol=min(path.tolerance))
    assert_allclose(path.true_outputs, off.evaluate(path.x).values)
    assert_allclose(path.outputs, arm(path.x))
    assert ((path.low < path.true_outputs) & (path.true_outputs < path.high)).all()
    row = path.table()[1]
    assert (row["waypoint"], row["x target"], row["reached"]) == (2, 1.4, True)


def test_what_the_true_model_cannot_reach_is_told_with_its_nearest():
    """The surrogate claims all of 2; the truth has 1.8 at most."""
    short = FunctionModel(lambda X: 0.9 * arm(X), ("a", "b"), ("x", "y"), BOX, name="truth")
    path = reach(ARM, {"x": [1.0, 1.95], "y": [1.0, 0.0]}, true_model=short)
    assert path.reached.tolist() == [True, False]
    assert path.true_outputs[1, 0] == pytest.approx(1.8, abs=1e-2)
    assert "at most x by 0.15" in path.reason


def test_a_condition_is_kept_by_the_true_model_too():
    """The surrogate takes the load for a tenth less than it is."""
    names = ("w", "load")
    box = np.array([[0.0, 1.0]] * 2)
    light = FunctionModel(lambda X: np.stack([X.sum(axis=1), 0.9 * X[:, 0]], axis=1), ("a", "b"), names, box)
    true = FunctionModel(lambda X: np.stack([X.sum(axis=1), X[:, 0]], axis=1), ("a", "b"), names, box)
    path = reach(light, {"w": 1.3}, constraints=["load <= 0.4"], true_model=true)
    assert path.success
    assert path.x[0, 0] <= 0.4 + 1e-3


def test_a_surrogates_own_error_widens_the_interval():
    from tensegra.surrogate import fit

    rng = np.random.default_rng(0)
    X = rng.uniform(0, 1, (40, 2))
    noisy = fit((X, X @ [1.0, 2.0] + 0.05 * rng.standard_normal(40)), "pce", degree=1, validation=None)
    path = reach(noisy, {"y1": 1.5})
    assert path.success
    assert 0.05 < float((path.high - path.low)[0, 0]) < 0.4


def test_inputs_that_are_not_designed_stand_where_they_are():
    path = reach(STIFF, {"w": 1.0}, inputs={"c": 0.5})
    assert path.input_names == ("a", "b")
    assert_allclose(path.x @ [1.0, 2.0], [1.5], atol=1e-3)
    scattered = reach(STIFF, {"w": 1.0}, inputs={"c": {"uniform": [0.4, 0.6]}}, samples=512)
    assert_allclose([scattered.low[0, 0], scattered.high[0, 0]], [0.91, 1.09], atol=5e-3)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"targets": {}}, "a target for at least one output"),
        ({"targets": {"z": 1.0}}, "found 'z'"),
        ({"targets": {"x": [1.0, 2.0], "y": [1.0, 2.0, 3.0]}}, "one finite number, or 3"),
        ({"targets": {"x": np.inf}}, "one finite number"),
        ({"targets": {"x": 1.0}, "tolerance": -1.0}, "a positive number"),
        ({"targets": {"x": 1.0}, "constraints": ["y == 1"]}, "an equality is a target"),
        ({"targets": {"x": 1.0}, "bounds": {"q": [0, 1]}}, "bounds: found 'q', expected one of a, b"),
        (
            {"targets": {"x": 1.0}, "inputs": {"a": True}},
            "inputs.a: found True, expected a distribution, a number",
        ),
    ],
)
def test_nonsense_is_refused(arguments, told):
    targets = arguments.pop("targets")
    with pytest.raises(StudyError, match=told):
        reach(ARM, targets, **arguments)


def test_a_model_that_fails_everywhere_is_told():
    dead = FunctionModel(lambda X: np.full(len(X), np.nan), ("a",), ("y",), np.array([[0.0, 1.0]]))
    with pytest.raises(StudyError, match="failed at all of the 20 starts"):
        reach(dead, {"y": 1.0})
