"""What `save` and `tensegra export` do: the formats of `exchange`, and figures as SVG, PDF and PNG."""

import os
from pathlib import Path

from tensegra.errors import ModelError
from tensegra.exchange import save as save_data
from tensegra.exchange.exchange import Saved
from tensegra.exchange.files import replacing
from tensegra.mechanics import EquilibriumPath
from tensegra.structure import Structure
from tensegra.study import Campaign

__all__ = ["FIGURES", "save", "save_figure"]

FIGURES = (".svg", ".pdf")
"""Suffixes of figures."""


def save(what: Saved, path: str | os.PathLike[str], format: str | None = None) -> None:  # noqa: A002 — the word of every library
    """Write what can be saved to a file, in the format that its suffix or `format` names.

    A figure of a structure shows it as drawn, one of a path its end over the end of its stages.

    Raises
    ------
    ModelError
        As for `tensegra.exchange.save`.
    """
    path = Path(path)
    if format is not None or path.suffix.lower() not in FIGURES:
        save_data(what, path, format)
        return
    from tensegra.report.figures import pdf, shape_figure, structure_figure, svg

    if isinstance(what, Structure):
        made = structure_figure(what, what.coordinates)
    elif isinstance(what, EquilibriumPath):
        made = shape_figure(what.structure, what.stages[-1].nodes, {"end of path": what.final.nodes})
    else:
        expected = "a structure or a path; a campaign's figures are those of its report, asked for by number"
        raise ModelError.at("save", f"{type(what).__name__} for {path.suffix}", expected)
    with replacing(path) as draft:
        draft.write_bytes(svg(made) if path.suffix.lower() == ".svg" else pdf(made))


def save_figure(campaign: Campaign, number: int, path: Path) -> None:
    """Write a figure of a campaign's report.

    Parameters
    ----------
    campaign
        With some runs.
    number
        The number that the figure has in the report.
    path
        A file named .svg or .pdf.

    Raises
    ------
    TensegraError
        There is no such figure, there are no runs yet, or the file cannot be written.
    """
    from tensegra.report.report import build_report
    from tensegra.report.results import open_results

    if path.suffix.lower() not in FIGURES:
        raise ModelError.at(path.name, path.suffix, "a file named .svg or .pdf", candidates=FIGURES)
    report = build_report(open_results(campaign), pdf=path.suffix.lower() == ".pdf")
    figures = {figure.number: figure for section in report.sections for figure in section.figures}
    if number not in figures:
        raise ModelError.at(
            "--figure", number, f"the number of one of the {len(figures)} figures of the report"
        )
    figure = figures[number]
    with replacing(path) as draft:
        draft.write_bytes(figure.image if figure.pdf is None else figure.pdf)
