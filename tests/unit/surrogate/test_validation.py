import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import StudyError
from tensegra.surrogate.validation import Validation, fold_indices, measure

Y = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 60.0]])
PREDICTION = np.array([[1.1, 10.0], [2.0, 18.0], [2.7, 60.0]])


def measured(std=None):
    return measure(Y, PREDICTION, std, method="held out 3", n_train=7, output_names=["v", "w"])


def test_measures_by_hand():
    v = measured()
    assert v.relative_error == pytest.approx([(0.1 + 0 + 0.1) / 3, 0.1 / 3])  # Eq. (7)
    assert v.normalised_error == pytest.approx([0.4 / 6, 2 / 90])
    assert v.r2_paper == pytest.approx([(0.81 + 0 + 0.49) / 2, (400 + 144 + 900) / 1400])  # Eq. (8)
    assert v.r2 == pytest.approx([1 - 0.1 / 2, 1 - 4 / 1400])
    assert v.mean_abs_error == pytest.approx([0.4 / 3, 2 / 3])  # in the outputs' own units
    assert v.rms_error == pytest.approx([np.sqrt(0.1 / 3), np.sqrt(4 / 3)])
    assert v.max_abs_error == pytest.approx([0.3, 2.0])
    assert v.coverage_90 is None
    assert (v.n_train, v.n_validation) == (7, 3)


def test_coverage_counts_the_runs_inside():
    std = np.array([[0.1, 0.0], [0.0, 1.0], [0.1, 0.0]])
    assert measured(std).coverage_90 == pytest.approx((2 / 3, 2 / 3))


def test_zeros_and_constants_make_measures_infinite_or_undefined_not_errors():
    zero = np.array([[0.0], [0.0]])
    v = measure(zero, zero + 1, None, method="held out 2", n_train=1, output_names=["w"])
    assert v.relative_error == (np.inf,)
    assert np.isnan(measure(zero, zero, None, method="", n_train=1, output_names=["w"]).r2[0])
    assert measure(zero, zero, None, method="", n_train=1, output_names=["w"]).relative_error == (0.0,)


def test_it_survives_json():
    v = measured(np.ones((3, 2)))
    assert Validation.from_dict(json.loads(json.dumps(v.to_dict(), allow_nan=False))) == v
    infinite = measure(np.zeros((2, 1)), np.ones((2, 1)), None, method="", n_train=1, output_names=["w"])
    back = Validation.from_dict(json.loads(json.dumps(infinite.to_dict(), allow_nan=False)))
    assert back.relative_error == (np.inf,)


def test_words():
    assert measured().summary() == "error 6.7e-02 relative (Eq. 7, held out 3)"
    lines = measured(np.ones((3, 2))).lines(["cm", ""])
    assert "largest 3.00e-01 cm, 90 % interval covers 100.0%" in lines[0]
    assert [row["output"] for row in measured().rows()] == ["v", "w"]


@given(st.integers(2, 12), st.integers(0, 100), st.integers(0, 2**31))
def test_folds_are_a_partition(n_folds, extra, seed):
    n_points = 2 * n_folds + extra
    folds = fold_indices(n_points, n_folds, np.random.default_rng(seed))
    assert np.array_equal(np.sort(np.concatenate(folds)), np.arange(n_points))
    assert max(map(len, folds)) - min(map(len, folds)) <= 1


@pytest.mark.parametrize("n_folds", [0, 1, 6])
def test_impossible_folds_are_refused(n_folds):
    with pytest.raises(StudyError, match="2 to 5 folds of 10 runs"):
        fold_indices(10, n_folds, np.random.default_rng(0))
