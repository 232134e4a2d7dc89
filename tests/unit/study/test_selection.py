import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

from tensegra.study import select
from tensegra.study.selection import NO_GROUP


@pytest.fixture
def frame():
    """950 regular runs, 50 irregular ones far from them, 20 failed; some irregular ones are certified."""
    rng = np.random.default_rng(1)
    x = rng.uniform(size=(950, 2))
    regular = np.column_stack([50 + 4 * x[:, 0] + x[:, 1] ** 2, 10 + np.sin(3 * x[:, 1])])
    irregular = np.array([-40.0, 3.0]) + rng.normal(scale=[0.5, 0.1], size=(50, 2))
    Y = np.concatenate([regular, irregular, np.full((20, 2), np.nan)])
    status = ["stable"] * 950 + ["collapsed"] * 40 + ["snapped"] * 10 + ["failed"] * 20
    frame = pd.DataFrame(Y, columns=["w", "v"]).assign(status=status)
    return frame.sample(frac=1, random_state=1).reset_index(drop=True)


def test_the_largest_group_is_kept_and_the_irregular_one_is_not(frame):
    selection = select(frame, ["w", "v"], method="hdbscan")
    assert_array_equal(selection.keep, frame["status"] == "stable")
    assert selection.n_kept == 950
    assert selection.note == ""


def test_groups_are_numbered_by_size_and_failures_are_in_none(frame):
    labels = select(frame, ["w", "v"], method="hdbscan").labels
    assert_array_equal(np.unique(labels), [NO_GROUP, 0, 1])
    assert set(labels[frame["status"] == "failed"]) == {NO_GROUP}
    assert set(labels[frame["status"] == "collapsed"]) == {1}


def test_the_table_sets_groups_against_statuses(frame):
    table = select(frame, ["w", "v"], method="hdbscan").table
    assert table.to_dict("index") == {
        "collapsed": {"largest group": 0, "other groups": 40, "no group": 0},
        "failed": {"largest group": 0, "other groups": 0, "no group": 20},
        "snapped": {"largest group": 0, "other groups": 10, "no group": 0},
        "stable": {"largest group": 950, "other groups": 0, "no group": 0},
    }


def test_a_certificate_is_asked_for_beside_the_group(frame):
    frame["status"] = frame["status"].replace("snapped", "unstable")
    frame.loc[frame.index[frame["status"] == "stable"][:5], "status"] = "unstable"
    selection = select(frame, ["w", "v"], method="hdbscan")
    assert selection.n_kept == 945


def test_the_certificate_alone_keeps_every_run_that_stands(frame):
    selection = select(frame, ["w", "v"], method="status")
    assert_array_equal(selection.keep, frame["status"].isin(["stable", "snapped"]))
    assert list(selection.table.columns) == ["largest group", "other groups", "no group"]


@pytest.mark.parametrize("n_runs", [60, 500, 2000])
def test_a_single_cloud_is_not_torn_to_pieces(n_runs):
    x = np.random.default_rng(2).uniform(size=(n_runs, 3))
    Y = np.column_stack([10 * x[:, 0] + x[:, 1] ** 2, np.sin(x[:, 1]) + 0.1 * x[:, 2]])
    frame = pd.DataFrame(Y, columns=["w", "v"]).assign(status="stable")
    assert select(frame, ["w", "v"], method="hdbscan").n_kept > 0.8 * n_runs


def test_where_no_group_stands_out_the_certificate_decides_and_it_is_said():
    Y = np.random.default_rng(3).normal(size=(300, 2))
    frame = pd.DataFrame(Y, columns=["w", "v"]).assign(status="stable")
    selection = select(frame, ["w", "v"], method="hdbscan", merge_distance=0.0)
    assert selection.keep.all()
    assert "found no group that stands out" in selection.note


def test_few_runs_are_one_group(frame):
    selection = select(frame.iloc[:30], ["w"], method="hdbscan")
    assert set(selection.labels) <= {NO_GROUP, 0}


def test_a_constant_output_does_not_disturb(frame):
    frame["constant"] = 1.0
    selection = select(frame, ["w", "v", "constant"], method="hdbscan")
    assert selection.n_kept == 950
