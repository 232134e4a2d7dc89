import numpy as np
import pytest

from tensegra_paper.chapters.shapes.chapter import _pair_row, shapes
from tensegra_paper.chapters.shapes.pair import find_pair
from tensegra_paper.setting import STRUCTURES, Setting


@pytest.mark.parametrize("beam", STRUCTURES)
def test_different_increments_end_in_different_shapes(tmp_path, beam):
    pair = find_pair(Setting(tmp_path, beam))
    regular, irregular = (pair.stepped[i].final for i in (pair.regular, pair.irregular))
    np.testing.assert_allclose(regular.nodes, pair.robust.final.nodes, atol=1e-3)
    assert np.linalg.norm(irregular.nodes - regular.nodes, axis=1).max() > 1.0
    assert regular.succeeded
    # It is an equilibrium that was found, not a diverged iterate.
    assert irregular.residual <= 1e-9


def test_the_chapter_says_what_holds(tmp_path):
    chapter = shapes(Setting(tmp_path))
    findings = {row.claim: row for row in chapter.rows if row.claim}
    assert set(findings) == {"y grows", "two shapes"}
    assert findings["y grows"].holds
    # What was put in says nothing of what comes out.
    assert all(row.holds is None for row in chapter.rows if not row.claim)
    assert [figure.name for figure in chapter.figures][:2] == ["fig-03a-structure", "fig-03bc-views"]
    assert len(chapter.tables[0].rows) == 9


@pytest.mark.parametrize("strain", [0.01, 0.89])
def test_a_root_beyond_the_law_is_no_second_shape(tmp_path, monkeypatch, strain):
    pair = find_pair(Setting(tmp_path))
    monkeypatch.setattr(type(pair.robust.final), "largest_strain", strain)
    assert _pair_row(pair).holds is (strain <= 0.05)
