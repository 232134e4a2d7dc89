import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.mechanics import solve_batch, solve_path
from tensegra.report.analysis_tables import optimum_table, propagation_table, result_tables
from tensegra.report.study_tables import reason_table, validation_table
from tensegra.report.tables import (
    MOST_ROWS,
    Table,
    aligned,
    displacement_table,
    event_table,
    history_frame,
    number,
    reaction_table,
    stage_table,
    structure_table,
    tension_table,
    write_history,
)
from tensegra.structure import library
from tensegra.study import CampaignState
from tensegra.surrogate.batches import field_runs

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
    assert last["T_K1"] == path.final.tension("K1")
    assert frame.attrs["units"] == {"length": "cm", "force": "kN", "temperature": "degC"}


def test_the_history_as_csv_keeps_all_digits(path, tmp_path):
    file = tmp_path / "path.CSV"
    write_history(path, file)
    frame, expected = pd.read_csv(file, dtype=str), history_frame(path)
    assert list(frame) == list(expected)
    assert [float(text) for text in frame["z_18"]] == expected["z_18"].tolist()


def test_positions_and_tensions_have_one_name_in_every_table(path, tmp_path):
    for name in ("path.parquet", "path.csv"):
        write_history(path, tmp_path / name)
    structure = path.structure
    frame = list(history_frame(path))
    assert list(pd.read_parquet(tmp_path / "path.parquet")) == frame
    assert list(pd.read_csv(tmp_path / "path.csv")) == frame
    field = field_runs(solve_batch(structure, actuation={"A14": [0.01, 0.02]}))
    named = list(field.runs.output_names)
    assert [name for name in frame if "_" in name] == named
    own = path.to_dataframe()
    # Its slack_<member> is a table's own column: whether, not how much.
    assert [name for name in own if name.partition("_")[0] in {*"xyz", "T"}] == named
    for name in named:
        assert own[name].tolist() == history_frame(path)[name].tolist()


@pytest.mark.parametrize("name", ["path.parquet", "path.csv"])
def test_a_history_without_a_step_is_an_empty_table_of_all_columns(path, tmp_path, name):
    write_history(replace(path, history=()), tmp_path / name)
    read = pd.read_csv if name.endswith("csv") else pd.read_parquet
    frame = read(tmp_path / name)
    assert len(frame) == 0
    assert list(frame) == list(history_frame(path))


def test_reactions_are_listed_with_their_sum(path):
    table = reaction_table(path.final)
    rows = {row[0]: row[1:] for row in table.rows}
    assert table.title.endswith("kN")
    assert list(rows) == ["1", "4", "5", "8", "sum"]
    total = np.array([rows[node] for node in "1458"], dtype=float).sum(axis=0)
    shown = 2e-4  # four decimals, four terms
    assert np.array(rows["sum"], dtype=float) == pytest.approx(total, abs=shown)
    assert total == pytest.approx([0.0, 0.0, -path.final.forces[:, 2].sum()], abs=shown)


def test_a_dash_stands_where_a_support_lets_go_and_few_of_many_supports_are_shown():
    net = solve_path(library.grid(10, 10)).final
    table = reaction_table(net)
    assert len(table.rows) == MOST_ROWS + 1
    assert "24 of" in table.note
    chain = solve_path(library.prism()).final
    assert any("–" in row for row in reaction_table(chain).rows)


def test_a_history_goes_to_known_kinds_of_file_only(path, tmp_path):
    with pytest.raises(ModelError, match=r"found 'path\.xls', expected a file named \.parquet or \.csv"):
        write_history(path, tmp_path / "path.xls")
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
