import jax
import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.surrogate import fit
from tensegra.surrogate.network import evaluate, initial_layers, slope
from tensegra.surrogate.training import _damped_steps, flat, layers_of


def uniform(n, d=2, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, size=(n, d))


def wave(X):
    return np.stack([np.sin(2 * X[:, 0] + X[:, 1]), X[:, 0] * np.exp(X[:, 1])], axis=1)


def wave_slopes(X):
    c, e = np.cos(2 * X[:, 0] + X[:, 1]), np.exp(X[:, 1])
    return np.stack([np.stack([2 * c, c], axis=1), np.stack([e, X[:, 0] * e], axis=1)], axis=1)


def test_evaluation_is_the_network_written_out():
    layers = initial_layers((2, 5, 4, 3), np.random.default_rng(0))
    Z = uniform(1500)
    (A, a), (B, b), (C, c) = layers
    np.testing.assert_allclose(evaluate(layers, Z), np.tanh(np.tanh(Z @ A + a) @ B + b) @ C + c, atol=1e-14)


def test_slope_agrees_with_jax():
    layers = initial_layers((3, 6, 5, 2), np.random.default_rng(1))
    Z = uniform(10, 3)

    def outputs(z):
        for W, b in layers[:-1]:
            z = jax.numpy.tanh(z @ W + b)
        return z @ layers[-1][0] + layers[-1][1]

    with jax.enable_x64(True):  # noqa: FBT003 - positional-only in JAX
        expected = np.asarray(jax.vmap(jax.jacfwd(outputs))(Z))
    np.testing.assert_allclose(slope(layers, Z), expected, atol=1e-13)


def test_layers_survive_the_way_through_a_vector():
    layers = initial_layers((3, 4, 2), np.random.default_rng(2))
    for (W, b), (V, c) in zip(layers, layers_of(flat(layers), (3, 4, 2)), strict=True):
        assert np.array_equal(W, V)
        assert np.array_equal(b, c)


def test_precision_of_the_user_is_left_alone():
    X = uniform(20)
    fit((X, wave(X)), "nn", hidden=(3,), iterations=2, validation=None)
    assert jax.numpy.zeros(1).dtype == np.float32


def test_damped_steps_solve_a_linear_problem_at_once():
    rng = np.random.default_rng(0)
    A, y = rng.normal(size=(30, 4)), rng.normal(size=30)
    theta = _damped_steps(
        np.zeros(4), lambda t: float(np.sum((A @ t - y) ** 2)), lambda t: (A.T @ A, A.T @ (A @ t - y)), 50
    )
    np.testing.assert_allclose(theta, np.linalg.lstsq(A, y)[0], atol=1e-6)


def test_second_stage_goes_on_where_adam_ends():
    """scikit-learn's L-BFGS stops at once on a small loss; this one must not."""
    X = uniform(100)
    options = {"training": "two_stage", "hidden": (12,), "adam_iterations": 400, "validation": None}
    errors = [
        np.abs(fit((X, wave(X)), "nn", iterations=iterations, **options).predict(X) - wave(X)).mean()
        for iterations in (0, 400)
    ]
    assert errors[1] < 0.1 * errors[0]


def test_adam_learns_from_a_part_of_the_runs_at_a_time():
    X, new = uniform(300), 0.9 * uniform(100, seed=3)
    options = {"training": "two_stage", "hidden": (12,), "iterations": 0, "validation": None}

    def predicted(runs, **more):
        return fit((X[runs], wave(X[runs])), "nn", **options, **more).predict(new)

    def error(runs, **more):
        return np.abs(predicted(runs, **more) - wave(new)).mean()

    every, first = np.arange(300), np.arange(16)
    # All parts are learned from, not the first alone.
    in_parts = error(every, adam_batch=16, adam_iterations=4000)
    assert in_parts < 0.5 * error(first, adam_iterations=4000)
    # A part as large as the whole is the whole.
    whole = predicted(every, adam_iterations=50)
    np.testing.assert_array_equal(predicted(every, adam_iterations=50, adam_batch=300), whole)


def test_levenberg_marquardt_is_the_more_accurate_of_the_two():
    X = uniform(150)
    accurate = fit((X, wave(X)), "nn", hidden=(10, 10))
    paper = fit(
        (X, wave(X)), "nn", training="two_stage", hidden=(10, 10), adam_iterations=500, iterations=200
    )
    assert max(accurate.validation.normalised_error) < 0.2 * max(paper.validation.normalised_error)


@pytest.mark.parametrize("training", ["levenberg_marquardt", "two_stage"])
def test_derivatives_help(training):
    X, new = uniform(25), 0.9 * uniform(200, seed=3)
    options = {"training": training, "hidden": (10,), "validation": None, "iterations": 60, "seed": 1}
    if training == "two_stage":
        options |= {"adam_iterations": 400, "iterations": 400}
    error = {
        used: np.abs(
            fit((X, wave(X), wave_slopes(X)), "nn", derivatives=used, **options).gradient(new)
            - wave_slopes(new)
        ).mean()
        for used in (True, False)
    }
    assert error[True] < 0.5 * error[False]


def test_an_ensemble_covers_what_it_says():
    X = uniform(1400)
    surrogate = fit(
        (X, wave(X)), "nn", hidden=(6,), iterations=30, ensemble=4, training_size=600, validation=800
    )
    assert len(surrogate.model.members) == 4
    # Calibrated on 90 runs: 90 % ± three standard deviations of 3.2 %.
    assert all(0.8 < coverage < 1.0 for coverage in surrogate.validation.coverage_90)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"training": "twostage"}, "did you mean 'two_stage'"),
        ({"hidden": ()}, "nn: hidden"),
        ({"hidden": (0,)}, "nn: hidden"),
        ({"ensemble": 0}, "1 or more networks"),
        ({"adam_batch": 0}, "nn: adam_batch"),
        ({"ensemble": 2}, "10 runs or more"),
    ],
)
def test_wrong_options_are_refused(options, message):
    X = uniform(8)
    with pytest.raises(StudyError, match=message):
        fit((X, wave(X)), "nn", validation=None, **options)


@pytest.mark.parametrize("ensemble", [1, 3])
def test_single_precision_is_near_double_precision(ensemble):
    box = np.array([[1e4, 1.1e4], [-1e-3, 1e-3]])
    unit = 0.5 * (uniform(1300) + 1)
    X = box[:, 0] + unit * (box[:, 1] - box[:, 0])
    Y = 50 + wave(2 * unit - 1)
    surrogate = fit((X, Y), "nn", hidden=(8, 8), iterations=20, ensemble=ensemble, validation=None)
    fast, exact = surrogate.predict(X, fast=True), surrogate.predict(X)
    assert fast.dtype == np.float64
    np.testing.assert_allclose(fast, exact, atol=1e-5 * Y.std())
    assert not np.array_equal(fast, exact)


def test_fast_is_nothing_to_other_kinds():
    X = uniform(60)
    surrogate = fit((X, wave(X)), "pce", validation=None)
    assert np.array_equal(surrogate.predict(X, fast=True), surrogate.predict(X))
