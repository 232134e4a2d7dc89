import numpy as np
import pytest
from scipy import stats

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.surrogate import fit
from tensegra.surrogate.basis import Basis, total_degree
from tensegra.surrogate.chaos import moments, sobol_indices
from tensegra.surrogate.leastsquares import LeastSquares, Rows
from tensegra.surrogate.problem import Problem


def uniform(n, d, seed=0, lower=0.0, upper=1.0):
    return np.random.default_rng(seed).uniform(lower, upper, size=(n, d))


def test_a_polynomial_is_recovered_exactly():
    X = uniform(60, 2)
    Y = 1 + X[:, 0] ** 3 - 2 * X[:, 0] * X[:, 1] ** 2
    surrogate = fit((X, Y), "pce", validation=0.25)
    assert surrogate.validation.max_abs_error[0] < 1e-11
    assert surrogate.model.indices.sum(axis=1).max() == 3


def ishigami(X):
    return np.sin(X[:, 0]) + 7 * np.sin(X[:, 1]) ** 2 + 0.1 * X[:, 2] ** 4 * np.sin(X[:, 0])


def test_moments_and_indices_of_the_ishigami_function():
    """Closed forms: Ishigami and Homma (1990); Sudret (2008), section 5.2."""
    a, b = 7.0, 0.1
    X = uniform(900, 3, lower=-np.pi, upper=np.pi)
    data = TrainingData(X=X, Y=ishigami(X), bounds=np.tile([-np.pi, np.pi], (3, 1)))
    surrogate = fit(data, "pce", validation=None, max_degree=14)
    variances = [(1 + b * np.pi**4 / 5) ** 2 / 2, a**2 / 8, 0.0]
    shared = b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    total = sum(variances) + shared
    mean, std = moments(surrogate)
    assert mean == pytest.approx(a / 2, abs=1e-3)
    assert std == pytest.approx(np.sqrt(total), rel=1e-3)
    first, whole = sobol_indices(surrogate)
    np.testing.assert_allclose(first[0], np.array(variances) / total, atol=1e-3)
    np.testing.assert_allclose(whole[0], np.add(variances, [shared, 0, shared]) / total, atol=1e-3)


def test_moments_follow_the_laws_of_the_inputs():
    laws = (stats.norm(2.0, 0.3), stats.expon(scale=0.5))
    X = np.column_stack([law.rvs(200, random_state=i) for i, law in enumerate(laws)])
    data = TrainingData(X=X, Y=X[:, 0] ** 2 * (1 + X[:, 1]), distributions=laws)
    mean, std = moments(fit(data, "pce", validation=None))
    # E[x²] = μ² + σ², E[x⁴] = μ⁴ + 6 μ²σ² + 3 σ⁴; E[(1 + t)] = 1.5, E[(1 + t)²] = 1 + 1 + 0.5
    second, fourth = 4 + 0.09, 16 + 6 * 4 * 0.09 + 3 * 0.0081
    assert mean[0] == pytest.approx(second * 1.5)
    assert std[0] == pytest.approx(np.sqrt(fourth * 2.5 - (second * 1.5) ** 2))


def test_closed_forms_are_refused_of_other_kinds():
    X = uniform(20, 1)
    surrogate = fit((X, X), "gpr", validation=None)
    with pytest.raises(StudyError, match="'pce'"):
        moments(surrogate)


@pytest.mark.parametrize("derivatives", [False, True])
def test_leave_one_out_is_what_leaving_one_out_gives(derivatives):
    X = uniform(25, 2)
    Y = np.exp(X[:, :1] + X[:, 1:] ** 2)
    dY = (Y * np.stack([np.ones(25), 2 * X[:, 1]], axis=1))[:, None] if derivatives else None
    data = TrainingData(X=X, Y=Y, dY=dY)
    problem = Problem.of(data)
    full = fit(data, "pce", degree=3, validation=None).model
    indices = total_degree(2, 3)
    basis = Basis(full.recurrences, indices)
    sizes = [3, 6, 10]
    residuals, _ = LeastSquares.of(Rows(problem.Z, problem.T, problem.dT), basis).leave_one_out(sizes)
    for i in range(25):
        others = np.arange(25) != i
        dT = None if problem.dT is None else problem.dT[others]
        for residual, size in zip(residuals, sizes, strict=True):
            smaller = Basis(full.recurrences, indices[:size])
            without = LeastSquares.of(Rows(problem.Z[others], problem.T[others], dT), smaller)
            prediction = smaller.values(problem.Z[[i]]).T @ without.coefficients(size)
            np.testing.assert_allclose(problem.T[i] - prediction[0], residual[i], rtol=1e-4, atol=1e-9)


def test_growing_beats_a_total_degree_where_the_inputs_differ_in_weight():
    X = uniform(300, 4)
    Y = np.exp(2 * X[:, 0]) / (1 + X[:, 1]) + 0.01 * X[:, 2] + 0.001 * X[:, 3] ** 2
    errors = [
        fit((X, Y), "pce", validation=0.3, sparse=sparse).validation.relative_error[0]
        for sparse in (True, False)
    ]
    assert errors[0] < 0.1 * errors[1]


def test_derivatives_are_worth_several_runs():
    X = uniform(60, 3)
    Y = np.cos(X.sum(axis=1))
    dY = -np.sin(X.sum(axis=1))[:, None] * np.ones((1, 3))
    data = TrainingData(X=X, Y=Y, dY=dY, bounds=[[0, 1]] * 3)
    new = uniform(200, 3, 9)
    without, with_them = (
        fit(data, "pce", validation=(new, np.cos(new.sum(axis=1))), derivatives=used)
        for used in (False, True)
    )
    assert with_them.validation.normalised_error[0] < 0.1 * without.validation.normalised_error[0]


def test_noise_is_not_learnt():
    rng = np.random.default_rng(3)
    X = uniform(200, 2)
    Y = X[:, 0] + 0.1 * rng.normal(size=200)
    surrogate = fit((X, Y), "pce", validation=None)
    assert len(surrogate.model.indices) < 10


def test_intervals_cover_what_they_say():
    X = uniform(1200, 3)
    Y = np.exp(X[:, 0] * X[:, 1]) + np.sin(3 * X[:, 2])
    surrogate = fit((X, Y), "pce", training_size=200, validation=1000)
    # Calibrated on 200 runs, which scatters by 2 %, and on the set of terms that suits these runs best.
    assert 0.8 < surrogate.validation.coverage_90[0] < 0.99


def test_too_high_a_degree_is_refused():
    X = uniform(20, 3)
    with pytest.raises(StudyError, match="at most 20 terms"):
        fit((X, X), "pce", degree=4, validation=None)
    with pytest.raises(StudyError, match="0 or more"):
        fit((X, X), "pce", degree=-1, validation=None)


def test_points_that_coincide_give_the_polynomial_they_can():
    X = np.repeat(uniform(6, 1), 10, axis=0)
    surrogate = fit((X, X**2), "pce", validation=None)
    np.testing.assert_allclose(surrogate.predict(X), X**2, atol=1e-8)
