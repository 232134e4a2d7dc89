"""What a floor may use of one above it, without knowing it: the package brings it when it is asked for.

A structure, a path or a batch lies below what draws, saves and shows it. So the ground floor holds a place
for each of these, the methods of results ask there, and `tensegra` itself says who brings what. Nothing is
imported before it is asked for.
"""

from collections.abc import Callable
from typing import Generic, TypeVar

__all__ = ["Above"]

T = TypeVar("T")


class Above(Generic[T]):
    """A place for what a floor above offers."""

    def __init__(self) -> None:
        self._load: list[Callable[[], T]] = []

    def brought_by(self, load: Callable[[], T]) -> None:
        """Let what `load` returns be what is offered, in place of an earlier one."""
        self._load[:] = [load]

    def __call__(self) -> T:
        """Bring it."""
        return self._load[0]()
