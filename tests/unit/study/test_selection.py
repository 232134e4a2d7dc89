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
    assert selection.note == "10 of 960 certified runs are left out"


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


def test_the_certificate_keeps_every_run_that_stands_and_is_compared_with_the_groups(frame):
    selection = select(frame, ["w", "v"])
    assert_array_equal(selection.keep, frame["status"].isin(["stable", "snapped"]))
    assert selection.note == ""
    assert selection.rule == "certified by the solver"
    by_group = select(frame, ["w", "v"], method="hdbscan")
    assert_array_equal(selection.labels, by_group.labels)
    assert selection.table.equals(by_group.table)


def test_without_the_comparison_nothing_is_clustered(frame, monkeypatch):
    monkeypatch.setattr("tensegra.study.selection._hdbscan_labels", None)
    selection = select(frame, ["w", "v"], compare=False)
    assert selection.n_kept == 960
    assert set(selection.labels) == {NO_GROUP, 0}


def test_the_paper_keeps_the_largest_group_whatever_the_solver_says(frame):
    frame.loc[frame.index[frame["status"] == "stable"][:5], "status"] = "unstable"
    by_group = select(frame, ["w", "v"], method="hdbscan")
    assert by_group.n_kept == 950
    assert by_group.note == "10 of 955 certified runs are left out; 5 of the 950 runs kept are not certified"
    assert "HDBSCAN" in by_group.rule
    both = select(frame, ["w", "v"], method="both")
    assert both.n_kept == 945
    assert both.note == "10 of 955 certified runs are left out"
    assert_array_equal(both.keep, by_group.keep & frame["status"].isin(["stable", "snapped"]))


def test_hdbscan_is_the_papers_with_nothing_added(frame):
    from hdbscan import HDBSCAN

    Y = frame[["w", "v"]].dropna()
    expected = HDBSCAN(min_cluster_size=25).fit_predict((Y - Y.mean()) / Y.std(ddof=0))
    labels = select(frame, ["w", "v"], method="hdbscan", min_cluster_size=25).labels
    found = labels[frame["w"].notna()]
    # The same groups, renumbered by size.
    pairs = set(zip(found.tolist(), expected.tolist(), strict=True))
    assert len(pairs) == len(set(expected)) == len(set(found))


def test_a_cloud_in_which_hdbscan_finds_no_group_is_told():
    Y = np.random.default_rng(3).normal(size=(300, 2))
    frame = pd.DataFrame(Y, columns=["w", "v"]).assign(status="stable")
    selection = select(frame, ["w", "v"], method="hdbscan")
    assert selection.note == f"{300 - selection.n_kept} of 300 certified runs are left out"
    assert select(frame, ["w", "v"]).n_kept == 300


def test_few_runs_are_one_group(frame):
    selection = select(frame.iloc[:30], ["w"], method="hdbscan")
    assert set(selection.labels) <= {NO_GROUP, 0}


def test_a_constant_output_does_not_disturb(frame):
    frame["constant"] = 1.0
    selection = select(frame, ["w", "v", "constant"], method="hdbscan")
    assert selection.n_kept == 950
