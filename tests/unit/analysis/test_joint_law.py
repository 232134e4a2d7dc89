"""What a surrogate was trained under is what every analysis of it draws from."""

import numpy as np
import pytest
from hanging import exact_moments, hanging, height
from numpy.testing import assert_allclose
from scipy import stats

import tensegra as tg
from tensegra.analysis import FunctionModel, SurrogateModel, calibrate, chaos_indices, propagate
from tensegra.errors import StudyError
from tensegra.study import TrainingData
from tensegra.surrogate import Surrogate, fit
from tensegra.surrogate.chaos import moments, sobol_indices

NARROW = {"normal": {"mean": 0.05, "std": 0.01}}
CORRELATED = {"correlation": [[1, -0.9], [-0.9, 1]]}

# Of 20,000 samples a standard deviation is known to half a percent; four of that.
SAMPLED = 0.02
# The expansion of 256 runs and the quasi-Monte Carlo integral of it are both exact to about 1e-3.
INTEGRATED = 3e-3


def saved_and_loaded(surrogate, folder):
    return Surrogate.load(surrogate.save(folder / "s.tg"))


@pytest.fixture(scope="module", params=[{}, CORRELATED], ids=["independent", "correlated"])
def campaign(request, tmp_path_factory):
    return hanging(NARROW, **request.param).run(tmp_path_factory.mktemp("hanging"))


@pytest.mark.parametrize("kind", ["gpr", "pce"])
def test_propagation_of_a_surrogate_is_that_of_its_study(campaign, kind, tmp_path):
    surrogate = saved_and_loaded(fit(campaign, kind), tmp_path)
    found = propagate(surrogate, samples=20_000).outputs["z"]
    mean, std = exact_moments(campaign.study)
    assert_allclose(found.std.value, std, rtol=SAMPLED)
    assert_allclose(found.mean.value, mean, atol=4 * std / np.sqrt(20_000))
    told = propagate(campaign.study, samples=16).laws
    assert propagate(surrogate, samples=16).laws == told


def test_the_expansion_has_the_moments_of_the_joint_law(campaign, tmp_path):
    pce = saved_and_loaded(fit(campaign, "pce"), tmp_path)
    mean, std = exact_moments(campaign.study)
    assert_allclose(moments(pce), [[mean], [std]], rtol=INTEGRATED)
    assert_allclose(chaos_indices(pce).indices["z"].variance, std**2, rtol=2 * INTEGRATED)


def test_an_expansion_says_what_it_cannot_give(tmp_path):
    pce = fit(hanging(NARROW, **CORRELATED).run(tmp_path), "pce")
    found = chaos_indices(pce).indices["z"]
    assert "correlated" in found.reason
    assert np.isnan([*found.first, *found.total]).all()
    with pytest.raises(StudyError, match="expected independent"):
        sobol_indices(pce)


def test_the_file_holds_names_units_laws_and_copula(tmp_path):
    study = hanging(NARROW, **CORRELATED)
    surrogate = saved_and_loaded(fit(study.run(tmp_path / "runs"), "pce"), tmp_path)
    space = surrogate.space
    assert space.names == study.space.names
    assert space.units == study.space.units
    assert [v.quantity for v in space.variables] == ["actuator", "youngs_modulus"]
    assert_allclose(space.correlation, study.space.correlation)
    assert_allclose(surrogate.bounds, study.space.bounds)
    U = np.random.default_rng(0).random((100, 2))
    assert np.array_equal(space.from_unit(U), study.space.from_unit(U))


LAWS = [
    {"uniform": [1, 2]},
    {"normal": {"mean": 3, "std": 0.1}},
    {"truncated_normal": {"mean": 3, "std": 0.1, "low": 2.9}},
    {"lognormal": {"mean": 2, "std": 1}},
    {"exponential": {"mean": 0.1, "shift": 3, "reflected": True}},
    {"beta": {"a": 2, "b": 3}},
    {"empirical": {"values": [1, 2, 2.5, 4]}},
    {"discrete": {"values": [1, 2, 4], "probabilities": [0.2, 0.3, 0.5]}},
    stats.gamma(2.0, scale=0.5),
    stats.norm(loc=1.0, scale=2.0),
]


@pytest.mark.parametrize(
    "law", LAWS, ids=lambda law: next(iter(law)) if isinstance(law, dict) else law.dist.name
)
def test_every_law_survives_the_file(law, tmp_path):
    law = tg.study.as_distribution(law) if isinstance(law, dict) else law
    X = np.random.default_rng(1).random((40, 2)) + 1.0
    data = TrainingData(X=X, Y=X.sum(axis=1), distributions=(law, stats.uniform(1, 1)))
    surrogate = fit(data, "gpr", validation=None)
    again = saved_and_loaded(surrogate, tmp_path)
    levels = np.linspace(0.01, 0.99, 33)
    assert np.array_equal(again.space.distributions[0].ppf(levels), law.ppf(levels))


def test_a_law_that_no_file_can_hold_is_refused_by_name(tmp_path):
    class Own:
        def pdf(self, x):
            return np.ones_like(x)

        def ppf(self, q):
            return q

    X = np.random.default_rng(1).random((40, 1))
    surrogate = fit(TrainingData(X=X, Y=X[:, 0], distributions=(Own(),)), "gpr", validation=None)
    with pytest.raises(StudyError, match="law of x1"):
        surrogate.save(tmp_path / "s.tg")


def test_a_law_that_is_told_goes_before_the_surrogates_own(campaign):
    pce = fit(campaign, "pce")
    found = propagate(pce, {"A": 0.05, "E": {"normal": {"mean": 100, "std": 1}}}, samples=4096)
    E = np.random.default_rng(2).normal(100, 1, 10**5)
    assert_allclose(found.outputs["z"].std.value, height(0.05, E).std(), rtol=0.05)
    other = propagate(SurrogateModel(pce, space=hanging({"uniform": [0.04, 0.06]}).space), samples=64)
    assert "uniform" in other.laws["A"]


def test_the_prior_of_a_surrogate_is_its_training_law(campaign):
    found = calibrate(
        fit(campaign, "pce"), {"A": [0.05], "z": [height(0.05, 100.0)], "z_std": [1.0]}, draws=200
    )
    parameter = found.parameter("E")  # a measurement that tells nothing leaves the prior
    assert_allclose([parameter.mean, parameter.std], [100, 5], rtol=0.05)


def test_arrays_alone_are_uniform_on_their_box():
    X = np.random.default_rng(1).random((60, 1))
    surrogate = fit((X, X[:, 0]), "pce")
    assert surrogate.space is None
    assert "uniform" in propagate(surrogate, samples=16).laws["x1"]
    assert (
        "uniform"
        in propagate(FunctionModel(lambda X: X, ("a",), ("y",), np.array([[0, 1]])), samples=16).laws["a"]
    )
