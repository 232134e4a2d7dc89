import json
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis import FunctionModel, SurrogateModel, optimise
from tensegra.analysis.problem import Recorder, state_problem
from tensegra.errors import StudyError
from tensegra.surrogate import fit

BOX = np.array([[0.0, 1.0], [0.0, 2.0]])
GRADIENT_METHODS = ("slsqp", "bfgs")

# What the methods leave of a smooth optimum in double precision: the square root of the rounding of the
# objective.
PLACE = 1e-6


def bowl(X):
    return (X[:, 0] - 0.3) ** 2 + 2 * (X[:, 1] - 1.5) ** 2


def model(function=bowl, **changes):
    return FunctionModel(function, ("a", "b"), ("y",), **{"bounds": BOX, "units": {"y": "cm"}, **changes})


def beam():
    """Return a stand-in for the beam: v changes its sign inside the box, w grows along it."""

    def function(X):
        a, b = X.T
        return np.stack([40 * (a - 0.4 * b) - 4 + 3 * a * b, 20 + 60 * a + 25 * b], axis=1)

    def derivative(X):
        a, b = X.T
        rows = [[40 + 3 * b, -16 + 3 * a], [np.full_like(a, 60.0), np.full_like(a, 25.0)]]
        return np.moveaxis(np.array(rows), 2, 0)

    return FunctionModel(function, ("a", "b"), ("v", "w"), BOX, derivative)


@pytest.mark.parametrize("method", GRADIENT_METHODS)
def test_a_bowl_is_found_from_every_start(method):
    best = optimise(model(), "y", maximise=False, method=method, starts=12)
    assert_allclose(best.x, [0.3, 1.5], atol=PLACE)
    assert best.success
    assert best.agreement.n_best == best.agreement.n_starts == 12
    assert best.agreement.unique
    assert best.inputs == {"a": best.x[0], "b": best.x[1]}


@pytest.mark.parametrize("method", GRADIENT_METHODS)
@pytest.mark.parametrize(
    ("constraints", "x"),
    [
        (("b <= 1",), [0.3, 1.0]),
        (("a + b == 1",), [0.0, 1.0]),
        (("a >= 0.5", "abs(b) <= 1.2"), [0.5, 1.2]),
        (("a ** 2 + b ** 2 <= 1",), None),
    ],
)
def test_constraints_hold_and_are_active_where_they_bind(method, constraints, x):
    best = optimise(model(), "y", constraints=constraints, maximise=False, method=method, starts=8)
    assert best.success
    assert min(best.margins.values()) > -1e-7
    if x is None:  # the stationary point of the Lagrangian on the circle
        a, b = best.x
        assert_allclose(a**2 + b**2, 1.0, atol=1e-7)
        assert_allclose(2 * (a - 0.3) * b, 4 * (b - 1.5) * a, atol=1e-5)
    else:
        assert_allclose(best.x, x, atol=1e-5)


@pytest.mark.parametrize("method", GRADIENT_METHODS)
def test_eq_12_is_reached_on_its_own_kink_and_told_not_to_be_unique(method):
    best = optimise(beam(), "abs(w) / (abs(v) + abs(w))", method=method, starts=30)
    assert best.objective > 1 - 1e-9
    assert abs(best.outputs["v"]) < 1e-6
    assert not best.agreement.unique
    assert "not unique" in best.reason


@pytest.mark.parametrize("method", GRADIENT_METHODS)
def test_the_well_posed_form_has_one_optimum(method):
    best = optimise(beam(), "w", constraints=("abs(v) <= 1",), method=method, starts=20)
    assert best.agreement.unique
    assert_allclose(best.x[1], 2.0, atol=PLACE)
    assert_allclose(abs(best.outputs["v"]), 1.0, atol=1e-6)
    assert list(best.margins) == ["abs(v) <= 1"]


