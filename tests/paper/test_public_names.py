"""The paper's package uses of the library what its packages offer, and nothing behind their doors."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

import tensegra_paper

ROOT = Path(tensegra_paper.__file__).parent

OFFERED = ("tensegra", "tensegra.report.figures", "tensegra.terminal")
"""Modules deeper than a package, or no package, whose names are public too."""

FILES = sorted(ROOT.rglob("*.py"))


def imported(file):
    """Return what a file imports from the library, as (module, name)."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "tensegra":
            yield from ((node.module, alias.name) for alias in node.names)
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.split(".")[0] == "tensegra")


def public(module, name):
    """Tell whether a name is offered by a package of the library."""
    home = import_module(module)
    is_package = hasattr(home, "__path__") and module.count(".") == 1
    return (is_package or module in OFFERED) and (not name or name in home.__all__)


@pytest.mark.parametrize("file", FILES, ids=[str(file.relative_to(ROOT)) for file in FILES])
def test_every_name_is_public(file):
    assert [pair for pair in imported(file) if not public(*pair)] == []


@pytest.mark.parametrize(
    "pair",
    [("tensegra.study.store", "Store"), ("tensegra.report", "carry_in"), ("tensegra.study.driver", "")],
)
def test_a_name_behind_a_door_is_found(pair):
    assert not public(*pair)
