"""Commands that other packages add to the command line, by entry points of one group.

A package offers one in its ``pyproject.toml``::

    [project.entry-points."tensegra.commands"]
    reproduce = "tensegra_paper.command:reproduce"

The function is written as those of `tensegra.cli`: its parameters are the options, its docstring is the help.
It is imported when its command is called or its help is shown, not before.
"""

from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from tensegra.errors import TensegraError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["GROUP", "Commands"]

GROUP = "tensegra.commands"


class Commands(TyperGroup):
    """The group of all commands: our own, and those of other packages after them."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - typer's own click, which it does not export
        """Return the names of all commands; one of our own is never replaced."""
        own = super().list_commands(ctx)
        return [*own, *sorted({entry.name for entry in entry_points(group=GROUP)} - set(own))]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - idem
        """Return a command by its name; None if there is none."""
        own = super().get_command(ctx, cmd_name)
        if own is not None:
            return own
        return next((_command(entry) for entry in entry_points(group=GROUP, name=cmd_name)), None)


def _command(entry: EntryPoint) -> Any:  # noqa: ANN401 - idem
    """Return the command of an entry point; where it cannot be loaded, one that says why."""
    try:
        function: Callable[..., None] = entry.load()
    except (ImportError, AttributeError) as error:
        function = _broken(entry, str(error))
    single = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    single.command(entry.name, context_settings={"help_option_names": ["-h", "--help"]})(function)
    return typer.main.get_command(single)


def _broken(entry: EntryPoint, reason: str) -> "Callable[..., None]":
    message = f"the command {entry.name!r} of {entry.value!r} cannot be loaded: {reason}"

    def refuse() -> None:
        raise TensegraError(message)

    refuse.__doc__ = f"{message[0].upper()}{message[1:]}."
    return refuse
