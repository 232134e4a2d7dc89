import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import integrate, stats

from tensegra.errors import StudyError
from tensegra.study import as_distribution
from tensegra.study.distributions import TAIL
from tensegra.study.law_entries import LAWS, DistributionEntry
from tensegra.units import is_sane

MEASURED = [2.0, 2.5, 2.5, 3.1, 4.0, 4.2, 5.5]

CONTINUOUS = {
    "uniform": {"uniform": [0.09, 0.10]},
    "normal": {"normal": {"mean": 11500, "std": 200}},
    "truncated_normal": {"truncated_normal": {"mean": 1.0, "std": 0.5, "low": 0.5, "high": 3.0}},
    "truncated below": {"truncated_normal": {"mean": 1.0, "std": 0.5, "low": 0.0}},
    "lognormal": {"lognormal": {"mean": 3.0, "std": 0.6, "shift": 1.0}},
    "exponential": {"exponential": {"mean": 0.001, "shift": 0.1}},
    "reflected": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
    "beta": {"beta": {"a": 2.0, "b": 3.0, "low": -1.0, "high": 4.0}},
    "weibull": {"weibull": {"shape": 1.7, "scale": 2.0, "shift": 0.5}},
    "triangular": {"triangular": [0.0, 1.0, 4.0]},
    "measured": {"empirical": {"values": [1.0, 2.0, 4.0, 4.5, 7.0]}},
    "kernel density": {"empirical": {"values": MEASURED, "method": "kde"}},
}
DISCRETE = {"discrete": {"values": [3.0, 1.0, 2.0], "probabilities": [0.5, 0.25, 0.25]}}
TIED = {"empirical": {"values": MEASURED}}

# Quantile and probability are inverse to each other up to the root finders' tolerance.
ROUND_TRIP = 1e-9
# `integrate.quad` over a density with kinks.
QUADRATURE = 1e-6


@pytest.fixture(params=CONTINUOUS, ids=lambda name: name.replace(" ", "_"))
def law(request):
    return as_distribution(CONTINUOUS[request.param])


def test_every_law_of_the_file_has_an_entry_and_a_test():
    assert set(LAWS) == set(DistributionEntry.model_fields)
    tested = {next(iter(written)) for written in [*CONTINUOUS.values(), DISCRETE, TIED]}
    assert tested == set(LAWS)


def test_quantiles_and_probabilities_are_inverse(law):
    q = np.linspace(0.001, 0.999, 201)
    assert_allclose(law.cdf(law.ppf(q)), q, rtol=0, atol=ROUND_TRIP)


def test_the_density_integrates_to_the_probability(law):
    a, b = (float(x) for x in law.ppf([0.2, 0.9]))
    kinks = [x for x in (1.0, 2.0, 4.0, 4.5) if a < x < b]
    integral, _ = integrate.quad(lambda x: float(law.pdf(x)), a, b, points=kinks or None, limit=200)
    assert integral == pytest.approx(0.7, abs=QUADRATURE)


def test_moments_are_those_of_the_quantile_function(law):
    q = (np.arange(400_000) + 0.5) / 400_000
    x = law.ppf(q)
    assert law.mean == pytest.approx(x.mean(), rel=1e-4)
    assert law.std == pytest.approx(x.std(), rel=1e-3)


def test_the_box_is_finite_and_holds_nearly_all(law):
    low, high = law.box
    assert np.isfinite([low, high]).all()
    assert low < high
    assert law.cdf(high) - law.cdf(low) >= 1 - 2 * TAIL - 1e-12


def test_the_box_of_a_bounded_law_is_its_support():
    assert as_distribution({"uniform": [0.09, 0.1]}).box == (0.09, 0.1)
    assert as_distribution({"beta": [2, 3]}).box == (0.0, 1.0)


def test_the_box_keeps_an_end_with_density_and_leaves_one_without():
    actuation = as_distribution(CONTINUOUS["reflected"])
    assert actuation.box[1] == 0.1
    assert actuation.box[0] == pytest.approx(0.1 + 0.001 * np.log(TAIL))
    assert as_distribution({"lognormal": {"mean": 3.0, "std": 0.6}}).box[0] > 1.0


def test_the_papers_actuation_is_a_tenth_minus_an_exponential():
    law = as_distribution(CONTINUOUS["reflected"])
    phi = stats.expon(scale=0.001)
    x = np.array([0.0921, 0.0988, 0.0999])
    assert law.mean == pytest.approx(0.099)
    assert_allclose(law.pdf(x), phi.pdf(0.1 - x))
    assert_allclose(law.cdf(x), phi.sf(0.1 - x))


def test_lognormal_parameters_are_the_moments_of_the_variable_itself():
    law = as_distribution({"lognormal": {"mean": 3.0, "std": 0.6}})
    assert (law.mean, law.std) == (pytest.approx(3.0), pytest.approx(0.6))


