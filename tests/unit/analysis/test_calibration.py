import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from tensegra.analysis import FunctionModel, calibrate, propagate, read_measurements
from tensegra.analysis.measurements import Measurements
from tensegra.analysis.priors import prior_of
from tensegra.errors import StudyError
from tensegra.study import parse_study

BOX = np.array([[1.0, 3.0], [0.0, 2.0], [0.0, 5.0]])


def pull(X):
    k, length, force = X.T
    return np.stack([length + force / k, force**2 / (2 * k)], axis=1)


SPRING = FunctionModel(pull, ("k", "length", "force"), ("x", "energy"), BOX, units={"x": "cm"})
FORCES = np.array([1.0, 2.0, 3.0, 4.0])
DATA = {"force": FORCES, "x": 1.0 + FORCES / 2.0 + [0.01, -0.02, 0.0, 0.01], "x_std": np.full(4, 0.02)}

# A straight line y = a + b t with normal priors: the posterior is normal, in closed form.
LINE = FunctionModel(lambda X: X[:, 0] + X[:, 1] * X[:, 2], ("a", "b", "t"), ("y",))
T = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
Y = np.array([1.1, 1.4, 2.2, 2.4, 3.1])
S = np.array([0.1, 0.2, 0.1, 0.3, 0.1])
LINE_PRIORS = {"a": stats.norm(0.5, 1.0), "b": stats.norm(0.0, 2.0)}


def line(**changes):
    options = {"inputs": LINE_PRIORS, "draws": 1000, "warmup": 100} | changes
    return calibrate(LINE, {"t": T, "y": Y, "y_std": S}, **options)


def test_the_posterior_of_a_straight_line_is_the_closed_form():
    A = np.stack([np.ones(5), T], axis=1) / S[:, None]
    precision = A.T @ A + np.diag([1.0, 0.25])
    covariance = np.linalg.inv(precision)
    mean = covariance @ (A.T @ (Y / S) + [0.5, 0.0])
    found = line()
    std = np.sqrt(np.diag(covariance))
    # 8,000 draws, more effective ones than 4,000: a mean to 1/60 of a deviation.
    assert_allclose([p.mean for p in found.parameters], mean, atol=0.06 * std.max())
    assert_allclose([p.std for p in found.parameters], std, rtol=0.05)
    assert_allclose(found.correlation()[0, 1], covariance[0, 1] / std.prod(), atol=0.05)
    assert_allclose([p.low for p in found.parameters], mean - 1.645 * std, atol=0.1 * std.max())
    assert_allclose(list(found.mode.values()), mean, rtol=1e-5)
    assert found.success
    assert found.n_divergent == 0
    assert_allclose([p.prior_std for p in found.parameters], [1.0, 2.0], rtol=0.1)


def test_what_the_data_do_not_tell_keeps_its_prior():
    found = calibrate(
        SPRING, {"force": [0.0], "x": [1.2], "x_std": [0.05]}, inputs={"k": {"uniform": [1, 3]}}
    )
    k, length = found.parameters
    assert_allclose([k.mean, k.std], [2.0, 2 / np.sqrt(12)], rtol=0.06)
    assert_allclose([length.mean, length.std], [1.2, 0.05], rtol=0.06)


def test_a_parameter_stays_within_its_prior():
    found = calibrate(SPRING, DATA, inputs={"k": {"uniform": [2.2, 3.0]}})
    assert found.draws[:, :, 0].min() >= 2.2
    assert found.parameter("k").mean < 2.25
    assert found.prediction.p_value < 0.01
    assert "the model does not fit the data" in found.reason


def test_the_prediction_stands_beside_the_data():
    found = calibrate(SPRING, {**DATA, "energy": [0.25, np.nan, 2.2, np.nan], "energy_std": [0.05] * 4})
    prediction = found.prediction
    assert prediction.outputs == ("x", "energy")
    assert np.isnan(prediction.low[[1, 3], 1]).all()
    measured = np.isfinite(prediction.measured)
    inside = (prediction.low <= prediction.measured) & (prediction.measured <= prediction.high)
    assert inside[measured].mean() > 0.6
    assert 0.02 < prediction.p_value < 0.98
    # A new measurement scatters more than the parameters do: 1.645 times the noise at least.
    assert np.all((prediction.high - prediction.low)[:, 0] > 2 * 1.6 * 0.02)


