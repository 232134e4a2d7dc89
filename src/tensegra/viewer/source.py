"""The viewer's JavaScript and style sheet: several files to read, one to load."""

import re
from functools import cache
from importlib.resources import files

__all__ = ["MODULES", "part", "script", "stylesheet"]

MODULES = ("algebra", "camera", "scene", "colours", "parts", "flat", "painter", "viewer", "panel")
"""The files of ``js/``, each after those that it imports."""

_IMPORT = re.compile(r'^import [^;]* from "\./[a-z]+\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=const|function|class|async)", re.MULTILINE)


@cache
def script() -> str:
    """Return the viewer as one script that imports and exports nothing; it defines ``mount``.

    The files are joined in their order without what they import from each other; no name stands in two of
    them.
    """
    return "\n".join(_EXPORT.sub("", _IMPORT.sub("", part(name))) for name in MODULES)


def part(name: str) -> str:
    """Return a file of ``js/``, by its name without the suffix."""
    return files("tensegra.viewer").joinpath("js", f"{name}.js").read_text("utf-8")


@cache
def stylesheet() -> str:
    """Return the viewer's style sheet."""
    return files("tensegra.viewer").joinpath("viewer.css").read_text("utf-8")
