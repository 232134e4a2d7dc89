import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, robust_optimise
from tensegra.analysis.measure import Measure
from tensegra.analysis.model import central_differences
from tensegra.analysis.problem import state_problem
from tensegra.analysis.robust import RobustModel
from tensegra.analysis.scatter import scatter
from tensegra.errors import StudyError

BOX = np.array([[-2.0, 2.0], [-2.0, 2.0]])
HILL = FunctionModel(
    lambda X: np.stack([1 - X[:, 0] ** 2 + 0.3 * X[:, 1], X[:, 0] + X[:, 1]], axis=1),
    ("a", "b"),
    ("w", "v"),
    BOX,
    lambda X: np.stack(
        [
            np.stack([-2 * X[:, 0], np.full(len(X), 0.3)], axis=1),
            np.ones((len(X), 2)),
        ],
        axis=1,
    ),
    units={"w": "cm"},
)
NORMAL = {"normal": {"mean": 0.0, "std": 0.1}}
# Of a quantile or a std by 64 evenly spread draws.
BY_DRAWS = 0.02


@given(
    order=st.permutations(range(12)),
    slopes=arrays(float, (2, 12, 3), elements=st.floats(-5, 5)),
    kappa=st.none() | st.floats(0, 3),
)
def test_the_slope_of_a_statistic_is_that_of_its_values(order, slopes, kappa):
    outcomes = np.array([order, order[::-1]]) ** 1.5  # apart, so that none overtakes another
    measure = Measure(kappa, None if kappa is not None else 0.23)
    step = 1e-6
    for i in range(3):
        ahead, behind = (measure.value(outcomes + sign * step * slopes[:, :, i]) for sign in (1, -1))
        found = measure.slope(outcomes, slopes)[:, i]
        assert_allclose(found, (ahead - behind) / (2 * step), rtol=1e-4, atol=1e-5)


def test_the_slope_of_a_robust_model_is_that_of_its_values():
    problem = state_problem(HILL, "w * v", constraints=["v <= 1"], maximise=False)
    around = scatter(HILL, {"a": NORMAL, "b": {"same_as": "a"}})
    box = dict(zip(("a", "b"), BOX.tolist(), strict=True))
    formulas = (problem.objective, problem.constraints[0].margin)
    model = RobustModel(around, formulas, (-1.0, 1.0), Measure(1.5, None), around.draw(16, 1), box)
    X = np.random.default_rng(1).uniform(-1, 1, (5, 2))
    assert_allclose(model.gradient(X), central_differences(model, X), rtol=1e-3, atol=1e-4)


def test_mean_and_std_of_a_linear_objective_are_exact():
    found = robust_optimise(
        HILL, "v", errors={"a": NORMAL}, kappa=2.0, bounds={"a": [0, 1], "b": [0, 1]}, starts=4, samples=256
    )
    assert_allclose(found.robust.x, [1.0, 1.0], atol=1e-6)
    assert_allclose(found.robust.objective, 2.0 - 2.0 * 0.1, atol=BY_DRAWS)
    assert_allclose(found.nominal.objective, 2.0, atol=1e-6)
    assert_allclose(found.spreads["robust"].outputs["v"].std.value, 0.1, rtol=0.05)


def test_a_limit_is_kept_with_the_probability_asked_for():
    # The greatest w subject to v <= 0 in nine of ten cases: 1 − a² + 0.3 b with a + b + e <= 0.
    found = robust_optimise(
        HILL, "w", errors={"a": NORMAL}, constraints=["v <= 0"], quantile=0.1, starts=6, samples=2000
    )
    assert_allclose(found.kept("robust", "v <= 0").value, 0.9, atol=BY_DRAWS)
    assert_allclose(found.kept("nominal", "v <= 0").value, 0.5, atol=BY_DRAWS)
    assert_allclose(found.robust.x.sum(), -0.1 * stats.norm.ppf(0.9), atol=BY_DRAWS)
    assert found.measure == "10 % quantile of w"
    assert found.success


def test_where_less_is_better_the_statistic_lies_above():
    found = robust_optimise(
        HILL, "a ** 2", errors={"a": NORMAL}, quantile=0.1, maximise=False, starts=4, samples=64
    )
    assert found.measure == "90 % quantile of a ** 2"
    # |e| is below 0.1 · z(0.95) in nine of ten cases.
    assert_allclose(found.robust.objective, (0.1 * stats.norm.ppf(0.95)) ** 2, rtol=0.15)
    assert found.robust.objective > found.nominal.objective


