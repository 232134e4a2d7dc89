"""The report of a campaign: one HTML file that needs nothing else."""

from base64 import b64encode
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

from tensegra.errors import StudyError
from tensegra.files import replacing, telling
from tensegra.report.pipeline import Listener, deaf
from tensegra.report.results import Results, open_results
from tensegra.report.tables import Table
from tensegra.study import Campaign
from tensegra.viewer.page import panel, viewer_head, viewer_tail

__all__ = ["Figure", "Report", "Section", "build_report", "render", "write_report"]


@dataclass(frozen=True)
class Figure:
    """A figure of the report.

    Attributes
    ----------
    number
        Its number in the report.
    title, text
        What it shows, in few words and in more.
    image
        The picture, SVG.
    pdf
        The same as PDF, where it is asked for.
    share
        Of the page's width, in percent.
    """

    number: int
    title: str
    text: str
    image: bytes = field(repr=False)
    share: int = 100
    pdf: bytes | None = field(default=None, repr=False)
    scene: dict[str, Any] | None = field(default=None, repr=False)

    @property
    def anchor(self) -> str:
        """Its place in the page."""
        return f"figure-{self.number}"

    @property
    def source(self) -> str:
        """The picture as a link that holds it."""
        return f"data:image/svg+xml;base64,{b64encode(self.image).decode()}"

    @property
    def html(self) -> str:
        """The picture as HTML, or the viewer that takes its place."""
        alt = escape(f"{self.title}. {self.text}")
        image = f'<img style="width: {self.share}%" src="{self.source}" alt="{alt}">'
        return image if self.scene is None else panel(self.scene, self.anchor, image)


@dataclass
class Section:
    """A section of the report: paragraphs, then tables, then figures."""

    title: str
    anchor: str
    paragraphs: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)


@dataclass(frozen=True)
class Report:
    """The content of a report, ready for its template."""

    title: str
    description: str
    sections: tuple[Section, ...]

    @property
    def has_scenes(self) -> bool:
        """Whether any figure is a viewer."""
        return any(figure.scene is not None for section in self.sections for figure in section.figures)

    def html(self) -> str:
        """Return the page."""
        head, tail = (viewer_head(), viewer_tail()) if self.has_scenes else ("", "")
        return render("report.html.j2", report=self, head=head, tail=tail)


def render(template: str, *, package: str = "tensegra.report", **content: object) -> str:
    """Return a page of a template.

    Parameters
    ----------
    template
        Its file.
    package
        Where the file is. It can include ``parts.html.j2`` and ``style.css``, which are here.
    **content
        What the template shows.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(where, ".") for where in (package, "tensegra.report")]),
        # Not by the name's suffix: what is not HTML is included in HTML.
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(**content)


def write_report(
    campaign: Campaign,
    output: Path | None = None,
    *,
    figures: Path | None = None,
    listener: Listener = deaf,
) -> Path:
    """Write the report of a campaign and return its file.

    Parameters
    ----------
    campaign
        Finished or not; the report has the sections for which there are results.
    output
        The file; ``report.html`` in the campaign's folder if left out.
    figures
        A folder for every figure as SVG and as PDF, too.
    listener
        Told of the progress.

    Raises
    ------
    StudyError
        If the campaign has no runs yet, or the file cannot be written.
    """
    path = campaign.folder / "report.html" if output is None else output
    if path.is_dir() or path.suffix.lower() not in {".html", ".htm"}:
        raise StudyError.at("report", str(path), "a file named .html")
    with telling(path, StudyError):
        path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path, StudyError) as file:
        # Opened first: a drawn report that cannot be written would be drawn in vain.
        report = build_report(open_results(campaign), pdf=figures is not None, listener=listener)
        if figures is not None:
            _write_figures(report, figures)
        file.write(report.html().encode())
    return path


def _write_figures(report: "Report", folder: Path) -> None:
    """Write every figure as SVG and as PDF, numbered as in the report."""
    folder.mkdir(parents=True, exist_ok=True)
    for figure in (figure for section in report.sections for figure in section.figures):
        for suffix, content in (("svg", figure.image), ("pdf", figure.pdf)):
            if content is not None:
                with replacing(folder / f"{figure.anchor}.{suffix}", StudyError) as file:
                    file.write(content)


def build_report(results: Results, *, pdf: bool = False, listener: Listener = deaf) -> Report:
    """Draw all figures of a campaign and gather its tables.

    Raises
    ------
    StudyError
        If there are no runs yet.
    """
    from tensegra.report.sections import Writer

    study = results.campaign.study
    frame = results.campaign.frame()
    if frame.empty:
        raise StudyError(f"{results.folder}: found no runs yet, expected some to report on")
    writer = Writer(results, frame, pdf=pdf)
    sections: list[Section] = []
    for done, part in enumerate(writer.parts):
        listener("report", done, len(writer.parts))
        sections += part()
    listener("report", len(writer.parts), len(writer.parts))
    return Report(study.name, study.description, tuple(sections))
