import json
import sys
from types import ModuleType

import pytest

from tensegra.cli import main
from tensegra_paper import making
from tensegra_paper.chapter import Agreement, Chapter, Row


@pytest.fixture
def tensegra(capsys):
    """Run the command and return its exit code, what it printed, and what it told."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main(["reproduce", *arguments])
        return left.value.code, *capsys.readouterr()

    return run


@pytest.fixture
def only(monkeypatch):
    """Let the command make one chapter, of one row that holds or does not."""

    def chapter(*, holds):
        module = ModuleType("one")
        row = Row("Fig. 1", "lift", 2.0, 2.5, "cm", Agreement.METHOD, holds, "within 1")
        module.one = lambda _: Chapter("one", "One", rows=(row,), findings=("It lifts.",))
        monkeypatch.setitem(sys.modules, "tensegra_paper.chapters.one", module)
        whole = making.reproduce
        monkeypatch.setattr(making, "reproduce", lambda *a, **k: whole(*a, chapters=("one",), **k))

    return chapter


def test_the_table_goes_to_stdout_and_the_progress_to_stderr(tensegra, only, tmp_path):
    only(holds=True)
    code, out, err = tensegra("-o", str(tmp_path / "made"), "--scale", "0.5")
    assert code == 0
    assert "lift" in out
    assert "It lifts." in out
    assert "[1/1] one" in err
    assert "[1/1]" not in out
    assert (tmp_path / "made" / "report.html").is_file()


def test_json_holds_every_row(tensegra, only, tmp_path):
    only(holds=True)
    _, out, _ = tensegra("-o", str(tmp_path), "--json", "--structure", "paper_beam_slender", "--seed", "5")
    content = json.loads(out)
    assert [row["quantity"] for row in content["rows"]] == ["lift"]
    assert content["stamp"]["seed"] == 5
    assert content["stamp"]["structure"] == "paper_beam_slender"


def test_a_row_of_method_that_fails_is_a_numerical_failure(tensegra, only, tmp_path):
    only(holds=False)
    code, _, _ = tensegra("-o", str(tmp_path))
    assert code == 1
    assert (tmp_path / "table.md").is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scale", "2"), "--scale: found 2.0, expected a number above 0, at most 1"),
        (("--scale", "0"), "--scale: found 0.0"),
        (("--structure", "paper_bean"), "did you mean 'paper_beam'?"),
    ],
)
def test_bad_input_is_refused_in_one_line(tensegra, tmp_path, arguments, message):
    code, out, err = tensegra(*arguments, "-o", str(tmp_path / "made"))
    assert code == 2
    assert out == ""
    assert message in err
    assert not (tmp_path / "made").exists()


def test_a_folder_that_cannot_be_written_is_refused(tensegra, only, tmp_path):
    only(holds=True)
    (tmp_path / "file").write_text("")
    code, _, err = tensegra("-o", str(tmp_path / "file"))
    assert code == 2
    assert "file" in err
