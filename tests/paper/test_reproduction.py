import json
import sys
from types import ModuleType

import pytest

from tensegra.errors import SolverError
from tensegra.report.figures.style import figure, styled
from tensegra.report.tables import Table
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.comparison import markdown_rows
from tensegra_paper.making import reproduce


@styled
def line():
    made = figure(1.0)
    made.add_subplot().plot([0, 1], [0, 1])
    return made


def row(quantity, *, holds=True, agreement=Agreement.METHOD):
    claim = "a" if agreement is Agreement.FINDING else ""
    return Row("Fig. 7", quantity, 2.0, 2.5, "cm", agreement, holds, "within 1", claim=claim)


@pytest.fixture
def chapters(monkeypatch):
    """Return a function that puts a chapter in the place of a module, and counts how often it is made."""
    made = []

    def add(name, *rows, fails=False):
        def make(setting):
            made.append(name)
            setting.tell(f"{name} at {setting.scale:g}")
            if fails:
                raise SolverError("no equilibrium")
            return Chapter(
                name=name,
                title=f"Chapter of {name}",
                figures=(Figure(f"fig-07-{name}", "A line. It rises", line),),
                rows=rows,
                text=("What was done & found.",),
                findings=(f"Finding of {name}.",),
                tables=(Table.of("More", ("a", "b"), [("x", 1.0)], "lr"),),
                seconds={"runs": 1.5},
                seeds={"points": 7},
            )

        module = ModuleType(name)
        setattr(module, name, make)
        monkeypatch.setitem(sys.modules, f"tensegra_paper.chapters.{name}", module)

    add.made = made
    return add


def test_report_and_tables_are_written(chapters, tmp_path):
    chapters("first", row("one"), row("two", holds=None, agreement=Agreement.VALUE))
    made = reproduce(tmp_path, chapters=("first",))
    assert made.succeeded
    html = made.report.read_text()
    assert html.count("data:image/svg+xml;base64,") == 1
    assert "http" not in html.replace("http-equiv", "")
    assert "What was done &amp; found." in html
    assert "Fig. 7.</strong> A line. It rises." in html
    assert (tmp_path / "figures" / "fig-07-first.png").stat().st_size > 1000
    assert [cells["Quantity"] for cells in markdown_rows(made.table.read_text())] == ["one", "two"]
    content = json.loads(made.table.with_suffix(".json").read_text())
    assert content["tally"] == {
        "finding": 0,
        "finding_held": 0,
        "method": 1,
        "method_held": 1,
        "value": 1,
        "input": 0,
    }
    assert content["rows"][0]["difference"] == 0.5
    assert content["seeds"] == {"first": {"points": 7}}
    assert {"tensegra", "numpy", "scipy"} <= set(content["versions"])
    assert content["stamp"]["structure"] == "paper_beam"


def test_a_finished_chapter_is_not_made_again(chapters, tmp_path):
    chapters("first", row("one"))
    told = []
    before = reproduce(tmp_path, chapters=("first",))
    again = reproduce(tmp_path, chapters=("first",), tell=told.append)
    assert chapters.made == ["first"]
    assert any("kept" in line for line in told)
    assert again.chapters == before.chapters
    assert again.seconds == before.seconds


@pytest.mark.parametrize("changes", [{"scale": 0.5}, {"seed": 2}, {"structure": "paper_beam_slender"}])
def test_another_stamp_makes_it_again(chapters, tmp_path, changes):
    chapters("first", row("one"))
    reproduce(tmp_path, chapters=("first",))
    reproduce(tmp_path, chapters=("first",), **changes)
    assert chapters.made == ["first", "first"]


def test_a_damaged_chapter_is_made_again(chapters, tmp_path):
    chapters("first", row("one"))
    reproduce(tmp_path, chapters=("first",))
    kept = tmp_path / "chapters" / "first.json"
    kept.write_text(kept.read_text()[:100])
    reproduce(tmp_path, chapters=("first",))
    (tmp_path / "figures" / "fig-07-first.svg").unlink()
    reproduce(tmp_path, chapters=("first",))
    assert chapters.made == ["first"] * 3


def test_a_chapter_that_cannot_be_had_leaves_the_others(chapters, tmp_path):
    chapters("bad", fails=True)
    chapters("good", row("one"))
    made = reproduce(tmp_path, chapters=("bad", "good"))
    assert not made.succeeded
    assert made.failures == ("bad: no equilibrium",)
    assert [finished.chapter.name for finished in made.chapters] == ["good"]
    assert "Could not be had: bad: no equilibrium." in made.report.read_text()
    reproduce(tmp_path, chapters=("bad", "good"))
    assert chapters.made == ["bad", "good", "bad"]


def test_a_row_of_method_that_does_not_hold_is_a_failure(chapters, tmp_path):
    chapters("first", row("one"), row("two", holds=False))
    made = reproduce(tmp_path, chapters=("first",))
    assert not made.succeeded
    assert "of 2 checks of our method 1 hold" in made.summary


def test_a_printed_value_that_is_not_met_is_no_failure(chapters, tmp_path):
    chapters("first", row("one", holds=False, agreement=Agreement.FINDING))
    assert reproduce(tmp_path, chapters=("first",)).succeeded


def test_the_command_that_makes_it_is_told(chapters, tmp_path):
    chapters("first", row("one"))
    made = reproduce(tmp_path, chapters=("first",), scale=0.01, structure="paper_beam_slender")
    assert made.command == "tensegra reproduce --scale 0.01 --structure paper_beam_slender"