def test_the_posterior_can_be_propagated_and_keeps_its_ties():
    found = calibrate(SPRING, DATA)
    assert abs(found.correlation()[0, 1]) > 0.5
    after = propagate(SPRING, found.inputs(force=2.5), samples=2000, outputs=["x"]).outputs["x"]
    flat = found.draws.reshape(-1, 2)
    exact = pull(np.column_stack([flat, np.full(len(flat), 2.5)]))[:, 0]
    assert_allclose(after.mean.value, exact.mean(), atol=1e-3)
    assert_allclose(after.std.value, exact.std(), rtol=0.1)
    assert after.std.value < 0.02  # independent draws of k and length would scatter three times as far


def test_inputs_that_are_fixed_or_tied_are_not_inferred():
    three = FunctionModel(lambda X: X[:, 0] + X[:, 1] + X[:, 2], ("a", "b", "c"), ("y",))
    found = calibrate(
        three, {"y": [3.0], "y_std": [0.01]}, inputs={"a": stats.norm(0, 1), "b": {"same_as": "a"}, "c": 1.0}
    )
    assert found.parameter_names == ("a",)
    assert_allclose(found.parameter("a").mean, 1.0, atol=0.01)
    assert (found.fixed, found.tied) == ({"c": 1.0}, {"b": "a"})
    again = propagate(three, found.inputs(), samples=200).outputs["y"]
    assert_allclose(again.mean.value, 3.0, atol=0.01)


def test_two_modes_are_both_drawn():
    square = FunctionModel(lambda X: X[:, 0] ** 2, ("a",), ("y",), np.array([[-2.0, 2.0]]))
    found = calibrate(square, {"y": [1.0], "y_std": [0.05]}, draws=100)
    assert found.success
    assert_allclose((found.draws > 0).mean(), 0.5, atol=0.05)


def test_populations_that_disagree_are_told():
    found = line(draws=60, chains=2)  # 120 draws cannot be 400 effective ones
    assert not found.success
    assert "the populations do not agree" in found.reason


def test_a_correlated_prior_pulls_both_parameters():
    study = parse_study(
        {
            "structure": "library:paper_beam",
            "variables": {
                "a": {"actuator": "A14", "distribution": {"normal": {"mean": 0, "std": 0.01}}},
                "b": {"actuator": "A23", "distribution": {"normal": {"mean": 0, "std": 0.01}}},
            },
            "correlation": [[1.0, 0.9], [0.9, 1.0]],
            "outputs": {"y": {"displacement": "z", "nodes": [18]}},
            "design": {"sampler": "sobol", "sizes": 8},
        }
    )
    first = FunctionModel(lambda X: X[:, 0], ("a", "b"), ("y",), space=study.space)
    found = calibrate(first, {"y": [0.02], "y_std": [0.0001]})
    r = 2 * np.sin(np.pi * 0.9 / 6)
    assert_allclose(found.parameter("b").mean, 0.02 * r, atol=1e-3)
    assert_allclose(found.parameter("b").std, 0.01 * np.sqrt(1 - r**2), rtol=0.06)
    Z = np.random.default_rng(0).standard_normal((5, 2))
    prior = prior_of(first, (), {})
    assert_allclose(prior.values(Z)[0], study.space.from_normal(Z))


def test_the_derivatives_of_the_prior_are_its_slopes():
    laws = {"k": {"triangular": [1, 2, 3]}, "length": stats.norm(1, 0.2), "force": {"same_as": "k"}}
    prior = prior_of(SPRING, (), laws)
    Z, step = np.random.default_rng(0).standard_normal((6, 2)), 1e-5
    _, slopes = prior.values(Z)
    for i in range(2):
        move = step * np.eye(2)[i]
        numeric = (prior.values(Z + move)[0] - prior.values(Z - move)[0]) / (2 * step)
        assert_allclose(slopes[:, :, i], numeric, rtol=1e-5, atol=1e-8)


