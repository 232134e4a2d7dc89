"""Reference of the command line, from the commands themselves."""

import inspect
from importlib.metadata import entry_points
from pathlib import Path
from typing import get_args, get_type_hints

from typer.models import ArgumentInfo, CommandInfo

from tensegra.cli import app
from tensegra.commands import GROUP

__all__ = ["pages"]

INTRO = """\
# Command line

Results go to stdout, progress and errors to stderr. `--json` prints the result as JSON. The exit code is 0
where the work was done, 1 where a number could not be found (what was found is written all the same), and 2
where the input is wrong: then one line says the place, what was found, what was expected, and the nearest
right name.
"""


def pages(_folder: Path) -> dict[str, str]:
    """Return the page of all commands."""
    parts = [INTRO]
    functions = {_name(command): command.callback for command in app.registered_commands}
    functions |= {entry.name: entry.load() for entry in entry_points(group=GROUP)}
    for name_of_command, function in sorted(functions.items()):
        hints = get_type_hints(function, include_extras=True)
        rows, usage = [], [f"tensegra {name_of_command}"]
        for name, parameter in inspect.signature(function).parameters.items():
            kind, info = get_args(hints[name])[:2]
            required = parameter.default is parameter.empty
            if isinstance(info, ArgumentInfo):
                written = info.metavar or name.upper()
                usage.append(written if required else f"[{written}]")
            else:
                # Of an annotated option, its first name stands where a default value would.
                written = ", ".join([info.default, *(info.param_decls or ())])
                written += "" if kind is bool else f" {info.metavar or _value(kind)}"
            default = "must be given" if required else f"`{parameter.default}`"
            if parameter.default is None or parameter.default is False:
                default = ""
            rows.append(f"| `{_cell(written)}` | {_cell(info.help or '')} | {default} |")
        parts.append(
            f"## {usage[0]}\n\n{inspect.getdoc(function)}\n\n```text\n{' '.join(usage)} [OPTIONS]\n```\n\n"
            "| argument or option | meaning | default |\n| --- | --- | --- |\n" + "\n".join(rows) + "\n"
        )
    return {"command-line.md": "\n".join(parts)}


def _name(command: CommandInfo) -> str:
    return command.name or command.callback.__name__


def _value(kind: object) -> str:
    """Return the word for a value of a type that has none of its own."""
    text = str(kind)
    return next(
        (word for part, word in (("Path", "FILE"), ("int", "N"), ("float", "X")) if part in text), "TEXT"
    )


def _cell(text: str) -> str:
    return text.replace("|", r"\|")
