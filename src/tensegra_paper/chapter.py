"""What a reproduction consists of: chapters with rows, where ours stands beside what was printed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import isfinite
from typing import TYPE_CHECKING

from tensegra import SolverError
from tensegra.report import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["Agreement", "Chapter", "Figure", "Row"]


class Agreement(StrEnum):
    """What can be asked of a row."""

    FINDING = "finding"
    """A printed claim, judged by what its words say (`tensegra_paper.claims`); it can fail."""
    METHOD = "method"
    """A check of ours that must hold, whatever the beam: a surrogate or an optimiser against FEM."""
    VALUE = "value"
    """A number beside the printed one, not judged: of another machine, or printed nowhere."""
    INPUT = "input"
    """Read back from what was put in or fitted to the print, so that it could not fail: no evidence."""


JUDGED = (Agreement.FINDING, Agreement.METHOD)


@dataclass(frozen=True)
class Row:
    """One printed finding beside ours.

    Attributes
    ----------
    place
        Where it is printed, such as ``Table 2`` or ``Fig. 13``.
    quantity
        What it is.
    published
        A number, a short text, or None where the publication has none.
    ours
        A number or a short text.
    unit
        Of both; ``""`` for none.
    agreement
        What can be asked.
    holds
        Whether the criterion that `why` states was met: of findings and checks of method, and of no others.
    why
        What was compared with which tolerance, or the reason of the difference.
    claim
        Key of `tensegra_paper.claims.CLAIMS` for a finding.

    Raises
    ------
    SolverError
        Where ours is no finite number: what the row tells of could not be computed.
    ValueError
        For a finding or a check of method without a verdict, another row with one, a finding without its
        claim, or a row without a reason.
    """

    place: str
    quantity: str
    published: float | str | None
    ours: float | str
    unit: str
    agreement: Agreement
    holds: bool | None
    why: str
    claim: str = ""

    def __post_init__(self) -> None:
        if (self.agreement in JUDGED) != (self.holds is not None):
            raise ValueError(f"{self.place}, {self.quantity}: findings and methods are judged, no others")
        if (self.agreement is Agreement.FINDING) != bool(self.claim):
            raise ValueError(f"{self.place}, {self.quantity}: a finding has its claim, no other row has one")
        if not self.why or self.ours == "":
            raise ValueError(f"{self.place}, {self.quantity}: a row is filled, with a reason")
        if not isinstance(self.ours, str) and not isfinite(self.ours):
            raise SolverError(f"{self.place}, {self.quantity}: no number could be found")

    @property
    def difference(self) -> float | None:
        """Ours less the published number; None where either is no number.

        Examples
        --------
        >>> Row("Fig. 14", "greatest w", 144.0, 146.0, "cm", Agreement.VALUE, None, "fit").difference
        2.0
        """
        if isinstance(self.published, str) or self.published is None or isinstance(self.ours, str):
            return None
        return self.ours - self.published


@dataclass(frozen=True)
class Figure:
    """A figure of a chapter.

    Attributes
    ----------
    name
        Stem of its files, such as ``fig-12-propagation``.
    caption
        A few words, a full stop, then what more there is to say.
    draw
        Makes it, in the report's style (`tensegra.report.figures.styled`).
    """

    name: str
    caption: str
    draw: "Callable[[], Drawing]" = field(repr=False)


@dataclass(frozen=True)
class Chapter:
    """A group of the publication's figures and tables, made again.

    Attributes
    ----------
    name
        Of its files, such as ``outcomes``.
    title
        For the reader.
    figures, rows, tables
        What it shows.
    text
        Paragraphs: what was run and what it shows.
    findings
        Sentences for the summary at the top of the report: what a reader should not miss, with numbers.
    seconds
        Time by task, as it was when the task was done; a resumed reproduction keeps it.
    seeds
        Seed by random choice.
    """

    name: str
    title: str
    figures: tuple[Figure, ...] = ()
    rows: tuple[Row, ...] = ()
    text: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    seeds: Mapping[str, int] = field(default_factory=dict)
