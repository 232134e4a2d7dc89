"""No floor knows one above it, not even by a name in a text."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"
MODULE = re.compile(r"tensegra(\.[a-z_]\w*)*\.?")


def floors():
    """Return the number of the floor of each part, the ground 0, as the import contract has them."""
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (layers,) = (
        contract["layers"]
        for contract in content["tool"]["importlinter"]["contracts"]
        if contract["type"] == "layers" and contract["layers"][0].startswith("tensegra.")
    )
    return {
        part.strip(): number for number, layer in enumerate(reversed(layers)) for part in layer.split("|")
    }


def texts(tree):
    """Yield the texts of a file with their lines, a formatted one as far as its first gap; no docstrings."""
    inside = set()
    for node in ast.walk(tree):
        # A text that stands by itself, such as a docstring, does nothing.
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            inside.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            inside.update(node.values)
            if node.values and isinstance(node.values[0], ast.Constant):
                yield node.lineno, node.values[0].value
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in inside:
            yield node.lineno, node.value


def floor_of(module, floors):
    found = [number for part, number in floors.items() if f"{module}.".startswith(f"{part}.")]
    return found[0] if found else None


def upward(source, module, floors):
    """Return the lines in which a file names a module of a floor above its own, or builds such a name."""
    own, lines = floor_of(module, floors), []
    for line, text in texts(ast.parse(source)):
        if not (MODULE.fullmatch(text) and "." in text):
            continue
        named = floor_of(text.rstrip("."), floors)
        # `"tensegra." + name` may lead to any floor.
        if named is None if text == "tensegra." else named is not None and own is not None and named > own:
            lines.append(line)
    return lines


def module_of(file):
    parts = file.relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_no_file_names_a_floor_above_it():
    known = floors()
    # The package offers the names of all floors; the contract on imports excepts it too.
    files = [file for file in (SOURCE / "tensegra").rglob("*.py") if module_of(file) != "tensegra"]
    found = {
        str(file.relative_to(ROOT)): lines
        for file in files
        if (lines := upward(file.read_text(encoding="utf-8"), module_of(file), known))
    }
    assert not found


def test_every_part_has_its_floor():
    known = floors()
    parts = {
        f"tensegra.{file.stem}"
        for file in (SOURCE / "tensegra").iterdir()
        if not file.name.startswith(("_", ".")) and (file.is_dir() or file.suffix == ".py")
    }
    assert parts == set(known)


@pytest.mark.parametrize(
    ("source", "seen"),
    [
        ('import_module("tensegra.report.figures.structure")', [1]),
        ('"""On tensegra.report."""\nload = __import__("tensegra.analysis")', [2]),
        ('sys.modules["tensegra.surrogate"]', [1]),
        ('import_module(f"tensegra.report.{name}")', [1]),
        ('import_module(f"tensegra.{floor}")', [1]),
        ('import_module("tensegra." + floor)', [1]),
        ('import_module("tensegra.structure.parts")', []),
        ('logging.getLogger("tensegra")', []),
        ('"see tensegra.report for more"', []),
        ('"""tensegra.report"""', []),
    ],
)
def test_a_name_of_a_floor_above_is_seen(source, seen):
    assert upward(source, "tensegra.mechanics.results", floors()) == seen
