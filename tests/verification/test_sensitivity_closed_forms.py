"""Sobol' indices against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, sobol_indices

# Ishigami & Homma 1990 with a = 7, b = 0.1; indices by Sobol' & Levitan 1999.
A, B = 7.0, 0.1
ISHIGAMI = FunctionModel(
    lambda X: np.sin(X[:, 0]) + A * np.sin(X[:, 1]) ** 2 + B * X[:, 2] ** 4 * np.sin(X[:, 0]),
    ("x1", "x2", "x3"),
    ("y",),
    np.array([[-np.pi, np.pi]] * 3),
)
V1 = 0.5 * (1 + B * np.pi**4 / 5) ** 2
V2 = A**2 / 8
V13 = B**2 * np.pi**8 * 8 / 225
VARIANCE = V1 + V2 + V13
FIRST = np.array([V1, V2, 0.0]) / VARIANCE
TOTAL = np.array([V1 + V13, V2, V13]) / VARIANCE
SECOND = np.array([0.0, V13, 0.0]) / VARIANCE  # pairs (1, 2), (1, 3), (2, 3)
PAIRS = np.triu_indices(3, 1)


def covers(values, halves, truth):
    return np.abs(values - truth) <= halves


def test_the_closed_form_is_the_published_one():
    assert_allclose(FIRST, [0.3139, 0.4424, 0.0], atol=5e-5)
    assert_allclose(TOTAL, [0.5576, 0.4424, 0.2437], atol=5e-5)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_intervals_of_ishigami_cover(seed):
    found = sobol_indices(ISHIGAMI, samples=1024, seed=seed).indices["y"]
    assert covers(found.first, found.first_half, FIRST).all()
    assert covers(found.total, found.total_half, TOTAL).all()
    assert covers(found.second[PAIRS], found.second_half[PAIRS], SECOND).all()
    assert_allclose(found.variance, VARIANCE, rtol=0.05)


def test_ishigami_within_a_hundredth():
    result = sobol_indices(ISHIGAMI, samples=2**14, resamples=50)
    found = result.indices["y"]
    assert_allclose(found.first, FIRST, atol=0.01)
    assert_allclose(found.total, TOTAL, atol=0.01)
    assert_allclose(found.second[PAIRS], SECOND, atol=0.01)
    assert covers(found.first, found.first_half, FIRST).all()
    assert covers(found.total, found.total_half, TOTAL).all()
    errors = [np.abs(step.total - TOTAL).max() for step in result.convergence["y"]]
    assert errors[-1] < errors[0] / 4


def test_an_additive_model_has_no_interactions():
    weights = np.array([4.0, 2.0, 1.0])
    model = FunctionModel(lambda X: X @ weights, ("a", "b", "c"), ("y",))
    laws = {"a": stats.norm(5, 1), "b": stats.norm(0, 2), "c": stats.norm(-3, 0.5)}
    found = sobol_indices(model, laws, samples=4096).indices["y"]
    shares = (weights * [1, 2, 0.5]) ** 2 / ((weights * [1, 2, 0.5]) ** 2).sum()
    assert_allclose(found.first, shares, atol=0.01)
    assert_allclose(found.total, shares, atol=0.01)
    assert_allclose(found.second[PAIRS], 0.0, atol=0.02)


def test_a_shift_of_the_output_changes_nothing():
    # Saltelli's estimators cancel badly when the mean is large against the scatter, unless the output is
    # centred.
    shifted = FunctionModel(
        lambda X: 1e6 + ISHIGAMI.function(X), ISHIGAMI.input_names, ("y",), ISHIGAMI.bounds
    )
    one, two = (sobol_indices(m, samples=256).indices["y"] for m in (ISHIGAMI, shifted))
    assert_allclose(one.total, two.total, atol=1e-6)
    assert_allclose(one.first, two.first, atol=1e-6)


def test_the_expansion_of_ishigami_has_its_indices():
    from tensegra.analysis import chaos_indices
    from tensegra.study import TrainingData
    from tensegra.surrogate import fit

    X = np.random.default_rng(0).uniform(-np.pi, np.pi, (500, 3))
    data = TrainingData(X=X, Y=ISHIGAMI.evaluate(X).values, bounds=ISHIGAMI.bounds)
    found = chaos_indices(fit(data, "pce", degree=10, validation=None)).indices["y1"]
    assert_allclose(found.first, FIRST, atol=0.01)
    assert_allclose(found.total, TOTAL, atol=0.01)
    assert_allclose(found.second[PAIRS], SECOND, atol=0.01)
    assert_allclose(found.variance, VARIANCE, rtol=0.02)


def test_screening_of_morriss_own_example_finds_its_groups():
    """Morris 1991, section 4: of twenty inputs ten matter, and of those seven by curvature or interaction."""
    from tensegra.analysis import morris_screening

    found = morris_screening(MORRIS, trajectories=30, seed=1).effects["y"]
    strong = set(np.argsort(-found.mu_star)[:10].tolist())
    assert strong == set(range(10))
    assert found.mu_star[10:].max() < 0.5 * found.mu_star[:10].min()
    straight = found.sigma[:10] < 0.1 * found.mu_star[:10].max()
    assert set(np.flatnonzero(straight).tolist()) <= {7, 8, 9}


def _morris(X):
    w = 2.0 * (X - 0.5)
    curved = [2, 4, 6]
    w[:, curved] = 2.0 * (1.1 * X[:, curved] / (X[:, curved] + 0.1) - 0.5)
    i = np.arange(20)
    first = np.where(i < 10, 20.0, (-1.0) ** (i + 1))
    y = w @ first
    for a in range(20):
        for b in range(a + 1, 20):
            y = y + (-15.0 if b < 6 else (-1.0) ** (a + b + 2)) * w[:, a] * w[:, b]
    for a in range(5):
        for b in range(a + 1, 5):
            for c in range(b + 1, 5):
                y = y - 10.0 * w[:, a] * w[:, b] * w[:, c]
    return y + 5.0 * w[:, 0] * w[:, 1] * w[:, 2] * w[:, 3]


MORRIS = FunctionModel(_morris, tuple(f"x{i + 1}" for i in range(20)), ("y",), np.array([[0.0, 1.0]] * 20))
