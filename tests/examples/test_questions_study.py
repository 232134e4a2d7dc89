"""The example of every question: one study file, all answers, all sections."""

from pathlib import Path

import pytest
from numpy.testing import assert_allclose

from tensegra.report.pipeline import carry_out, require_sound
from tensegra.report.report import build_report
from tensegra.report.results import open_results
from tensegra.study import read_study

FILE = Path(__file__).parents[2] / "examples" / "questions.yaml"


def test_the_file_asks_every_question():
    study = read_study(FILE)
    require_sound(study)
    kinds = {entry.kind for entry in study.analyses}
    assert kinds == {
        "propagation",
        "sensitivity",
        "morris",
        "optimisation",
        "robust",
        "inverse",
        "calibration",
    }


@pytest.mark.slow
def test_the_file_alone_answers_them_all(tmp_path):
    study = read_study(FILE)
    done = carry_out(study, tmp_path, workers=1)
    results = open_results(done.campaign)
    assert {stored.entry for stored in results.analyses} == set(range(len(study.analyses)))
    by_name = {stored.name: stored.content for stored in results.analyses}
    lift = [stored.content for stored in results.analyses if stored.name == "Highest straight lift"]
    # 348 runs in five variables leave the surrogate some millimetres of error.
    for content in lift:
        assert_allclose(content["objective"], lift[-1]["objective"], rtol=0.02)
        assert content["true_status"] == "stable"
    taut = by_name["Highest lift with taut cables"]
    assert taut["outputs"]["slack"] == 0
    assert taut["outputs"]["max_tension"] <= 240.0 * (1 + 1e-6)
    steps = by_name["A straight lift in steps"]
    assert all(steps["reached"])
    # The measurements were made with E = 11,900 and a prestress of −0.0241.
    posterior = {p["name"]: p for p in by_name["Stiffness and prestress from measurements"]["parameters"]}
    for name, known in (("E", 11900.0), ("prestress", -0.0241)):
        assert abs(posterior[name]["mean"] - known) < 3 * posterior[name]["std"]
    report = build_report(results)
    assert len(report.sections) >= len(study.analyses) + 6
    assert report.html().count("<figure") > 15
