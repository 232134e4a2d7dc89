import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.mechanics import solve_path
from tensegra.report.analysis_tables import optimum_table, propagation_table, result_tables
from tensegra.report.study_tables import reason_table, validation_table
from tensegra.report.tables import (
    Table,
    aligned,
    displacement_table,
    event_table,
    history_frame,
    number,
    stage_table,
    structure_table,
    tension_table,
    write_history,
)
from tensegra.structure import library
from tensegra.study import CampaignState

SIX_DIGITS = 5e-6
"""Half a unit of the sixth significant digit of the largest number, for which `aligned` has room."""


@pytest.fixture(scope="module")
def path():
    return solve_path(library.paper_beam(), {"A14": 0.10, "A23": 0.10})


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=8))
def test_aligned_numbers_keep_six_digits_of_the_largest(values):
    largest = max(map(abs, values))
    for text, value in zip(aligned(values), values, strict=True):
        assert float(text) == pytest.approx(value, abs=SIX_DIGITS * largest, rel=SIX_DIGITS)


def test_aligned_numbers_have_the_same_number_of_decimals():
    decimals = {len(text.partition(".")[2]) for text in aligned([53.14669, -0.01, 7.0])}
    assert decimals == {4}


def test_numbers_that_there_are_not_are_a_dash():
    assert number(None) == number(float("inf")) == number(float("nan")) == "–"
    assert Table.of("", ("a",), [(None,), (float("nan"),)], "r").rows == (("–",), ("–",))


def test_the_structure_is_described(path):
    text = dict(structure_table(path.structure).rows)
    assert text["Members"] == "12 struts, 32 cables, 4 clustered cables"
    assert text["Units"] == "cm, kN, degC"
    assert text["Supports"] == "xyz at 1, 4, 5, 8"


def test_stages_and_actuation_are_listed_with_their_certificates(path):
    table = stage_table(path)
    assert [row[:2] for row in table.rows] == [("prestress", "stable"), ("actuation", "stable")]
    assert any("[kN/cm]" in header for header in table.header)


def test_displacements_are_in_the_unit_of_length_and_skip_what_does_not_move(path):
    table = displacement_table(path)
    rows = {row[0]: np.array(row[1:], dtype=float) for row in table.rows}
    assert table.title.endswith("cm")
    assert not {"1", "4", "5", "8"} & set(rows)
    tip = (rows["18"] + rows["23"])[:3] / 2
    # The reference values of the beam at 10 %, to the four decimals that the table shows.
    assert tip == pytest.approx([-10.6235, 13.8088, 53.1467], abs=1e-4)


def test_extremes_of_the_tensions_are_named(path):
    rows = {row[0]: row for row in tension_table(path.final).rows}
    clustered = rows["clustered cables"]
    tensions = {name: path.final.tension(name) for name in ("K1", "K2", "K3", "K4")}
    assert clustered[4] == min(tensions, key=tensions.get)
    assert float(clustered[5]) == pytest.approx(max(tensions.values()), abs=1e-3)


def test_a_quiet_history_has_no_events(path):
    assert event_table(path).rows == ()


def test_the_history_is_written_with_units(path, tmp_path):
    file = tmp_path / "path.parquet"
    write_history(path, file)
    frame = pd.read_parquet(file)
    assert len(frame) == len(path.history) == len(history_frame(path))
    last = frame.iloc[-1]
    assert last["z_18"] == path.final.node(18)[2]
    assert last["tension_K1"] == path.final.tension("K1")
    assert frame.attrs["units"] == {"length": "cm", "force": "kN", "temperature": "degC"}


def test_a_history_goes_to_parquet_only(path, tmp_path):
    with pytest.raises(ModelError, match=r"found 'path\.csv', expected a file named \.parquet"):
        write_history(path, tmp_path / "path.csv")
    with pytest.raises(ModelError, match="cannot be written"):
        write_history(path, tmp_path / "nowhere" / "path.parquet")


def test_each_analysis_has_a_table(results):
    titles = [table.title for table in result_tables(results)]
    assert titles == ["Scatter", "Shares", "Lift"]


def test_the_statistics_of_two_models_stand_side_by_side(results):
    table = propagation_table(results.analyses[0])
    assert [row[:2] for row in table.rows] == [
        ("v [cm]", "pce"),
        ("v [cm]", "truth"),
        ("w [cm]", "pce"),
        ("w [cm]", "truth"),
    ]
    content = results.analyses[0].content["outputs"]["w"]["statistics"]
    assert float(table.rows[2][2]) == pytest.approx(content["mean"]["value"], rel=1e-3)


def test_reasons_are_counted_by_what_they_have_in_common():
    reasons = {f"collapse at {i}.5 % of stage 'actuation 2'; nodes {i}": 1 for i in range(40)} | {"slack": 3}
    state = CampaignState(50, 50, {"collapsed": 40, "snapped": 3, "stable": 7}, reasons, 0.001)
    assert reason_table(state).rows == (("40", "collapse at … % of stage 'actuation …'"), ("3", "slack"))


def test_an_optimum_stands_beside_its_true_value(results):
    table = optimum_table(results.analyses[2:])
    assert table.header == ("", "slsqp", "bfgs")
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["status, true model"] == ("stable", "stable")
    assert float(rows["T [degC]"][0]) <= 40.0 + 1e-6
    assert rows["constraints, true model"] == ("hold", "hold")
    assert "subject to T <= 40" in table.note


def test_errors_of_surrogates_are_listed_by_output(results):
    table = validation_table(results)
    assert [row[:2] for row in table.rows] == [
        ("pce (pce)", "v [cm]"),
        ("pce (pce)", "w [cm]"),
        ("gpr (gpr)", "w [cm]"),
    ]
    assert all(re.fullmatch(r"[\d.e+-]+ %|– %", row[2]) for row in table.rows)
