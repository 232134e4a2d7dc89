import re

import pytest
from study_contents import CONTENT

from tensegra.errors import StudyError
from tensegra.study import parse_study


def analyses(*entries):
    return parse_study({**CONTENT, "analyses": list(entries)}).analyses


MEASURED = {"A14": [0.09, 0.1], "w": [47.0, None], "w_std": [0.1, None]}


def test_all_kinds_are_read_and_written_in_full():
    read = analyses(
        {
            "propagation": {
                "model": "truth",
                "quantiles": [0.05],
                "limits": {"w": [40, 50]},
                "confidence": 0.9,
            }
        },
        {"sensitivity": {"model": "truth", "samples": 64}},
        {"morris": {"model": "truth", "inputs": {"A14": 0.1}}},
        {"optimisation": {"model": "truth", "objective": "w", "methods": ["direct"], "acquisition": "mpi"}},
        {
            "robust": {
                "model": "truth",
                "objective": "w",
                "errors": {"A14": {"normal": [0, 0.001]}},
                "kappa": 3,
            }
        },
        {"inverse": {"model": "truth", "targets": {"w": [40.0, None, 50.0], "T_K1": 80}, "tolerance": 0.1}},
        {"calibration": {"model": "truth", "measurements": MEASURED, "predict": {"inputs": {"A14": 0.1}}}},
    )
    kinds = ["propagation", "sensitivity", "morris", "optimisation", "robust", "inverse", "calibration"]
    assert [entry.kind for entry in read] == kinds
    written = [entry.written() for entry in read]
    assert analyses(*written) == read
    assert written[0]["propagation"]["limits"] == {"w": [40, 50]}
    assert read[4].value.errors["A14"].law().std == pytest.approx(0.001)
    assert read[6].value.measurements["w"] == (47.0, None)


def test_measurements_are_read_from_their_file(tmp_path):
    (tmp_path / "m.csv").write_text("A14,w,w_std\n0.09,47.0,0.1\n0.10,,\n", encoding="utf-8")
    content = {**CONTENT, "analyses": [{"calibration": {"model": "truth", "measurements": "m.csv"}}]}
    study = parse_study(content, tmp_path)
    assert study.analyses[0].value.measurements == {
        "A14": (0.09, 0.1),
        "w": (47.0, None),
        "w_std": (0.1, None),
    }
    assert parse_study(study.to_mapping()).analyses == study.analyses  # which needs no file any more


def test_errors_take_units_like_inputs():
    content = {
        **CONTENT,
        "variables": {"L": {"rest_length": "K2", "distribution": {"uniform": [447, 448]}}},
        "analyses": [
            {"robust": {"model": "truth", "objective": "w", "errors": {"L": {"normal": ["0 mm", "5 mm"]}}}}
        ],
    }
    assert parse_study(content).analyses[0].value.errors["L"].law().std == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ({"propagation": {"model": "truth", "limits": {"x": 1}}}, "limits: found 'x', expected an output"),
        ({"propagation": {"model": "truth", "quantiles": [1.5]}}, "less than 1"),
        ({"sensitivity": {"model": "truth", "method": "chaos", "inputs": {"A14": 0.1}}}, "does not take"),
        ({"morris": {"model": "truth", "levels": 3}}, "multiple of 2"),
        ({"morris": {"model": "truth", "trajectories": 2}}, "greater than or equal to 4"),
        (
            {"robust": {"model": "truth", "objective": "w", "errors": {"A41": {"normal": [0, 1]}}}},
            "errors: found 'A41', expected a variable; did you mean 'A14'?",
        ),
        (
            {
                "robust": {
                    "model": "truth",
                    "objective": "w",
                    "errors": {"A14": {"same_as": "A14"}},
                }
            },
            "errors.A14.same_as: found 'A14', expected another variable",
        ),
        ({"inverse": {"model": "truth", "targets": {"v": 1}}}, "targets: found 'v', expected an output"),
        ({"inverse": {"model": "truth", "targets": {"w": [1, 2], "T_K1": [1]}}}, "lists of one length"),
        ({"inverse": {"model": "truth", "targets": {"w": 1}, "tolerance": {"v": 1}}}, "tolerance: found 'v'"),
        ({"calibration": {"model": "truth", "measurements": {"x": [1]}}}, "an output or <output>_std"),
        ({"calibration": {"model": "truth", "measurements": "none.csv"}}, "measurements: found 'none.csv'"),
        (
            {"calibration": {"model": "truth", "measurements": MEASURED, "predict": {"outputs": ["v"]}}},
            "predict.outputs: found 'v', expected an output",
        ),
        ({"optimisation": {"model": "truth", "objective": "w", "methods": ["newton"]}}, "methods"),
    ],
)
def test_entries_that_make_no_sense_are_refused(entry, told):
    with pytest.raises(StudyError, match=re.escape(told)):
        analyses(entry)
