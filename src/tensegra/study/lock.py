"""One driver for each campaign folder: a lock that dies with its process."""

import json
import os
import platform
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from tensegra.errors import StudyError

__all__ = ["Driver", "driver_of", "lock_folder"]

LOCK = "lock"

Driver = dict[str, Any]
"""Who runs a campaign: ``pid``, ``host``, ``started`` (seconds since the epoch)."""


@contextmanager
def lock_folder(folder: Path) -> Iterator[None]:
    """Hold the folder for this process as long as the context lasts.

    The operating system releases the lock of a process that dies, in whatever way, so a stale lock
    cannot be: what a dead driver leaves behind is a file that nobody holds.

    Raises
    ------
    StudyError
        If another process holds it; the message names that process.
    """
    with (folder / LOCK).open("a+", encoding="utf-8") as file:
        if not _try_lock(file):
            driver = _read(file) or {}
            who = f"process {driver.get('pid', '?')} on {driver.get('host', '?')}"
            raise StudyError(
                f"{folder}: {who} is running this campaign; wait for it, or end it, and run again"
            )
        try:
            _write(file, {"pid": os.getpid(), "host": platform.node(), "started": time.time()})
            yield
        finally:
            _write(file, None)
            _unlock(file)


def driver_of(folder: Path) -> Driver | None:
    """Return who is running the campaign now, or None if nobody is."""
    try:
        file = (folder / LOCK).open("r+", encoding="utf-8")
    except OSError:
        return None
    with file:
        if _try_lock(file):
            _unlock(file)
            return None
        return _read(file)


def _read(file: IO[str]) -> Driver | None:
    file.seek(0)
    try:
        content = json.loads(file.read())
    except ValueError:
        return None
    return content if isinstance(content, dict) else None


def _write(file: IO[str], content: Driver | None) -> None:
    file.seek(0)
    file.truncate()
    if content is not None:
        json.dump(content, file)
    file.flush()


if sys.platform == "win32":
    import msvcrt

    # Beyond the text, for Windows refuses to read what is locked.
    _OFFSET = 1 << 20

    def _try_lock(file: IO[str]) -> bool:
        file.seek(_OFFSET)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

    def _unlock(file: IO[str]) -> None:
        file.seek(_OFFSET)
        msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)

else:
    import fcntl

    def _try_lock(file: IO[str]) -> bool:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def _unlock(file: IO[str]) -> None:
        fcntl.flock(file, fcntl.LOCK_UN)
