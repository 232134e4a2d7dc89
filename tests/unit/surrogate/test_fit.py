import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.surrogate import fit


def data(n=60, seed=0):
    X = np.random.default_rng(seed).uniform(size=(n, 2))
    Y = np.stack([1 + X[:, 0] ** 2, 2 + X[:, 0] * X[:, 1], 3 - X[:, 1]], axis=1)
    return TrainingData(X=X, Y=Y, bounds=[[0, 1], [0, 1]], output_names=("u", "v", "w"))


class Campaign:
    def training_data(self):
        return data()


def test_runs_come_in_several_forms():
    X, Y = data().X, data().Y
    expected = fit(data(), "pce").predict(X[:5])
    np.testing.assert_allclose(fit(Campaign(), "pce").predict(X[:5]), expected, atol=1e-10)
    # Without bounds the box is that of the points.
    np.testing.assert_allclose(fit((X, Y), "pce").predict(X[:5]), expected, atol=1e-10)
    with pytest.raises(StudyError, match="expected a campaign"):
        fit(3, "pce")
    with pytest.raises(StudyError, match="'1 arrays'"):
        fit((X,), "pce")


def test_hold_out_by_share_by_number_by_runs_or_not_at_all():
    assert fit(data(), "pce").validation.method == "held out 12"
    share = fit(data(), "pce", validation=0.5)
    assert (share.n_train, share.validation.n_validation, share.validation.n_train) == (30, 30, 30)
    number = fit(data(), "pce", validation=10)
    assert (number.n_train, number.validation.n_validation) == (50, 10)
    own = fit(data(), "pce", validation=data(25, seed=1))
    assert (own.n_train, own.validation.method) == (60, "held out 25")
    assert fit(data(), "pce", validation=None).validation is None


def test_training_size_leaves_the_held_out_runs_alone():
    surrogate = fit(data(), "pce", training_size=20, validation=30)
    assert (surrogate.n_train, surrogate.validation.n_validation) == (20, 30)


def test_cross_validation_trains_on_all_runs():
    surrogate = fit(data(), "pce", validation="6-fold")
    v = surrogate.validation
    assert (surrogate.n_train, v.method, v.n_train, v.n_validation) == (60, "6-fold", 50, 60)
    assert max(v.normalised_error) < 1e-10
    assert v.coverage_90 is not None


def test_outputs_are_selected_by_name_and_in_order():
    surrogate = fit(data(), "pce", outputs=["w", "u"], validation=data(10, seed=2))
    assert surrogate.output_names == ("w", "u")
    np.testing.assert_allclose(surrogate.predict(data().X), data().Y[:, [2, 0]], atol=1e-10)
    assert max(surrogate.validation.max_abs_error) < 1e-10
    with pytest.raises(StudyError, match=r"outputs: found 'W'.* did you mean 'w'"):
        fit(data(), "pce", outputs=["W"])


def test_the_seed_chooses_the_runs_held_out():
    errors = [fit(data(), "pce", degree=1, seed=seed).validation.normalised_error for seed in (1, 1, 2)]
    assert errors[0] == errors[1] != errors[2]


@pytest.mark.parametrize("validation", [0, 1.5, 60, -0.2, True, "5 folds", "", 1.0])
def test_impossible_validations_are_refused(validation):
    if validation == 1.0 and not isinstance(validation, bool):
        assert fit(data(), "pce", validation=validation).validation.n_validation == 1
        return
    with pytest.raises(StudyError, match="validation"):
        fit(data(), "pce", validation=validation)


@pytest.mark.parametrize("size", [0, 1, 49])
def test_impossible_training_sizes_are_refused(size):
    with pytest.raises(StudyError, match="training size"):
        fit(data(), "pce", training_size=size)


def test_validation_runs_of_another_shape_are_refused():
    other = TrainingData(X=np.zeros((4, 1)), Y=np.zeros((4, 3)))
    with pytest.raises(StudyError, match=r"found \(1, 3\), expected \(2, 3\)"):
        fit(data(), "pce", validation=other)


def test_unknown_kind_is_refused():
    with pytest.raises(StudyError, match="one of gpr, nn, pce, field, piecewise; did you mean 'gpr'"):
        fit(data(), "gp")


def test_description_teaches():
    text = fit(data(), "pce", max_degree=4).describe()
    assert text.startswith("Surrogate('pce': x1, x2 → u, v, w; 48 runs; error ")
    assert "seed 0, max_degree 4" in text
    assert "x1               0 … 1" in text
    assert "not validated" in fit(data(), "pce", validation=None).describe()


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        ("pce", {"degree": "three"}, r"options of pce: degree: found 'three', expected int \| None"),
        ("pce", {"sparse": 1}, "sparse: found 1, expected bool"),
        ("nn", {"hidden": [30, 2.5]}, r"hidden: found \[30, 2\.5\], expected Sequence\[int\] \| None"),
        ("nn", {"learning_rate": True}, "learning_rate: found True, expected float"),
        ("gpr", {"subset": 1e3}, r"subset: found 1000\.0, expected int"),
    ],
)
def test_options_of_a_wrong_type_are_refused(kind, options, message):
    with pytest.raises(StudyError, match=message):
        fit(data(), kind, **options)
