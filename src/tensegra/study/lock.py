"""One driver for each campaign folder: a lock that dies with its process, and a look that takes none."""

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
"""Who runs a campaign: ``pid``, ``host``, ``birth`` (what tells the process from a later one of the same
number, or null), and since it began ``rows`` in ``seconds``, which no clock that is wrong can falsify."""

WIDTH = 1024
"""Bytes that the driver's word takes, padded: written over in one go, it is never seen by halves."""


LOOKS, SECONDS_BETWEEN_LOOKS = 20, 0.01
"""How often to look for the word of a driver that has only just taken the lock."""


class Held:
    """The lock of a folder, held by this process."""

    def __init__(self, file: IO[str]) -> None:
        self._file, self._began = file, time.monotonic()
        self._me: Driver = {"pid": os.getpid(), "host": platform.node(), "birth": _birth(os.getpid())}
        self.tell(0)

    def tell(self, rows: int) -> None:
        """Say how many rows have been stored since the folder was locked."""
        _write(self._file, {**self._me, "rows": rows, "seconds": time.monotonic() - self._began})


@contextmanager
def lock_folder(folder: Path) -> Iterator[Held]:
    """Hold the folder for this process as long as the context lasts.

    The operating system releases the lock of a process that dies, in whatever way, so a stale lock
    cannot be: what a dead driver leaves behind is a file that nobody holds.

    Raises
    ------
    StudyError
        If another process holds it; the message names that process. If the file system knows no locks.
    """
    with _opened(folder / LOCK) as file:
        try:
            locked = _try_lock(file)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise StudyError(
                f"{folder}: cannot be locked ({reason}), and two processes might write to it at a time; "
                "choose a folder on another file system"
            ) from None
        if not locked:
            driver = _read_soon(file)
            who = f"process {driver.get('pid', '?')} on {driver.get('host', '?')}"
            raise StudyError(
                f"{folder}: {who} is running this campaign; wait for it, or end it, and run again"
            )
        try:
            yield Held(file)
        finally:
            _write(file, None)
            _unlock(file)


def driver_of(folder: Path) -> Driver | None:
    """Return who is running the campaign now, or None if nobody is.

    The lock is not touched: a look that took it, however shortly, would refuse a driver that starts at that
    moment, and a file system without locks can still be read. A driver says itself when it ends; of one that
    could not, the process is gone. Of a driver on another machine only its own word is known.
    """
    try:
        with (folder / LOCK).open(encoding="utf-8") as file:
            driver = _read(file)
    except (OSError, ValueError):
        return None
    if driver is None or type(driver.get("pid")) is not int or driver["pid"] <= 0:
        return None
    if driver.get("host") == platform.node() and not _is_alive(driver["pid"], driver.get("birth")):
        return None
    return driver


def _is_alive(pid: int, birth: object) -> bool:
    """Tell whether a process of this machine exists, and is the one that was born then."""
    return _exists(pid) and (birth is None or birth == _birth(pid))


def _birth(pid: int) -> str | None:
    """Return when a process was born, in ticks since the machine was; None where nobody says."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        # The second field is a name in brackets, which may hold anything.
        return text.rpartition(")")[2].split()[19]
    except (OSError, IndexError):
        return None


def _read(file: IO[str]) -> Driver | None:
    file.seek(0)
    try:
        content = json.loads(file.read())
    except ValueError:
        return None
    return content if isinstance(content, dict) else None


def _read_soon(file: IO[str]) -> Driver:
    """Return what the holder of a lock says of itself; it may have taken it a moment ago."""
    for _ in range(LOOKS):
        driver = _read(file)
        if driver is not None:
            return driver
        time.sleep(SECONDS_BETWEEN_LOOKS)
    return {}


def _opened(path: Path) -> IO[str]:
    """Open a file to read and to write over, whether it is there or not."""
    return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+", encoding="utf-8")


def _write(file: IO[str], content: Driver | None) -> None:
    file.seek(0)
    file.write(("" if content is None else json.dumps(content)).ljust(WIDTH))
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

    def _exists(pid: int) -> bool:
        import ctypes

        synchronize, waiting = 0x00100000, 0x102
        kernel = ctypes.windll.kernel32
        handle = kernel.OpenProcess(synchronize, False, pid)  # noqa: FBT003 - Windows' own signature
        if not handle:
            return False
        try:
            return bool(kernel.WaitForSingleObject(handle, 0) == waiting)
        finally:
            kernel.CloseHandle(handle)

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

    def _exists(pid: int) -> bool:
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        except OverflowError:
            return False
        except PermissionError:
            return True
        return True
