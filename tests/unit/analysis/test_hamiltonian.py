import numpy as np
import pytest
from numpy.testing import assert_allclose

from tensegra.analysis.hamiltonian import Moves


def normal(mean, covariance):
    precision = np.linalg.inv(covariance)

    def log_density(z):
        pull = -(z - mean) @ precision
        return 0.5 * ((z - mean) * pull).sum(axis=1), pull

    return log_density


@pytest.mark.parametrize("factor", [np.eye(2), np.diag([3.0, 0.5])], ids=["round", "scaled"])
def test_moves_keep_a_normal_density(factor):
    mean, covariance = np.array([1.0, -2.0]), np.array([[4.0, 1.2], [1.2, 0.5]])
    rng = np.random.default_rng(0)
    moves = Moves(normal(mean, covariance), rng.standard_normal((4000, 2)), factor, 0.5, rng)
    for _ in range(40):
        moves.move()
    assert_allclose(moves.z.mean(axis=0), mean, atol=0.12)  # four standard errors of 4,000 draws
    assert_allclose(np.cov(moves.z.T), covariance, atol=0.35)
    assert moves.n_divergent == 0


def test_the_step_finds_the_acceptance():
    moves = Moves(
        normal(np.zeros(3), np.diag([1.0, 1e-4, 1.0])),
        np.zeros((500, 3)),
        np.eye(3),
        1.0,
        np.random.default_rng(1),
    )
    for _ in range(30):
        moves.move()
    assert 0.6 < moves.acceptance < 0.95
    assert moves.step < 0.05


def test_a_wall_is_not_crossed():
    def half(z):
        log_p = np.where(z[:, 0] > 0, -0.5 * (z**2).sum(axis=1), -np.inf)
        return log_p, np.where(z > 0, -z, np.nan)

    rng = np.random.default_rng(2)
    moves = Moves(half, np.abs(rng.standard_normal((2000, 1))), np.eye(1), 0.3, rng)
    for _ in range(20):
        moves.move()
    assert moves.z.min() > 0
    assert_allclose(moves.z.mean(), np.sqrt(2 / np.pi), atol=0.06)
