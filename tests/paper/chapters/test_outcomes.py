import numpy as np
import pytest

from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapters.outcomes import chapter as module
from tensegra_paper.chapters.outcomes.chapter import SHAPES, classify, outcomes
from tensegra_paper.setting import Setting


def runs(status, w, beyond=()):
    n_runs = len(status)
    tip = np.zeros((n_runs, 2, 3))
    tip[:, :, 2] = np.reshape(w, (-1, 1))
    zeros = np.zeros(n_runs)
    strained = np.isin(np.arange(n_runs), beyond)
    return BeamRuns({"A": zeros}, np.array(status), tip, zeros, np.where(strained, 0.9, 0.03), strained, 1.0)


def test_the_shape_is_told_apart_from_the_status():
    nan = float("nan")
    path = runs(
        ["stable", "stable", "snapped", "stable", "collapsed", "collapsed", "stable"], [5, 5, -2, 5, 1, 1, 5]
    )
    stepped = runs(
        ["stable", "stable", "stable", "unstable", "collapsed", "stable", "failed"], [5, 7, -2, 5, 1, 3, nan]
    )
    assert classify(stepped, path).tolist() == [
        "upward",
        "stable, off the path",
        "stable, tip not above its start",
        "does not stand",
        "prestress lost",
        "upward",
        "not converged",
    ]


def test_a_root_beyond_the_law_is_counted_as_such():
    path = runs(["stable", "stable", "stable", "stable"], [5, 5, 5, 5])
    stepped = runs(["unstable", "stable", "stable", "collapsed"], [5, 9, 5, 5], beyond=(0, 1, 2, 3))
    # On the path a run is a shape, whatever its strain; elsewhere it is a root of the equations alone.
    assert classify(stepped, path).tolist() == [
        "spurious root, beyond the law",
        "spurious root, beyond the law",
        "upward",
        "spurious root, beyond the law",
    ]


@pytest.fixture(scope="module")
def chapter(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "N_RUNS", 48)
        return outcomes(Setting(tmp_path_factory.mktemp("outcomes")))


def test_shares_add_up(chapter):
    for table in chapter.tables:
        for column in (1, 2):
            shares = [float(cells[column]) for cells in table.rows[: len(SHAPES)]]
            assert sum(shares) == pytest.approx(100.0, abs=0.05)


def test_no_run_is_lost_along_stable_paths(chapter):
    (rows,) = [[row for row in chapter.rows if row.agreement == "method"]]
    assert len(rows) == 2
    assert all(row.holds and row.ours == 0.0 for row in rows)


def test_the_stepped_procedure_loses_some(chapter):
    lost = [row.ours for row in chapter.rows if "not converged" in row.quantity and "stepped" in row.quantity]
    assert max(lost) > 0.0
