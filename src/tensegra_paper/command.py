"""``tensegra reproduce``: parse, call, show, exit code."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tensegra_paper.reproduction import Reproduction

__all__ = ["reproduce"]

DONE, NUMERICAL_FAILURE = 0, 1


def reproduce(
    scale: Annotated[
        float, typer.Option("--scale", help="Share of the publication's numbers of runs, above 0, at most 1.")
    ] = 1.0,
    structure: Annotated[
        str,
        typer.Option(
            "--structure", metavar="NAME", help="paper_beam, paper_beam_slender or paper_beam_identified."
        ),
    ] = "paper_beam",
    seed: Annotated[int, typer.Option("--seed", help="From which all random choices come.")] = 1,
    folder: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="runs/reproduction- and the name if left out."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Make every table and figure of the source paper again, beside the printed values."""
    from tensegra_paper import making

    made = making.reproduce(
        folder if folder is not None else Path("runs") / f"reproduction-{structure}",
        scale=scale,
        structure=structure,
        seed=seed,
        tell=lambda line: typer.echo(line, err=True),
    )
    show(made, as_json=as_json)
    raise typer.Exit(DONE if made.succeeded else NUMERICAL_FAILURE)


def show(made: "Reproduction", *, as_json: bool = False) -> None:
    """Show how the publication's values compare with ours; the reasons stand in the report."""
    from tensegra.terminal import print_json, print_line, print_table

    if as_json:
        print_json(made.to_dict())
        return
    from tensegra_paper.comparison import short_table

    for finished in made.chapters:
        print_table(short_table(finished.chapter.title, finished.chapter.rows))
    for finding in (text for finished in made.chapters for text in finished.chapter.findings):
        print_line(f"- {finding}")
    for failure in made.failures:
        print_line(f"Could not be had: {failure}.")
    print_line(made.summary)
    print_line(f"{made.report}, {made.table}")
