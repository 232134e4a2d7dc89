"""What the tests compare, with whom and how near: from the tests themselves."""

import ast
import json
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from tensegra.mechanics import solve_path
from tensegra.structure import read_structure

__all__ = ["pages"]

HEAD = """\
# Verification and validation

*Verification* asks whether the equations are solved right: against mathematics. *Validation* asks whether
other programs and published figures say the same. This page is made from the tests: the first table is
measured by the build, the rest are the tests' own words and tolerances. `scripts/test` runs them.

## Beside other programs

Every stage of every case is solved and compared with what another program found. Positions are relative to
the structure's size, tensions to the largest tension, the eigenvalue to itself.

| case | the other program | stages | positions | tensions | lowest eigenvalue |
| --- | --- | ---: | ---: | ---: | ---: |
"""


def pages(folder: Path) -> dict[str, str]:
    """Return the page of verification and validation."""
    tests = folder.parents[1] / "tests"
    rows = [_compared(path) for path in sorted((tests / "validation" / "cases").glob("*.structure.json"))]
    parts = [HEAD + "\n".join(rows) + "\n"]
    for kind, title in (
        ("validation", "Validation, test by test"),
        ("verification", "Verification, test by test"),
    ):
        parts.append(f"## {title}\n")
        parts += [_told(path) for path in sorted((tests / kind).glob("test_*.py"))]
    return {"verification.md": "\n".join(parts)}


def _compared(path: Path) -> str:
    expected = json.loads(
        path.with_name(path.name.replace(".structure.", ".expected.")).read_text(encoding="utf-8")
    )
    structure = read_structure(path)
    solved = solve_path(structure)
    size = np.ptp(structure.coordinates, axis=0).max()
    moved, pulled, softest = 0.0, 0.0, 0.0
    for found, told in zip(solved.stages, expected["stages"], strict=True):
        nodes = np.array([told["nodes"][node] for node in structure.nodes])
        tensions = np.array([told["tensions"][member] for member in structure.members])
        moved = max(moved, np.abs(found.nodes - nodes).max() / size)
        pulled = max(pulled, np.abs(found.tensions - tensions).max() / np.abs(tensions).max())
        softest = max(softest, abs(found.lowest_eigenvalue / min(told["lowest_tangent_eigenvalues"]) - 1.0))
    told_by = expected["source"].partition(";")[0].partition("(")[0].strip()
    source = re.sub(r"\S+/(\S+)", r"`\1`", told_by)  # of a path its last name
    case = path.name.removesuffix(".structure.json")
    return f"| `{case}` | {source} | {len(solved.stages)} | {moved:.0e} | {pulled:.0e} | {softest:.0e} |"


def _told(path: Path) -> str:
    """Return a section on a file of tests: its text, its tolerances, and what each test says."""
    module = ast.parse(path.read_text(encoding="utf-8"))
    text = (ast.get_docstring(module) or "").replace("`", "").replace("*", r"\*")
    parts = [f"### {path.stem.removeprefix('test_').replace('_', ' ')}\n\n{text}\n"]
    if bounds := list(_tolerances(module)):
        parts.append("| tolerance | value | why |\n| --- | --- | --- |")
        parts += [f"| `{name}` | {value} | {why} |" for name, value, why in bounds]
        parts.append("")
    names = [node.name for node in ast.walk(module) if isinstance(node, ast.FunctionDef)]
    tests = [name.removeprefix("test_").replace("_", " ") for name in names if name.startswith("test_")]
    parts += [f"- {name}" for name in tests]
    return "\n".join([*parts, "", f"`tests/{path.parent.name}/{path.name}`\n"])


def _tolerances(module: ast.Module) -> Iterator[tuple[str, str, str]]:
    """Yield the named numbers of a file that say in words why they are so."""
    for one, following in pairwise(module.body):
        if not (isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Name)):
            continue
        try:
            value = ast.literal_eval(one.value)
        except ValueError:
            continue
        said = following.value if isinstance(following, ast.Expr) else None
        if isinstance(value, float) and isinstance(said, ast.Constant) and isinstance(said.value, str):
            yield one.targets[0].id, f"{value:g}", " ".join(said.value.split()).replace("|", r"\|")
