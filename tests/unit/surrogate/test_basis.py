import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from tensegra.surrogate.basis import (
    Basis,
    law_quadrature,
    margin,
    recurrence,
    total_degree,
    uniform_quadrature,
)

LAWS = {
    "uniform": stats.uniform(2, 3),
    "normal": stats.norm(1.0, 0.5),
    "exponential": stats.expon(scale=0.001),
    "beta": stats.beta(2, 5),
    "truncated normal": stats.truncnorm(-2, 1, loc=10, scale=2),
    "triangular": stats.triang(0.3),
}
ORTHONORMAL = 1e-8  # quadrature and recurrence to degree 6; densities with a kink cost some digits
EXACT = 1e-12


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_quadrature_has_the_moments_of_the_law(law):
    nodes, weights = law_quadrature(law)
    z = (nodes - law.mean()) / law.std()
    assert weights.sum() == pytest.approx(1)
    assert weights @ z == pytest.approx(0, abs=ORTHONORMAL)
    assert weights @ z**2 == pytest.approx(1, abs=ORTHONORMAL)
    assert weights @ z**4 - 3 == pytest.approx(law.stats("k"), abs=1e-6)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_polynomials_are_orthonormal_under_the_law(law):
    nodes, weights = law_quadrature(law)
    basis = Basis(recurrence(nodes, weights, 6)[None], total_degree(1, 6))
    values = basis.values(nodes[:, None])
    np.testing.assert_allclose((values * weights) @ values.T, np.eye(7), atol=ORTHONORMAL)


def test_hermite_coefficients():
    a, b = recurrence(*law_quadrature(stats.norm()), 10)
    np.testing.assert_allclose(a, 0, atol=1e-9)
    np.testing.assert_allclose(b[1:], np.arange(1, 11), rtol=1e-9)  # Gautschi (2004), table 1.1


def test_legendre_coefficients():
    a, b = recurrence(*uniform_quadrature(-1, 1), 12)
    j = np.arange(1, 13)
    np.testing.assert_allclose(a, 0, atol=EXACT)
    np.testing.assert_allclose(b[1:], 1 / (4 - 1 / j**2), rtol=1e-10)  # Gautschi (2004), table 1.1


def test_total_degree_counts():
    assert len(total_degree(5, 6)) == 462
    assert total_degree(5, 0).tolist() == [[0] * 5]


@given(st.integers(1, 4), st.integers(0, 4), st.integers(1, 6), st.randoms(use_true_random=False))
def test_a_set_and_part_of_its_margin_stay_downward_closed(n_inputs, degree, max_degree, random):
    indices = total_degree(n_inputs, min(degree, max_degree))
    for _ in range(3):
        outside = margin(indices, max_degree)
        indices = np.concatenate(
            [indices, outside[[i for i in range(len(outside)) if random.random() < 0.5]]]
        )
    inside = set(map(tuple, indices.tolist()))
    assert len(inside) == len(indices)
    assert indices.max(initial=0) <= max_degree
    for alpha in inside:
        for j in range(n_inputs):
            assert alpha[j] == 0 or (*alpha[:j], alpha[j] - 1, *alpha[j + 1 :]) in inside


def test_products_and_derivatives_are_those_of_the_factors():
    rng = np.random.default_rng(0)
    Z = rng.uniform(-1, 1, size=(7, 3))
    coefficients = np.stack([recurrence(*uniform_quadrature(-1, 1), 4)] * 3)
    indices = total_degree(3, 4)
    values, slopes = Basis(coefficients, indices).derivatives(Z)
    for i, alpha in enumerate(indices):
        legendre = [np.polynomial.Legendre.basis(a) * np.sqrt(2 * a + 1) for a in alpha]
        factors = np.stack([p(z) for p, z in zip(legendre, Z.T, strict=True)])
        np.testing.assert_allclose(values[i], factors.prod(axis=0), atol=EXACT)
        for j in range(3):
            factors_j = factors.copy()
            factors_j[j] = legendre[j].deriv()(Z[:, j])
            np.testing.assert_allclose(slopes[j, i], factors_j.prod(axis=0), atol=1e-11)
