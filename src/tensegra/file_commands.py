"""The commands of files: new, schema, import, export; each parses, calls and ends with its exit code."""

import json
from pathlib import Path
from typing import Annotated

import typer

from tensegra.errors import ModelError, TensegraError

__all__ = ["add_commands"]

DONE, NUMERICAL_FAILURE = 0, 1

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Settings = list[str] | None


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this file to the command line."""
    app.command()(new)
    app.command()(schema)
    app.command("import")(import_file)
    app.command()(export)


def new(
    structure: Annotated[Path, typer.Argument(metavar="FILE", help="The structure file to write.")] = Path(
        "structure.yaml"
    ),
    source: Annotated[
        str, typer.Option("--from", metavar="library:NAME", help="A built-in structure to start from.")
    ] = "library:prism",
    study: Annotated[
        Path | None,
        typer.Option(
            "--study", metavar="FILE", help="The study file to write; study.yaml beside it if left out."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Write over files that are there.")] = False,
    as_json: Json = False,
) -> None:
    """Write a structure and a study to start from, with remarks; both run as they are."""
    from tensegra.exchange.files import replacing
    from tensegra.report.references import LIBRARY, structure_from
    from tensegra.schemas import starter_structure, starter_study

    if not source.startswith(LIBRARY):
        raise ModelError.at("--from", source, "a built-in structure such as library:prism")
    study = structure.with_name("study.yaml") if study is None else study
    for file in (structure, study):
        if file.suffix.lower() not in {".yaml", ".yml"}:
            raise ModelError.at("new", file.name, "a file named .yaml or .yml")
        if not force and file.exists():
            raise ModelError(f"{file}: there is such a file already; --force writes over it")
    if structure.resolve() == study.resolve():
        raise ModelError.at("--study", str(study), "another file than that of the structure")
    begun = structure_from(source)
    reference = _relative(structure, study)
    texts = {structure: starter_structure(begun), study: starter_study(begun, reference)}
    for file, text in texts.items():
        with replacing(file) as draft:
            draft.write_text(text, encoding="utf-8", newline="\n")
    if as_json:
        typer.echo(json.dumps({"structure": str(structure), "study": str(study)}, indent=1))
    else:
        typer.echo(f"{structure}: {begun!r}\n{study}: a study of it")
        typer.echo(f"Next: tensegra check {structure}, then tensegra run {study} -o runs/first")


def _relative(structure: Path, study: Path) -> str:
    """Return how a study names its structure: relative to its own folder where that is possible."""
    try:
        return structure.resolve().relative_to(study.resolve().parent).as_posix()
    except ValueError:
        return structure.resolve().as_posix()


def schema(
    name: Annotated[str, typer.Argument(metavar="structure|study", help="Which format.")],
) -> None:
    """Print the JSON Schema of a format: every key with type, unit, default, description and example."""
    from tensegra.schemas import schema_text

    typer.echo(schema_text(name), nl=False)


def import_file(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="A file of another program; see docs/exchange.md.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="The structure file to write, .yaml or .json.")
    ],
    format: Annotated[  # noqa: A002 — the word of every program
        str | None,
        typer.Option("--format", help="Its format where the suffix does not tell, such as compas."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option("--unit", help="Unit of its lengths; m if the file says none.")
    ] = None,
    force_unit: Annotated[
        str | None, typer.Option("--force-unit", help="Unit of its forces; N if the file says none.")
    ] = None,
    strut_stiffness: Annotated[
        str | None,
        typer.Option("--strut-stiffness", metavar="EA", help="EA of struts for which it has none."),
    ] = None,
    cable_stiffness: Annotated[
        str | None,
        typer.Option("--cable-stiffness", metavar="EA", help="EA of cables for which it has none."),
    ] = None,
    struts: Annotated[
        Settings,
        typer.Option("--struts", metavar="LAYER", help="A layer of a drawing whose lines are struts."),
    ] = None,
    cables: Annotated[
        Settings,
        typer.Option("--cables", metavar="LAYER", help="A layer of a drawing whose lines are cables."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Read a structure from a file of another program and write it as a structure file."""
    from tensegra.exchange import read_structure
    from tensegra.structure import write_structure

    structure = read_structure(
        file,
        format=format,
        unit=unit,
        force_unit=force_unit,
        strut_stiffness=strut_stiffness,
        cable_stiffness=cable_stiffness,
        struts=tuple(struts or ()),
        cables=tuple(cables or ()),
    )
    _require_other(file, output)
    write_structure(structure, output)
    if as_json:
        counts = {"nodes": structure.n_nodes, "members": structure.n_members}
        typer.echo(json.dumps({"structure": str(output), "name": structure.name, **counts}, indent=1))
    else:
        typer.echo(f"{output}: {structure!r}")


def _require_other(file: Path, output: Path) -> None:
    if output.exists() and file.exists() and output.samefile(file):
        raise ModelError.at("-o", str(output), "another file than the one that is read")


def export(
    source: Annotated[
        str,
        typer.Argument(
            metavar="STRUCTURE|CAMPAIGN", help="A structure file, library:NAME, or a campaign's folder."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="The file; its suffix names the format, see docs/exchange.md."),
    ],
    actuation: Annotated[
        Settings,
        typer.Option(
            "--actuation", "-a", metavar="NAME=VALUE", help="Value of an actuator, such as A14=0.10."
        ),
    ] = None,
    temperature: Annotated[
        Settings,
        typer.Option("--temperature", "-t", metavar="NAME=VALUE", help="Temperature of a member or group."),
    ] = None,
    drawing: Annotated[
        bool, typer.Option("--drawing", help="Write the structure as it is drawn, without solving it.")
    ] = False,
    format: Annotated[  # noqa: A002 — the word of every program
        str | None,
        typer.Option("--format", help="The format where the suffix does not tell, such as compas."),
    ] = None,
    figure: Annotated[
        int | None,
        typer.Option("--figure", metavar="NUMBER", help="A figure of a campaign's report, .svg or .pdf."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a structure, where it comes to rest, or the runs of a campaign for another program."""
    from tensegra.mechanics import solve_path
    from tensegra.report.export import save, save_figure
    from tensegra.report.references import parse_settings, parse_temperatures, structure_from
    from tensegra.study import open_campaign

    inputs = (*(actuation or []), *(temperature or []))
    if Path(source).is_dir():
        if drawing or inputs:
            raise TensegraError(
                f"{source}: a campaign is solved already; -a, -t and --drawing are for a structure"
            )
        campaign = open_campaign(source)
        if figure is not None:
            save_figure(campaign, figure, output)
        else:
            save(campaign, output, format)
        _tell(output, "solved", as_json=as_json)
        return
    if figure is not None:
        raise TensegraError(f"{source}: --figure is for a campaign; a structure's figure needs no number")
    structure = structure_from(source)
    if drawing:
        if inputs:
            raise TensegraError(f"{source}: a drawing is not solved; leave out -a and -t, or --drawing")
        save(structure, output, format)
        _tell(output, "drawn", as_json=as_json)
        return
    path = solve_path(
        structure, parse_settings(actuation or [], "-a"), parse_temperatures(temperature or [], structure)
    )
    save(path, output, format)
    _tell(output, str(path.status), path.reason, as_json=as_json)
    raise typer.Exit(DONE if path.final.succeeded else NUMERICAL_FAILURE)


def _tell(output: Path, status: str, reason: str = "", *, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps({"file": str(output), "status": status, "reason": reason}, indent=1))
    else:
        typer.echo(f"{output}: {status}{': ' + reason if reason else ''}")
