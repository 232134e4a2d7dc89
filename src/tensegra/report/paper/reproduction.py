"""The paper, whole: every chapter in order, each kept once it is done, then the report and the table."""

import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.errors import TensegraError
from tensegra.files import replacing
from tensegra.mechanics import PathSettings
from tensegra.report.paper.beam_model import solve_beam
from tensegra.report.paper.chapter import Agreement, Chapter, Row
from tensegra.report.paper.finished import FinishedChapter, Stamp, finish, read_finished, row_to_dict
from tensegra.report.paper.page import markdown_page, page
from tensegra.report.paper.setting import Setting
from tensegra.report.pipeline import versions
from tensegra.report.results import write_json

__all__ = ["CHAPTERS", "Reproduction", "Tally", "reproduce"]

CHAPTERS = (
    "shapes",
    "outcomes",
    "designs",
    "accuracy",
    "uncertainty",
    "indices",
    "selection",
    "optimum",
    "gripper",
)
"""Modules of this folder, each with a function of its name that makes the chapter of its name."""


@dataclass(frozen=True)
class Tally:
    """How many rows there are, and hold.

    Attributes
    ----------
    method, method_held
        Rows of agreement of method, and those that hold.
    finding, finding_held
        Rows of agreement of value with something to hold, and those that do.
    value
        Rows of agreement of value altogether.
    """

    method: int
    method_held: int
    finding: int
    finding_held: int
    value: int


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
        """Whether every chapter could be made and every row of method holds."""
        return not self.failures and self.tally.method_held == self.tally.method

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows of all chapters."""
        return tuple(row for finished in self.chapters for row in finished.chapter.rows)

    @cached_property
    def tally(self) -> Tally:
        """How many rows there are, and hold."""
        method = [row for row in self.rows if row.agreement is Agreement.METHOD]
        value = [row for row in self.rows if row.agreement is Agreement.VALUE]
        finding = [row for row in value if row.holds is not None]
        held = [sum(bool(row.holds) for row in rows) for rows in (method, finding)]
        return Tally(len(method), held[0], len(finding), held[1], len(value))

    @property
    def summary(self) -> str:
        """How many rows hold, as a sentence."""
        counts = self.tally
        return (
            f"Of {counts.method} rows of method {counts.method_held} hold; of {counts.value} rows of value "
            f"{counts.finding} have something to hold, and {counts.finding_held} do."
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


def reproduce(
    folder: str | Path,
    *,
    scale: float = 1.0,
    structure: str = "paper_beam",
    seed: int = 1,
    threads: int | None = None,
    tell: Callable[[str], None] | None = None,
    chapters: tuple[str, ...] = CHAPTERS,
) -> Reproduction:
    """Make every table and figure of the publication again, beside the printed values.

    Run again with the same arguments, it goes on where it was: a finished chapter is not made again, nor is a
    block of runs of an unfinished one.

    Parameters
    ----------
    folder
        Created where it is missing.
    scale
        Share of the publication's numbers of runs, in (0, 1].
    structure
        ``paper_beam`` or ``paper_beam_slender``.
    seed
        From which all random choices come.
    threads
        One a core where left out.
    tell
        Told of the progress, a line at a time.
    chapters
        Names of `CHAPTERS`; all of them where left out.

    Returns
    -------
    Reproduction
        Its `succeeded` says whether all could be had and holds.

    Raises
    ------
    StudyError
        For a beam that there is not, a scale out of range, or a folder that cannot be written.
    """
    setting = Setting(Path(folder), structure, scale, seed, threads, tell or (lambda _: None))
    numbers = versions()
    beam = setting.structure
    stamp = Stamp(numbers["tensegra"], structure, beam.fingerprint, scale, seed)
    _warm_up(setting)
    done: list[FinishedChapter] = []
    failures: list[str] = []
    for place, name in enumerate(chapters, start=1):
        setting.tell(f"[{place}/{len(chapters)}] {name}")
        try:
            done.append(_finished(setting, name, stamp))
        except TensegraError as error:
            failures.append(f"{name}: {error}")
            setting.tell(f"    could not be had: {error}")
    made = Reproduction(
        setting.folder,
        stamp,
        tuple(done),
        tuple(failures),
        sum(finished.total for finished in done),
        numbers | _machine(setting),
        datetime.now(UTC).isoformat(timespec="seconds"),
    )
    with replacing(made.report) as file:
        file.write(page(made).encode())
    with replacing(made.table) as file:
        file.write(markdown_page(made).encode())
    write_json(made.table.with_suffix(".json"), made.to_dict())
    return made


def _warm_up(setting: Setting) -> None:
    """Compile the kernels, which the times of the chapters would hold otherwise."""
    began = time.perf_counter()
    setting.tell("kernels: compiled once, which may take half a minute")
    actuation = np.linspace(0.01, 0.1, 16)
    for settings in (PathSettings(), PathSettings(path="stepped")):
        solve_beam(setting.structure, {"A14": actuation, "A23": actuation}, settings)
    setting.tell(f"    {time.perf_counter() - began:.1f} s")


def _finished(setting: Setting, name: str, stamp: Stamp) -> FinishedChapter:
    """Return a chapter that is there, or make it."""
    before = read_finished(setting.folder, name, stamp)
    if before is not None:
        setting.tell(f"    kept, made in {before.total:.1f} s before")
        return before
    began, spared = time.perf_counter(), sum(setting.spared.values())
    make: Callable[[Setting], Chapter] = getattr(import_module(f"tensegra.report.paper.{name}"), name)
    chapter = make(setting)
    # What an interrupted run had solved before is part of what the chapter takes.
    before_this = sum(setting.spared.values()) - spared
    finished = finish(chapter, setting.folder, stamp, time.perf_counter() - began + before_this)
    setting.tell(f"    {time.perf_counter() - began:.1f} s")
    return finished


def _machine(setting: Setting) -> dict[str, str]:
    return {
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "processors": str(os.cpu_count() or 1),
        "threads": str(setting.threads or os.cpu_count() or 1),
    }
