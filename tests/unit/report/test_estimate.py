"""What follows the runs is told before them."""

from tensegra.report.estimate import estimate, estimate_table
from tensegra.study.cost import Probe

COST = Probe(32, 8, {"stable": 8}, seconds_per_run=0.5, seconds_per_block=0.0)


def told(study):
    return {(part.name, part.model): part for part in estimate(study, COST)}


def test_every_surrogate_and_analysis_is_told(small_study):
    parts = told(small_study())
    assert parts["pce", "runs"].n_points == 26  # a fifth of 32 is held out
    assert parts["Scatter", "pce"].n_points == parts["Scatter", "truth"].n_points == 40
    assert parts["Scatter", "pce"].seconds is None
    assert parts["Scatter", "truth"].seconds == 20.0
    assert parts["Shares", "pce"].n_points == 64 * 6  # Saltelli: 2 d + 2 points a block
    assert parts["Lift", "pce"].n_points == 2 * 3 * 40
    table = estimate_table(list(parts.values()))
    assert [row[0] for row in table.rows] == ["pce", "gpr", "Scatter", "Scatter", "Shares", "Lift"]
    assert table.rows[3][-1] == "20 s"


def test_counts_are_those_of_the_methods(small_study):
    analyses = [
        {"sensitivity": {"name": "chaos", "model": "pce", "method": "chaos"}},
        {"sensitivity": {"name": "first", "model": "pce", "samples": 64, "second_order": False}},
        {"morris": {"name": "screen", "model": "truth", "trajectories": 5}},
        {"optimisation": {"name": "best", "model": "pce", "objective": "w", "methods": ["direct", "bayesian"],
                          "starts": 2, "evaluations": 30}},
        {"inverse": {"name": "way", "model": "pce", "targets": {"w": [1.0, 2.0, 3.0]}, "starts": 2,
                     "samples": 10}},
        {"robust": {"name": "safe", "model": "pce", "objective": "w", "errors": {"T": {"normal": [0, 1]}},
                    "starts": 2, "draws": 8, "samples": 100}},
        {"calibration": {"name": "learn", "model": "pce", "measurements": {"w": [1.0], "w_std": [0.1]},
                         "chains": 2, "warmup": 30, "draws": 50}},
    ]  # fmt: skip
    counts = {key: part.n_points for key, part in told(small_study(analyses=analyses)).items()}
    assert counts["chaos", "pce"] == 0
    assert counts["first", "pce"] == 64 * 4
    assert counts["screen", "truth"] == 15
    assert (counts["best", "pce"], counts["best", "truth"]) == (30, 80)
    assert counts["way", "pce"] == 3 * (80 + 10)
    assert counts["safe", "pce"] == 80 * 8 + 200
    assert counts["learn", "pce"] == 2 * 80 * 16