def test_discrete_values_round_trip_and_carry_their_probabilities():
    law = as_distribution(DISCRETE)
    assert_allclose(law.ppf(law.cdf([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0])
    assert_allclose(law.ppf([0.0, 0.25, 0.2501, 0.5, 0.51, 1.0]), [1, 1, 2, 2, 3, 3])
    assert_allclose(law.pdf([1.0, 1.5, 3.0, 9.0]), [0.25, 0.0, 0.5, 0.0])
    assert (law.mean, law.box) == (pytest.approx(2.25), (1.0, 3.0))
    assert law.std == pytest.approx(np.sqrt(0.25 * 1.25**2 + 0.25 * 0.25**2 + 0.5 * 0.75**2))


def test_measurements_with_ties_round_trip_and_agree_with_numpy():
    law = as_distribution(TIED)
    q = np.linspace(0, 1, 57)
    assert_allclose(law.ppf(q), np.quantile(MEASURED, q))
    assert_allclose(law.ppf(law.cdf(MEASURED)), MEASURED)
    assert law.cdf(2.5) == pytest.approx(2 / 6)


def test_the_kernel_density_agrees_with_scipys():
    law = as_distribution({"empirical": {"values": MEASURED, "method": "kde"}})
    reference = stats.gaussian_kde(MEASURED)
    x = np.linspace(0, 8, 9)
    assert_allclose(law.pdf(x), reference(x), rtol=1e-12)
    assert_allclose(law.ppf([0.0, 1.0]), [-np.inf, np.inf])


def test_shapes_are_kept():
    law = as_distribution(CONTINUOUS["kernel density"])
    assert law.ppf(np.full((2, 3), 0.5)).shape == (2, 3)
    assert law.cdf(3.0).shape == ()


@given(
    low=st.floats(-1e3, 1e3).filter(is_sane),
    width=st.floats(1e-3, 1e3),
    q=st.floats(0.0, 1.0),
)
@settings(max_examples=50)
def test_uniform_quantiles_stay_between_its_ends(low, width, q):
    law = as_distribution({"uniform": [low, low + width]})
    assert low <= law.ppf(q) <= np.nextafter(low + width, np.inf)


def test_a_distribution_written_and_read_again_is_equal(law):
    assert as_distribution(law.to_mapping()) == law
    assert as_distribution(law) is law


def test_the_repr_says_what_it_is():
    assert repr(as_distribution({"uniform": [0.09, 0.1]})) == "Distribution(uniform, low=0.09, high=0.1)"
    assert "<7 numbers>" in repr(as_distribution(TIED))


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ({"uniform": [1, 0]}, r"x\.uniform: found low 1\.0 and high 0\.0, expected low < high"),
        ({"uniform": [1, 1]}, "expected low < high"),
        ({"unifrom": [0, 1]}, r"x: found 'unifrom', expected one of .*did you mean 'uniform'\?"),
        ({"normal": {"mean": 1, "sdt": 2}}, r"x\.normal: found 'sdt', .*did you mean 'std'\?"),
        ({"normal": {"mean": 1}}, r"x\.normal\.std: the key is missing"),
        ({"normal": [1, -2]}, r"x\.normal\.std: found -2, expected a number greater than 0"),
        ({"normal": [1, 0]}, "expected a number greater than 0"),
        ({"normal": [1, True]}, r"x\.normal\.std: found True, expected a number"),
        ({"normal": ["a", 1]}, r"x\.normal\.mean: found 'a', expected a number"),
        ({"uniform": [0, 1, 2]}, "found 3 numbers, expected at most 2: low, high"),
        ({"uniform": [0, float("nan")]}, r"x\.uniform\.high: found nan, expected a finite number"),
        ({"uniform": [0, float("inf")]}, "expected a finite number"),
        ({"uniform": [0, 1], "normal": [0, 1]}, r"found \['uniform', 'normal'\], expected exactly one of"),
        ({}, "expected exactly one of"),
        (3, "x: found 3, expected a mapping"),
        ({"exponential": {"mean": 1, "reflected": 1}}, r"reflected: found 1, expected a boolean"),
        ({"truncated_normal": {"mean": 1, "std": 1}}, "neither low nor high"),
        ({"truncated_normal": {"mean": 1, "std": 1, "low": 2, "high": 1}}, "expected low < high"),
        ({"triangular": [0, 5, 4]}, "found the mode 5.0, expected one from 0.0 to 4.0"),
        ({"beta": {"a": 0, "b": 1}}, r"x\.beta\.a: found 0, expected a number greater than 0"),
        ({"discrete": {"values": [1, 1]}}, "found a value twice"),
        ({"discrete": {"values": []}}, r"x\.discrete\.values"),
        ({"discrete": {"values": [1, 2], "probabilities": [0.5, 0.6]}}, "sum of probabilities of 1.1"),
        ({"discrete": {"values": [1, 2], "probabilities": [1.0]}}, "found 1 probabilities for 2 values"),
        ({"empirical": {"values": [1, 1]}}, "at least two different measurements"),
        ({"empirical": {"values": [1, 2], "bandwidth": 1.0}}, "only the method 'kde' takes"),
        ({"empirical": {}}, "expected either values or a file"),
        ({"empirical": {"file": "a.csv"}}, "has not been read"),
    ],
)
def test_what_cannot_be_is_refused(written, message):
    with pytest.raises(StudyError, match=message):
        as_distribution(written, "x")
