"""How far a long job is: bars where stderr is a terminal, else a line now and then."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import floor, log10
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from tensegra.report.pipeline import Listener

__all__ = ["progress"]

SECONDS_BETWEEN_LINES = 10.0

FEW_PARTS = 16
"""Parts of a task below which their rate tells nothing."""


class _Pace:
    """How fast a task of many parts goes on, and when it will end."""

    def __init__(self) -> None:
        self.first: tuple[int, float] | None = None

    def tell(self, done: int, total: int, now: float) -> str:
        """Return rate and time left; nothing at the beginning and the end, or of a task of few parts."""
        if self.first is None:
            self.first = done, now
        begun, began = self.first
        if not (begun < done < total and now > began and total >= FEW_PARTS):
            return ""
        rate = (done - begun) / (now - began)
        digits = max(0, 2 - floor(log10(rate)))
        return f"{rate:.{digits}f}/s, {(total - done) / rate:.0f} s left"


@contextmanager
def progress() -> "Iterator[Listener]":
    """Show how far a long job is, on stderr: bars in a terminal, else a line now and then.

    Yields
    ------
    Listener
        Called as ``listener(task, done, total, note)``; a `total` of 0 means that nobody knows.
    """
    if sys.stderr.isatty():
        with _bars() as listener:
            yield listener
    else:
        yield _lines(sys.stderr.write, time.monotonic)


@contextmanager
def _bars() -> "Iterator[Listener]":
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[note]}", style="dim"),
    )
    with Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, Any] = {}
        paces: dict[str, _Pace] = {}

        def listener(task: str, done: int, total: int, note: str = "") -> None:
            if task not in tasks:
                tasks[task] = bars.add_task(escape(task), total=None, note="")
            pace = paces.setdefault(task, _Pace()).tell(done, total, time.monotonic())
            told = ", ".join(filter(None, (note, pace)))
            bars.update(tasks[task], completed=done, total=total or None, note=escape(told))

        yield listener


def _lines(write: Callable[[str], object], clock: Callable[[], float]) -> "Listener":
    """Return a listener that writes the first, the last and now and then a line of each task."""
    told: dict[str, float] = {}
    paces: dict[str, _Pace] = {}
    finished: set[str] = set()

    def listener(task: str, done: int, total: int, note: str = "") -> None:
        now = clock()
        pace = paces.setdefault(task, _Pace()).tell(done, total, now)
        ended = 0 < total <= done
        if task in finished or (
            not ended and now - told.get(task, -SECONDS_BETWEEN_LINES) < SECONDS_BETWEEN_LINES
        ):
            return
        told[task] = now
        if ended:
            finished.add(task)
        count = f"{done} of {total}" if total else str(done)
        write(f"{task}: {', '.join(filter(None, (count, note, pace)))}\n")

    return listener
