"""The paper, whole: every chapter in order, each kept once it is done, then the report and the table."""

import os
import platform
import time
from collections.abc import Callable
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensegra import TensegraError
from tensegra.mechanics import PathSettings
from tensegra.report import versions, write_json
from tensegra.study import replacing
from tensegra_paper.beam_model import solve_beam
from tensegra_paper.finished import FinishedChapter, Stamp, finish, read_finished
from tensegra_paper.page import markdown_page, page
from tensegra_paper.reproduction import Reproduction
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra_paper.chapter import Chapter

__all__ = ["CHAPTERS", "reproduce"]

CHAPTERS = (
    "assumptions",
    "shapes",
    "outcomes",
    "designs",
    "accuracy",
    "uncertainty",
    "indices",
    "selection",
    "chain",
    "optimum",
    "gripper",
)
"""Folders of `tensegra_paper.chapters`, each with a function of its name that makes the chapter."""


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
        ``paper_beam``, ``paper_beam_slender`` or ``paper_beam_identified``.
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
    make: Callable[[Setting], Chapter] = getattr(import_module(f"tensegra_paper.chapters.{name}"), name)
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
