import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tensegra.analysis import FunctionModel, optimise
from tensegra.errors import StudyError

BOX = np.array([[0.0, 1.0], [-1.0, 1.0]])


def waves(X):
    return np.where(X[:, 0] < 0.05, np.nan, np.sin(3 * X[:, 0]) - X[:, 1] ** 2)


MODEL = FunctionModel(waves, ("a", "b"), ("w",), BOX)


def search(path=None, evaluations=12, **changes):
    return optimise(MODEL, "w", method="bayesian", evaluations=evaluations, file=path, **changes)


def test_a_search_that_is_stopped_goes_on_as_if_it_had_not_been(tmp_path):
    path, cut = tmp_path / "search.json", 9

    def stop(done, _):
        if done == cut + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search(path, progress=stop)
    assert len(json.loads(path.read_text(encoding="utf-8"))["x"]) == cut
    again = search(path)
    assert_array_equal(again.trace.x, search().trace.x)
    assert again.n_evaluations == 12
    assert "9 are from an earlier search" in again.reason


def test_more_evaluations_than_before_go_on_from_the_file(tmp_path):
    path = tmp_path / "search.json"
    first, more = search(path, evaluations=8), search(path, evaluations=14)
    assert_array_equal(more.trace.x[:8], first.trace.x)
    assert more.n_evaluations == 14
    assert more.objective >= first.objective


def test_a_failed_run_is_kept_as_one(tmp_path):
    holed = FunctionModel(lambda X: np.where(X[:, 0] > 0.5, np.nan, X[:, 0]), ("a", "b"), ("w",), BOX)
    path = tmp_path / "search.json"
    optimise(holed, "w", method="bayesian", evaluations=6, file=path)
    outputs = json.loads(path.read_text(encoding="utf-8"))["outputs"]
    assert [None] in outputs
    again = optimise(holed, "w", method="bayesian", evaluations=8, file=path)
    assert np.isnan(again.trace.objective[:6]).sum() == outputs.count([None])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"seed": 2}, r"settings.seed: found 0, expected 2"),
        ({"acquisition": "ei"}, "settings.acquisition"),
        ({"maximise": False}, "problem.maximise"),
        ({"bounds": {"a": [0, 0.5]}}, "problem.bounds"),
        ({"constraints": ("a <= 0.5",)}, "problem.constraints"),
    ],
)
def test_a_file_of_another_search_is_refused(tmp_path, changes, told):
    path = tmp_path / "search.json"
    search(path, evaluations=3)
    with pytest.raises(StudyError, match=told):
        search(path, evaluations=4, **changes)


def test_what_is_no_search_is_refused(tmp_path):
    path = tmp_path / "search.json"
    path.write_text("{}", encoding="utf-8")
    with pytest.raises(StudyError, match="tensegra/search/1"):
        search(path)
    path.write_text("no", encoding="utf-8")
    with pytest.raises(StudyError, match="cannot be read as a search"):
        search(path)
    with pytest.raises(StudyError, match="cannot be written"):
        search(tmp_path / "nowhere" / "search.json")
    with pytest.raises(StudyError, match="'bayesian', which alone"):
        optimise(MODEL, "w", file=path)
