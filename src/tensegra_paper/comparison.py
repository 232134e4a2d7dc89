"""The table of a reproduction: rows for reading, in Markdown, and back from it."""

from collections.abc import Iterable, Sequence

from tensegra.report import NOTHING, Table, number
from tensegra_paper.chapter import Row

__all__ = ["HEADER", "comparison_table", "markdown_rows", "short_table", "text_of", "to_markdown", "verdict"]

HEADER = ("Place", "Quantity", "Unit", "Published", "Ours", "Difference", "Agreement", "Holds", "Why")
ALIGN = "sllrrrssl"

ROUNDING = 1e-9
"""Share of a published number below which a difference is what arithmetic leaves of none."""

DIGITS = 5
"""Significant digits of our numbers: one more than the publication ever prints."""


def verdict(row: Row) -> str:
    """Return whether a row holds, in a word.

    Examples
    --------
    >>> from tensegra_paper.chapter import Agreement
    >>> verdict(Row("Fig. 6", "upward", 98.4, 88.0, "%", Agreement.VALUE, None, "reconstructed"))
    '–'
    """
    return NOTHING if row.holds is None else "yes" if row.holds else "no"


def comparison_table(title: str, rows: Iterable[Row]) -> Table:
    """Return rows as a table of texts."""
    return Table.of(title, HEADER, (_cells(row) for row in rows), ALIGN)


def short_table(title: str, rows: Iterable[Row]) -> Table:
    """Return rows for a terminal, without their reasons."""
    header = ("Place", "Quantity", "Published", "Ours", "Difference", "Agreement")
    cells = [
        (
            row.place,
            f"{row.quantity} [{row.unit}]" if row.unit else row.quantity,
            text_of(row.published),
            text_of(row.ours),
            _difference(row),
            str(row.agreement) if row.holds is None else f"{row.agreement}: {verdict(row)}",
        )
        for row in rows
    ]
    return Table.of(title, header, cells, "slllrs")


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.place,
        row.quantity,
        row.unit or NOTHING,
        text_of(row.published),
        text_of(row.ours),
        _difference(row),
        str(row.agreement),
        verdict(row),
        row.why,
    )


def text_of(value: float | str | None) -> str:
    """Return a cell as it is shown."""
    return value if isinstance(value, str) else number(value, DIGITS)


def _difference(row: Row) -> str:
    if row.difference is None:
        return NOTHING
    if abs(row.difference) < ROUNDING * abs(float(row.published or 0.0)):
        return "0"
    text = number(row.difference, 3)
    return text if row.difference <= 0.0 else f"+{text}"


def to_markdown(table: Table, *, level: int = 2) -> str:
    r"""Return a table in Markdown, under its title as a heading.

    Examples
    --------
    >>> print(to_markdown(Table.of("Sizes", ("What", "|v| [cm]"), [("a", 1.5)], "lr")))
    ## Sizes
    <BLANKLINE>
    | What | \|v\| [cm] |
    | --- | ---: |
    | a | 1.5 |
    <BLANKLINE>
    """
    marks = ["---:" if align == "r" else "---" for align in table.align]
    lines = [_line(table.header), f"| {' | '.join(marks)} |", *(_line(cells) for cells in table.rows)]
    return "\n".join([f"{'#' * level} {table.title}", "", *lines, ""])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', BAR).replace(chr(10), ' ') for cell in cells)} |"


BAR = "\\|"
"""A bar within a cell of Markdown."""


def markdown_rows(text: str) -> list[dict[str, str]]:
    """Return the rows of a comparison table in Markdown, by the names of `HEADER`.

    Examples
    --------
    >>> from tensegra_paper.chapter import Agreement
    >>> row = Row("Fig. 14", "greatest w for |v| <= 1", 146.85, 146.5, "cm", Agreement.VALUE, None, "fit")
    >>> back = markdown_rows(to_markdown(comparison_table("All", [row])))
    >>> back[0]["Quantity"], back[0]["Ours"]
    ('greatest w for |v| <= 1', '146.5')
    """
    lines = text.splitlines()
    first = lines.index(_line(HEADER)) + 2
    rows = []
    for line in lines[first:]:
        if not line.startswith("|"):
            break
        cells = line.replace(BAR, "\0").strip("| ").split(" | ")
        rows.append(dict(zip(HEADER, (cell.replace("\0", "|") for cell in cells), strict=True)))
    return rows
