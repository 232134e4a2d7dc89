"""What the pages of the site say in Python is true, and what they name is there.

The tutorials are executed by the build itself (`scripts/docs`); here the code of all other pages runs, each
page from its first block to its last, and its remarks are compared with what is printed.
"""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "src" / "tensegra"
PAGES = sorted(
    path
    for path in (DOCS / "index.md", *(DOCS / "how-to").glob("*.md"))
    if "```python" in path.read_text(encoding="utf-8")
)
THEORY = sorted((DOCS / "theory").glob("*.md"))
NOTATION = (DOCS / "reference" / "notation.md").read_text(encoding="utf-8")

NEEDS = "# needs "
"""Begins a block that runs only where a library is installed that tensegra does not bring."""


def blocks(page):
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    return [re.sub(r"^%.*\n", "", block, flags=re.MULTILINE) for block in found]


@pytest.fixture
def precision_put_back():
    """Put JAX back to the precision that it had: a page may choose one for the whole process."""
    import jax

    before = jax.config.jax_enable_x64
    yield
    jax.config.update("jax_enable_x64", before)


@pytest.mark.usefixtures("precision_put_back")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_code_of_a_page_prints_what_it_says(page, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    space = {}
    for code in blocks(page):
        first = code.partition("\n")[0]
        if first.startswith(NEEDS) and not _importable(first.removeprefix(NEEDS)):
            continue
        exec(compile(code, str(page), "exec"), space)  # noqa: S102 - our own
        printed = capsys.readouterr().out.splitlines()
        for said in re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE):
            assert said in printed


def test_most_pages_say_what_they_print():
    said = [
        page
        for page in PAGES
        if any(re.search(r"^print\(.*  # ", code, re.MULTILINE) for code in blocks(page))
    ]
    assert len(said) >= len(PAGES) - 1


def _importable(name):
    from importlib.util import find_spec

    return find_spec(name) is not None


def test_the_first_page_needs_twelve_lines():
    (code,) = blocks(DOCS / "index.md")
    assert len([line for line in code.splitlines() if line]) <= 12


@pytest.mark.parametrize("page", sorted(DOCS.rglob("how-to/*.md")), ids=lambda page: page.stem)
def test_files_that_a_page_names_exist(page):
    for name in re.findall(r"`((?:src|tests|docs|examples)/[\w./-]+)`", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


def test_no_equation_has_the_number_of_another():
    numbers = [
        tag for page in THEORY for tag in re.findall(r"\\tag\{(\w+)\}", page.read_text(encoding="utf-8"))
    ]
    assert len(numbers) == len(set(numbers)) > 30


def test_equations_and_files_of_the_notation_exist():
    numbers = {
        tag for page in THEORY for tag in re.findall(r"\\tag\{(\w+)\}", page.read_text(encoding="utf-8"))
    }
    rows = re.findall(r"^\| \$.*\|$", NOTATION, re.MULTILINE)
    assert len(rows) > 20
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert set(re.findall(r"\((\w\d+)\)", cells[3])) <= numbers, row
        assert (SOURCE / cells[4].strip("`")).is_file(), row


def test_equations_that_docstrings_cite_exist():
    numbers = {
        tag for page in THEORY for tag in re.findall(r"\\tag\{(\w+)\}", page.read_text(encoding="utf-8"))
    }
    cited = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef):
                cited |= set(re.findall(r"\(([MPDBSCIA]\d+)\)", ast.get_docstring(node) or ""))
    assert cited <= numbers
    assert len(cited) >= 10


def test_the_tower_is_the_same_in_every_tutorial():
    texts = []
    for page in (DOCS / "tutorials").glob("*.md"):
        texts += re.findall(
            r"writefile tower\.yaml\n(.*?)\nsupports:", page.read_text(encoding="utf-8"), re.DOTALL
        )
    assert len(texts) == 3
    assert len(set(texts)) == 1


def test_the_tower_stands_as_the_tutorial_says():
    import tensegra as tg

    page = (DOCS / "tutorials" / "tower.md").read_text(encoding="utf-8")
    drawn, more = re.findall(r"%%writefile (?:-a )?tower\.yaml\n(.*?)```", page, re.DOTALL)
    import yaml

    assert tg.solve_path(tg.parse_structure(yaml.safe_load(drawn))).status == "collapsed"
    tower = tg.parse_structure(yaml.safe_load(drawn + more))
    path = tg.solve_path(tower, {"pull": 0.05})
    assert path.status == "stable"
    assert np.all(path.final.tensions[4:] > 0)


def test_every_public_name_stands_in_the_reference():
    import tensegra as tg

    listed = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    for name in set(tg.__all__) - {"library", "__version__"}:
        assert re.search(rf"^   {name}$", listed, re.MULTILINE), name
    for name in tg.library.__all__:
        assert re.search(rf"^   structure\.library\.{name}$", listed, re.MULTILINE), name


def test_every_key_of_both_formats_stands_on_a_generated_page_with_an_example(monkeypatch, tmp_path):
    import json

    from tensegra.schemas import schema_text

    monkeypatch.syspath_prepend(DOCS)
    from generate import formats

    pages = formats.pages(tmp_path)
    rows = [
        line for text in pages.values() for line in text.splitlines() if line.startswith(("| `", "| **`"))
    ]
    shown = {}
    for row in rows:
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
        shown.setdefault(cells[0].strip("*`"), []).append(cells)
    for name in ("structure", "study"):
        schema = json.loads(schema_text(name))
        for part in (schema, *schema["$defs"].values()):
            full = part if "properties" in part else next(iter(part.get("anyOf", ())), {})
            for key, entry in full.get("properties", {}).items():
                told = [
                    cells
                    for cells in shown[key]
                    if entry.get("description", "").split(".")[0][:20] in cells[3]
                ]
                assert told, key
                assert all(cells[1] and cells[4] for cells in told), key
