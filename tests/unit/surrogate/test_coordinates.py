import numpy as np
import pytest
from scipy import stats

from tensegra.study import TrainingData
from tensegra.study.distributions import as_distribution
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.problem import Problem

CASES = {
    "raw": [
        {"uniform": [2, 3]},
        {"normal": [0, 1]},
        {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
        {"beta": [0.1, 0.1]},
        {"lognormal": {"mean": 10, "std": 2}},
        {"triangular": [0, 0, 1]},
        {"discrete": {"values": [0, 1, 2]}},
        {"empirical": {"values": [1, 1, 2, 3, 5, 5]}},
    ],
    "log": [
        {"lognormal": {"mean": 1, "std": 1}},
        {"lognormal": {"mean": 1, "std": 5, "shift": 100}},
        {"weibull": [0.4, 1]},
        {"empirical": {"values": np.exp(np.random.default_rng(0).normal(size=200)).tolist()}},
    ],
    "two-sided log": [
        {"empirical": {"values": stats.t(1.5).ppf(np.linspace(0.002, 0.998, 300)).tolist(), "method": "kde"}},
    ],
}


def problem(law, *, told=True, n=200):
    X = law.ppf((np.random.default_rng(0).permutation(n) + 0.5) / n)[:, None]
    laws = (law,) if told else None
    return Problem.of(TrainingData(X=X, Y=X, distributions=laws))


@pytest.mark.parametrize(("kind", "law"), [(kind, law) for kind, laws in CASES.items() for law in laws])
def test_the_law_chooses(kind, law):
    asked = problem(as_distribution(law))
    coordinates = Coordinates.of(asked)
    assert coordinates.kinds == (kind,)
    W = coordinates.forward(asked.Z)
    assert np.ptp(W) < 15
    assert np.all(np.diff(W[np.argsort(asked.Z[:, 0]), 0]) >= 0)


@pytest.mark.parametrize(("kind", "law"), [("raw", stats.uniform()), ("log", stats.lognorm(1.0))])
def test_without_a_law_the_runs_choose(kind, law):
    assert Coordinates.of(problem(law, told=False)).kinds == (kind,)


@pytest.mark.parametrize("kind", CASES)
def test_the_slope_is_the_derivative(kind):
    asked = problem(as_distribution(CASES[kind][0]))
    coordinates = Coordinates.of(asked)
    # Also beyond the runs, where a logarithm goes on as its tangent.
    Z = np.linspace(asked.Z.min() - 0.5, asked.Z.max() + 0.5, 101)[:, None]
    step = 1e-6
    numeric = (coordinates.forward(Z + step) - coordinates.forward(Z - step)) / (2 * step)
    assert np.all(np.isfinite(coordinates.forward(Z)))
    np.testing.assert_allclose(coordinates.slope(Z), numeric, rtol=1e-4)


def test_derivatives_change_with_the_coordinate():
    X = np.exp(np.random.default_rng(0).normal(size=(50, 1)))
    data = TrainingData(X=X, Y=np.log(X), dY=1 / X, distributions=(stats.lognorm(1.0),))
    asked = Problem.of(data)
    own = Coordinates.of(asked).problem(asked)
    np.testing.assert_allclose(own.dT, own.dT[0, 0, 0], rtol=1e-9)  # a logarithm is straight in itself
