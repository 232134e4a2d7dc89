import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.study import TrainingData
from tensegra.surrogate import fit, intervals
from tensegra.surrogate import gpr as gpr_module


def wave(X):
    return np.stack([np.sin(3 * X[:, 0]) + X[:, 1] ** 2, np.exp(X[:, 0] * X[:, 1])], axis=1)


def uniform(n, seed=0):
    return np.random.default_rng(seed).uniform(size=(n, 2))


def test_it_interpolates():
    X = uniform(80)
    surrogate = fit((X, wave(X)), "gpr", validation=None)
    # The nugget times the weights, which grow as the kernel matrix comes close to singular, is left over.
    np.testing.assert_allclose(surrogate.predict(X), wave(X), rtol=1e-5)


def test_each_output_has_its_own_length_scales():
    X = uniform(80)
    Y = np.stack([np.sin(9 * X[:, 0]) + X[:, 1], X[:, 0] + np.sin(9 * X[:, 1])], axis=1)
    first, second = fit((X, Y), "gpr", validation=None).model.processes
    assert first.length_scale[0] < first.length_scale[1]
    assert second.length_scale[0] > second.length_scale[1]


def test_deviation_is_calibrated_on_leave_one_out_residuals():
    """The closed form equals conditioning once per run without it."""
    X = uniform(40)
    # With a smaller subset than runs the length scales are kept when a run is left out.
    surrogate = fit((X, np.sin(8 * X[:, 0] + 5 * X[:, 1])), "gpr", subset=39, validation=None)
    process = surrogate.model.processes[0]
    t = surrogate.scaling.outputs(np.sin(8 * X[:, 0] + 5 * X[:, 1])[:, None])[:, 0]
    K = process.kernel(process.centres) + process.nugget * np.eye(40)
    scores = []
    for i in range(40):
        others = np.arange(40) != i
        solved = np.linalg.solve(K[np.ix_(others, others)], np.stack([t[others], K[others, i]], axis=1))
        residual = t[i] - K[i, others] @ solved[:, 0]
        scores.append(residual / np.sqrt(K[i, i] - K[i, others] @ solved[:, 1]))
    assert process.deviation == pytest.approx(gpr_module.calibrated(np.array(scores)), rel=1e-2)


def test_intervals_cover_what_they_say():
    X = uniform(1500)
    Y = np.sin(14 * X[:, 0]) * np.cos(11 * X[:, 1])
    surrogate = fit((X, Y), "gpr", training_size=300, validation=1000)
    # Calibrated on 300 leave-one-out residuals, which are not independent.
    assert 0.8 < surrogate.validation.coverage_90[0] < 0.98


def test_nugget_rises_until_the_factorisation_passes():
    X = np.concatenate([uniform(30), uniform(30)])  # every run twice: singular without a nugget
    surrogate = fit((X, wave(X)), "gpr", validation=None)
    assert all(process.nugget >= gpr_module.SMALLEST_NUGGET for process in surrogate.model.processes)
    np.testing.assert_allclose(surrogate.predict(X), wave(X), rtol=1e-6)

    def fails_below(limit):
        def attempt(nugget):
            if nugget < limit:
                raise np.linalg.LinAlgError
            return nugget

        return attempt

    assert gpr_module._with_smallest_nugget(fails_below(5e-11))[1] == pytest.approx(1e-10)
    with pytest.raises(StudyError, match="cannot be factorised"):
        gpr_module._with_smallest_nugget(fails_below(1.0))


def test_likelihood_slope_is_its_derivative():
    rng = np.random.default_rng(0)
    Z, t = rng.normal(size=(30, 2)), rng.normal(size=30)
    theta, direction = np.log([0.4, 0.7]), np.array([0.3, -0.8])
    _, slope = gpr_module._negative_log_likelihood(theta, Z, t, 1e-8)

    def remainder(step):
        ahead, behind = (
            gpr_module._negative_log_likelihood(theta + sign * step * direction, Z, t, 1e-8)[0]
            for sign in (1, -1)
        )
        return abs((ahead - behind) / 2 - step * slope @ direction)

    assert np.log2(remainder(2e-2) / remainder(1e-2)) == pytest.approx(
        3, abs=0.1
    )  # a central remainder's order


def test_restarts_do_not_make_it_worse():
    X = uniform(60)
    Y = np.sin(9 * X[:, 0]) * X[:, 1]
    plain, restarted = (fit((X, Y), "gpr", restarts=n, validation=None) for n in (0, 3))
    t = plain.scaling.outputs(Y[:, None])[:, 0]
    Z = plain.scaling.inputs(X)
    likelihood = [
        -gpr_module._negative_log_likelihood(np.log(s.model.processes[0].length_scale), Z, t, 1e-13)[0]
        for s in (plain, restarted)
    ]
    assert likelihood[1] >= likelihood[0] - 1e-6 * abs(likelihood[0])


def test_inducing_points_come_close_to_the_exact_process():
    X = uniform(600)
    exact = fit((X, wave(X)), "gpr", validation=None)
    sparse = fit((X, wave(X)), "gpr", validation=None, exact_limit=500, inducing_points=150)
    assert len(sparse.model.processes[0].centres) <= 150
    new = uniform(100, seed=5) * 0.98 + 0.01
    np.testing.assert_allclose(sparse.predict(new), exact.predict(new), rtol=1e-5)


def test_inducing_points_are_spread():
    Z = np.concatenate([np.zeros((50, 1)) + 1e-3 * uniform(50)[:, :1], np.linspace(0, 10, 21)[:, None]])
    chosen = Z[gpr_module._spread(Z, np.ones(1), 8), 0]
    assert np.min(np.diff(np.sort(chosen))) > 0.5


def test_too_small_a_subset_is_refused():
    X = uniform(20)
    with pytest.raises(StudyError, match="gpr: subset: found 1"):
        fit((X, X), "gpr", subset=1)


def test_the_length_scales_of_few_runs_are_found_again_without_each_fold(monkeypatch):
    """What fits 60 runs too well tells their errors too small; found without them it does not."""
    X = np.random.default_rng(4).uniform(size=(100, 8))
    new = np.random.default_rng(5).uniform(size=(2000, 8))

    def kinked(X):
        return np.prod((np.abs(4 * X - 2) + np.arange(8)) / (1 + np.arange(8)), axis=1)

    def coverage():
        data = TrainingData(X=X, Y=kinked(X), bounds=[[0, 1]] * 8)
        return fit(data, "gpr", validation=(new, kinked(new))).validation.coverage_90[0]

    again = coverage()
    monkeypatch.setattr(gpr_module, "FEW_RUNS", range(0))
    assert coverage() < again - 0.05
    assert 0.75 < again < 0.98


def test_fold_factors_never_shrink_and_follow_the_errors():
    rng = np.random.default_rng(0)
    calls = []

    def errors(size):
        def standardised(used, fold):
            calls.append(len(fold))
            assert not set(used) & set(fold)
            return size * np.random.default_rng(len(calls)).normal(size=len(fold))

        return standardised

    assert intervals.fold_factor(150, errors(0.1), rng) == 1.0
    assert intervals.fold_factor(150, errors(2.0), rng) == pytest.approx(2.2, abs=0.5)
    assert 100 <= sum(calls) // 2 < 120  # enough of them, not all
