"""The command line: parse, call, exit code.

Results go to stdout, everything else to stderr. The exit code is 0 where the work was done, 1 where a
number could not be found (what was found is written all the same) and 2 where the input is wrong.
"""

import importlib.util
import io
import json
import logging
import os
import sys
import warnings
from pathlib import Path
from typing import Annotated

import typer

from tensegra.commands import Commands
from tensegra.errors import TensegraError, shortened
from tensegra.file_commands import add_commands

__all__ = ["app", "main"]

LONGEST_LINE = 2000
"""Characters of an error: place, value and names known, each shortened, fit in."""

LEAST_MEMORY = 640 << 20
"""Bytes of addresses without which OpenBLAS does not load, but tries for ever (seen at 500 MB)."""

DONE, NUMERICAL_FAILURE, BAD_INPUT = 0, 1, 2

app = typer.Typer(
    name="tensegra",
    cls=Commands,
    help="Statics, uncertainty and optimisation of classical and clustered tensegrity structures.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
StructureArgument = Annotated[
    str,
    typer.Argument(metavar="STRUCTURE", help="A structure file, or library:NAME such as library:paper_beam."),
]
CampaignArgument = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="The folder of a campaign.")]


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit code."""
    _degrade_quietly()
    try:
        _require_room()
        app(arguments)
    except TensegraError as error:
        _refuse(str(error))
    except BrokenPipeError:
        # Who reads the output has seen enough; what is left of it goes nowhere.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(DONE) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        _refuse(f"{error.filename}: {reason}" if error.filename else reason)
    except MemoryError as error:
        _refuse(f"not enough memory ({str(error) or 'none could be had'}); try fewer runs or samples")
    except ImportError as error:
        # The system's word for a library that finds no room.
        if "memory" not in str(error) and "map segment" not in str(error):
            raise
        _refuse(f"not enough memory to load a library ({error})")


def _degrade_quietly() -> None:
    """Let a terminal that lacks a letter show another, and numbers that overflow be told by their status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace" if stream is sys.stdout else "backslashreplace")
    if not sys.warnoptions:
        warnings.filterwarnings("ignore", category=RuntimeWarning, module=r"tensegra|numpy|scipy")


def _require_room() -> None:
    """Refuse a limit of memory under which the linear algebra would wait for more as it is loaded."""
    if importlib.util.find_spec("resource") is None:  # as on Windows
        return
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < LEAST_MEMORY:
        raise MemoryError(f"the limit is {limit >> 20} MB, expected at least {LEAST_MEMORY >> 20}")


def _refuse(message: str) -> None:
    sys.stderr.write(f"tensegra: error: {shortened(' '.join(message.split()), LONGEST_LINE)}\n")
    raise SystemExit(BAD_INPUT)


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False) -> None:
    if version:
        import tensegra

        typer.echo(f"tensegra {tensegra.__version__}")
        raise typer.Exit


@app.command()
def check(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A structure or study file, or library:NAME.")],
    as_json: Json = False,
) -> None:
    """Read a structure or a study, and tell what it is and whether it stands."""
    from tensegra.report.check import check_structure, check_study
    from tensegra.report.references import is_study_file, structure_from

    if is_study_file(file):
        from tensegra.study import read_study
        from tensegra.terminal import show_study_check

        show_study_check(check_study(read_study(file)), as_json=as_json)
        return
    from tensegra.terminal import show_structure_check

    result = check_structure(structure_from(file))
    show_structure_check(result, as_json=as_json)
    raise typer.Exit(DONE if result.stands else NUMERICAL_FAILURE)


