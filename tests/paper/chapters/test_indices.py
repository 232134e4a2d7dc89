from dataclasses import replace

import numpy as np
import pytest

from tensegra.analysis import FunctionModel, sobol_indices
from tensegra.surrogate import fit
from tensegra_paper.chapter import Agreement
from tensegra_paper.chapters.indices import chapter
from tensegra_paper.setting import Setting

BOX = np.array([[0.0, 1.0], [0.0, 1.0]])


@pytest.fixture(scope="module")
def line():
    model = FunctionModel(lambda X: 2 * X[:, 0] + X[:, 1], ("a", "b"), ("y",), BOX)
    return sobol_indices(model, samples=256)


def test_the_largest_difference_of_two_results_is_found(line):
    indices = line.indices["y"]
    moved = replace(indices, total=indices.total + np.array([0.0, -0.25]))
    assert chapter._apart(line, replace(line, indices={"y": moved})) == pytest.approx(0.25)


def test_indices_outside_their_intervals_are_counted(line):
    indices = line.indices["y"]
    moved = replace(indices, first=indices.first + np.array([3.0, 0.5]) * indices.first_half)
    inside, n_indices, farthest = chapter._inside(line, replace(line, indices={"y": moved}))
    assert (inside, n_indices) == (3, 4)
    assert farthest == pytest.approx(3.0)


def test_the_chapter_is_filled_and_its_methods_agree(tmp_path, monkeypatch):
    def quick(_setting, _name, data, _kind, **_options):
        return fit(data.rows(np.arange(400)), "pce", validation=None)

    monkeypatch.setattr(chapter, "trained", quick)
    made = chapter.indices(Setting(tmp_path, scale=0.001))
    method = [row for row in made.rows if row.agreement is Agreement.METHOD]
    assert len(method) == 2
    assert all(row.holds for row in method)
    dropped = next(row for row in made.rows if row.quantity.startswith("blocks dropped"))
    assert 0.0 < dropped.ours < 100.0
    # The surviving blocks and those with collapsed runs at rest answer different questions.
    four = [row.ours for row in made.rows if row.quantity.startswith("total indices of v")]
    assert four[0] != four[1]
    claims = {row.claim: row.holds for row in made.rows if row.claim}
    assert len(claims) == 7
    assert not claims["top much stronger"]
    assert not claims["A14 low on y"]
    for figure in made.figures:
        assert figure.draw().axes
