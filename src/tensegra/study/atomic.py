"""Files that are there as a whole or not at all, and a clear word where they cannot be written."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from tensegra.errors import StudyError

__all__ = ["TEMPORARY", "replacing", "writing"]

TEMPORARY = ".writing"
"""Ending of a file that is being written."""


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn a failure to write into a message that says what is safe and what to do."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StudyError(
            f"{folder}: cannot write ({reason}); the shards that are there are whole, run again to go on"
        ) from error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Open a temporary file that takes the place of `path` once it is whole and on the disk."""
    # Hidden, so that readers of a whole folder pass over it.
    temporary = path.with_name(f".{path.name}{TEMPORARY}")
    with writing(path.parent):
        try:
            with temporary.open("wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink()
            raise
        _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    """Bring a renaming to the disk, where the system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
