"""Plain values: mappings with text keys, lists and scalars, whatever a file or a caller gave."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tensegra.structure.bounded import DEEPEST
from tensegra.structure.coerce import is_id
from tensegra.structure.problems import InvalidStructureError, Place, Problem
from tensegra.structure.text import REPEATED

__all__ = ["merged", "plain", "value_at"]


def plain(value: object) -> dict[str, Any]:
    """Return a copy of a mapping with text keys, lists for sequences and Python numbers for NumPy's.

    Raises
    ------
    InvalidStructureError
        It is no mapping, a key is neither a text nor a whole number, or a key is there twice.

    Examples
    --------
    >>> plain({1: (0.0, np.float64(2))})
    {'1': [0.0, 2.0]}
    """
    if not isinstance(value, Mapping):
        raise InvalidStructureError.of([Problem((), value, "a mapping of keys to values")])
    problems: list[Problem] = []
    copy: dict[str, Any] = _Copier(problems).copy((), value)
    if problems:
        raise InvalidStructureError.of(problems)
    return copy


# Most of what a file holds: no need to ask any further.
_SCALARS = frozenset({str, int, float, bool, type(None)})


class _Copier:
    def __init__(self, problems: list[Problem]) -> None:
        self._problems = problems
        # A YAML alias is the same object again: copied once, so that aliases of aliases stay small.
        self._copies: dict[int, Any] = {}

    def copy(self, place: Place, value: Any) -> Any:  # noqa: ANN401
        is_list = isinstance(value, (list, tuple))
        if not is_list and not isinstance(value, Mapping):
            return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
        if len(place) > DEEPEST:
            found = f"more than {DEEPEST} lists and mappings within one another"
            self._problems.append(Problem(place[:2], found, "plain values"))
            return None
        if id(value) not in self._copies:
            if not is_list:
                copied: dict[str, Any] = {}
                self._copies[id(value)] = copied
                self._fill(place, copied, value)
            else:
                items: list[Any] = []
                self._copies[id(value)] = items
                items.extend(
                    item if type(item) in _SCALARS else self.copy((*place, index), item)
                    for index, item in enumerate(value)
                )
        return self._copies[id(value)]

    def _fill(self, place: Place, copied: dict[str, Any], mapping: Mapping[Any, Any]) -> None:
        for key, item in mapping.items():
            name = str(key)
            if not is_id(key):
                self._problems.append(Problem(place, key, "a key that is a text or a whole number"))
            elif name in copied or item is REPEATED:
                self._problems.append(Problem(place, name, "each key once"))
            else:
                copied[name] = item if type(item) in _SCALARS else self.copy((*place, name), item)


def merged(target: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return `target` with `changes` merged in, as RFC 7396 has it.

    Mappings are merged key by key, None removes a key, and anything else takes the place of what was.

    Examples
    --------
    >>> merged({"a": {"b": 1, "c": 2}, "d": [1, 2]}, {"a": {"b": None, "e": 3}, "d": [4]})
    {'a': {'c': 2, 'e': 3}, 'd': [4]}
    """
    result = dict(target)
    for key, change in changes.items():
        if change is None:
            result.pop(key, None)
        elif isinstance(change, Mapping):
            below = result.get(key)
            result[key] = merged(below if isinstance(below, Mapping) else {}, change)
        else:
            result[key] = change
    return result


def value_at(value: object, place: Place) -> object:
    """Return what stands at `place` in a plain or raw value; None where there is nothing."""
    for key in place:
        if isinstance(value, Mapping):
            value = next((item for name, item in value.items() if str(name) == str(key)), None)
        elif isinstance(value, list | tuple) and isinstance(key, int) and key < len(value):
            value = value[key]
        else:
            return None
    return value
