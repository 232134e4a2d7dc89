"""What shows itself: a result that draws its figure and its tables, though both are made floors above.

Nothing of the report is imported before a figure or a table is asked for, and no floor below knows its name.
"""

from typing import TYPE_CHECKING, Any, Protocol

from tensegra.above import Above

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Presented", "Presenter", "Tabled", "presenter"]


class Presenter(Protocol):
    """Who draws."""

    def figure_of(self, result: Any, /) -> Any:  # noqa: ANN401 - any result; a matplotlib Figure
        """Return the figure of a result."""
        ...

    def html_of(self, result: Any, /) -> str:  # noqa: ANN401 - any result
        """Return the tables of a result as a piece of HTML."""
        ...


presenter: Above[Presenter] = Above()
"""Who draws results."""


class Presented:
    """A result that shows itself."""

    __slots__ = ()

    def plot(self) -> Any:  # noqa: ANN401 - a matplotlib Figure, which the floors below do not import
        """Draw it.

        Returns
        -------
        matplotlib.figure.Figure
            Shown by a notebook as it is; ``.savefig(path)`` writes it.

        Raises
        ------
        TensegraError
            There is nothing to draw, as after a failed solution.
        """
        return presenter().figure_of(self)

    def _repr_html_(self) -> str:
        """Return the tables that a notebook shows."""
        return presenter().html_of(self)


class Tabled(Presented):
    """A result with a table, a mapping for each row."""

    __slots__ = ()

    def table(self) -> list[dict[str, Any]]:
        """Return a mapping for each row."""
        raise NotImplementedError

    def to_dataframe(self) -> "pd.DataFrame":
        """Return the table as a `pandas.DataFrame`."""
        import pandas as pd

        return pd.DataFrame(self.table())
