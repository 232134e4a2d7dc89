"""What can be viewed in space: the method is here, on the ground floor; what does it is registered above."""

from collections.abc import Callable
from typing import Any

__all__ = ["Viewable", "register"]

_load: list[Callable[[], Callable[..., Any]]] = []


def register(load: Callable[[], Callable[..., Any]]) -> None:
    """Let what `load` returns do what `Viewable.view` promises; it is called when something is viewed."""
    _load[:] = [load]


class Viewable:
    """What has a method `view`."""

    __slots__ = ()

    def view(self, **options: Any) -> Any:  # noqa: ANN401 - a widget of an optional library
        """Show this in a notebook, to be turned, played and moved on.

        Parameters
        ----------
        options
            Those of `tensegra.viewer.widget.view`.

        Raises
        ------
        TensegraError
            The extra ``notebook`` is not installed.
        """
        return _load[0]()(self, **options)
