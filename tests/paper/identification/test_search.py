"""The search: descents find what they see, records are read again, fronts are those of their points."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra_paper.identification.__main__ import main
from tensegra_paper.identification.candidate import reference
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.front import miss, nondominated
from tensegra_paper.identification.local import descend
from tensegra_paper.identification.records import EDGE, NEAR, Records
from tensegra_paper.identification.responses import Effort
from tensegra_paper.identification.search import Plan

FEW = Effort(design=32, samples=512, outcomes=16, blocks=4)


def test_a_descent_reaches_agreement_along_a_curved_valley():
    # Two findings that move together a hundred times more than apart, and bend.
    def off(x):
        return np.array(
            [100.0 * (x[0] + x[1] + x[2] ** 2) + x[1], 100.0 * (x[0] + x[1] + x[2] ** 2) - x[2] - 0.3]
        )

    end = descend(off, np.array([0.3, -0.2, 0.4]), lambda _: np.eye(3), max_steps=40, good=1e-6)
    assert end.cost < 1e-3
    assert np.abs(end.misses).max() < 0.05


def test_a_descent_never_ends_worse_than_it_began():
    end = descend(lambda x: np.array([1.0 + np.sin(50.0 * x[0])]), np.array([0.1]), lambda _: np.eye(1))
    assert end.cost <= np.arcsinh(1.0 + np.sin(5.0)) ** 2 + 1e-12


def test_records_are_read_again_and_a_line_cut_short_is_dropped(tmp_path):
    file = tmp_path / "records.jsonl"
    first = Records(file)
    values = first.values(reference(), FEW, NEAR)
    thinner = reference().moved(reference().numbers + 1e-3)
    other = first.values(thinner, FEW, NEAR)
    assert first.n_solved == 2
    text = file.read_text(encoding="utf-8")
    file.write_text(text[: len(text) - 20], encoding="utf-8")
    second = Records(file)
    assert second.values(reference(), FEW, NEAR) == values
    assert second.n_solved == 0
    assert second.values(thinner, FEW, NEAR) == other
    assert second.n_solved == 1
    assert file.read_text(encoding="utf-8") == text
    assert second.values(reference(), FEW, EDGE).keys() > values.keys()


def test_a_beam_that_cannot_be_is_kept_as_none(tmp_path):
    records = Records(tmp_path / "records.jsonl")
    numbers = reference().numbers.copy()
    numbers[30] = np.log(1e9)  # a self-stress under which no strut keeps a length
    assert records.values(reference().moved(numbers), FEW, NEAR) is None
    assert json.loads(records.file.read_text(encoding="utf-8"))["values"] is None
    assert list(records.answers()) == []


@given(st.lists(st.tuples(st.floats(0, 9), st.floats(0, 9)), min_size=1, max_size=30))
def test_no_point_beats_one_of_the_front_and_each_other_is_beaten(points):
    rows = np.array(points)
    front = nondominated(rows)
    for place in range(len(rows)):
        beaten = np.any(np.all(rows <= rows[place], axis=1) & np.any(rows < rows[place], axis=1))
        if place in front:
            assert not beaten
        else:
            assert beaten or any(np.array_equal(rows[place], rows[other]) for other in front)


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda f: f.key)
def test_a_finding_is_missed_by_nothing_where_it_agrees(finding):
    assert miss(finding, finding.target) == 0.0
    wrong = finding.target + (-1.0 if finding.least else 1.0) * (finding.tolerance + finding.scale)
    assert miss(finding, wrong) == pytest.approx(1.0)


def test_a_plan_is_scaled_and_never_empty():
    small = Plan(seed=7).scaled(1e-6)
    assert (small.seed, small.n_starts, small.n_descents, small.n_refined) == (7, 1, 1, 1)


@pytest.mark.parametrize("scale", ["0", "1.5", "nan", "much"])
def test_a_wrong_scale_is_one_message(scale, tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["-o", str(tmp_path / "out"), "--scale", scale])
    assert stopped.value.code == 2
    assert "expected a number above 0, at most 1" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_is_one_message(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    with pytest.raises(SystemExit) as stopped:
        main(["-o", str(tmp_path / "file")])
    assert stopped.value.code == 2
    assert "argument -o/--output" in capsys.readouterr().err


@pytest.mark.slow
def test_a_small_search_ends_resumes_and_solves_nothing_twice(tmp_path, capsys):
    assert main(["-o", str(tmp_path), "--scale", "0.002"]) == 0
    first = capsys.readouterr().out
    kept = (tmp_path / "records.jsonl").read_bytes()
    assert main(["-o", str(tmp_path), "--scale", "0.002"]) == 0
    assert capsys.readouterr().out == first
    assert (tmp_path / "records.jsonl").read_bytes() == kept
    assert (tmp_path / "paper_beam_identified.json").is_file()