def test_random_inputs_are_not_designed():
    found = robust_optimise(HILL, "w", inputs={"b": {"uniform": [-1, 1]}}, starts=4, samples=64)
    assert found.robust.input_names == ("a",)
    assert_allclose(found.robust.x, [0.0], atol=1e-4)
    assert_allclose(found.nominal.objective, 1.0, atol=1e-6)  # b at its median
    assert found.laws["a"] == "0"


def test_the_true_model_tells_what_really_comes_of_it():
    shifted = FunctionModel(lambda X: HILL.function(X) - 0.5, ("a", "b"), ("w", "v"), BOX, name="truth")
    found = robust_optimise(
        HILL, "w + v", errors={"a": NORMAL}, constraints=["v <= 1"], starts=4, samples=128, true_model=shifted
    )
    for spread in found.spreads.values():
        means = [part.outputs["w + v"].mean.value for part in (spread, spread.other)]
        assert_allclose(means[0] - means[1], 1.0, atol=1e-9)
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert content["kind"] == "robust"
    assert content["kept"]["robust"]["v <= 1"]["value"] > 0.9
    assert "trace" not in content["robust"]
    assert {row["design"] for row in found.table()} == {"robust", "nominal"}


def test_a_design_that_a_draw_fails_at_is_none():
    edge = FunctionModel(lambda X: np.where(X[:, 0] > 1.0, np.nan, X[:, 0]), ("a", "b"), ("w",), BOX)
    found = robust_optimise(edge, "w", errors={"a": {"uniform": [-0.1, 0.1]}}, starts=12, samples=256)
    assert found.spreads["robust"].n_failed <= 1  # the samples reach a hair further than the draws
    assert 0.6 < found.robust.inputs["a"] <= 0.905
    assert found.nominal.inputs["a"] <= 1.0


@pytest.mark.slow
def test_bayesian_search_takes_the_statistic_for_an_output():
    found = robust_optimise(HILL, "w", errors={"a": NORMAL}, method="bayesian", evaluations=15, samples=64)
    assert_allclose(found.robust.x, [0.0, 2.0], atol=0.1)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"errors": {"c": NORMAL}}, "errors: found 'c', expected one of a, b"),
        (
            {"errors": {"a": NORMAL}, "inputs": {"a": NORMAL}},
            "inputs: found 'a', expected an input that is not searched",
        ),
        ({"inputs": {"a": NORMAL, "b": NORMAL}}, "nothing is searched"),
        ({}, "nothing scatters"),
        ({"errors": {"a": NORMAL}, "kappa": 1, "quantile": 0.1}, "one of them"),
        ({"errors": {"a": NORMAL}, "quantile": 1.5}, "a share between 0 and 1"),
        ({"errors": {"a": NORMAL}, "kappa": -1}, "not below 0"),
        ({"errors": {"a": NORMAL}, "constraints": ["v == 0"]}, "errors break any equality"),
        ({"errors": {"a": NORMAL}, "method": "direct"}, "slsqp, bfgs or bayesian"),
        ({"errors": {"a": NORMAL}, "bounds": {"x": [0, 1]}}, "bounds: found 'x', expected one of a, b"),
        ({"errors": {"a": NORMAL}, "bounds": {"a": [1, 1]}}, "room between the bounds"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        robust_optimise(HILL, "w", starts=2, samples=16, **arguments)


def test_a_surrogates_box_is_narrowed_by_the_errors():
    from tensegra.surrogate import fit

    X = np.random.default_rng(0).uniform(-1, 1, (60, 2))
    pce = fit((X, X @ [1.0, 2.0]), "pce", validation=None)
    found = robust_optimise(pce, "y1", errors={"x1": {"uniform": [-0.2, 0.1]}}, starts=4, samples=64)
    low, high = pce.bounds[0]
    assert_allclose(found.robust.bounds[0], [low + 0.2, high - 0.1], atol=0.01)
    assert found.spreads["robust"].n_outside == 0
    assert_allclose(found.robust.inputs["x1"], high - 0.1, atol=0.01)
