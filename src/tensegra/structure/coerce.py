"""From what a caller gives to what a frozen object holds: floats, tuples and text ids.

What cannot be brought into form is kept as it is, for the checks to refuse with its place.
"""

from collections.abc import Callable, Iterable, Mapping
from numbers import Integral
from typing import Any

from tensegra.structure.frozen import FrozenMapping
from tensegra.structure.problems import InvalidStructureError, Problem
from tensegra.units import as_float, is_number

__all__ = ["Vector", "by_id", "is_id", "name_of", "names", "number", "sorted_axes", "store", "vector"]

Vector = tuple[float, float, float]


def store(instance: object, **values: object) -> None:
    """Set fields of a frozen instance that is being made."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)


def number(value: Any) -> Any:  # noqa: ANN401 — anything comes in, and goes out if it is no number
    """Return a real number as a float; None, for a number that is left out, stays None."""
    if value is None or type(value) is float:
        return value
    return as_float(value) if is_number(value) else value


def vector(value: Any) -> Any:  # noqa: ANN401 — idem
    """Return a sequence of numbers as a tuple of floats."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        return value
    return tuple(map(number, value))


def is_id(value: object) -> bool:
    """Tell whether `value` can name something: a text or a whole number."""
    return type(value) is str or (not isinstance(value, bool) and isinstance(value, str | Integral))


def name_of(value: object) -> object:
    """Return an id as a text."""
    if type(value) is str:
        return value
    return str(value) if is_id(value) else value


def names(value: str | Iterable[str | int]) -> tuple[object, ...]:
    """Return ids as a tuple of texts; a single text is one id, not a sequence of letters."""
    return tuple(map(name_of, [value] if isinstance(value, str) else value))


def sorted_axes(value: object) -> object:
    """Return axes in the order x, y, z."""
    return "".join(sorted(value)) if isinstance(value, str) and set(value) <= set("xyz") else value


def by_id(
    place: str, items: Mapping[Any, Any], form: Callable[[Any], object] = lambda item: item
) -> FrozenMapping[Any, Any]:
    """Return `items` under text ids, each brought into form.

    Raises
    ------
    InvalidStructureError
        Two ids are the same text, such as 1 and "1".
    """
    formed: dict[object, object] = {}
    for key, item in items.items():
        name = name_of(key)
        if name in formed:
            raise InvalidStructureError.of([Problem((place,), name, "each id once")])
        formed[name] = form(item)
    return FrozenMapping(formed)
