"""The page on exchange does what it says."""

import re
import shlex
from pathlib import Path

import pytest

from tensegra.cli import main
from tensegra.exchange.formats import FORMATS

PAGE = (Path(__file__).parents[2] / "docs" / "exchange.md").read_text(encoding="utf-8")


def test_the_python_example_prints_what_it_says(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    code = next(block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "tensegra" in block)
    exec(compile(code, "docs/exchange.md", "exec"), {})  # noqa: S102 - our own
    promised = [line.partition("  # ")[2] for line in code.splitlines() if line.startswith("print(")]
    assert capsys.readouterr().out.splitlines() == promised
    pytest.importorskip("compas")
    (code,) = [
        block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "compas.data" in block
    ]
    found = {}
    exec(compile(code, "docs/exchange.md", "exec"), found)  # noqa: S102 - our own
    assert len(found["forces"]) == 64


@pytest.mark.parametrize("command", re.findall(r"^    (tensegra export library.*)$", PAGE, re.MULTILINE))
def test_commands_on_built_in_structures_work(command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(shlex.split(command)[1:])
    assert not left.value.code


def test_the_tables_shown_are_read(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    rows = re.search(r"    node,x,y,z,supports.*?\n\n", PAGE, re.DOTALL)[0].splitlines()[:3]
    left, right = zip(*(re.split(r" {3,}", row.strip()) for row in rows), strict=True)
    more = [f"{n},{n},{n * n},0," for n in (5, 8, 9)]
    Path("tower_nodes.csv").write_text("\n".join([*left, *more]), encoding="utf-8")
    Path("tower_members.csv").write_text("\n".join([*right, "k2,cable,2 9,1e5,,"]), encoding="utf-8")
    import tensegra as tg

    assert tg.read_structure("tower.csv").members["K1"].nodes == ("1", "5", "9")


def test_every_format_has_its_row():
    for form in FORMATS:
        row = re.search(rf"^\| `\{form.suffix}` \| `{form.name}` \|(.*)$", PAGE, re.MULTILINE)[1]
        assert row.split("|")[0].strip() == ("yes" if form.read is not None else "")
        many = form.write_runs is not None or form.many_shapes
        assert row.split("|")[3].strip() == ("yes" if many else "")
