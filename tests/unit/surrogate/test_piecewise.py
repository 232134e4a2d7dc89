import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.surrogate import RegimeData, fit, load
from tensegra.surrogate.outcome import softmax, train_outcome

BOX = [[-1.0, 1.0], [-1.0, 1.0]]


def label(X):
    """Divide the square by a circle around a corner, and what is inside that by a parabola."""
    fallen = np.hypot(X[:, 0] - 1, X[:, 1] - 1) < 0.8
    slack = X[:, 1] > 0.3 + 0.5 * X[:, 0] ** 2
    return np.where(fallen, "collapsed", np.where(slack, "slack", "taut"))


def response(X):
    """Have a kink along the parabola, and nothing sensible within the circle."""
    over = np.maximum(0, X[:, 1] - 0.3 - 0.5 * X[:, 0] ** 2)
    w = 3 + np.sin(X[:, 0] + X[:, 1]) + 2 * over
    return np.where(label(X) == "collapsed", np.nan, w)


def data(n, seed=0):
    X = np.random.default_rng(seed).uniform(-1, 1, size=(n, 2))
    return RegimeData.of(X, response(X), label(X), bounds=BOX, output_names=("w",))


@pytest.fixture(scope="module")
def surrogate():
    return fit(data(1500), "piecewise", validation=data(1000, seed=1))


def test_it_is_right_within_the_regimes_and_about_them(surrogate):
    assert surrogate.regime_names == ("collapsed", "slack", "taut")
    assert surrogate.validation.outcome_right > 0.98
    assert surrogate.validation.error < 1e-4
    assert "outcome right for 9" in repr(surrogate)
    # One surrogate for all of it is worth a fiftieth of that.
    assert fit(data(1500), "pce", validation=data(1000, seed=1)).validation.error > 50 * 1e-5


def test_it_says_which_regime_it_speaks_for_and_where_it_does_not(surrogate):
    new = data(500, seed=2)
    Y, regime = surrogate.predict(new.X, return_regime=True)
    np.testing.assert_array_equal(np.isnan(Y[:, 0]), regime == "collapsed")
    assert np.mean(regime == new.labels) > 0.97
    Y, std, again = surrogate.predict(new.X, return_std=True, return_regime=True)
    np.testing.assert_array_equal(again, regime)
    np.testing.assert_array_equal(np.isnan(std), np.isnan(Y))
    assert np.isnan(surrogate.gradient(new.X)[regime == "collapsed"]).all()
    assert np.isfinite(surrogate.gradient(new.X)[regime != "collapsed"]).all()


def test_its_probabilities_are_probabilities(surrogate):
    new = data(3000, seed=3)
    P = surrogate.outcome(new.X)
    np.testing.assert_allclose(P.sum(axis=1), 1.0)
    right = np.array(surrogate.regime_names)[P.argmax(axis=1)] == new.labels
    # Calibrated: on average the outcome is as often right as it says (±3 standard deviations of the mean).
    assert np.mean(P.max(axis=1)) == pytest.approx(np.mean(right), abs=3 * np.sqrt(0.02 / 3000))


def test_saved_and_loaded_it_knows_its_regimes(surrogate, tmp_path):
    loaded = load(surrogate.save(tmp_path / "w.tg"))
    X = data(200, seed=4).X
    assert loaded.regime_names == surrogate.regime_names
    assert np.array_equal(loaded.outcome(X), surrogate.outcome(X))
    assert np.array_equal(loaded.predict(X), surrogate.predict(X), equal_nan=True)
    assert loaded.validation == surrogate.validation


def test_a_regime_has_a_piece_of_its_own_where_that_pays():
    X = np.random.default_rng(0).uniform(-1, 1, size=(400, 2))
    same = RegimeData.of(X, np.exp(X[:, 0] - X[:, 1]), np.where(X[:, 0] > 0.7, "slack", "taut"))
    options = {"piece": "pce", "iterations": 20, "validation": None}
    # What goes on unchanged across the border is known better from the larger side: the set of terms there
    # is settled by seven times the runs.
    assert len(fit(data(600), "piecewise", **options).model.pieces) == 2
    few = same.rows(np.r_[np.flatnonzero(same.labels == "taut"), np.flatnonzero(same.labels == "slack")[:10]])
    model = fit(few, "piecewise", **options).model
    assert len(model.pieces) == 1
    assert model.piece_of == (0, 0)


def test_cross_validation_counts_outcomes_too():
    validation = fit(data(300), "piecewise", validation="3-fold", piece="pce", iterations=100).validation
    assert validation.method == "3-fold"
    assert validation.n_validation == np.count_nonzero(data(300).labels != "collapsed")
    assert 0.9 < validation.outcome_right <= 1.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"piece": "piecewise"}, "another kind"),
        ({"piece": "pcee"}, "did you mean 'pce'"),
        ({"hidden": ()}, "piecewise: hidden"),
    ],
)
def test_wrong_options_are_refused(options, message):
    with pytest.raises(StudyError, match=message):
        fit(data(60), "piecewise", validation=None, iterations=2, **options)


def test_other_kinds_know_of_no_regimes():
    surrogate = fit(data(60), "pce", validation=None)
    assert surrogate.regime_names == ()
    X = data(10).X
    for ask in (surrogate.outcome, lambda X: surrogate.predict(X, return_regime=True)):
        with pytest.raises(StudyError, match="one of kind 'piecewise' does"):
            ask(X)


def test_softmax_takes_large_scores():
    np.testing.assert_allclose(softmax(np.array([[1e4, 1e4 - np.log(3)]])), [[0.75, 0.25]])


def test_an_outcome_that_is_a_coin_is_not_claimed_to_be_known():
    """Labels at random with 80 % of one: whatever the training remembers, the calibration tells."""
    rng = np.random.default_rng(0)
    Z, coin = rng.uniform(-1, 1, size=(2000, 2)), np.where(rng.uniform(size=2000) < 0.8, "a", "b")
    outcome = train_outcome(Z, coin, rng, (16, 16), 300)
    p = outcome.probabilities(rng.uniform(-1, 1, size=(2000, 2)))[:, 0]
    # Calibrated on 300 tosses: ±3 standard deviations.
    assert np.mean(p) == pytest.approx(0.8, abs=3 * np.sqrt(0.16 / 300))
    assert np.mean(p > 0.95) < 0.1
