"""Surrogates under laws of every kind: ties, atoms, few values, heavy tails."""

import numpy as np
import pytest
from scipy import stats

from tensegra.analysis import chaos_indices
from tensegra.study import TrainingData
from tensegra.study.distributions import as_distribution
from tensegra.surrogate import fit
from tensegra.surrogate.chaos import moments

LAWS = {
    "ties": {"empirical": {"values": [1, 1, 1, 1, 1, 1, 2, 2, 2, 3, 5, 5]}},
    "smoothed": {"empirical": {"values": [1, 2, 2.5, 4, 9], "method": "kde"}},
    "three values": {"discrete": {"values": [0, 1, 2]}},
    "two values": {"discrete": {"values": [3, 7], "probabilities": [0.9, 0.1]}},
    "U shape": {"beta": [0.2, 0.3]},
    "heavy tail": {"lognormal": {"mean": 1.65, "std": 2.16}},
    "heavier tail": {"weibull": [0.5, 2.0]},
    "kink": {"triangular": [0, 0.2, 1]},
    "reflected": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
}
SLACK = 1e-7  # of a least-squares fit; a law's own moments are exact


def drawn(laws, n, function, seed=0):
    U = np.random.default_rng(seed).random((n, len(laws)))
    X = np.column_stack([law.ppf(u) for law, u in zip(laws, U.T, strict=True)])
    return TrainingData(X=X, Y=function(X), distributions=laws, bounds=[law.box for law in laws])


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_moments_of_an_input_are_those_of_its_law(law):
    laws = (as_distribution(law), as_distribution({"uniform": [0, 1]}))
    data = drawn(laws, 100, lambda X: np.column_stack([X[:, 0], X[:, 0] * X[:, 1]]))
    surrogate = fit(data, "pce", validation=None)
    mean, std = moments(surrogate)
    second = laws[0].std ** 2 + laws[0].mean ** 2
    assert mean == pytest.approx([laws[0].mean, laws[0].mean / 2], rel=SLACK)
    assert std == pytest.approx([laws[0].std, np.sqrt(second / 3 - laws[0].mean ** 2 / 4)], rel=SLACK)
    shares = chaos_indices(surrogate).indices[surrogate.output_names[0]]
    assert shares.first == pytest.approx([1.0, 0.0], abs=SLACK)  # the first output is the first input


@pytest.mark.parametrize("kind", ["pce", "gpr", "auto"])
def test_an_input_of_three_values_is_learnt(kind):
    laws = (as_distribution({"discrete": {"values": [0, 1, 2]}}), as_distribution({"uniform": [0, 1]}))
    data = drawn(laws, 60, lambda X: X[:, 0] ** 2 + X[:, 1])
    options = {"time_budget": 0.01} if kind == "auto" else {}
    surrogate = fit(data, kind, validation=None, **options)
    # A square is a polynomial of the third degree's space; the third itself is none under three values.
    np.testing.assert_allclose(surrogate.predict([[2.0, 0.5], [0.0, 0.25]]), [[4.5], [0.25]], atol=1e-3)
    if kind == "pce":
        assert surrogate.model.indices[:, 0].max() == 2


def test_an_expansion_in_the_logarithm_is_taken_where_it_is_nearer():
    laws = (as_distribution(LAWS["heavy tail"]), as_distribution({"uniform": [0, 1]}))
    data = drawn(laws, 150, lambda X: np.sin(3 * X[:, 1]) + 0.3 * np.log(X[:, 0]))
    surrogate = fit(data, "pce", validation=None)
    assert surrogate.model.coordinates.kinds == ("log", "raw")
    log_std = np.sqrt(np.log1p((2.16 / 1.65) ** 2))
    sine = np.sqrt(0.5 - np.sin(6) / 12 - ((1 - np.cos(3)) / 3) ** 2)
    assert moments(surrogate)[1] == pytest.approx(np.hypot(0.3 * log_std, sine), rel=1e-6)
    inside = laws[0].ppf([0.2, 0.9])
    points = np.column_stack([inside, [0.3, 0.6]])
    np.testing.assert_allclose(
        surrogate.gradient(points)[:, 0], np.column_stack([0.3 / inside, 3 * np.cos(3 * points[:, 1])]), 1e-4
    )


# A law told, or only its draws; the coordinate that is right for it; how far the surrogate may be off.
@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize(("kind", "options"), [("gpr", {}), ("nn", {"hidden": (8, 8), "iterations": 30})])
def test_a_heavy_tail_is_learnt_as_well_as_its_logarithm(kind, options, told):
    """Without it the error was 8 to 70 % of the spread, with it about that of log x."""
    unit = stats.qmc.Sobol(2, seed=1).random(128)
    X = np.column_stack([np.exp(stats.norm.ppf(unit[:, 0])), unit[:, 1]])

    def wave(X):
        return np.sin(3 * X[:, 1]) + 0.01 * np.log(X[:, 0])

    laws = (stats.lognorm(1.0), stats.uniform()) if told else None
    surrogate = fit(TrainingData(X=X, Y=wave(X), distributions=laws), kind, validation=None, **options)
    in_log = np.column_stack([np.log(X[:, 0]), X[:, 1]])
    beside = fit((in_log, wave(X)), kind, validation=None, **options)
    rng = np.random.default_rng(3)
    new = np.column_stack([np.exp(rng.uniform(-2, 2, 500)), rng.uniform(0.01, 0.99, 500)])
    error = np.sqrt(np.mean((surrogate.predict(new)[:, 0] - wave(new)) ** 2))
    log_new = np.column_stack([np.log(new[:, 0]), new[:, 1]])
    own = np.sqrt(np.mean((beside.predict(log_new)[:, 0] - wave(new)) ** 2))
    assert error < 3 * own + 1e-7
    assert surrogate.model.coordinates.kinds == ("log", "raw")
    if kind == "nn":
        np.testing.assert_allclose(surrogate.predict(new, fast=True), surrogate.predict(new), atol=1e-4)


@pytest.mark.parametrize("kind", ["gpr", "nn", "pce"])
def test_the_coordinate_is_in_the_file(kind, tmp_path):
    laws = (as_distribution(LAWS["heavy tail"]), as_distribution({"normal": [0, 1]}))
    data = drawn(laws, 60, lambda X: np.log(X[:, 0]) + X[:, 1])
    surrogate = fit(data, kind, validation=None, **({"iterations": 3} if kind == "nn" else {}))
    loaded = type(surrogate).load(surrogate.save(tmp_path / "tail.tg"))
    assert loaded.model.coordinates.kinds == surrogate.model.coordinates.kinds == ("log", "raw")
    assert np.array_equal(loaded.predict(data.X), surrogate.predict(data.X))
    assert np.array_equal(loaded.gradient(data.X), surrogate.gradient(data.X))
