import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from tensegra.analysis import FunctionModel, optimise
from tensegra.analysis.bayesian import BayesianOptimiser, _log_improvement
from tensegra.analysis.cubeprocess import (
    AMPLITUDES,
    JITTERS,
    LENGTH_SCALES,
    _negative_log_likelihood,
    fit_process,
)
from tensegra.analysis.problem import state_problem
from tensegra.errors import StudyError

BOX = np.array([[0.0, 1.0], [-1.0, 1.0]])


def waves(X):
    return np.stack([np.sin(3 * X[:, 0]) - X[:, 1] ** 2, X[:, 0] - 0.5 + 0.2 * X[:, 1]], axis=1)


MODEL = FunctionModel(waves, ("a", "b"), ("w", "v"), BOX)


@pytest.mark.parametrize("acquisition", ["ucb", "ei", "mpi"])
def test_a_smooth_maximum_is_found_in_few_evaluations(acquisition):
    best = optimise(MODEL, "w", method="bayesian", evaluations=18, acquisition=acquisition)
    assert best.objective > 1 - 1e-2
    assert best.n_evaluations == 18
    assert best.success
    assert "18 evaluations, the first 6 of them space-filling" in best.reason


def test_a_constraint_is_kept_and_reached():
    best = optimise(MODEL, "w", constraints=("-0.5 <= v <= -0.1",), method="bayesian", evaluations=18)
    b = np.linspace(-1, 1, 20001)  # along the limit v = −0.1
    exact = np.max(np.sin(3 * np.minimum(0.4 - 0.2 * b, np.pi / 6)) - b**2)
    assert best.margins["-0.5 <= v <= -0.1"] >= -1e-8
    assert_allclose(best.objective, exact, atol=1e-3)


def test_the_crease_of_eq_12_costs_no_more_than_its_outputs():
    best = optimise(MODEL, "abs(w) / (abs(v) + abs(w))", method="bayesian", evaluations=16)
    assert best.objective > 1 - 1e-4


def test_ask_and_tell_is_the_search_and_can_be_resumed():
    problem = state_problem(MODEL, "w", maximise=True)

    def run(optimiser, n):
        for _ in range(n):
            x = optimiser.ask()
            optimiser.tell(x, waves(x[None])[0])
        return optimiser

    whole = run(BayesianOptimiser(problem, n_initial=4, seed=3), 9)
    resumed = BayesianOptimiser(problem, n_initial=4, seed=3)
    for x, outputs in zip(whole.X[:6], whole.outputs[:6], strict=True):
        resumed.tell(x, outputs)
    run(resumed, 3)  # what was told and the seed are all that counts
    assert_array_equal(resumed.X, whole.X)
    x, value = whole.best()
    assert value == waves(whole.X)[:, 0].max()
    assert_array_equal(waves(x[None])[0, 0], value)


def test_the_same_seed_gives_the_same_search():
    one, two, three = (optimise(MODEL, "w", method="bayesian", evaluations=9, seed=s) for s in (0, 0, 1))
    assert_array_equal(one.trace.x, two.trace.x)
    assert (one.trace.x != three.trace.x).any()


def test_it_keeps_away_from_where_the_model_failed():
    holed = FunctionModel(lambda X: np.where(X[:, :1] > 0.4, np.nan, waves(X)), ("a", "b"), ("w", "v"), BOX)
    best = optimise(holed, "w", method="bayesian", evaluations=20)
    assert np.isfinite(best.objective)
    assert best.inputs["a"] <= 0.4
    # The best lies at the edge, sin(1.2) = 0.932: the search closes in on it, on both sides.
    assert best.objective > 0.85
    assert np.isfinite(best.trace.objective[10:]).sum() >= 3


def test_without_any_result_it_goes_on_at_random_and_says_so():
    optimiser = BayesianOptimiser(state_problem(MODEL, "w"), n_initial=2, seed=0)
    for _ in range(4):
        optimiser.tell(optimiser.ask(), np.full(2, np.nan))
    assert_array_equal(optimiser.X, np.clip(optimiser.X, *BOX.T))
    assert np.unique(optimiser.X, axis=0).shape == (4, 2)
    assert np.isnan(optimiser.best()[1])


def test_no_point_is_asked_for_twice():
    best = optimise(MODEL, "w", method="bayesian", evaluations=25)
    Z = (best.trace.x - BOX[:, 0]) / (BOX[:, 1] - BOX[:, 0])
    gaps = np.abs(Z[:, None] - Z).max(axis=2)[np.triu_indices(25, 1)]
    assert gaps.min() > 1e-4


def test_the_logarithm_of_expected_improvement_is_right_and_does_not_underflow():
    u = np.array([-8.0, -3.0, -1.0, -0.5, 0.0, 2.0])
    exact = np.log(stats.norm.pdf(u) + u * stats.norm.cdf(u))
    assert_allclose(_log_improvement(u)[1:], exact[1:], rtol=1e-10)
    # φ(u) + u Φ(u) → φ(u) / u² for u → −∞
    far = np.array([-50.0, -1e3, -1e6])
    assert_allclose(_log_improvement(far), stats.norm.logpdf(far) - 2 * np.log(-far), rtol=1e-3)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"acquisition": "eii"}, "did you mean 'ei'"),
        ({"xi": -1.0}, "not below 0"),
        ({"constraints": ("v == 0",)}, "a band"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        optimise(MODEL, "w", method="bayesian", evaluations=3, **arguments)


def test_the_gradient_of_the_likelihood_is_that_of_differences():
    rng = np.random.default_rng(0)
    Z, t = rng.random((9, 3)), rng.standard_normal(9)
    squares = (Z[:, None, :] - Z) ** 2
    theta, step = np.array([0.3, -0.5, -1.0, 0.2]), 1e-6

    def cost(theta):
        return _negative_log_likelihood(theta, squares, t, 1e-8)[0]

    slopes = [(cost(theta + e) - cost(theta - e)) / (2 * step) for e in step * np.eye(4)]
    assert_allclose(_negative_log_likelihood(theta, squares, t, 1e-8)[1], slopes, rtol=1e-6)


def test_the_process_is_that_of_scikit_learn():
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    rng = np.random.default_rng(1)
    Z, fresh = rng.random((15, 2)), rng.random((7, 2))
    y = 3.0 + np.sin(4 * Z[:, 0]) * Z[:, 1]
    process = fit_process(Z, y, rng)
    amplitude, *lengths = np.exp(process.theta)
    kernel = ConstantKernel(amplitude) * RBF(lengths)
    other = GaussianProcessRegressor(kernel, alpha=JITTERS[0], optimizer=None, normalize_y=True).fit(Z, y)
    mean, std = process.predict(fresh)
    expected, deviation = other.predict(fresh, return_std=True)
    # The kernel matrix has a condition number of up to 1e10.
    assert_allclose(mean, expected, rtol=1e-6)
    assert_allclose(std, deviation, rtol=1e-3, atol=1e-5)
    # No length scale nearby explains the outputs better.
    squares, t = (Z[:, None, :] - Z) ** 2, (y - y.mean()) / y.std()
    best = _negative_log_likelihood(process.theta, squares, t, JITTERS[0])[0]
    for change in 0.05 * np.vstack([np.eye(3), -np.eye(3)]):
        theta = np.clip(process.theta + change, *np.log([AMPLITUDES, LENGTH_SCALES, LENGTH_SCALES]).T)
        assert _negative_log_likelihood(theta, squares, t, JITTERS[0])[0] >= best - 1e-6
