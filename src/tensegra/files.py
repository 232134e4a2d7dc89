"""Files on disk: each is written whole or not at all, under a name that every system takes."""

import contextlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from tensegra.errors import TensegraError

__all__ = [
    "LONGEST",
    "drafting",
    "is_draft",
    "replacing",
    "require_file_names",
    "telling",
    "write_json",
    "write_text",
]

MARK = ".writing"
"""What the name of every draft holds, the file that is being written."""

LONGEST_STEM = 80
"""Bytes of a file's name that its draft repeats: the rest of the draft's name fits into what is left."""

LONGEST = 100
"""Bytes of a name: with a suffix and what marks a file as being written it stays below the 255 of most
file systems, and below the 143 of an encrypted one."""

_FORBIDDEN = frozenset('/\\:*?"<>|')

_RESERVED = frozenset(
    {"con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(1, 10))}
)
"""Names that Windows keeps for devices, whatever their suffix."""


@contextlib.contextmanager
def replacing(
    path: Path, error_type: type[TensegraError] = TensegraError, advice: str = ""
) -> Iterator[IO[bytes]]:
    """Open a draft for writing bytes; it takes the place of `path` once it is whole and on the disk.

    Parameters
    ----------
    path
        The file. Until the end of the block it is what it was before.
    error_type
        The class of the error to raise where the file cannot be written.
    advice
        What the message says after the reason.

    Raises
    ------
    TensegraError
        The file cannot be written; no draft is left.
    """
    with drafting(path, error_type, advice) as draft, draft.open("wb") as file:
        yield file


@contextlib.contextmanager
def drafting(path: Path, error_type: type[TensegraError] = TensegraError, advice: str = "") -> Iterator[Path]:
    """Give the name of a draft beside `path`, for what opens files by their names; see `replacing`.

    The draft has the suffix of `path`, by which many libraries choose a format, and is hidden, so that who
    reads all files of a folder passes over it.
    """
    with telling(path, error_type, advice):
        if path.is_dir():
            raise IsADirectoryError(None, "it is a folder")
        stem = path.stem.encode(errors="replace")[:LONGEST_STEM].decode(errors="ignore")
        draft = path.with_name(f".{stem}.{os.getpid()}{MARK}{path.suffix}")
        try:
            yield draft
            _sync(draft, os.O_RDWR)
            draft.replace(path)
        finally:
            with contextlib.suppress(OSError):
                draft.unlink()
        with contextlib.suppress(OSError):  # a folder can be brought to the disk on some systems alone
            _sync(path.parent, os.O_RDONLY)


@contextlib.contextmanager
def telling(path: Path, error_type: type[TensegraError] = TensegraError, advice: str = "") -> Iterator[None]:
    """Turn a failure of the system to write into one message: which file, why, and `advice`."""
    try:
        yield
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise error_type(f"{path}: cannot be written ({reason}){advice}") from error


def write_text(path: Path, text: str, error_type: type[TensegraError] = TensegraError) -> None:
    """Write a text as UTF-8, with line feeds as they are; see `replacing`."""
    with replacing(path, error_type) as file:
        file.write(text.encode())


def write_json(
    path: Path, content: Mapping[str, Any], error_type: type[TensegraError] = TensegraError
) -> None:
    """Write JSON without NaN on one line; see `replacing`."""
    write_text(path, json.dumps(content, ensure_ascii=False, allow_nan=False) + "\n", error_type)


def is_draft(path: Path) -> bool:
    """Whether a file is one that was being written, left over where the process was killed.

    Examples
    --------
    >>> is_draft(Path("runs/.table.41.writing.csv")), is_draft(Path("runs/table.csv"))
    (True, False)
    """
    return path.name.startswith(".") and MARK in path.name


def _sync(path: Path, flags: int) -> None:
    """Bring a file, or what a folder says of its files, to the disk."""
    descriptor = os.open(path, flags)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def require_file_names(names: Iterable[str], place: str, error_type: type[TensegraError]) -> None:
    """Refuse names that cannot be those of files beside one another, on any system.

    Parameters
    ----------
    names
        The names, without suffixes.
    place
        Where they stand, the beginning of every message.
    error_type
        The class of the error to raise.

    Raises
    ------
    TensegraError
        A name would lead to another folder, cannot be a file's, or is another's but for its case.

    Examples
    --------
    >>> from tensegra.errors import StudyError
    >>> require_file_names(["pce", "Kriging 2"], "surrogates", StudyError)
    >>> require_file_names(["../pce"], "surrogates", StudyError)
    Traceback (most recent call last):
    tensegra.errors.StudyError: surrogates: found '../pce', expected a name that a file can have: ...
    """
    seen: dict[str, str] = {}
    for name in names:
        fault = _fault(name)
        if fault:
            raise error_type.at(place, name, f"a name that a file can have: {fault}")
        other = seen.setdefault(name.casefold(), name)
        if other != name:
            expected = f"another name: its file would be that of {other!r} where case makes no difference"
            raise error_type.at(place, name, expected)


def _fault(name: str) -> str:
    """Return what a name may not have, as a phrase; nothing if it is sound."""
    if not name.isprintable() or _FORBIDDEN & set(name):
        return f"printable characters but {' '.join(sorted(_FORBIDDEN))}"
    if not name or name.startswith((".", " ", "-")) or name.endswith((".", " ")):
        return "no point, space or hyphen at its beginning, no point or space at its end"
    if name.partition(".")[0].casefold() in _RESERVED:
        return "none that Windows keeps for a device"
    if len(name.encode(errors="replace")) > LONGEST:
        return f"at most {LONGEST} bytes"
    return ""
