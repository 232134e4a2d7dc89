import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.mechanics import solve_batch
from tensegra.structure import apply_changes, library
from tensegra.study import parse_study
from tensegra.study.data import TrainingData
from tensegra.surrogate import RegimeData, fit, regime_labels

X = np.arange(12.0).reshape(6, 2)
Y = np.array([1.0, 2.0, np.nan, 4.0, np.nan, 6.0])
LABELS = ["taut", "slack", "collapsed", "taut", "failed", "taut"]


def test_rows_are_sorted_into_those_that_stand_and_the_others():
    data = RegimeData.of(X, Y, LABELS)
    assert data.n_points == 6
    assert data.runs.Y[:, 0].tolist() == [1, 2, 4, 6]
    assert data.labels.tolist() == ["taut", "slack", "taut", "taut", "collapsed", "failed"]
    np.testing.assert_array_equal(data.X[4:], X[[2, 4]])
    # The box is that of all runs, also of those at which nothing stands.
    np.testing.assert_array_equal(data.runs.box, [[0, 10], [1, 11]])


def test_without_labels_a_run_stands_if_it_has_outputs():
    data = RegimeData.of(X, Y, bounds=[[0, 20], [0, 20]], output_names=("w",))
    assert data.labels.tolist() == ["standing"] * 4 + ["fallen"] * 2
    assert data.runs.output_names == ("w",)
    assert repr(data) == "RegimeData(4 of 6 points stand: x1, x2 → w; 2 fallen, 4 standing)"


def test_rows_count_through_both():
    part = RegimeData.of(X, np.stack([Y, 2 * Y], axis=1), LABELS).rows([0, 3, 4]).select_outputs(["y2"])
    assert part.labels.tolist() == ["taut", "taut", "collapsed"]
    assert part.runs.Y[:, 0].tolist() == [2, 12]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"regimes": ["taut"] * 3}, "shapes"),
        ({"regimes": ["taut", "slack", "taut", "collapsed"]}, "'collapsed'.* a regime in which every run"),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    data = RegimeData.of(X, Y, LABELS)
    parts = {"runs": data.runs, "regimes": data.regimes, "fallen_X": data.fallen_X, "fallen": data.fallen}
    with pytest.raises(StudyError, match=message):
        RegimeData(**(parts | change))


def test_a_standing_run_without_outputs_is_refused():
    with pytest.raises(StudyError, match="a finite number"):
        RegimeData.of(X, Y, ["taut"] * 6)
    with pytest.raises(StudyError, match="some runs that stand"):
        RegimeData.of(X, Y, ["collapsed"] * 6)
    with pytest.raises(StudyError, match="a row for each run"):
        RegimeData.of(X, Y[:3])


def test_a_batch_is_taut_slack_or_collapsed():
    beam = apply_changes(library.paper_beam(), {"gravity": [0, 0, 0]})
    A = np.random.default_rng(3).uniform(0, 0.3, size=(60, 3))
    batch = solve_batch(beam, actuation=dict(zip(("A1", "A23", "A4"), A.T, strict=True)))
    labels = regime_labels(batch)
    assert set(labels.tolist()) <= {"taut", "slack", "collapsed"}
    assert {"taut", "collapsed"} <= set(labels.tolist())
    np.testing.assert_array_equal(labels == "collapsed", batch.status == "collapsed")
    stands = labels != "collapsed"
    np.testing.assert_array_equal(labels[stands] == "slack", batch.slack[stands].any(axis=1))


def test_a_campaign_brings_its_regimes(tmp_path):
    study = parse_study(
        {
            "schema": "tensegra/study/1",
            "structure": "library:paper_beam",
            "changes": {"gravity": [0, 0, 0]},
            "variables": {
                name: {"actuator": name, "distribution": {"uniform": [0.0, 0.3]}}
                for name in ("A1", "A23", "A4")
            },
            "outputs": {"w": {"displacement": "z", "nodes": ["18", "23"]}, "n": {"slack_cables": "all"}},
            "design": {"sampler": "sobol", "sizes": 64},
        }
    )
    campaign = study.run(tmp_path / "runs")
    surrogate = fit(campaign, "piecewise", outputs=["w"], validation=None, piece="pce", iterations=50)
    status = campaign.frame()["status"]
    assert surrogate.n_train == 64
    assert "taut" in surrogate.regime_names
    assert ("collapsed" in surrogate.regime_names) == (status == "collapsed").any()
    # A kind that knows of no regimes learns from what stands.
    assert fit(campaign, "pce", outputs=["w"], validation=None).n_train == (status != "collapsed").sum()


def test_other_kinds_take_what_stands():
    data = RegimeData.of(X, Y, LABELS)
    assert fit(data, "pce", degree=0, validation=None).n_train == 4
    assert isinstance(data.runs, TrainingData)
