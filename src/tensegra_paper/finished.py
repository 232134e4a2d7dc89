"""Chapters that are done: drawn, timed and kept on the disk, so that they are not made again.

The folder of a reproduction::

    report.html, table.md, table.json    what a reader opens
    figures/NAME.svg, figures/NAME.png   every figure
    chapters/NAME.json                   every finished chapter, with the stamp under which it was made
    runs/NAME-KEY.npz                    solved runs, by a key of all that they depend on
"""

import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from tensegra.report import Table, write_json
from tensegra.report.figures import WIDTH, svg
from tensegra.study import replacing
from tensegra_paper.chapter import Agreement, Chapter, Row

__all__ = ["DrawnFigure", "FinishedChapter", "Stamp", "finish", "read_finished"]

SCHEMA = "tensegra/reproduction/1"

PNG_DPI = 160


@dataclass(frozen=True)
class Stamp:
    """What a chapter depends on: with the same stamp it is not made again.

    Attributes
    ----------
    version
        Of tensegra.
    structure, fingerprint
        Name and content of the beam.
    scale, seed
        Of the reproduction.
    """

    version: str
    structure: str
    fingerprint: str
    scale: float
    seed: int


@dataclass(frozen=True)
class DrawnFigure:
    """A figure on the disk.

    Attributes
    ----------
    name, caption
        As of `Figure`.
    path
        The SVG; a PNG of the same stem stands beside it.
    share
        Of the page's width, in percent.
    """

    name: str
    caption: str
    path: Path
    share: int

    @property
    def label(self) -> str:
        """Its number in the publication, such as ``Fig. 12``; ``Figure`` where it has none there.

        Examples
        --------
        >>> DrawnFigure("fig-06-outcomes", "", Path("x.svg"), 100).label
        'Fig. 6'
        >>> DrawnFigure("fig-12ac-uniform", "", Path("x.svg"), 100).label
        'Fig. 12a, c'
        """
        match = re.match(r"fig-0*(\d+)([a-d]*)-", self.name)
        return f"Fig. {match[1]}{', '.join(match[2])}" if match else "Figure"

    @property
    def title(self) -> str:
        """The first sentence of the caption."""
        return self.caption.split(". ", 1)[0].rstrip(".")

    @property
    def text(self) -> str:
        """The rest of the caption, closed by a full stop; ``""`` if there is none."""
        rest = self.caption.split(". ", 1)[1:]
        return f"{rest[0].rstrip('.')}." if rest else ""


@dataclass(frozen=True)
class FinishedChapter:
    """A chapter with its figures drawn.

    Attributes
    ----------
    chapter
        Without figures to draw.
    figures
        On the disk.
    total
        Seconds that it took altogether, drawing included.
    """

    chapter: Chapter
    figures: tuple[DrawnFigure, ...]
    total: float


def finish(chapter: Chapter, folder: Path, stamp: Stamp, seconds: float) -> FinishedChapter:
    """Draw a chapter's figures and keep the chapter.

    Parameters
    ----------
    chapter
        What was made.
    folder
        Of the reproduction.
    stamp
        Under which it was made.
    seconds
        That making it took, without the drawing.

    Raises
    ------
    StudyError
        If a file cannot be written.
    """
    began = perf_counter()
    places = folder / "figures"
    places.mkdir(parents=True, exist_ok=True)
    figures = []
    for figure in chapter.figures:
        drawing = figure.draw()
        path = places / f"{figure.name}.svg"
        with replacing(path) as file:
            file.write(svg(drawing))
        with replacing(path.with_suffix(".png")) as file:
            drawing.savefig(file, format="png", dpi=PNG_DPI)
        share = round(100 * min(1.0, drawing.get_figwidth() / WIDTH))
        figures.append(DrawnFigure(figure.name, figure.caption, path, share))
    total = seconds + perf_counter() - began
    finished = FinishedChapter(replace(chapter, figures=()), tuple(figures), total)
    write_json(_path(folder, chapter.name), _to_dict(finished, stamp))
    return finished


def read_finished(folder: Path, name: str, stamp: Stamp) -> FinishedChapter | None:
    """Return a chapter that was finished under the same stamp; None if there is none."""
    try:
        content = json.loads(_path(folder, name).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    if content.get("schema") != SCHEMA or content.get("stamp") != asdict(stamp):
        return None
    finished = _of_dict(content, folder)
    return finished if all(figure.path.is_file() for figure in finished.figures) else None


def _path(folder: Path, name: str) -> Path:
    return folder / "chapters" / f"{name}.json"


def row_to_dict(row: Row) -> dict[str, Any]:
    """Return a row as plain values, with its difference."""
    content = asdict(row) | {"agreement": str(row.agreement), "difference": row.difference}
    return {key: _plain(value) for key, value in content.items()}


def _plain(value: object) -> object:
    """Return a NumPy number as Python's."""
    return value.item() if hasattr(value, "item") else value


def _to_dict(finished: FinishedChapter, stamp: Stamp) -> dict[str, Any]:
    chapter = finished.chapter
    return {
        "schema": SCHEMA,
        "stamp": asdict(stamp),
        "name": chapter.name,
        "title": chapter.title,
        "text": list(chapter.text),
        "findings": list(chapter.findings),
        "rows": [row_to_dict(row) for row in chapter.rows],
        "tables": [asdict(table) for table in chapter.tables],
        "seconds": {key: float(value) for key, value in chapter.seconds.items()},
        "seeds": {key: int(value) for key, value in chapter.seeds.items()},
        "figures": [
            {"name": figure.name, "caption": figure.caption, "share": figure.share}
            for figure in finished.figures
        ],
        "total": finished.total,
    }


def _of_dict(content: Mapping[str, Any], folder: Path) -> FinishedChapter:
    rows = []
    for kept in content["rows"]:
        fields = {key: value for key, value in kept.items() if key != "difference"}
        rows.append(Row(**fields | {"agreement": Agreement(fields["agreement"])}))
    tables = [
        Table(
            **kept | {"header": tuple(kept["header"]), "rows": tuple(tuple(cells) for cells in kept["rows"])}
        )
        for kept in content["tables"]
    ]
    chapter = Chapter(
        name=content["name"],
        title=content["title"],
        rows=tuple(rows),
        text=tuple(content["text"]),
        findings=tuple(content["findings"]),
        tables=tuple(tables),
        seconds=content["seconds"],
        seeds=content["seeds"],
    )
    figures = tuple(
        DrawnFigure(path=folder / "figures" / f"{kept['name']}.svg", **kept) for kept in content["figures"]
    )
    return FinishedChapter(chapter, figures, content["total"])
