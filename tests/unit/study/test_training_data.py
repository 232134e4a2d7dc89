import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData

X = np.arange(12.0).reshape(6, 2)
Y = np.arange(18.0).reshape(6, 3)
DY = np.arange(36.0).reshape(6, 3, 2)


def test_what_is_left_out_is_filled_in():
    data = TrainingData(X=X, Y=Y[:, 0])
    assert data.Y.shape == (6, 1)
    assert data.input_names == ("x1", "x2")
    assert data.output_names == ("y1",)
    assert data.input_units == ("", "")
    assert data.box.tolist() == [[0, 10], [1, 11]]
    assert (data.n_points, data.n_inputs, data.n_outputs) == (6, 2, 1)


def test_derivatives_of_one_output_may_be_a_matrix():
    assert TrainingData(X=X, Y=Y[:, 0], dY=DY[:, 0]).dY.shape == (6, 1, 2)


def test_rows_and_outputs_are_selected_together():
    data = TrainingData(X=X, Y=Y, dY=DY, output_names=("u", "v", "w"), output_units=("cm", "cm", "kN"))
    part = data.rows([4, 1]).select_outputs(["w", "u"])
    assert np.array_equal(part.X, X[[4, 1]])
    assert np.array_equal(part.Y, Y[[4, 1]][:, [2, 0]])
    assert np.array_equal(part.dY, DY[[4, 1]][:, [2, 0]])
    assert part.output_units == ("kN", "cm")
    assert np.array_equal(part.box, data.box)
    assert repr(part) == "TrainingData(2 points: x1, x2 → w, u, with derivatives)"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"Y": Y[:5]}, "as many rows"),
        ({"X": X[:0], "Y": Y[:0]}, "at least one"),
        ({"X": X[:, 0]}, "shape of X"),
        ({"X": X[:, :0]}, "shape of X"),
        ({"X": "text"}, "not an array of numbers"),
        ({"dY": DY[:, :2]}, r"dY: found \(6, 2, 2\), expected the shape \(6, 3, 2\)"),
        ({"bounds": [[0, 1]]}, "2 rows"),
        ({"bounds": [[1, 0], [0, 1]]}, "2 rows"),
        ({"input_names": ("a",)}, "input_names"),
        ({"output_names": ("a", "b", "a")}, "different names"),
        ({"distributions": ()}, "2 of them"),
    ],
)
def test_what_does_not_fit_is_refused(changes, message):
    with pytest.raises(StudyError, match=message):
        TrainingData(**({"X": X, "Y": Y} | changes))


def test_a_failed_run_is_refused_with_its_place():
    bad = Y.copy()
    bad[3, 1] = np.nan
    with pytest.raises(StudyError, match=r"Y\[3, 1\]: found nan, expected a finite number"):
        TrainingData(X=X, Y=bad)


def test_an_unknown_output_is_refused():
    with pytest.raises(StudyError, match="did you mean 'y1'"):
        TrainingData(X=X, Y=Y).select_outputs(["Y1"])
