import numpy as np
import pytest

from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapters.designs.chapter import spread
from tensegra_paper.five_inputs import ACTUATIONS, TEMPERATURES, product_design
from tensegra_paper.setting import Setting

N_ACTUATIONS, N_TEMPERATURES = 25, 64


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return product_design(Setting(tmp_path_factory.mktemp("designs")), N_ACTUATIONS, N_TEMPERATURES)


def test_every_actuation_meets_every_temperature(inputs):
    pairs = np.column_stack([inputs[name] for name in (*ACTUATIONS, *TEMPERATURES)])
    assert len(np.unique(pairs, axis=0)) == len(pairs) == N_ACTUATIONS * N_TEMPERATURES
    assert len(np.unique(pairs[:, :2], axis=0)) == N_ACTUATIONS
    assert len(np.unique(pairs[:, 2:], axis=0)) == N_TEMPERATURES


def test_inputs_fill_their_printed_ranges(inputs):
    for name in ACTUATIONS:
        assert 0.09 <= inputs[name].min() < 0.0908
        assert 0.0992 < inputs[name].max() <= 0.10
    for name in TEMPERATURES:
        assert 0.0 <= inputs[name].min() < 5.0
        assert 145.0 < inputs[name].max() <= 150.0


def runs_of(inputs):
    n_runs = len(inputs["A14"])
    return BeamRuns(inputs, np.full(n_runs, "stable"), np.zeros((n_runs, 2, 3)), *np.zeros((3, n_runs)), 1.0)


def test_the_effect_of_temperatures_is_told_from_that_of_actuations(inputs):
    """For y = a A14 + 3 T_top + T_bottom the shares follow from the variances of the inputs."""
    values = 1000.0 * inputs["A14"] + 0.03 * inputs["T_top"] + 0.01 * inputs["T_bottom"]
    found = spread(runs_of(inputs), values, N_ACTUATIONS)
    temperatures = (0.03 * inputs["T_top"] + 0.01 * inputs["T_bottom"]).var()
    assert found.share == pytest.approx(temperatures / values.var(), rel=1e-9)
    ratio = found.by_temperature["T_top"] / found.by_temperature["T_bottom"]
    assert ratio == pytest.approx(9.0 * inputs["T_top"].var() / inputs["T_bottom"].var(), rel=1e-6)
    assert found.by_temperature["T_middle"] == pytest.approx(0.0, abs=1e-12)


def test_boxes_are_sorted_by_magnitude(inputs):
    values = -1000.0 * inputs["A14"] + 0.01 * inputs["T_top"]
    boxes = spread(runs_of(inputs), values, N_ACTUATIONS).boxes
    assert np.all(np.diff(np.abs(boxes[2])) >= 0.0)
    assert np.all(np.diff(boxes, axis=0) >= 0.0)
