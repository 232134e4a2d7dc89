"""A finished reproduction: its chapters, how many rows there are and hold, and its files."""

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from tensegra_paper.chapter import Agreement, Row
from tensegra_paper.finished import FinishedChapter, Stamp, row_to_dict
from tensegra_paper.setting import Setting

__all__ = ["Reproduction", "Tally"]

LESS = (
    " With fewer runs than printed, what depends on their number (Figs. 17, 18 and 20, Eq. 12) is compared "
    "and not judged."
)


@dataclass(frozen=True)
class Tally:
    """How many rows there are, and hold.

    Attributes
    ----------
    finding, finding_held
        Printed claims, and those that hold on this beam.
    method, method_held
        Checks of our own method, and those that hold.
    value, input
        Numbers that are compared and not judged, and rows that could not fail.
    """

    finding: int
    finding_held: int
    method: int
    method_held: int
    value: int
    input: int


@dataclass(frozen=True)
class Reproduction:
    """A finished reproduction.

    Attributes
    ----------
    folder
        Where it is.
    stamp
        What it was made from.
    chapters
        Those that could be made.
    failures
        Why the others could not.
    seconds
        That making all chapters took, now or before.
    versions
        Of what the results depend on, and the machine.
    finished
        Date and time, UTC.
    """

    folder: Path
    stamp: Stamp
    chapters: tuple[FinishedChapter, ...]
    failures: tuple[str, ...]
    seconds: float
    versions: dict[str, str]
    finished: str

    @property
    def report(self) -> Path:
        """The HTML file."""
        return self.folder / "report.html"

    @property
    def table(self) -> Path:
        """The table in Markdown; in JSON it stands beside it."""
        return self.folder / "table.md"

    @property
    def succeeded(self) -> bool:
        """Whether every chapter could be made and every check of method holds."""
        return not self.failures and self.tally.method_held == self.tally.method

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all chapters."""
        return tuple(row for finished in self.chapters for row in finished.chapter.rows)

    @cached_property
    def tally(self) -> Tally:
        """How many rows there are, and hold."""
        of = {kind: [row for row in self.rows if row.agreement is kind] for kind in Agreement}
        held = {kind: sum(bool(row.holds) for row in rows) for kind, rows in of.items()}
        return Tally(
            len(of[Agreement.FINDING]),
            held[Agreement.FINDING],
            len(of[Agreement.METHOD]),
            held[Agreement.METHOD],
            len(of[Agreement.VALUE]),
            len(of[Agreement.INPUT]),
        )

    @property
    def claims(self) -> tuple[Row, ...]:
        """The printed claims, those that do not hold first."""
        claims = [row for row in self.rows if row.agreement is Agreement.FINDING]
        return tuple(sorted(claims, key=lambda row: bool(row.holds)))

    @property
    def summary(self) -> str:
        """How many rows hold, as a sentence."""
        counts = self.tally
        return (
            f"Of {counts.finding} printed claims {counts.finding - counts.finding_held} do not hold on this "
            f"beam and {counts.finding_held} do; of {counts.method} checks of our method "
            f"{counts.method_held} hold. {counts.value} more numbers are compared and not judged, "
            f"{counts.input} were put in or fitted to the print." + (LESS if self.stamp.scale < 1.0 else "")
        )

    @property
    def command(self) -> str:
        """The command that makes it."""
        stamp = self.stamp
        options = [f"--scale {stamp.scale:g}"] if stamp.scale < 1.0 else []
        options += [f"--structure {stamp.structure}"] if stamp.structure != Setting.structure_name else []
        options += [f"--seed {stamp.seed}"] if stamp.seed != Setting.seed else []
        return " ".join(["tensegra reproduce", *options])

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values, as ``table.json`` holds them."""
        return {
            "stamp": asdict(self.stamp),
            "tally": asdict(self.tally),
            "findings": [text for finished in self.chapters for text in finished.chapter.findings],
            "rows": [
                {"chapter": finished.chapter.name, **row_to_dict(row)}
                for finished in self.chapters
                for row in finished.chapter.rows
            ],
            "failures": list(self.failures),
            "seconds": {
                finished.chapter.name: {"altogether": finished.total, **finished.chapter.seconds}
                for finished in self.chapters
            },
            "seeds": {finished.chapter.name: dict(finished.chapter.seeds) for finished in self.chapters},
            "versions": self.versions,
            "finished": self.finished,
        }
