"""What the publication prints, as numbers."""

import json
from functools import cache
from importlib.resources import files
from typing import Any

__all__ = ["published", "published_number"]


@cache
def _content() -> dict[str, Any]:
    text = (files("tensegra_paper") / "published.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


def published(*path: str | int) -> Any:  # noqa: ANN401 - whatever stands there
    """Return what is printed at a place of ``published.json``.

    Examples
    --------
    >>> published("optimisation", "optimum", "w"), published("gripper", "beams")
    (146.85, 4)
    """
    found: Any = _content()
    for key in path:
        found = found[key]
    return found


def published_number(*path: str | int) -> float:
    """Return a printed number.

    Examples
    --------
    >>> published_number("propagation", "table_2_displacement_z_cm", "mean", 0)
    52.6
    """
    return float(published(*path))
