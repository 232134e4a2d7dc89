"""Beams beside what is printed: each finding measured with many runs, counted in and out of the fit."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import tensegra as tg
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.measured import measure
from tensegra_paper.identification.responses import Effort, respond

__all__ = ["CHAPTERS", "Tally", "markdown", "tally"]

MANY = Effort(design=512, samples=10_000, outcomes=4096, blocks=512, direct=True)
"""Numbers of runs of the final measurement: as many samples as printed, shares within 0.8 %, all solved."""

CHAPTERS = tuple(dict.fromkeys(finding.chapter for finding in FINDINGS))


@dataclass(frozen=True, eq=False)
class Tally:
    """What a beam agrees with.

    Attributes
    ----------
    name
        Of the beam.
    values
        Measured, by key of a finding.
    """

    name: str
    values: Mapping[str, float]

    def count(self, *, fitted: bool | None = None, chapter: str | None = None) -> tuple[int, int]:
        """Return how many findings the beam agrees with, and of how many.

        Parameters
        ----------
        fitted
            Only those in the fit, or only the others.
        chapter
            Only those of a chapter.
        """
        chosen = [
            finding
            for finding in FINDINGS
            if fitted in {None, finding.fitted} and chapter in {None, finding.chapter}
        ]
        return sum(finding.agrees(self.values[finding.key]) for finding in chosen), len(chosen)


def tally(name: str, structure: tg.Structure, effort: Effort = MANY) -> Tally:
    """Measure all findings on a beam.

    Parameters
    ----------
    name, structure
        Of the beam.
    effort
        Numbers of runs.

    Raises
    ------
    tensegra.SolverError
        If the beam does not stand under the nominal actuations.
    """
    found = respond(structure, effort)
    if found is None:
        raise tg.SolverError.at(f"beam {name}", "a run that does not stand", "all runs up to 10 % stable")
    return Tally(name, measure(found, effort))


def markdown(tallies: Iterable[Tally]) -> str:
    """Return the list of findings beside beams as a table in Markdown, and the counts as another."""
    beams = list(tallies)
    lines = [
        "| Chapter | Place | Finding | Printed | Tolerance | Fit | "
        + " | ".join(beam.name for beam in beams)
        + " |",
        "| --- | --- | --- | --- | ---: | --- |" + " ---: |" * len(beams),
    ]
    for finding in FINDINGS:
        bound = "at least " if finding.least else "at most " if finding.most else "± "
        limit = f"{bound}{finding.target if finding.least or finding.most else finding.tolerance:.3g}"
        cells = [
            f"{'**' if finding.agrees(value) else ''}{value:.4g}{'**' if finding.agrees(value) else ''}"
            for value in (beam.values[finding.key] for beam in beams)
        ]
        parts = [
            finding.chapter,
            finding.place,
            finding.key,
            finding.words,
            limit,
            "in" if finding.fitted else "held out",
        ]
        lines.append(f"| {' | '.join(parts)} | {' | '.join(cells)} |")
    lines += [
        "",
        "| Agrees with | " + " | ".join(beam.name for beam in beams) + " |",
        "| --- |" + " ---: |" * len(beams),
    ]
    rows: list[tuple[str, bool | None, str | None]]
    rows = [("in the fit", True, None), ("held out", False, None), ("all", None, None)]
    rows += [(f"chapter {chapter}", None, chapter) for chapter in CHAPTERS]
    for title, fitted, chapter in rows:
        counts = [beam.count(fitted=fitted, chapter=chapter) for beam in beams]
        lines.append(f"| {title} | " + " | ".join(f"{held} of {total}" for held, total in counts) + " |")
    return "\n".join(lines) + "\n"
