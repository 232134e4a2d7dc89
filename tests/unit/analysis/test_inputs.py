import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from tensegra.analysis import FunctionModel, SameAs
from tensegra.analysis.inputs import random_inputs
from tensegra.errors import StudyError
from tensegra.study import Space, Variable, as_distribution

BOX = np.array([[0.0, 1.0], [2.0, 4.0], [5.0, 5.0]])


def model(**changes):
    return FunctionModel(lambda X: X[:, 0], ("a", "b", "c"), ("y",), **{"bounds": BOX, **changes})


def variable(name, **law):
    return Variable(name, "actuator", name, as_distribution(law))


def correlated(rank):
    variables = (variable("a", normal=[0, 1]), variable("b", normal=[10, 2]), variable("c", uniform=[0, 1]))
    correlation = np.eye(3)
    correlation[0, 1] = correlation[1, 0] = rank
    return Space(variables, correlation)


def test_what_is_not_named_is_uniform_on_the_box_or_fixed_where_that_is_a_point():
    inputs = random_inputs(model())
    assert inputs.independent == ("a", "b")
    assert_allclose(inputs.from_unit([[0.5, 0.25]]), [[0.5, 2.5, 5.0]])


def test_a_tied_variable_repeats_the_other_in_every_sample():
    inputs = random_inputs(model(), {"a": SameAs("b"), "b": stats.norm(1, 2), "c": 7})
    X = inputs.from_unit(np.random.default_rng(0).random((50, 1)))
    assert_array_equal(X[:, 0], X[:, 1])
    assert_array_equal(X[:, 2], 7.0)
    assert inputs.independent == ("b",)
    assert inputs.describe() == {"a": "same as b", "b": "norm(1, 2)", "c": "7"}


def test_the_papers_shared_error_is_one_dimension():
    inputs = random_inputs(
        model(),
        {"a": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}}, "b": {"same_as": "a"}},
    )
    X = inputs.from_unit([[0.5]])
    assert_allclose(X[0, :2], 0.1 - 0.001 * np.log(2))


def test_a_space_gives_laws_and_correlation():
    inputs = random_inputs(model(space=correlated(0.8)))
    assert inputs.copula is not None
    X = inputs.from_unit(np.random.default_rng(0).random((20_000, 3)))
    assert_allclose(stats.spearmanr(X[:, 0], X[:, 1]).statistic, 0.8, atol=0.02)
    assert_allclose([X[:, 1].mean(), X[:, 1].std()], [10, 2], rtol=0.02)


def test_a_named_variable_leaves_the_correlation_and_the_others_keep_theirs():
    inputs = random_inputs(model(space=correlated(0.8)), {"c": 1.0})
    assert inputs.independent == ("a", "b")
    assert inputs.copula.names == ("a", "b")
    freed = random_inputs(model(space=correlated(0.8)), {"a": stats.norm(3, 1)})
    assert freed.copula is None
    X = freed.from_unit(np.random.default_rng(0).random((5000, 3)))
    assert abs(stats.spearmanr(X[:, 0], X[:, 1]).statistic) < 0.05


@pytest.mark.parametrize(
    ("inputs", "told"),
    [
        ({"A": 1.0}, "did you mean 'a'"),
        ({"a": SameAs("bb")}, "did you mean 'b'"),
        ({"a": SameAs("a")}, "a law of its own"),
        ({"a": SameAs("b"), "b": SameAs("c")}, "a law of its own"),
        ({"a": float("nan")}, "finite"),
        ({"a": "normal"}, "a distribution"),
        ({"a": True}, "a distribution"),
        ({"a": {"norml": [0, 1]}}, "did you mean 'normal'"),
        ({"a": 1, "b": 2, "c": 3}, "nothing random"),
    ],
)
def test_what_is_no_law_is_refused(inputs, told):
    with pytest.raises(StudyError, match=told):
        random_inputs(model(), inputs)


def test_a_variable_without_law_and_bounds_is_refused():
    with pytest.raises(StudyError, match="'c'"):
        random_inputs(model(bounds=None), {"a": 1, "b": stats.norm()})
