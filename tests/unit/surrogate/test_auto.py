import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.surrogate import auto, choose, fit


@pytest.fixture(autouse=True)
def small_networks(monkeypatch):
    small = {"hidden": (6,), "iterations": 25}
    candidates = [(kind, small if kind == "nn" else own, growth) for kind, own, growth in auto.CANDIDATES]
    monkeypatch.setattr(auto, "CANDIDATES", tuple(candidates))


def runs(n=80, seed=0):
    X = np.random.default_rng(seed).uniform(size=(n, 2))
    return X, 2 + np.exp(X[:, 0]) * X[:, 1]


def step(n=60, seed=0):
    """Rise so steeply that a polynomial is the wrong choice."""
    X = np.random.default_rng(seed).uniform(-1, 1, size=(n, 1))
    return X, 2 + np.tanh(25 * X[:, 0])


def test_the_smallest_cross_validated_error_wins():
    choice = choose(step(), seed=1)
    errors = {trial.kind: trial.error for trial in choice.trials}
    assert list(errors) == [kind for kind, *_ in auto.CANDIDATES]
    assert choice.surrogate.kind == min(errors, key=errors.get) != "pce"
    assert choice.surrogate.validation.error == errors[choice.surrogate.kind]
    assert choice.surrogate.validation.method == "5-fold"
    assert repr(choice).startswith(f"Choice('{choice.surrogate.kind}': pce ")


def test_what_is_far_off_on_the_first_fold_is_given_up(monkeypatch):
    trained = []
    own = auto.answers_of_fold
    monkeypatch.setattr(auto, "answers_of_fold", lambda *told: trained.append(told[2]) or own(*told))
    choice = choose(step(200), seed=1)
    trials = {trial.kind: trial for trial in choice.trials}
    least = min(trial.error for trial in choice.trials)
    assert trials["pce"].given_up
    assert trials["pce"].error > auto.GIVEN_UP * least
    assert trained.count("pce") == 1
    assert trained.count(choice.surrogate.kind) == auto.N_FOLDS
    assert "given up after one fold" in repr(choice)


def test_without_time_the_quickest_is_taken():
    choice = choose(runs(), time_budget=1e-6)
    assert choice.surrogate.kind == "pce"
    assert [trial.error is None for trial in choice.trials] == [False, True, True]
    assert "gpr no time" in repr(choice)


def test_fit_holds_out_the_same_runs_as_ever():
    surrogate = fit(runs(), "auto", time_budget=1e-6, validation=20)
    assert (surrogate.n_train, surrogate.validation.method) == (60, "held out 20")
    assert surrogate.validation == fit(runs(), "pce", validation=20).validation
    folds = fit(runs(), "auto", time_budget=1e-6, validation="4-fold")
    assert (folds.n_train, folds.validation.method) == (80, "4-fold")


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("auto", {"time_budget": 0}, "a positive number of seconds"),
        ("auto", {"degree": 3}, "options of auto"),
        ("pce", {"time_budget": 3.0}, "unless the kind is 'auto'"),
    ],
)
def test_wrong_options_are_refused(kind, options, message):
    with pytest.raises(StudyError, match=message):
        fit(runs(), kind, **options)
