"""A search chooses what it is told to choose, and a discrete variable stays on its values."""

import itertools

import numpy as np
import pytest
from hanging import hanging, height
from numpy.testing import assert_allclose

from tensegra.analysis import FunctionModel, optimise, reach, robust_optimise
from tensegra.errors import StudyError
from tensegra.study.distributions import as_distribution
from tensegra.study.space import Space
from tensegra.study.variables import Variable
from tensegra.surrogate import fit

UNIFORM = {"uniform": [0.0, 0.1]}
VALUES = [0.0, 0.05, 0.1]
DISCRETE = {"discrete": {"values": VALUES, "probabilities": [0.2, 0.3, 0.5]}}


def space(**laws):
    return Space(tuple(Variable(name, "", "", as_distribution(law)) for name, law in laws.items()))


@pytest.fixture(scope="module")
def smooth(tmp_path_factory):
    study = hanging(UNIFORM)
    return study, fit(study.run(tmp_path_factory.mktemp("smooth")), "gpr")


@pytest.fixture(scope="module")
def stepped(tmp_path_factory):
    study = hanging(DISCRETE)
    return study, fit(study.run(tmp_path_factory.mktemp("stepped")), "gpr")


@pytest.mark.parametrize("which", [0, 1], ids=["study", "surrogate"])
def test_the_actuators_are_searched_and_the_rest_is_held_at_its_mean(smooth, which):
    best = optimise(smooth[which], "z", starts=4)
    assert best.search == ("A",)
    assert_allclose(best.held["E"], 100.0)
    assert_allclose([best.inputs["A"], best.objective], [0.1, height(0.1, 100.0)], rtol=1e-5)
    assert "held: E = 100" in str(best)


def test_what_is_named_is_searched(smooth):
    study, gpr = smooth
    best = optimise(gpr, "z", search=["E"], inputs={"A": 0.02}, starts=4)
    assert best.search == ("E",)
    assert_allclose([best.inputs["A"], best.inputs["E"]], [0.02, study.space.bounds[1, 1]])
    both = optimise(gpr, "z", search=["A", "E"], starts=4)
    assert_allclose(both.x, study.space.bounds[:, 1])
    assert both.held == {}
    by_bounds = optimise(gpr, "z", bounds={"E": [95, 105]}, starts=4)
    assert by_bounds.search == ("A", "E")
    assert_allclose(by_bounds.inputs["E"], 105)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"search": ["B"]}, "search: found 'B', expected one of A, E"),
        (
            {"search": ["A"], "inputs": {"A": 0.1}},
            "inputs: found 'A', expected an input that is not searched",
        ),
        (
            {"search": ["A"], "bounds": {"E": [95, 105]}},
            r"bounds: found 'E', expected an input that is searched",
        ),
        ({"inputs": {"A": 0.1}}, "nothing is searched"),
        ({"search": ["A"], "inputs": {"E": {"same_as": "A"}}}, "inputs.E.same_as"),
    ],
)
def test_what_cannot_be_searched_is_refused(smooth, options, told):
    for ask in (
        lambda: optimise(smooth[1], "z", starts=2, **options),
        lambda: reach(smooth[1], {"z": -1.0}, starts=2, **options),
        lambda: robust_optimise(smooth[1], "z", starts=2, **options),
    ):
        with pytest.raises(StudyError, match=told):
            ask()


def test_a_condition_on_what_is_held_is_refused(smooth):
    with pytest.raises(
        StudyError, match=r"found 'E <= 90', expected a condition that what is searched \(A\)"
    ):
        optimise(smooth[1], "z", constraints=["E <= 90"], starts=2)


def test_a_robust_design_keeps_the_laws_of_the_rest(smooth):
    study, gpr = smooth
    found = robust_optimise(gpr, "z", starts=4, samples=4096, true_model=study)
    assert found.search == ("A",)
    assert "normal" in found.laws["E"]
    spread = found.spreads["robust"].outputs["z"].std.value
    E = np.random.default_rng(0).normal(100, 5, 10**5)
    assert_allclose(spread, height(0.1, E).std(), rtol=0.02)


