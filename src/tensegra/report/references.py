"""What a user types on the command line, made into structures, inputs and kinds of file."""

import re
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path

from tensegra.errors import ModelError
from tensegra.exchange import read_structure
from tensegra.structure import Structure, library
from tensegra.units import QuantityError

__all__ = [
    "LIBRARY",
    "is_study_file",
    "parse_loads",
    "parse_settings",
    "parse_temperatures",
    "structure_from",
]

HOTTEST = "10000 K"
"""A difference of temperature beyond which nothing is solid, and a number a slip."""

LIBRARY = "library:"
"""Beginning of a reference to a built-in structure."""

_STUDY = re.compile(r"""(?:^|[{,])[ \t]*["']?schema["']?[ \t]*:[ \t]*["']?tensegra/study/""", re.MULTILINE)
"""Blanks within a line only: what may run over empty lines is tried anew from each of them."""


def structure_from(reference: str) -> Structure:
    """Return the structure of a file, or the built-in one of ``library:<name>``.

    Raises
    ------
    ModelError
        There is none, or what the file describes cannot be.

    Examples
    --------
    >>> structure_from("library:paper_beam").n_nodes
    24
    >>> structure_from("library:paper_beem")
    Traceback (most recent call last):
    tensegra.errors.ModelError: library: found 'paper_beem', ...; did you mean 'paper_beam'?
    """
    if not reference.startswith(LIBRARY):
        if is_study_file(reference):
            raise ModelError.at(
                reference, "a study", f"a structure; `tensegra run {reference}` runs the study"
            )
        return read_structure(reference)
    name = reference.removeprefix(LIBRARY)
    if name not in library.__all__:
        expected = f"one of {', '.join(library.__all__)}"
        raise ModelError.at("library", name, expected, candidates=library.__all__)
    structure: Structure = getattr(library, name)()
    return structure


def is_study_file(reference: str) -> bool:
    """Tell whether a file says that it is a study; one that cannot be read does not."""
    try:
        path = Path(reference)
        if not path.is_file():  # a pipe may never end
            return False
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError):
        return False
    return _STUDY.search(text) is not None


def parse_temperatures(settings: Sequence[str], structure: Structure) -> dict[str, float]:
    """Return differences of temperature in the structure's unit, from ``top=50`` or ``top=90 degF``.

    Raises
    ------
    ModelError
        As `parse_settings`; or for a difference that no solid outlasts.

    Examples
    --------
    >>> parse_temperatures(["top=90 degF"], library.paper_beam())
    {'top': 50.0}
    """
    units = structure.units
    values = parse_settings(settings, "-t", lambda text: units.number(text.strip(), "temperature"))
    limit = units.number(HOTTEST, "temperature")
    for name, value in values.items():
        if abs(value) > limit:
            expected = f"a difference of at most {limit:g} {units.temperature}, beyond which nothing is solid"
            raise ModelError.at(f"-t: {name}", value, expected)
    return values


def parse_loads(settings: Sequence[str], structure: Structure) -> dict[tuple[str, str], float]:
    """Return forces by node and axis in the structure's unit, from ``18.z=-0.5`` or ``18.z=-500 N``.

    Raises
    ------
    ModelError
        As `parse_settings`; or where no node and no axis are named.

    Examples
    --------
    >>> parse_loads(["18.z=-0.5", "19.x=2000 N"], library.paper_beam())
    {('18', 'z'): -0.5, ('19', 'x'): 2.0}
    """
    values = {}
    read = parse_settings(settings, "-l", lambda text: structure.units.number(text.strip(), "force"))
    for place, value in read.items():
        node, _, axis = place.rpartition(".")  # a node's own name may hold points
        if not node or axis not in ("x", "y", "z"):
            raise ModelError.at("-l", place, "a node and an axis, such as '18.z=-0.5'")
        values[node, axis] = value
    return values


def parse_settings(
    settings: Sequence[str], option: str, read: Callable[[str], float] = float
) -> dict[str, float]:
    """Return the values of ``name=value`` settings, each as `read` reads it.

    Raises
    ------
    ModelError
        A setting is not of this form, its value is no finite number, or a name is set twice.

    Examples
    --------
    >>> parse_settings(["A14=0.10", "A23=0.1"], "-a")
    {'A14': 0.1, 'A23': 0.1}
    """
    values: dict[str, float] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        name = name.strip()
        try:
            value = read(text)
        except (ValueError, QuantityError):
            value = float("nan")
        if not equals or not name or not isfinite(value):
            raise ModelError.at(option, setting, "a name and a finite number, such as 'A14=0.10'")
        if name in values:
            raise ModelError(f"{option}: {name!r} is set twice")
        values[name] = value
    return values