def test_the_objective_may_use_variables_and_kinks_of_several_kinds():
    best = optimise(model(), "max(y, 0.2) + 0.1 * abs(a - 0.6) + min(b, 3)", maximise=False, starts=10)
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 2, 401)), -1).reshape(-1, 2)
    a, b = grid.T
    exact = np.min(np.maximum(bowl(grid), 0.2) + 0.1 * np.abs(a - 0.6) + b)
    assert exact - 5e-3 < best.objective <= exact + 1e-6


def test_the_trace_holds_every_evaluation_and_the_best_so_far():
    best = optimise(model(), "y", constraints=("b <= 1",), maximise=False, starts=5, seed=4)
    trace = best.trace
    n = best.n_evaluations
    assert_array_equal(trace.evaluation, np.arange(1, n + 1))
    assert_array_equal(trace.start[:5], range(5))
    assert trace.x.shape == (n, 2)
    assert_allclose(trace.objective, bowl(trace.x))
    assert_array_equal(trace.feasible, trace.x[:, 1] <= 1 + 1e-8)
    known = trace.best[np.isfinite(trace.best)]
    assert (np.diff(known) <= 0).all()
    assert known[-1] == best.objective


def test_the_same_seed_gives_the_same_search():
    one, two, three = (optimise(beam(), "w - v ** 2", starts=6, seed=seed) for seed in (1, 1, 2))
    assert_array_equal(one.trace.x, two.trace.x)
    assert one.trace.x.shape != three.trace.x.shape or (one.trace.x != three.trace.x).any()


@pytest.mark.parametrize("method", GRADIENT_METHODS)
def test_a_region_where_the_model_fails_is_walked_around(method):
    # The line search runs into the failed region; the optimum lies outside of it.
    holed = model(lambda X: np.where(X[:, 0] > 0.45, np.nan, bowl(X)))
    best = optimise(holed, "y", maximise=False, method=method, starts=20)
    assert_allclose(best.objective, 0.0, atol=1e-6)
    assert np.isnan(best.trace.objective).any()
    assert best.success


def test_a_model_that_always_fails_is_an_error_not_a_number():
    with pytest.raises(StudyError, match="gave no number at any of the 5 starting points"):
        optimise(model(lambda X: np.full(len(X), np.nan)), "y", starts=5)


def test_constraints_that_nothing_meets_are_told():
    for method in GRADIENT_METHODS:
        best = optimise(model(), "y", constraints=("a >= 2",), maximise=False, method=method, starts=4)
        assert not best.success
        assert "misses by least" in best.reason
        assert_allclose(best.inputs["a"], 1.0, atol=1e-6)
        assert_allclose(best.margins["a >= 2"], -1.0, atol=1e-6)
        assert best.agreement.n_best == 0


def test_the_optimum_is_solved_again_by_the_true_model():
    truth = FunctionModel(lambda X: bowl(X) + 0.25, ("a", "b"), ("y",), BOX)
    best = optimise(model(), "y", constraints=("b <= 1",), maximise=False, starts=5, true_model=truth)
    assert_allclose(best.gap, 0.25)
    assert_allclose(best.true_objective, best.objective + 0.25)
    assert best.true_status == "evaluated"
    assert best.true_feasible
    assert best.true_margins == best.margins
    assert_allclose(best.true_outputs["y"], best.true_objective)
    rows = {row["quantity"]: row for row in best.table()}
    assert_allclose(rows["y"]["difference"], 0.25)


def test_an_optimum_that_the_true_model_does_not_allow_is_told():
    shifted = FunctionModel(lambda X: bowl(X) + 0.1, ("a", "b"), ("y",), BOX)
    best = optimise(model(), "b", constraints=("y <= 0.05",), starts=6, true_model=shifted)
    assert_allclose(best.margins["y <= 0.05"], 0.0, atol=1e-6)
    assert_allclose(best.true_margins["y <= 0.05"], -0.1, atol=1e-6)
    assert best.true_feasible is False


def test_where_the_true_model_fails_there_is_a_status_and_no_gap():
    truth = FunctionModel(lambda X: np.full(len(X), np.nan), ("a", "b"), ("y",), BOX)
    best = optimise(model(), "y", maximise=False, starts=5, true_model=truth)
    assert (best.true_status, best.gap, best.true_outputs) == ("failed", None, None)


