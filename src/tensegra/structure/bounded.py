"""What a text may hold: plain values, neither too deep nor, with all its aliases written out, too many."""

from collections.abc import Mapping
from typing import Any

from tensegra.errors import shown

__all__ = ["DEEPEST", "MOST_VALUES", "TextError", "require_plain"]

DEEPEST = 64
"""Lists and mappings within one another: a study needs eight, and what reads values calls itself."""

MOST_VALUES = 20_000_000
"""Values with every alias written out: a structure of a million members, where ten short lines of aliases
of aliases would be a billion."""

_TOO_DEEP = f"nested too deeply, expected at most {DEEPEST} lists and mappings within one another"

_PLAIN: frozenset[type] = frozenset({str, int, float, bool, type(None)})


class TextError(ValueError):
    """A text that is not what its format demands; the message says where."""


def require_plain(value: object, *allowed: type) -> None:
    """Refuse values that are not plain, are nested too deeply, hold themselves, or are too many.

    Parameters
    ----------
    value
        What a reader of YAML or JSON returned.
    allowed
        Types that may stand in it beside those of plain values.

    Raises
    ------
    TextError
        Naming what is wrong.

    Examples
    --------
    >>> require_plain({"a": [1, 2.0, None]})
    >>> loop = []
    >>> loop.append(loop)
    >>> require_plain(loop)
    Traceback (most recent call last):
    tensegra.structure.bounded.TextError: found a list that holds itself, expected an end
    """
    types: frozenset[type] = _PLAIN.union(allowed)
    if not isinstance(value, list | dict):
        _scalar(value, types)
        return
    # Of each list or mapping that has been left: how many values it holds, and how deep.
    sizes: dict[int, tuple[int, int]] = {}
    open_ones: set[int] = {id(value)}
    stack: list[tuple[Any, list[Any]]] = [(value, _containers(value, types))]
    while stack:
        holder, below = stack[-1]
        if below:
            child = below.pop()
            if id(child) in sizes:
                continue
            if id(child) in open_ones:
                raise TextError(f"found a {type(child).__name__} that holds itself, expected an end")
            if len(stack) >= DEEPEST:
                raise TextError(_TOO_DEEP)
            open_ones.add(id(child))
            stack.append((child, _containers(child, types)))
            continue
        stack.pop()
        open_ones.discard(id(holder))
        sizes[id(holder)] = _size(holder, sizes)


def _containers(holder: Any, types: frozenset[type]) -> list[Any]:  # noqa: ANN401 - a list or a mapping
    """Return the lists and mappings directly within one, after a look at its scalars."""
    found = []
    if isinstance(holder, Mapping):
        for key in holder:
            _scalar(key, types)
    for item in holder.values() if isinstance(holder, Mapping) else holder:
        if isinstance(item, list | dict):
            found.append(item)
        else:
            _scalar(item, types)
    return found


def _size(holder: Any, sizes: Mapping[int, tuple[int, int]]) -> tuple[int, int]:  # noqa: ANN401 - idem
    items = holder.values() if isinstance(holder, Mapping) else holder
    within = [sizes[id(item)] for item in items if isinstance(item, list | dict)]
    size = len(holder) + sum(size for size, _ in within)
    depth = 1 + max((depth for _, depth in within), default=0)
    if size > MOST_VALUES:
        raise TextError(f"found more than {MOST_VALUES} values, expected fewer (aliases written out)")
    if depth > DEEPEST:
        raise TextError(_TOO_DEEP)
    return size, depth


def _scalar(value: object, types: frozenset[type]) -> None:
    if type(value) is str:
        # Half of a surrogate pair is no character: it can be neither printed nor written.
        if not value.isascii() and any("\ud800" <= character <= "\udfff" for character in value):
            raise TextError(f"found {shown(value)}, expected a text of whole characters")
    elif type(value) not in types:
        raise TextError(
            f"found a {type(value).__name__} {shown(value)}, expected a number, a text or a truth"
        )
