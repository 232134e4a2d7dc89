import numpy as np
import pytest

from tensegra_paper.chapter import Agreement
from tensegra_paper.chapters.accuracy import chapter
from tensegra_paper.setting import Setting


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Train networks for a hundredth of their iterations, to see the chapter and not its accuracy."""
    quick = {"training": "two_stage", "hidden": (50, 50), "adam_iterations": 50, "iterations": 20}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chapter, "KINDS", {"gpr": ("gpr", {}), "nn": ("nn", quick)})
        patch.setattr(chapter, "SMALL_SIZES", (50, 1000))
        patch.setattr(chapter, "N_PREDICTED", 1000)
        setting = Setting(tmp_path_factory.mktemp("accuracy"), scale=0.001)
        first = chapter.accuracy(setting)
        told = []
        again = chapter.accuracy(Setting(setting.folder, scale=0.001, tell=told.append))
        assert told == []  # nothing is trained again
        yield first, again


def test_claims_stand_for_both_kinds(made):
    chapter_made, _ = made
    claims = {row.claim: row for row in chapter_made.rows if row.claim}
    assert claims["process error"].holds
    assert claims["process more accurate"].holds
    # A network of 50 iterations is worse than the printed one, and its row says so.
    assert not claims["network error"].holds
    r2 = [row for row in chapter_made.rows if row.place.startswith("Fig. 11")]
    assert len(r2) == 4
    assert all(row.agreement is Agreement.METHOD for row in r2)


def test_more_runs_leave_a_smaller_error(made):
    chapter_made, _ = made
    rows = {(row[0], row[1]): float(row[2]) for row in chapter_made.tables[0].rows}
    assert rows["Gaussian process", "1000"] < 0.1 * rows["Gaussian process", "50"]


def test_what_was_measured_is_kept(made):
    first, again = made
    measured = [row.ours for row in first.rows if row.place.startswith("Fig.")]
    assert measured == [row.ours for row in again.rows if row.place.startswith("Fig.")]
    assert all(isinstance(row.ours, str) or np.isfinite(row.ours) for row in again.rows)


def test_its_figures_can_be_drawn(made):
    error, parity = (figure.draw() for figure in made[0].figures)
    assert [axes.get_title() for axes in error.axes] == ["(a) v", "(b) w"]
    assert len(parity.axes) == 4