@app.command()
def solve(
    structure: StructureArgument,
    actuation: Annotated[
        list[str] | None,
        typer.Option(
            "--actuation", "-a", metavar="NAME=VALUE", help="Value of an actuator, such as A14=0.10."
        ),
    ] = None,
    temperature: Annotated[
        list[str] | None,
        typer.Option(
            "--temperature",
            "-t",
            metavar="NAME=VALUE",
            help="Difference of temperature of a member or group, such as top=50.",
        ),
    ] = None,
    load: Annotated[
        list[str] | None,
        typer.Option(
            "--load",
            "-l",
            metavar="NODE.AXIS=VALUE",
            help="Force added on a node along an axis, such as 18.z=-0.5.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Write every step of the path to a .parquet or .csv file."),
    ] = None,
    settle_start: Annotated[
        bool, typer.Option("--settle-start", help="Let a start that does not stand fall first.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Follow a structure through its stages and then along an actuation."""
    from tensegra.mechanics import solve_path
    from tensegra.report.references import parse_loads, parse_settings, parse_temperatures, structure_from
    from tensegra.report.tables import write_history
    from tensegra.terminal import show_path

    asked = structure_from(structure)
    path = solve_path(
        asked,
        parse_settings(actuation or [], "-a"),
        parse_temperatures(temperature or [], asked),
        loads=parse_loads(load or [], asked),
        settle_start=settle_start,
    )
    if output is not None:
        write_history(path, output)
    show_path(path, as_json=as_json)
    raise typer.Exit(DONE if path.final.succeeded else NUMERICAL_FAILURE)


@app.command()
def run(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="A study file.")],
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign", "-o", help="Folder of the campaign; runs/ and the file's name if left out."
        ),
    ] = None,
    workers: Annotated[
        int,
        typer.Option("--workers", min=1, help="Processes of a local Dask cluster; 1: this one."),
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler, such as tcp://node7:8786."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Tell what would be done and how long it takes; do nothing.")
    ] = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="NAME", help="Make this surrogate or analysis alone, and what it needs."
        ),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Let the libraries below tell what they log.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run a study, or what of it is still missing: campaign, surrogates and analyses."""
    from tensegra.progress import progress
    from tensegra.report.check import check_study
    from tensegra.report.pipeline import carry_out
    from tensegra.study import pending_points, probe, read_study
    from tensegra.terminal import show_dry_run, show_results

    if verbose:
        logging.getLogger("tensegra").setLevel(logging.DEBUG)
    asked = read_study(study)
    folder = campaign if campaign is not None else Path("runs") / study.stem
    if dry_run:
        check, cost = check_study(asked), probe(asked, pending_points(asked, folder), workers=workers)
        show_dry_run(check, cost, as_json=as_json)
        return
    with progress() as listener:
        results = carry_out(
            asked, folder, workers=workers, scheduler=scheduler, listener=listener, only=only or ()
        )
    show_results(results, as_json=as_json)
    raise typer.Exit(DONE if results.succeeded else NUMERICAL_FAILURE)


@app.command()
def design(
    study: Annotated[Path, typer.Argument(metavar="STUDY", help="A study file.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The table, .parquet or .csv, a column for each variable.")
    ],
    as_json: Json = False,
) -> None:
    """Write the design points of a study, for use elsewhere or as a design of sampler 'file'."""
    from tensegra.study import design_points, read_study, write_points

    asked = read_study(study)
    points = design_points(asked)
    write_points(output, asked.input_names, points)
    if as_json:
        units = {variable.name: variable.unit for variable in asked.variables}
        typer.echo(json.dumps({"points": str(output), "n_points": len(points), "units": units}, indent=1))
    else:
        typer.echo(f"{output}: {len(points)} points of {', '.join(asked.input_names)}")


@app.command()
def status(campaign: CampaignArgument, as_json: Json = False) -> None:
    """Tell how far a campaign is: done, failed, pending, reasons, rate, time left."""
    from tensegra.study import open_campaign
    from tensegra.terminal import show_state

    show_state(open_campaign(campaign), as_json=as_json)


@app.command()
def report(
    campaign: CampaignArgument,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The HTML file; report.html in the campaign if left out."),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option("--figures", metavar="FOLDER", help="Write every figure as SVG and as PDF there, too."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write the report of a campaign, one HTML file with all its figures and tables."""
    from tensegra.progress import progress
    from tensegra.report.report import write_report
    from tensegra.study import open_campaign
    from tensegra.terminal import show_report

    with progress() as listener:
        written = write_report(open_campaign(campaign), output, figures=figures, listener=listener)
    show_report(written, as_json=as_json)


@app.command()
def studio(
    shown: Annotated[
        str,
        typer.Argument(
            metavar="STRUCTURE|CAMPAIGN",
            help="A structure file, library:NAME, or the folder of a campaign.",
        ),
    ],
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Of the page; any free one for 0.")
    ] = 0,
    host: Annotated[
        str, typer.Option("--host", help="Another address than this machine's own needs a token.")
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address alone.")] = False,
) -> None:
    """Open a page on which a structure is moved by hand, each move solved and certified."""
    import webbrowser

    from tensegra.studio import open_source, serve

    def opened(address: str) -> None:
        typer.echo(address)
        sys.stdout.flush()
        if not no_browser:
            webbrowser.open(address)

    serve(open_source(shown), host=host, port=port, opened=opened)


add_commands(app)
