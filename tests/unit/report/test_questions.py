"""Screening, robust optima, trajectories and calibrations, from the study's entry to its section."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tensegra.report import figures
from tensegra.report.analysis_tables import grouped, result_tables
from tensegra.report.pipeline import carry_out
from tensegra.report.report import build_report
from tensegra.report.results import open_results
from tensegra.study import parse_study

MEASURED = {
    "A14": [0.005, 0.010, 0.015],
    "w": [2.46, 4.78, None],
    "w_std": [0.05, 0.05, None],
    "T_K1": [None, 159.8, 170.8],
    "T_K1_std": [None, 0.5, 0.5],
}
ERROR = {"normal": {"mean": 0, "std": 0.0002}}
CONTENT = {
    "name": "asked",
    "structure": "library:paper_beam",
    "seed": 3,
    "variables": {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.02]}},
        "A23": {"actuator": "A23", "distribution": {"uniform": [0.0, 0.02]}},
        "prestress": {
            "prestress": {"stage": "prestress", "members": ["K1", "K4"]},
            "distribution": {"normal": {"mean": -0.0255, "std": 0.001}},
        },
    },
    "outputs": {
        "v": {"displacement": "y", "nodes": [18, 23]},
        "w": {"displacement": "z", "nodes": [18, 23]},
        "T_K1": {"tension": "K1"},
    },
    "design": {"sampler": "sobol", "sizes": 64},
    "surrogates": {"pce": {"kind": "pce"}},
    "analyses": [
        {
            "propagation": {
                "name": "Scatter",
                "model": "pce",
                "compare_with": "truth",
                "samples": 40,
                "quantiles": [0.9],
                "limits": {"w": 5.0},
                "outputs": ["w"],
            }
        },
        {"sensitivity": {"name": "Shares", "model": "pce", "method": "chaos"}},
        {"morris": {"name": "Screening", "model": "truth", "trajectories": 4}},
        {
            "optimisation": {
                "name": "Lift",
                "model": "pce",
                "objective": "w",
                "constraints": ["T_K1 <= 150"],
                "bounds": {"prestress": [-0.0255, -0.0255]},
                "methods": ["slsqp", "direct"],
                "starts": 4,
            }
        },
        {
            "robust": {
                "name": "Safe lift",
                "model": "pce",
                "objective": "w",
                "constraints": ["v <= 2"],
                "errors": {"A14": ERROR, "A23": {"same_as": "A14"}},
                "inputs": {"prestress": -0.0255},
                "starts": 2,
                "draws": 16,
                "samples": 32,
            }
        },
        {
            "inverse": {
                "name": "Steps",
                "model": "pce",
                "targets": {"w": [2.0, 4.0], "v": [None, 1.0]},
                "errors": {"A14": ERROR},
                "inputs": {"prestress": -0.0255},
                "samples": 32,
            }
        },
        {
            "calibration": {
                "name": "Prestress",
                "model": "pce",
                "measurements": MEASURED,
                "inputs": {"A23": 0.0},
                "chains": 2,
                "draws": 60,
                "warmup": 60,
                "predict": {"inputs": {"A14": 0.02}, "outputs": ["w"], "samples": 64, "quantiles": [0.5]},
            }
        },
    ],
}


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    done = carry_out(parse_study(CONTENT), tmp_path_factory.mktemp("asked"), workers=1)
    return open_results(done.campaign)


@pytest.fixture(scope="module")
def contents(asked):
    return {group[0].kind: group[0].content for group in grouped(asked.analyses)}


def test_every_entry_has_its_result(asked, contents):
    assert list(contents) == [next(iter(entry)) for entry in CONTENT["analyses"]]
    assert {stored.kind for stored in asked.analyses} == set(contents)
    lift = [stored.content for stored in asked.analyses if stored.kind == "optimisation"]
    assert [(content["method"], content["model"]) for content in lift] == [
        ("slsqp", "pce"),
        ("direct", "truth"),
    ]
    assert_allclose(lift[0]["objective"], lift[1]["objective"], rtol=1e-3)
    assert contents["robust"]["spreads"]["robust"]["other"]["model"] == "truth"
    assert contents["inverse"]["true_status"] == ["stable", "stable"]
    assert [p["name"] for p in contents["calibration"]["parameters"]] == ["prestress"]
    assert contents["calibration"]["prediction"]["true"] is not None


def test_the_tables_say_what_was_found(asked):
    tables = {table.title: table for table in result_tables(asked)}
    assert list(tables) == [
        "Scatter",
        "Scatter: quantiles and limits",
        "Shares",
        "Screening",
        "Lift",
        "Safe lift",
        "Steps",
        "Prestress",
        "Measurements and predictions",
        "Prestress: prediction",
        "Prestress: prediction: quantiles and limits",
    ]
    for table in tables.values():
        assert {len(row) for row in table.rows} == {len(table.header)} == {len(table.align)}
    quantities = [row[2] for row in tables["Scatter: quantiles and limits"].rows]
    assert quantities == ["90 % quantile", "P(> 5)"] * 2
    assert "In closed form" in tables["Shares"].note
    assert any(row[0].startswith("P(v <= 2), truth") for row in tables["Safe lift"].rows)
    assert [row[0] for row in tables["Steps"].rows] == ["1", "", "2", ""]
    assert tables["Steps"].rows[0][3:6] == ("w [cm]", "2", "2")
    assert tables["Steps"].rows[1][4] == "–"  # v is free at the first waypoint
    assert len(tables["Measurements and predictions"].rows) == 4  # the cells that were measured
    assert "4 trajectories, 16 runs of truth" in tables["Screening"].note


def test_every_result_has_its_section_and_figures(asked):
    report = build_report(asked)
    n_figures = {section.title: len(section.figures) for section in report.sections}
    expected = {"Shares": 1, "Screening": 1, "Lift": 2, "Safe lift": 1, "Steps": 1, "Prestress": 3}
    assert {title: n_figures[title] for title in expected} == expected
    text = " ".join(paragraph for section in report.sections for paragraph in section.paragraphs)
    assert "largest R̂" in text.replace("Largest", "largest")
    assert "Errors and random inputs: A14" in text


def test_the_axes_name_their_units(contents):
    def labels(drawing):
        return {axes.get_xlabel() for axes in drawing.axes} | {axes.get_ylabel() for axes in drawing.axes}

    assert "effect on T_K1 [kN]" in labels(figures.screening_figure(contents["morris"]))
    robust = contents["robust"]
    panels = figures.robust_panels(robust)
    assert {"w [cm]", "margin of v <= 2 [cm]"} <= labels(figures.robust_figure(robust, panels))
    assert {"w − target [cm]", "waypoint"} <= labels(figures.trajectory_figure(contents["inverse"]))
    calibration = contents["calibration"]
    assert "prestress" in labels(figures.marginal_figure(calibration))
    assert {"A14", "T_K1 − predicted [kN]"} <= labels(figures.fit_figure(calibration))
    assert "w [cm]" in labels(figures.prediction_figure(calibration["after"]))


def test_inputs_that_stand_fixed_are_left_out_of_the_visits(asked):
    lift = [stored for stored in asked.analyses if stored.kind == "optimisation"]
    drawing = figures.visited_figure([s.content for s in lift], [s.trace() for s in lift])
    assert [axes.get_xlabel() for axes in drawing.axes] == ["A14", "A23", "objective [cm]"]


def test_what_the_posterior_predicts_is_narrower_than_the_prior(contents):
    prior, posterior = contents["calibration"]["after"]
    spread = [part["outputs"]["w"]["statistics"]["std"]["value"] for part in (prior, posterior)]
    assert spread[1] < spread[0]
    assert np.isfinite(spread).all()
