"""Statuses, the reasons that mechanics gives for them, and the errors, from the source."""

import ast
import inspect
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import tensegra.mechanics
from tensegra import errors
from tensegra.mechanics.status import SEVERITY, Status

__all__ = ["pages"]

HEAD = """\
# Statuses and messages

Every equilibrium has a status; where it is not `stable`, also a reason. What to do about each is told in
[what a status means](../how-to/statuses.md). This page is made from the source.

## Statuses
"""

REASONS = """
## Reasons

What a run that is not `stable` may be told, by the place in the source. ⟨…⟩ is filled in.

| status | reason | source |
| --- | --- | --- |
"""

ERRORS = """
## Errors

A bad input is refused with one message: the place, what was found, what was expected, and the nearest right
name. In Python it is one of these; on the command line it is printed after `tensegra: error:`, and the exit
code is 2.

| error | is a | when |
| --- | --- | --- |
"""

SAYING = {"fail": Status.FAILED, "_fail": Status.FAILED, "set": None, "end": None}
"""Methods that give a run its word, and the word where it is not among their arguments."""


def pages(_folder: Path) -> dict[str, str]:
    """Return the page of statuses, reasons and errors."""
    meanings = _strings_below(Status)
    parts = [HEAD, *(f"`{status}`\n: {meanings[status.name]}\n" for status in SEVERITY)]
    rows = sorted({row for path in _sources() for row in _reasons(path)}, key=_order)
    parts.append(REASONS + "\n".join(f"| `{s}` | {reason} | `{file}` |" for s, reason, file in rows) + "\n")
    raised = [
        (
            name,
            found.__bases__[0].__name__,
            (inspect.getdoc(found) or "").partition("\n\n")[0].replace("\n", " "),
        )
        for name, found in vars(errors).items()
        if inspect.isclass(found) and issubclass(found, Exception) and found.__module__ == errors.__name__
    ]
    parts.append(
        ERRORS + "\n".join(f"| `{name}` | `{base}` | {text} |" for name, base, text in raised) + "\n"
    )
    return {"statuses.md": "\n".join(parts)}


def _order(row: tuple[str, str, str]) -> tuple[int, str]:
    return [str(status) for status in SEVERITY].index(row[0]), row[1]


def _sources() -> list[Path]:
    return sorted(Path(tensegra.mechanics.__file__).parent.glob("*.py"))


def _reasons(path: Path) -> Iterator[tuple[str, str, str]]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
            continue
        if node.func.attr not in SAYING:
            continue
        words = [
            Status[part.attr]
            for part in node.args
            if isinstance(part, ast.Attribute) and part.attr in Status.__members__
        ]
        status = words[0] if words else SAYING[node.func.attr]
        for part in node.args:
            text = _text(part)
            if status is not None and text:
                yield str(status), text.replace("|", r"\|"), path.name


def _text(part: ast.expr) -> str:
    """Return a text or f-string as it is read, with ⟨…⟩ for what is filled in."""
    if isinstance(part, ast.Constant) and isinstance(part.value, str):
        return part.value
    if isinstance(part, ast.JoinedStr):
        pieces = ("⟨…⟩" if isinstance(one, ast.FormattedValue) else str(one.value) for one in part.values)  # type: ignore[attr-defined]
        return "".join(pieces)
    return ""


def _strings_below(kind: type) -> dict[str, str]:
    """Return the text below each value of a class."""
    body = ast.parse(inspect.getsource(kind)).body[0].body  # type: ignore[attr-defined]
    return {
        one.targets[0].id: following.value.value
        for one, following in pairwise(body)
        if isinstance(one, ast.Assign) and isinstance(following, ast.Expr)
    }
