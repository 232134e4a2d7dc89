"""Foreign files: opened only where they are files of a size, written as a whole or not at all."""

import importlib
from contextlib import AbstractContextManager
from pathlib import Path
from stat import S_ISREG
from typing import Any

from tensegra.errors import ModelError
from tensegra.files import drafting

__all__ = ["LARGEST_FILE", "MOST_NUMBERS", "library", "replacing", "require_file"]

LARGEST_FILE = 256 << 20
"""Bytes of a file that is read: a structure of a hundred thousand members needs a tenth of it."""

MOST_NUMBERS = 50_000_000
"""Numbers of a matrix that is read, 400 MB: a compressed file says little of what it holds."""


def require_file(path: Path) -> Path:
    """Return `path` where there is a file that can be read.

    Raises
    ------
    ModelError
        There is none, it is no file (a pipe may never end), or it is too large.
    """
    try:
        found = path.stat()
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or "").lower()
        raise ModelError(f"{path}: {reason}") from None
    except ValueError as error:  # a name that no file can have, such as one with a zero byte
        raise ModelError.at("file", str(path), f"the name of a file ({error})") from None
    if not S_ISREG(found.st_mode):
        raise ModelError(f"{path}: this is not a file")
    if found.st_size > LARGEST_FILE:
        raise ModelError.at(path.name, f"{found.st_size} bytes", f"a file of at most {LARGEST_FILE} bytes")
    return path


def replacing(path: Path) -> AbstractContextManager[Path]:
    """Give the name of a draft beside `path`, which takes the place of `path` once it is whole.

    Raises
    ------
    ModelError
        The file cannot be written.
    """
    return drafting(path, ModelError)


def library(name: str, format: str) -> Any:  # noqa: A002, ANN401 — a module of another project
    """Import the library that a format needs.

    Parameters
    ----------
    name
        The module.
    format
        The format, for the message.

    Raises
    ------
    ModelError
        It is not installed; the message names the extra that brings it.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != name.partition(".")[0]:
            raise
        raise ModelError(
            f"{format}: needs the library {name.partition('.')[0]!r}, which is not installed; "
            "`pip install tensegra[exchange]` brings it"
        ) from None
