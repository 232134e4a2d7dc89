"""Expectations in probability: any law, with a density, atoms, ties or all of these."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from tensegra.errors import StudyError
from tensegra.study.distributions import as_distribution
from tensegra.study.law_entries import LAWS
from tensegra.study.quadrature import law_quadrature
from tensegra.surrogate.basis import Basis, highest_degrees, recurrence, total_degree

EXACT = 1e-11  # of the spread: rounding of quantiles far from zero
ORTHONORMAL = 1e-7  # to degree 5, whose squares of heavy tails are felt at quantiles of 1e-100
DEGREE = 5

sizes = st.floats(0.05, 20.0)
# A number is 0 or of a size to compute with: what is smaller is refused where a law is read.
places = st.floats(-50.0, 50.0).map(lambda place: place if abs(place) > 1e-90 else 0.0)
numbers = st.lists(st.integers(-20, 20), min_size=2, max_size=30).filter(lambda v: len(set(v)) > 1)
ENTRIES = {
    "uniform": st.builds(lambda low, width: [low, low + width], places, sizes),
    "normal": st.builds(lambda mean, std: [mean, std], places, sizes),
    "truncated_normal": st.builds(
        lambda mean, std, low, width: (
            {"mean": mean, "std": std, "low": mean + low * std}
            | ({} if width > 3 else {"high": mean + (low + width) * std})
        ),
        places,
        sizes,
        st.floats(-3, 2).map(lambda place: place if abs(place) > 1e-90 else 0.0),
        st.floats(0.1, 4),
    ),
    "lognormal": st.builds(
        lambda mean, ratio, shift: [mean, ratio * mean, shift], sizes, st.floats(0.05, 2.0), places
    ),
    "exponential": st.builds(
        lambda mean, shift, reflected: {"mean": mean, "shift": shift, "reflected": reflected},
        sizes,
        places,
        st.booleans(),
    ),
    "beta": st.builds(
        lambda a, b, low, width: [a, b, low, low + width],
        st.floats(0.1, 20),
        st.floats(0.1, 20),
        places,
        sizes,
    ),
    "weibull": st.builds(lambda shape, scale, shift: [shape, scale, shift], st.floats(0.5, 8), sizes, places),
    "triangular": st.builds(
        lambda low, at, width: [low, low + at * width, low + width],
        places,
        st.floats(0, 1).map(lambda share: share if share > 1e-90 else 0.0),
        sizes,
    ),
    "discrete": st.builds(lambda values: {"values": sorted(set(values))}, numbers),
    "empirical": st.builds(
        lambda values, method: {"values": values, "method": method}, numbers, st.sampled_from(["data", "kde"])
    ),
}


def test_every_law_of_the_registry_is_tried():
    assert set(ENTRIES) == set(LAWS)


@pytest.mark.parametrize("kind", ENTRIES)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_moments_and_polynomials_are_those_of_the_law(kind, data):
    law = as_distribution({kind: data.draw(ENTRIES[kind])})
    points, weights = law_quadrature(law, DEGREE + 1)
    assert np.all(np.diff(points) > 0)
    assert weights.sum() == pytest.approx(1)
    assert abs(weights @ points - law.mean) < EXACT * (law.std + abs(law.mean))
    assert np.sqrt(weights @ (points - law.mean) ** 2) == pytest.approx(law.std, rel=1e-9)

    z = (points - law.mean) / law.std
    coefficients = recurrence(z, weights, DEGREE)[None]
    n_polynomials = int(highest_degrees(coefficients)[0]) + 1
    assert n_polynomials == min(DEGREE + 1, len(points))
    finer, finer_weights = law_quadrature(law, 2 * DEGREE)
    values = Basis(coefficients, total_degree(1, n_polynomials - 1)).values(
        (finer[:, None] - law.mean) / law.std
    )
    gram = (values * finer_weights) @ values.T
    np.testing.assert_allclose(gram, np.eye(n_polynomials), atol=ORTHONORMAL)


@pytest.mark.parametrize(
    ("law", "n_values"),
    [
        (stats.rv_discrete(values=([0, 1, 4], [0.2, 0.5, 0.3])), 3),
        (stats.randint(0, 6), 6),
    ],
)
def test_a_jump_of_the_quantile_function_is_found_without_being_told(law, n_values):
    points, weights = law_quadrature(law)
    assert len(points) == n_values
    np.testing.assert_allclose(weights, law.pmf(points), atol=1e-10)


def test_a_gap_in_a_density_is_found_without_being_told():
    law = stats.rv_histogram(([1, 0, 3], [0, 1, 2, 3]), density=False)
    points, weights = law_quadrature(law)
    assert not np.any((points > 1) & (points < 2))
    assert weights @ points == pytest.approx(law.mean(), abs=1e-12)
    assert weights @ points**2 == pytest.approx(law.moment(2), rel=1e-12)


def test_a_law_known_by_its_quantiles_alone_will_do():
    class Quantiles:
        def ppf(self, q):
            return stats.norm.ppf(q)

        def pdf(self, x):
            raise AssertionError(x)

    points, weights = law_quadrature(Quantiles())
    assert weights @ points**4 == pytest.approx(3, rel=1e-9)


def test_very_many_measurements_stay_few_points():
    law = as_distribution({"empirical": {"values": np.random.default_rng(0).normal(size=30_000).tolist()}})
    points, weights = law_quadrature(law, 20)
    assert len(points) < 200_000
    assert np.sqrt(weights @ (points - weights @ points) ** 2) == pytest.approx(law.std, rel=1e-12)


def test_quantiles_that_are_not_finite_are_refused():
    class Nowhere:
        def ppf(self, q):
            return np.full(np.shape(q), np.inf)

    with pytest.raises(StudyError, match="no finite ones with probability"):
        law_quadrature(Nowhere())
