"""The report of a reproduction: one HTML file that needs nothing else, and the same in Markdown."""

from base64 import b64encode
from typing import TYPE_CHECKING

from tensegra.report import Table, number, render
from tensegra_paper.chapter import Row
from tensegra_paper.comparison import comparison_table, text_of, to_markdown, verdict
from tensegra_paper.finished import DrawnFigure
from tensegra_paper.published import published

if TYPE_CHECKING:
    from tensegra_paper.reproduction import Reproduction

__all__ = ["markdown_page", "page"]


def page(made: "Reproduction") -> str:
    """Return the report as HTML."""
    return render(
        "page.html.j2",
        package="tensegra_paper",
        made=made,
        citation=published("source"),
        source=_source,
        number=number,
        verdict=verdict,
        comparison=comparison_table,
        tables=_provenance(made),
    )


def markdown_page(made: "Reproduction") -> str:
    """Return the table of all rows in Markdown, with what made it."""
    parts = [
        f"# The paper reproduced: {made.stamp.structure}",
        "",
        (
            f"“{published('source')}”. Made by `{made.command}` in {made.seconds:.0f} s; what each row means "
            "stands in its last column."
        ),
        "",
        made.summary,
        "",
    ]
    parts += [f"- {finding}" for finished in made.chapters for finding in finished.chapter.findings]
    parts += [f"- Could not be had: {failure}." for failure in made.failures]
    parts += ["", "Printed claims that do not hold on this beam:", ""]
    parts += [_claim_line(row) for row in made.claims if not row.holds]
    parts += ["", "They hold:", ""]
    parts += [_claim_line(row) for row in made.claims if row.holds]
    parts.append("")
    parts.append(to_markdown(comparison_table("Published and ours", made.rows)))
    assumed = [finished for finished in made.chapters if finished.chapter.name == "assumptions"]
    parts += [to_markdown(table) for finished in assumed for table in finished.chapter.tables]
    parts += [to_markdown(table) for table in _provenance(made)]
    return "\n".join(parts)


def _claim_line(row: Row) -> str:
    """Return a claim as an item of a list."""
    unit = f" {row.unit}" if row.unit else ""
    ours, printed = (text_of(value) for value in (row.ours, row.published))
    return f"- {row.place}, {row.quantity}: printed {printed}, here {ours}{unit}"


def _source(figure: DrawnFigure) -> str:
    """Return a figure as a link that holds it."""
    return f"data:image/svg+xml;base64,{b64encode(figure.path.read_bytes()).decode()}"


def _provenance(made: "Reproduction") -> tuple[Table, ...]:
    times = [
        (finished.chapter.name, what, number(seconds, 3))
        for finished in made.chapters
        for what, seconds in [("altogether", finished.total), *finished.chapter.seconds.items()]
    ]
    seeds = [
        (finished.chapter.name, what, str(seed))
        for finished in made.chapters
        for what, seed in finished.chapter.seeds.items()
    ]
    return (
        Table.of("Times", ("Chapter", "Task", "Seconds"), times, "llr"),
        Table.of("Seeds", ("Chapter", "Random choice", "Seed"), seeds, "llr"),
        Table.of("Versions and machine", ("What", ""), list(made.versions.items()), "ll"),
    )