def test_a_true_model_of_other_inputs_is_refused():
    truth = FunctionModel(bowl, ("a", "c"), ("y",), BOX)
    with pytest.raises(StudyError, match="true_model"):
        optimise(model(), "y", starts=2, true_model=truth)


def test_a_surrogate_is_searched_in_its_box_and_knows_its_uncertainty():
    X = np.random.default_rng(0).random((80, 2)) * [1, 2]
    surrogate = fit((X, bowl(X)), "gpr", validation=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        best = optimise(surrogate, "y1", maximise=False, starts=10, true_model=SurrogateModel(surrogate))
    assert_allclose(best.x, [0.3, 1.5], atol=1e-2)
    assert best.outputs_std["y1"] >= 0
    assert_allclose(best.gap, 0.0, atol=1e-6)  # one point or a batch of them: other roundings in the kernel
    with pytest.raises(StudyError, match="trained in"):
        optimise(surrogate, "y1", bounds={"x1": [0.0, 1.5]}, starts=2)


def test_a_bound_of_no_width_fixes_a_variable():
    for method in GRADIENT_METHODS:
        best = optimise(model(), "y", bounds={"a": [0.8, 0.8]}, maximise=False, method=method, starts=4)
        assert_allclose(best.x, [0.8, 1.5], atol=PLACE)


def test_the_result_is_json_and_prints():
    best = optimise(model(), "y", constraints=("b <= 1",), maximise=False, starts=3, true_model=model())
    content = json.loads(json.dumps(best.to_dict(), allow_nan=False))
    assert content["kind"] == "optimisation"
    assert content["trace"]["best"][-1] == best.objective
    assert content["agreement"]["n_starts"] == 3
    assert "minimum of y by slsqp" in str(best)


def test_progress_counts_evaluations():
    told = []
    best = optimise(model(), "y", maximise=False, starts=3, progress=lambda *now: told.append(now))
    assert told[0] == (3, 0)
    assert told[-1] == (best.n_evaluations, 0)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"method": "slsq"}, "did you mean 'slsqp'"),
        ({"starts": 0}, "at least 1"),
        ({"evaluations": 0}, "at least 1"),
        ({"objective": "Y"}, "did you mean 'y'"),
        ({"constraints": ("y < 1", "z < 1")}, r"constraints\[1\]"),
        ({"bounds": {"A": [0, 1]}}, "did you mean 'a'"),
        ({"bounds": {"a": [1, 0]}}, "two finite numbers"),
        ({"bounds": {"a": [0, float("inf")]}}, "two finite numbers"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        optimise(model(), **{"objective": "y", "starts": 2, **arguments})


def test_a_problem_without_bounds_or_with_a_name_twice_is_refused():
    with pytest.raises(StudyError, match="bounds of 'b' too"):
        optimise(model(bounds=None), "y", bounds={"a": [0, 1]})
    with pytest.raises(StudyError, match="not both"):
        optimise(FunctionModel(bowl, ("a", "b"), ("a",), BOX), "a")


def test_local_derivatives_are_those_of_central_differences():
    problem = state_problem(beam(), "abs(w) / (abs(v) + abs(w))", constraints=("v * a <= 1", "b == w / 100"))
    recorder = Recorder(problem)
    Z = np.random.default_rng(3).random((6, 2))
    scales = problem.scales(recorder.evaluate(Z, range(6))[2])

    def locals_at(Z):
        X, found, _ = recorder.evaluate(Z, range(len(Z)))
        return problem.localise(X, found, scales, np.full(len(Z), 0.1))

    here, step = locals_at(Z), 1e-6
    for i in range(2):
        shift = step * np.eye(2)[i]
        for local, up, down in zip(here, locals_at(Z + shift), locals_at(Z - shift), strict=True):
            assert_allclose(local.df[i], (up.f - down.f) / (2 * step), rtol=1e-6, atol=1e-7)
            assert_allclose(local.dc[:, i], (up.c - down.c) / (2 * step), rtol=1e-6, atol=1e-7)
