import numpy as np
import pytest

from tensegra.mechanics import solve_path
from tensegra.structure import library
from tensegra_paper.beam_model import BeamRuns, solve_beam

INPUTS = {"A14": np.array([0.1, 0.05]), "A23": np.array([0.1, 0.02]), "T_top": np.array([0.0, 100.0])}


@pytest.fixture(scope="module")
def runs():
    return solve_beam(library.paper_beam(), INPUTS)


def test_outputs_are_those_of_the_path(runs):
    beam = library.paper_beam()
    path = solve_path(beam, {"A14": 0.05, "A23": 0.02}, {"top": 100.0})
    assert runs.v[1] == pytest.approx(path.displacement("y", nodes=["18", "23"]), rel=1e-9)
    assert runs.w[1] == pytest.approx(path.displacement("z", nodes=["18", "23"]), rel=1e-9)
    assert runs.displacement("z", "23")[1] == pytest.approx(path.displacement("z", nodes=["23"]), rel=1e-9)


def test_a_warmer_top_lets_the_tip_down(runs):
    cold = solve_beam(library.paper_beam(), INPUTS | {"T_top": np.zeros(2)})
    assert runs.w[1] < cold.w[1]
    assert runs.w[0] == cold.w[0]


def test_runs_survive_their_file_form(runs):
    back = BeamRuns.of_arrays(runs.to_arrays())
    assert list(back.inputs) == list(INPUTS)
    np.testing.assert_array_equal(back.X, runs.X)
    np.testing.assert_array_equal(back.tip, runs.tip)
    assert back.seconds == runs.seconds
    assert back.stands.all()


def test_times_of_joined_runs_add_up(runs):
    joined = BeamRuns.joined([runs, runs])
    assert joined.n_runs == 4
    assert joined.seconds == pytest.approx(2 * runs.seconds)
