import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis.tempering import Reference, lead


def mixture(z, centres, widths, shares):
    """Log density and gradient of normal peaks in one dimension."""
    logs = np.array(
        [
            np.log(p) + stats.norm(c, w).logpdf(z[:, 0])
            for c, w, p in zip(centres, widths, shares, strict=True)
        ]
    )
    total = np.logaddexp.reduce(logs)
    pulls = np.array([-(z[:, 0] - c) / w**2 for c, w in zip(centres, widths, strict=True)])
    return total, (np.exp(logs - total) * pulls).sum(axis=0)[:, None]


def led(density, reference, seed=0, **options):
    settings = {"n_populations": 8, "n_draws": 500, "most_moves": 100} | options
    return lead(density, lambda z: density(z)[0], reference, rng=np.random.default_rng(seed), **settings)


def about(*centres, width=0.1):
    m = len(centres)
    return Reference.of(np.array(centres)[:, None], np.full((m, 1, 1), width), np.zeros(m))


@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.2, 0.8)])
def test_peaks_get_the_weight_that_they_have(shares):
    found = led(lambda z: mixture(z, (-1.0, 1.5), (0.05, 0.1), shares), about(-1.0, 1.5))
    assert_allclose((found.draws > 0).mean(), shares[1], atol=0.02)
    left = found.draws[found.draws < 0]
    assert_allclose([left.mean(), left.std()], [-1.0, 0.05], atol=0.01)


def test_a_peak_that_nobody_found_is_met_from_the_prior():
    found = led(lambda z: mixture(z, (-1.0, 1.0), (0.05, 0.05), (0.5, 0.5)), about(1.0))
    assert_allclose((found.draws > 0).mean(), 0.5, atol=0.06)


def test_a_normal_density_takes_a_stage_or_two():
    found = led(lambda z: mixture(z, (0.7,), (0.1,), (1.0,)), about(0.7))
    assert found.n_stages <= 2
    assert_allclose([found.draws.mean(), found.draws.std()], [0.7, 0.1], atol=0.005)


def test_too_few_moves_are_told():
    found = led(lambda z: mixture(z, (2.0,), (1e-4,), (1.0,)), about(-1.0), most_moves=2)
    assert not found.complete


def test_the_reference_integrates_to_one_and_has_its_slope():
    reference = about(-1.0, 0.5, width=0.3)
    grid = np.linspace(-40, 40, 200_001)[:, None]
    log_q, slope = reference.log_density(grid)
    assert_allclose(np.trapezoid(np.exp(log_q), grid[:, 0]), 1.0, rtol=1e-4)
    assert_allclose(slope[1:-1, 0], np.gradient(log_q, grid[:, 0])[1:-1], atol=1e-4)
    draws = reference.draw(20_000, np.random.default_rng(0))[:, 0]
    cdf = np.cumsum(np.exp(log_q)) * (grid[1, 0] - grid[0, 0])
    assert_allclose(
        np.interp(np.quantile(draws, [0.1, 0.5, 0.9]), grid[:, 0], cdf), [0.1, 0.5, 0.9], atol=0.01
    )