def test_a_surrogates_own_error_widens_the_posterior():
    from tensegra.surrogate import fit

    rng = np.random.default_rng(0)
    X = rng.uniform(0, 1, (50, 1))
    pce = fit((X, X[:, 0] + 0.1 * rng.standard_normal(50)), "pce", degree=1, validation=None)
    found = calibrate(pce, {"y1": [0.5], "y1_std": [0.001]})
    assert 0.05 < found.parameter("x1").std < 0.2


def test_the_true_model_is_asked_at_the_mode_and_json_can_hold_it_all():
    off = FunctionModel(lambda X: pull(X) + 0.5, ("k", "length", "force"), ("x", "energy"), BOX, name="truth")
    found = calibrate(SPRING, DATA, true_model=off, chains=4, draws=100)
    assert_allclose(found.prediction.true[:, 0] - found.prediction.mean[:, 0], 0.5, atol=0.01)
    content = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert content["kind"] == "calibration"
    assert (content["n_chains"], content["n_draws"]) == (4, 100)
    assert len(content["draws"]) == 400
    assert [row["parameter"] for row in found.table()] == ["k", "length"]
    assert "k = 1.99" in str(found)


def test_the_same_seed_gives_the_same_posterior():
    one, two = (line(draws=60, chains=2) for _ in range(2))
    assert_array_equal(one.draws, two.draws)


def test_a_file_is_read_with_its_gaps(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("force, x, x_std\n1, 1.51, 0.02\n2, , \n3, 2.49, 0.02\n", encoding="utf-8")
    data = Measurements.of(read_measurements(path), SPRING)
    assert (data.n_states, data.n_values, data.outputs) == (3, 2, ("x",))
    assert_array_equal(data.known["force"], [1, 2, 3])
    assert np.isnan(data.values[1, 0])
    path.write_text("force,x\n1,one\n", encoding="utf-8")
    with pytest.raises(StudyError, match=r"data.csv, row 1, column 'x': found 'one'"):
        read_measurements(path)
    with pytest.raises(StudyError, match="a CSV file"):
        read_measurements(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        ({"x": [1.0]}, "a column 'x_std', its standard deviation"),
        ({"x": [1.0], "x_std": [0.0]}, r"x_std, row 1: found 0.0, expected a positive number"),
        ({"x": [1.0, 2.0], "x_std": [1.0]}, "columns of one length"),
        ({"y": [1.0]}, "found 'y'"),
        ({"force": [1.0]}, "one of the outputs"),
        ({"force": [np.nan], "x": [1.0], "x_std": [1.0]}, "force, row 1"),
        ({"x": [np.nan], "x_std": [1.0]}, "the column is empty"),
        ({"x": [1.0], "x_std": [1.0], "energy_std": [1.0]}, "a column 'energy' beside it"),
    ],
)
def test_measurements_that_cannot_be_are_refused(columns, told):
    with pytest.raises(StudyError, match=told):
        calibrate(SPRING, columns)


@pytest.mark.parametrize(
    ("inputs", "told"),
    [
        ({"force": 1.0}, "do not tell already"),
        ({"k": 1.0, "length": 1.0}, "nothing to calibrate"),
        ({"k": {"discrete": {"values": [1, 2]}}}, "a prior with a density"),
    ],
)
def test_priors_that_cannot_be_are_refused(inputs, told):
    with pytest.raises(StudyError, match=told):
        calibrate(SPRING, DATA, inputs=inputs)


def test_a_model_that_fails_everywhere_is_told():
    dead = FunctionModel(lambda X: np.full(len(X), np.nan), ("a",), ("y",), np.array([[0.0, 1.0]]))
    with pytest.raises(StudyError, match="failed at each of 12 draws of the prior"):
        calibrate(dead, {"y": [1.0], "y_std": [1.0]})
    with pytest.raises(StudyError, match="at least 2"):
        calibrate(SPRING, DATA, chains=1)
