"""What can be viewed in space: the method is here, on the ground floor; what shows it is above."""

from collections.abc import Callable
from typing import Any

from tensegra.above import Above

__all__ = ["Viewable", "viewer"]

viewer: Above[Callable[..., Any]] = Above()
"""What shows something in space."""


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
        return viewer()(self, **options)
