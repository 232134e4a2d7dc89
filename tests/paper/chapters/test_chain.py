import numpy as np
import pytest

from tensegra import SolverError
from tensegra_paper import models
from tensegra_paper.chapters.chain import chapter
from tensegra_paper.chapters.optimum import searching
from tensegra_paper.groups import Groups
from tensegra_paper.setting import Setting


def standing(setting, outputs):
    keep = models.lift_runs(setting, stepped=True).stands
    return Groups(tuple(outputs), np.where(keep, 0, -1), keep, 0.0)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(models, "LEAST_LIFT_RUNS", 512)
        patch.setattr(chapter, "NETWORK", chapter.NETWORK | {"adam_iterations": 200})
        patch.setattr(chapter, "LBFGS_ITERATIONS", 20)
        patch.setattr(searching, "EVALUATIONS", 14)
        patch.setattr(searching, "FEWEST_STARTS", {"slsqp": 3, "bfgs": 2, "direct": 6})
        # Among few runs HDBSCAN finds no group; what it finds among many is the affair of another chapter.
        patch.setattr(chapter, "stepped_groups", standing)
        yield chapter.chain(Setting(tmp_path_factory.mktemp("chain"), scale=0.001))


def test_the_chain_runs_to_its_end_and_is_solved_again_by_fem(made):
    assert sum("judged with the printed number of runs alone" in row.why for row in made.rows) == 2
    rows = {name: cells for name, *cells in made.tables[1].rows}
    assert len(rows["w [cm], FEM"]) == len(chapter.SEARCHED)
    assert set(rows["status, FEM"]) <= {"stable", "snapped", "collapsed", "unstable", "failed"}


def test_both_kinds_are_trained_on_all_kept_runs(made):
    trained = [row for row in made.rows if row.quantity.startswith("training on")]
    assert len(trained) == 2
    assert trained[0].quantity.split(",")[0] == trained[1].quantity.split(",")[0]
    assert all(np.isfinite(row.ours) for row in trained)


def test_its_figure_can_be_drawn(made):
    assert made.figures[0].draw().axes


def test_too_few_kept_runs_are_a_numerical_failure(tmp_path, monkeypatch):
    monkeypatch.setattr(models, "LEAST_LIFT_RUNS", 128)
    with pytest.raises(SolverError, match="of 128 stepped runs, too few to learn from"):
        chapter.chain(Setting(tmp_path, scale=0.001))
