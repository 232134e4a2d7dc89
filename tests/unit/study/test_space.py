import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import spearmanr

from tensegra.errors import StudyError
from tensegra.study import Space, Variable, as_distribution

LAWS = {
    "a": {"uniform": [0.09, 0.10]},
    "b": {"normal": {"mean": 11500, "std": 200}},
    "c": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
}
RANKS = [[1.0, 0.6, -0.3], [0.6, 1.0, 0.2], [-0.3, 0.2, 1.0]]

# Through Φ and its inverse: five standard deviations out, 1e-16 in probability is 1e-9 in the variable.
ROUND_TRIP = 1e-8


def space_of(laws, correlation=None):
    variables = tuple(Variable(name, "actuator", name, as_distribution(law)) for name, law in laws.items())
    return Space(variables, correlation)


@pytest.fixture(params=[None, RANKS], ids=["independent", "correlated"])
def space(request):
    return space_of(LAWS, request.param)


# Correlated, three add up to five, where the reflected law is 0.1 less 3e-10: its digits end there.
coordinates = st.lists(st.lists(st.floats(-3, 3), min_size=3, max_size=3), min_size=1, max_size=4).map(
    np.array
)


@given(Z=coordinates)
@settings(max_examples=40)
@pytest.mark.parametrize("correlation", [None, RANKS], ids=["independent", "correlated"])
def test_normal_coordinates_round_trip(correlation, Z):
    space = space_of(LAWS, correlation)
    assert_allclose(space.to_normal(space.from_normal(Z)), Z, atol=1e-5)


def test_the_unit_cube_round_trips(space):
    U = np.random.default_rng(1).uniform(0.001, 0.999, (200, 3))
    X = space.from_unit(U)
    assert_allclose(space.to_unit(X), U, atol=ROUND_TRIP)
    assert_allclose(space.from_unit(space.to_unit(X)), X, rtol=ROUND_TRIP)


def test_both_ways_into_the_space_agree(space):
    from scipy.special import ndtri

    U = np.random.default_rng(2).uniform(0.001, 0.999, (50, 3))
    assert_allclose(space.from_normal(ndtri(U)), space.from_unit(U), rtol=1e-10)


def test_the_first_coordinate_is_the_first_variable_alone(space):
    U = np.random.default_rng(3).uniform(size=(20, 3))
    assert_allclose(space.from_unit(U)[:, 0], 0.09 + 0.01 * U[:, 0], rtol=1e-9)


def test_a_sample_has_the_rank_correlation_asked_for():
    U = np.random.default_rng(4).uniform(size=(40_000, 3))
    found = spearmanr(space_of(LAWS, RANKS).from_unit(U)).statistic
    # The standard error of a rank correlation of 40,000 samples is 0.005.
    assert_allclose(found, RANKS, atol=0.02)


def test_the_marginals_do_not_depend_on_the_correlation():
    U = np.random.default_rng(5).uniform(size=(40_000, 3))
    X = space_of(LAWS, RANKS).from_unit(U)
    q = [0.1, 0.5, 0.9]
    for column, law in zip(X.T, LAWS.values(), strict=True):
        assert_allclose(as_distribution(law).cdf(np.quantile(column, q)), q, atol=0.01)


def test_the_corners_of_the_cube_stay_finite_once_clipped(space):
    X = space.clip(space.from_unit(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])))
    assert np.isfinite(X).all()
    assert (space.bounds[:, 0] <= X).all()
    assert (space.bounds[:, 1] >= X).all()


def test_names_units_and_bounds_are_in_the_order_of_the_variables(space):
    assert space.names == ("a", "b", "c")
    assert space.bounds.shape == (3, 2)
    assert_allclose(space.bounds[0], [0.09, 0.10])
    with pytest.raises(ValueError, match="read-only"):
        space.bounds[0, 0] = 0


@pytest.mark.parametrize(
    ("correlation", "message"),
    [
        ([[1.0, 0.5], [0.5, 1.0]], r"found \(2, 2\), expected a matrix of 3 x 3"),
        ([[1, 0.5, 0], [0.4, 1, 0], [0, 0, 1]], "symmetric"),
        ([[2, 0, 0], [0, 1, 0], [0, 0, 1]], "ones on its diagonal"),
        ([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]], "contradict each other"),
    ],
)
def test_what_is_no_correlation_matrix_is_refused(correlation, message):
    with pytest.raises(StudyError, match=message):
        space_of(LAWS, correlation)


def test_points_of_the_wrong_shape_are_refused(space):
    with pytest.raises(StudyError, match="a row per point, 3 columns"):
        space.from_unit(np.zeros((4, 2)))
