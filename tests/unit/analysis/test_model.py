import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis import FunctionModel, Model, SurrogateModel
from tensegra.analysis.model import Evaluation, as_model, column_index, n_outside
from tensegra.errors import StudyError
from tensegra.surrogate import fit

BOX = np.array([[0.0, 1.0], [0.0, 2.0]])


def plane(X):
    return np.stack([X[:, 0] ** 2, X[:, 0] * X[:, 1]], axis=1)


@pytest.fixture(scope="module")
def surrogate():
    X = np.random.default_rng(0).random((60, 2)) * [1, 2]
    return fit((X, plane(X)), "gpr", validation=None)


def test_a_row_with_any_nan_is_failed_and_all_nan():
    found = Evaluation.of_values([[1.0, 2.0], [np.nan, 3.0], [np.inf, 0.0]])
    assert_array_equal(found.valid, [True, False, False])
    assert np.isnan(found.values[1:]).all()
    assert found.n_failed == 2
    assert found.tally() == {"failed": 2, "evaluated": 1}


def test_a_function_of_one_output_may_return_a_vector():
    model = FunctionModel(lambda X: X.sum(axis=1), ("a", "b"), ("y",))
    assert model.evaluate([[1, 2], [3, 4]]).values.shape == (2, 1)
    assert isinstance(model, Model)


def test_differences_stay_inside_the_box_and_are_exact_for_a_quadratic():
    asked = []

    def function(X):
        asked.append(X)
        return plane(X)

    model = FunctionModel(function, ("a", "b"), ("p", "q"), BOX)
    slopes = model.gradient([[0.5, 1.0], [0.3, 0.7]])
    # Central differences have no truncation on a quadratic.
    assert_allclose(slopes, [[[1.0, 0.0], [1.0, 0.5]], [[0.6, 0.0], [0.7, 0.3]]], atol=1e-10)
    corner = model.gradient([[0.0, 2.0]])
    assert_allclose(corner, [[[0.0, 0.0], [2.0, 0.0]]], atol=2e-3)  # one-sided: as large as the step
    assert all(n_outside(X, BOX) == 0 for X in asked)


def test_a_surrogate_is_a_model_with_its_own_uncertainty(surrogate):
    model = as_model(surrogate)
    assert isinstance(model, SurrogateModel)
    assert model.name == "gpr"
    X = [[0.4, 0.9], [0.1, 0.2]]
    assert_allclose(model.evaluate(X).values, plane(np.array(X)), atol=1e-3)
    assert model.gradient(X).shape == (2, 2, 2)
    assert (model.uncertainty(X) >= 0).all()
    assert model.units == {"x1": "", "x2": "", "y1": "", "y2": ""}


def test_points_outside_the_box_are_counted_instead_of_warned_of(surrogate):
    X = np.array([[0.5, 1.0], [1.5, 1.0]])
    model = SurrogateModel(surrogate)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert model.evaluate(X).valid.all()
        model.gradient(X)
        model.uncertainty(X)
    assert n_outside(X, model.bounds) == 1
    assert n_outside(X, None) == 0


def test_what_is_no_model_is_refused():
    with pytest.raises(StudyError, match="a surrogate, a study or a FunctionModel"):
        as_model(3)


def test_names_and_columns_are_checked():
    with pytest.raises(StudyError, match="did you mean 'w'"):
        column_index(("v", "w"), ["W"], "outputs")
    with pytest.raises(StudyError, match="2 columns"):
        FunctionModel(plane, ("a", "b"), ("p", "q")).evaluate([[1.0, 2.0, 3.0]])
