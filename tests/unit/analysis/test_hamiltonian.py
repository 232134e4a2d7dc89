import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis.diagnostics import bulk_ess, rhat, tail_ess
from tensegra.analysis.hamiltonian import sample

COVARIANCE = np.array([[4.0, 1.2], [1.2, 0.5]])
PRECISION = np.linalg.inv(COVARIANCE)
CENTRE = np.array([3.0, -1.0])


def normal(z):
    r = z - CENTRE
    return -0.5 * np.einsum("ni,ij,nj->n", r, PRECISION, r), -r @ PRECISION


def draw(density=normal, seed=0, n_draws=1000, starts=None):
    rng = np.random.default_rng(seed)
    starts = rng.standard_normal((8, 2)) if starts is None else starts
    return sample(density, starts, np.eye(2), n_warmup=150, n_draws=n_draws, rng=rng)


def test_a_normal_density_is_drawn_from():
    chains = draw()
    flat = chains.draws.reshape(-1, 2)
    # 8,000 draws of effective size above 4,000: a mean to 1/60 of a deviation, a variance to 3 %.
    assert_allclose(flat.mean(axis=0), CENTRE, atol=0.1)
    assert_allclose(np.cov(flat.T), COVARIANCE, rtol=0.1)
    assert 0.7 < chains.acceptance < 0.97
    assert chains.n_divergent == 0
    assert_allclose(chains.log_density, normal(flat)[0].reshape(8, 1000))


def test_its_chains_pass_their_diagnostics():
    draws = draw(n_draws=500).draws
    for k in range(2):
        assert rhat(draws[:, :, k]) < 1.01
        assert min(bulk_ess(draws[:, :, k]), tail_ess(draws[:, :, k])) > 1000


def test_a_curved_density_is_drawn_from():
    # a ~ N(0, 1), b ~ N(a², 0.5²): E b = 1, E b² = 3 + 0.25.
    def banana(z):
        a, r = z[:, 0], z[:, 1] - z[:, 0] ** 2
        slope = np.stack([-a + 8 * a * r, -4 * r], axis=1)
        return -0.5 * a**2 - 2 * r**2, slope

    flat = draw(banana, n_draws=2000).draws.reshape(-1, 2)
    assert_allclose(flat.mean(axis=0), [0.0, 1.0], atol=0.12)
    assert_allclose((flat[:, 1] ** 2).mean(), 3.25, rtol=0.2)


def test_beyond_an_edge_nothing_is_drawn():
    def half(z):
        log_p, slope = normal(z)
        return np.where(z[:, 0] > 3.0, log_p, -np.inf), slope

    chains = draw(half, starts=np.full((8, 2), [4.0, -1.0]))
    assert chains.draws[:, :, 0].min() > 3.0
    # The mean of the upper half of a normal law.
    assert_allclose(chains.draws[:, :, 0].mean(), 3.0 + 2.0 * np.sqrt(2 / np.pi), atol=0.15)


def test_chains_in_two_modes_are_told():
    def two(z):
        offset = np.where(z[:, :1] > 0, 20.0, -20.0) * np.array([[1.0, 0.0]])
        return -0.5 * ((z - offset) ** 2).sum(axis=1), offset - z

    starts = np.repeat([[20.0, 0.0], [-20.0, 0.0]], 4, axis=0)
    draws = draw(two, starts=starts, n_draws=100).draws[:, :, 0]
    assert rhat(draws) > 1.5
    assert bulk_ess(draws) < 20


def test_the_same_seed_gives_the_same_chains():
    assert_array_equal(draw(n_draws=5).draws, draw(n_draws=5).draws)


def test_the_effective_size_of_independent_and_of_tied_draws():
    rng = np.random.default_rng(3)
    independent = rng.standard_normal((4, 1000))
    assert_allclose(bulk_ess(independent), 4000, rtol=0.1)
    tied = np.empty((4, 4000))
    tied[:, 0] = rng.standard_normal(4)
    for i in range(1, 4000):  # of an autoregression of ρ the size is n (1 − ρ)/(1 + ρ)
        tied[:, i] = 0.8 * tied[:, i - 1] + 0.6 * rng.standard_normal(4)
    assert_allclose(bulk_ess(tied), 16000 / 9, rtol=0.2)
    assert bulk_ess(np.ones((4, 100))) == 400
    assert rhat(np.ones((4, 100))) == pytest.approx(1.0)


@pytest.mark.parametrize("fault", ["shifted", "wider", "drifting"])
def test_chains_that_differ_are_told(fault):
    draws = np.random.default_rng(5).standard_normal((4, 500))
    if fault == "shifted":
        draws[0] += 1.0
    elif fault == "wider":
        draws[0] *= 4.0  # of the same mean: the folded draws tell
    else:
        draws += np.linspace(-1, 1, 500)
    assert rhat(draws) > 1.05