def test_the_intervals_of_a_trajectory_hold_the_scatter_of_the_rest(smooth):
    study, gpr = smooth
    path = reach(gpr, {"z": [-1.05]}, starts=4, samples=1024, true_model=study)
    assert path.input_names == ("A",)
    assert_allclose(path.held["E"], 100.0)
    A = path.x[0, 0]
    E = np.random.default_rng(0).normal(100, 5, 10**5)
    assert_allclose([path.low[0, 0], path.high[0, 0]], np.quantile(height(A, E), [0.05, 0.95]), atol=5e-4)
    assert path.success
    fixed = reach(gpr, {"z": [-1.05]}, starts=4, inputs={"E": 100.0})
    assert_allclose(fixed.x, path.x, atol=1e-5)


def test_a_correlated_rest_keeps_its_copula():
    joint = Space(
        tuple(
            Variable(n, q, "", as_distribution({"normal": [0, 1]}))
            for n, q in (("a", "actuator"), ("b", ""), ("c", ""))
        ),
        np.array([[1, 0, 0], [0, 1, 0.8], [0, 0.8, 1]]),
    )
    model = FunctionModel(
        lambda X: X[:, 0] + X[:, 1] + X[:, 2], ("a", "b", "c"), ("y",), np.array([[-1, 1]] * 3), space=joint
    )
    found = robust_optimise(model, "y", starts=3, samples=4096)
    rho = 2 * np.sin(np.pi * 0.8 / 6)
    assert_allclose(found.spreads["robust"].outputs["y"].std.value, np.sqrt(2 + 2 * rho), rtol=0.02)


@pytest.mark.parametrize("method", ["slsqp", "bfgs", "bayesian"])
def test_an_optimum_stands_on_a_value(stepped, method):
    options = {"starts": 6, "evaluations": 10}
    best = optimise(stepped[1], "(z + 1.03) ** 2", maximise=False, method=method, **options)
    assert best.inputs["A"] in VALUES
    assert best.inputs["A"] == min(VALUES, key=lambda A: abs(height(A, best.held["E"]) + 1.03))
    assert set(best.trace.x[:, 0]) <= set(VALUES)


def test_a_trajectory_stands_on_values_and_is_reached_where_the_truth_says_so(stepped):
    study, gpr = stepped
    path = reach(gpr, {"z": [-1.03, -1.045, -1.1]}, starts=5, true_model=study)
    assert set(path.x[:, 0]) <= set(VALUES)
    assert path.reached.tolist() == [False, True, True]
    assert "1 waypoints" not in path.reason
    assert "missed, at most z by 0.015" in path.reason


def test_a_robust_design_stands_on_a_value(stepped):
    found = robust_optimise(stepped[1], "(z + 1.03) ** 2", maximise=False, starts=3, samples=64)
    assert found.robust.inputs["A"] in VALUES


def test_what_is_held_of_a_discrete_law_is_one_of_its_values(stepped):
    best = optimise(stepped[1], "z", search=["E"], starts=2)
    assert best.held["A"] == 0.05  # its mean is 0.065


def integers(n, high):
    return space(
        **{f"n{i}": {"discrete": {"values": list(range(high + 1))}} for i in range(n)}, x={"uniform": [0, 5]}
    )


def bent(X):
    """Return a convex quadratic whose rounded minimum is not the best of the integer ones."""
    d = X.shape[1]
    Q = np.eye(d) + 0.45 * (np.eye(d, k=1) + np.eye(d, k=-1))
    r = X - (1.3 + 0.37 * np.arange(d))
    return np.einsum("ni,ij,nj->n", r, Q, r)


@pytest.mark.parametrize(("n", "high"), [(2, 4), (4, 5)], ids=["enumerated", "branched"])
def test_integers_are_as_good_as_the_best_of_all_combinations(n, high):
    names = (*(f"n{i}" for i in range(n)), "x")
    model = FunctionModel(bent, names, ("y",), np.array([[0, high]] * n + [[0, 5]]), space=integers(n, high))
    best = optimise(model, "y", maximise=False, starts=10)
    grid = np.array(list(itertools.product(*[range(high + 1)] * n, np.linspace(0, 5, 501))))
    assert_allclose(best.objective, bent(grid).min(), atol=1e-4)
    assert all(float(best.inputs[f"n{i}"]).is_integer() for i in range(n))
    # and the trajectory to the value that it has
    path = reach(model, {"y": best.objective}, starts=10)
    assert all(float(value).is_integer() for value in path.x[0, :n])


def test_bounds_that_leave_no_value_are_refused(stepped):
    with pytest.raises(StudyError, match="one of its values"):
        optimise(stepped[1], "z", bounds={"A": [0.01, 0.04]}, starts=2)
