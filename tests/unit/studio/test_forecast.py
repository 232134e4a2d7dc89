"""What a campaign knows of a set-point, against the study itself."""

import json
import struct

import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.structure.text import load_yaml
from tensegra.studio import forecast
from tensegra.studio.page import Page
from tensegra.studio.source import Source
from tensegra.study import parse_study
from tensegra.surrogate import fit

STUDY = {
    "schema": "tensegra/study/1",
    "name": "beam",
    "structure": "library:paper_beam",
    "seed": 1,
    "variables": {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.05, 0.10]}},
        "T": {"temperature": "top", "distribution": {"uniform": [0, 150]}},
    },
    "outputs": {
        "w": {"displacement": "z", "nodes": [18, 23]},
        "z": {"coordinate": "z", "nodes": [18]},
        "d": {"distance": True, "nodes": [18, 23]},
        "K1": {"tension": "K1"},
        "R": {"reaction": "z", "nodes": [1, 4]},
        "most": {"max_tension": "all"},
        "least": {"min_tension": "all"},
        "n": {"slack_cables": "all"},
        "e": {"lowest_eigenvalue": True},
    },
    "design": {"sampler": "sobol", "sizes": 32},
    "surrogates": {"pce": {"kind": "pce"}},
}
POINT = {"A14": 0.07, "T": 40.0}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    study = parse_study(STUDY)
    campaign = study.run(tmp_path_factory.mktemp("runs"))
    return Source("runs", study.structure, study, {"pce": fit(campaign.training_data(["w", "K1"]), "pce")})


def said(page, message):
    answer = page.answer(message)
    length = struct.unpack("<I", answer[:4])[0]
    return json.loads(answer[4 : 4 + length])


def test_true_outputs_are_those_of_the_study(source):
    told = said(Page(source), {"type": "move", "values": POINT})["state"]
    row = source.study.evaluate(np.array([[POINT[name] for name in source.study.input_names]])).Y[0]
    assert told["truth"] == pytest.approx(
        dict(zip(source.study.output_names, row, strict=True)), rel=1e-6, abs=1e-6
    )


def test_predictions_are_near_the_truth_and_say_where_they_leave_their_training(source):
    page = Page(source)
    told = said(page, {"type": "move", "values": POINT})["state"]
    value, low, high = told["predictions"]["pce"]["outputs"]["w"]
    assert value == pytest.approx(told["truth"]["w"], rel=1e-3)
    assert (low is None) == (high is None)
    assert not told["predictions"]["pce"]["outside"]
    outside = said(page, {"type": "move", "values": {"A14": 0.12}})["state"]
    assert outside["predictions"]["pce"]["outside"]


def test_the_spread_is_that_of_the_free_variables_alone(source):
    found = forecast.spread(source, "pce", POINT, ["T"], {"w": 0.0})["w"]
    assert found["exceedance"] == 1.0
    assert sum(found["counts"]) == forecast.SAMPLES
    ends = [
        said(Page(source), {"type": "move", "values": {**POINT, "T": T}})["state"]["truth"]["w"]
        for T in (0, 150)
    ]
    assert found["low"] == pytest.approx(min(ends), abs=0.02 * abs(ends[1] - ends[0]))
    assert found["high"] == pytest.approx(max(ends), abs=0.02 * abs(ends[1] - ends[0]))
    held = forecast.spread(source, "pce", POINT, [], {})["w"]
    assert held["low"] == pytest.approx(held["mean"], abs=1.0)
    assert held["percentiles"][0] == pytest.approx(held["percentiles"][2])


def test_slopes_are_the_change_over_a_variable_s_range(source):
    slopes = forecast.spread(source, "pce", POINT, [], {})["w"]["slopes"]
    step = 1e-4
    up, down = (
        forecast.predictions(source, {**POINT, "A14": POINT["A14"] + sign * step})["pce"]["outputs"]["w"][0]
        for sign in (1, -1)
    )
    assert slopes["A14"] == pytest.approx((up - down) / (2 * step) * 0.05, rel=1e-3)


def test_the_optimum_is_solved_again_and_its_entry_is_one_of_a_study(source):
    found = forecast.best(source, "pce", "w", maximise=True, search=["A14"], values=POINT)
    assert found["inputs"] == pytest.approx({"A14": 0.10, "T": 40.0})
    assert found["true_status"] == "stable"
    assert found["true_objective"] == pytest.approx(found["objective"], rel=1e-3)
    asked = parse_study({**STUDY, "analyses": load_yaml(found["entry"])})
    assert asked.analyses[0].optimisation.objective == "w"


@pytest.mark.parametrize(
    ("message", "fault"),
    [
        ({"type": "spread", "surrogate": "gpr", "free": [], "limits": {}}, "one of the campaign's"),
        ({"type": "spread", "surrogate": "pce", "free": ["A41"], "limits": {}}, "did you mean 'A14'"),
        ({"type": "spread", "surrogate": "pce", "free": "A14", "limits": {}}, "a list of variables"),
        ({"type": "optimise", "surrogate": "pce", "output": "w", "search": []}, "a list of variables"),
        ({"type": "optimise", "surrogate": "pce", "output": "w * 2", "search": ["A14"]}, "an output"),
        ({"type": "optimise", "surrogate": "pce", "output": "w", "search": ["B"]}, "a variable"),
    ],
)
def test_what_a_page_may_not_ask_is_refused(source, message, fault):
    assert fault in said(Page(source), message)["text"]


def test_a_structure_alone_has_no_forecast(source):
    alone = Source("library:paper_beam", source.structure, None, source.surrogates)
    with pytest.raises(StudyError, match="needs a campaign"):
        forecast.spread(alone, "pce", POINT, [], {})
