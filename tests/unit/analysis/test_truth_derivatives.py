import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis import TrueModel, optimise, reach
from tensegra.analysis.model import central_differences
from tensegra.errors import StudyError
from tensegra.study import parse_study

CONTENT = {
    "structure": "library:paper_beam",
    "changes": {"gravity": [0, 0, 0]},
    "variables": {
        "A1": {"actuator": "A1", "distribution": {"uniform": [0.0, 0.1]}},
        "A23": {"actuator": "A23", "distribution": {"uniform": [0.0, 0.1]}},
        "T": {"temperature": "top", "distribution": {"uniform": [0, 50]}},
        "F": {"load": {"node": 18, "axis": "z"}, "distribution": {"uniform": [0, 1]}},
        "L": {"rest_length": "K2", "distribution": {"uniform": [447, 448]}},
    },
    "outputs": {
        "w": {"displacement": "z", "nodes": [18, 23]},
        "T_K1": {"tension": "K1"},
        "largest": {"max_tension": "all"},
        "least": {"min_tension": "clustered"},
        "slack": {"slack_cables": "all"},
        "stability": {"lowest_eigenvalue": True},
    },
    "design": {"sampler": "sobol", "sizes": 8},
}
X = np.array([[0.05, 0.04, 20.0, 0.2, 447.6], [0.02, 0.03, 5.0, 0.5, 447.3]])
# Differences of a thousandth of the box, on a path that bends by some percent over it.
DIFFERENCES = 1e-3


@pytest.fixture(scope="module")
def truth():
    return TrueModel(parse_study(CONTENT))


def test_the_derivatives_are_those_of_the_values(truth):
    exact, numeric = truth.gradient(X), central_differences(truth, X)
    scale = np.abs(numeric).max(axis=(0, 2), keepdims=True)
    assert_allclose(exact[:, :4] / scale[:, :4], numeric[:, :4] / scale[:, :4], atol=DIFFERENCES)
    assert_array_equal(exact[:, 4], 0.0)
    assert_array_equal(exact[:, 5], numeric[:, 5])


def test_an_extreme_tension_has_the_derivative_of_its_bearer(truth):
    values, slopes = truth.evaluate(X).values, truth.gradient(X)
    bearer = truth.study.evaluate(X)
    assert_allclose(values, bearer.Y)
    assert_allclose(slopes[:, 2, 1], central_differences(truth, X)[:, 2, 1], rtol=DIFFERENCES)


def test_what_was_evaluated_ahead_is_not_solved_again(truth):
    calls = []

    def solver(structure, **inputs):
        from tensegra.mechanics import solve_batch

        calls.append(len(next(iter(next(iter(inputs.values())).values()))))
        return solve_batch(structure, **inputs)

    ahead = TrueModel(truth.study, solver=solver, ahead=True, of=("w", "largest"))
    found = ahead.evaluate(X)
    n_solved = len(calls)
    slopes = ahead.gradient(X)
    assert len(calls) == n_solved
    assert_allclose(found.values, truth.evaluate(X).values)
    assert_allclose(slopes[:, [0, 2]], truth.gradient(X)[:, [0, 2]])
    assert np.isnan(slopes[:, [1, 3, 4, 5]]).all()
    assert len(ahead.gradient(X[:1])) == 1  # another point is solved


def test_direct_searches_on_the_structure_whatever_the_model(truth):
    study = truth.study
    best = optimise(
        study, "w", constraints=["slack == 0", "largest <= 70"], method="direct", starts=24, bounds=FIXED
    )
    assert best.model == "truth"
    assert best.success
    assert best.outputs["slack"] == 0
    assert_allclose(best.outputs["largest"], 70.0, rtol=1e-6)  # the limit is what stops it
    grid = np.array([(a, b, 0.0, 0.0, 447.6) for a in np.linspace(0, 0.1, 9) for b in np.linspace(0, 0.1, 9)])
    found = truth.evaluate(grid).values
    allowed = (found[:, 4] == 0) & (found[:, 2] <= 70.0)
    assert best.objective >= found[allowed, 0].max()


FIXED = {"T": [0, 0], "F": [0, 0], "L": [447.6, 447.6]}


def test_a_count_is_equal_to_a_whole_number_only(truth):
    assert truth.counts == ("slack",)
    best = optimise(truth, "w", constraints=["slack == 0"], method="bayesian", evaluations=12, bounds=FIXED)
    assert best.success
    assert best.outputs["slack"] == 0


def test_direct_needs_the_true_model():
    from tensegra.analysis import FunctionModel

    model = FunctionModel(lambda X: X[:, 0], ("a",), ("y",), np.array([[0.0, 1.0]]))
    with pytest.raises(StudyError, match="the true model, which 'direct' searches on"):
        optimise(model, "y", method="direct")


def test_the_structure_itself_follows_a_trajectory(truth):
    path = reach(
        truth, {"w": [10.0, 20.0]}, inputs={"T": 0.0, "F": 0.0, "L": 447.6}, constraints=["stability >= 1e-3"]
    )
    assert path.success
    again = truth.evaluate(np.column_stack([path.x, np.tile([0.0, 0.0, 447.6], (2, 1))]))
    assert_allclose(again.values[:, 0], [10.0, 20.0], atol=1e-3)
