"""Optimisers against functions of known optimum."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tensegra.analysis import FunctionModel, optimise

# The gradient methods agree with each other and with the truth to this.
SAME = 1e-6


def branin(X):
    x, y = X.T
    q = y - 5.1 / (4 * np.pi**2) * x**2 + 5 / np.pi * x - 6
    return q**2 + 10 * (1 - 1 / (8 * np.pi)) * np.cos(x) + 10


BRANIN = FunctionModel(branin, ("x", "y"), ("f",), np.array([[-5.0, 10.0], [0.0, 15.0]]))
BRANIN_LEAST = 10 / (8 * np.pi)  # at (−π, 12.275), (π, 2.275) and (3π, 2.475)

# Hartmann 1973, in the constants of Dixon & Szegö 1978.
A = np.array([[3, 10, 30], [0.1, 10, 35], [3, 10, 30], [0.1, 10, 35]])
P = 1e-4 * np.array([[3689, 1170, 2673], [4699, 4387, 7470], [1091, 8732, 5547], [381, 5743, 8828]])
ALPHA = np.array([1.0, 1.2, 3.0, 3.2])


def hartmann(X):
    return -np.exp(-np.einsum("ij,nij->ni", A, (X[:, None, :] - P) ** 2)) @ ALPHA


def hartmann_slope(X):
    D = X[:, None, :] - P
    e = ALPHA * np.exp(-np.einsum("ij,nij->ni", A, D**2))
    return 2 * np.einsum("ni,ij,nij->nj", e, A, D)


HARTMANN = FunctionModel(hartmann, ("a", "b", "c"), ("f",), np.array([[0.0, 1.0]] * 3), hartmann_slope)
HARTMANN_LEAST = -3.86277978733266  # published as −3.86278 at (0.114614, 0.555649, 0.852547)

H = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, -0.5], [0.0, -0.5, 2.0]])
CENTRE = np.array([0.2, 0.6, 0.5])
QUADRATIC = FunctionModel(
    lambda X: np.einsum("ni,ij,nj->n", X - CENTRE, H, X - CENTRE) - 7,
    ("a", "b", "c"),
    ("f",),
    np.array([[0.0, 1.0]] * 3),
    lambda X: 2 * (X - CENTRE) @ H,
)


@pytest.mark.parametrize(
    ("model", "least"),
    [(BRANIN, BRANIN_LEAST), (HARTMANN, HARTMANN_LEAST), (QUADRATIC, -7.0)],
    ids=["branin", "hartmann", "quadratic"],
)
def test_the_gradient_methods_reach_the_known_optimum(model, least):
    found = [optimise(model, "f", maximise=False, method=m, starts=60) for m in ("slsqp", "bfgs")]
    for best in found:
        assert_allclose(best.objective, least, atol=SAME)
        assert best.success
    assert abs(found[0].objective - found[1].objective) < SAME


def test_the_three_minima_of_branin_are_told_apart():
    best = optimise(BRANIN, "f", maximise=False, starts=60)
    assert not best.agreement.unique
    assert_allclose(best.agreement.x_low, [-np.pi, 2.275], atol=0.05)
    assert_allclose(best.agreement.x_high, [3 * np.pi, 12.275], atol=0.05)


def test_a_quadratic_in_a_corner_of_its_constraints():
    # min x'x subject to a + b + c = 1, a <= 0.2: by hand (0.2, 0.4, 0.4).
    ball = FunctionModel(lambda X: (X**2).sum(axis=1), ("a", "b", "c"), ("f",), np.array([[0.0, 1.0]] * 3))
    for method in ("slsqp", "bfgs"):
        best = optimise(
            ball, "f", constraints=("a + b + c == 1", "a <= 0.2"), maximise=False, method=method, starts=5
        )
        assert_allclose(best.x, [0.2, 0.4, 0.4], atol=1e-5)


def test_bayesian_on_a_quadratic():
    best = optimise(QUADRATIC, "f", maximise=False, method="bayesian", evaluations=25)
    assert best.objective + 7 < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("acquisition", ["ucb", "ei"])
def test_bayesian_regret_on_hartmann(acquisition):
    regret = [
        optimise(
            HARTMANN,
            "f",
            maximise=False,
            method="bayesian",
            evaluations=40,
            acquisition=acquisition,
            seed=seed,
        ).objective
        - HARTMANN_LEAST
        for seed in range(10)
    ]
    assert np.median(regret) <= 1e-3


def beam(X):
    """Return v and w like those of the source paper's beam: v = 0 on a surface, w up to some 140 on it."""
    a, b, c = X.T / 0.3
    v = 30 * (a - 1.6 * c + 0.5 * b - 0.3 * b * c) - 6
    w = 20 + 60 * a + 50 * b + 25 * c - 10 * a * b
    return np.stack([v, w], axis=1)


BEAM = FunctionModel(beam, ("A1", "A23", "A4"), ("v", "w"), np.array([[0.0, 0.3]] * 3))
# w grows along every input; at A1 = A23 = 0.3 the limit v = −1 gives A4: 30 (1.5 − 1.9 c) − 6 = −1.
C = (1.5 - 5 / 30) / 1.9
BEAM_MOST = 20 + 60 + 50 + 25 * C - 10


@pytest.mark.parametrize("method", ["slsqp", "bfgs", "bayesian"])
def test_all_methods_agree_on_both_forms_of_the_papers_problem(method):
    options = {"starts": 40} if method != "bayesian" else {"evaluations": 30}
    printed = optimise(BEAM, "abs(w) / (abs(v) + abs(w))", method=method, **options)
    assert printed.objective > 1 - 1e-4
    posed = optimise(BEAM, "w", constraints=("abs(v) <= 1",), method=method, **options)
    assert_allclose(posed.objective, BEAM_MOST, rtol=1e-3)
    assert posed.margins["abs(v) <= 1"] > -1e-6
