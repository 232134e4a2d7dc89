"""How far a long job is: bars where stderr is a terminal, else a line now and then."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from tensegra.report.pipeline import Listener

__all__ = ["progress"]

SECONDS_BETWEEN_LINES = 10.0


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

        def listener(task: str, done: int, total: int, note: str = "") -> None:
            if task not in tasks:
                tasks[task] = bars.add_task(escape(task), total=None)
            bars.update(tasks[task], completed=done, total=total or None, note=escape(note))

        yield listener


def _lines(write: Callable[[str], object], clock: Callable[[], float]) -> "Listener":
    """Return a listener that writes the first, the last and now and then a line of each task."""
    told: dict[str, float] = {}
    finished: set[str] = set()

    def listener(task: str, done: int, total: int, note: str = "") -> None:
        now = clock()
        ended = 0 < total <= done
        if task in finished or (
            not ended and now - told.get(task, -SECONDS_BETWEEN_LINES) < SECONDS_BETWEEN_LINES
        ):
            return
        told[task] = now
        if ended:
            finished.add(task)
        count = f"{done} of {total}" if total else str(done)
        write(f"{task}: {count}{', ' + note if note else ''}\n")

    return listener
