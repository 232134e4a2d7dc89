"""The file that a surrogate is kept in: a zip of a header and of arrays, with the sum of each.

::

    surrogate.json       plain values
    arrays/NAME.npy      an array each
    sums.json            the SHA-256 of every entry above

An entry is read when it is asked for, its sum compared; what nobody asks for is never unpacked. The same
content always gives the same bytes, and nothing of it is ever run.
"""

import io
import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from struct import error as StructError  # noqa: N812 - the module gives its exception a lower-case name
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.files import replacing

__all__ = ["MOST_BYTES", "Arrays", "open_archive", "write_archive"]

HEADER, SUMS = "surrogate.json", "sums.json"

MOST_BYTES = 1 << 30
"""What all arrays together may unpack to: a Gaussian process of 10,000 runs has 0.8 GB."""

MOST_HEADER_BYTES = 1 << 26
"""What the header may unpack to: validation and laws of some thousand outputs are a few MB."""


def write_archive(path: Path, header: bytes, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a header and arrays; the file is replaced as a whole, or not at all."""
    entries = {HEADER: header}
    for name in sorted(arrays):
        buffer = io.BytesIO()
        np.lib.format.write_array(buffer, np.ascontiguousarray(arrays[name]), allow_pickle=False)
        entries[f"arrays/{name}.npy"] = buffer.getvalue()
    sums = {name: sha256(content).hexdigest() for name, content in entries.items()}
    entries[SUMS] = json.dumps(sums, indent=1).encode()
    with replacing(path, StudyError) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            # Without the time of writing.
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)


class Arrays(Mapping[str, NDArray[Any]]):
    """The arrays of an archive, each read, compared with its sum and looked through when it is asked for.

    Parameters
    ----------
    archive
        The open file.
    sums
        The sum of each entry.
    """

    def __init__(self, archive: zipfile.ZipFile, sums: Mapping[str, str], beginning: str = "arrays/") -> None:
        self._archive, self._sums, self._beginning = archive, sums, beginning
        self._names = tuple(
            name.removeprefix(beginning).removesuffix(".npy") for name in sums if name.startswith(beginning)
        )
        self._left = MOST_BYTES

    def __getitem__(self, name: str) -> NDArray[Any]:
        entry = f"{self._beginning}{name}.npy"
        if entry not in self._sums:
            raise KeyError(name)
        content = read_entry(self._archive, entry, self._left, self._sums)
        self._left -= len(content)
        array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        if array.dtype.kind not in "fiub":
            raise TypeError(f"array {name!r} holds no numbers")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError(f"array {name!r} holds a number that is not finite")
        return array

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def below(self, prefix: str) -> "Arrays":
        """Return those whose names begin with `prefix`, under what follows it; nothing is read yet."""
        return Arrays(self._archive, self._sums, self._beginning + prefix)


@contextmanager
def open_archive(path: Path, form: str) -> Iterator[tuple[dict[str, Any], Arrays]]:
    """Open a file that `write_archive` wrote: its header, and its arrays as they are asked for.

    Whatever fails within the context for want of a sound content is a damaged surrogate.

    Parameters
    ----------
    path
        The file.
    form
        What the header has to say for its format.

    Raises
    ------
    StudyError
        In one line, if there is no such file, it is none of ours, or it is damaged.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            header = _header(archive, path, form)
            yield header, Arrays(archive, _sums(archive))
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file") from None
    except (zipfile.BadZipFile, OSError):
        raise StudyError(f"{path}: not a surrogate, or damaged (expected a file written by save)") from None
    # What a damaged zip raises, and what a header or an array that does not fit raises further in.
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, AssertionError) as error:
        raise _damaged(path, error) from None
    except (RuntimeError, EOFError, MemoryError, SyntaxError, zlib.error, StructError) as error:
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> StudyError:
    reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    return StudyError(f"{path}: damaged surrogate ({reason})")


def read_entry(
    archive: zipfile.ZipFile, name: str, most: int, sums: Mapping[str, str] | None = None
) -> bytes:
    """Return an entry of at most so many bytes, compared with its sum where the sums are known."""
    size = archive.getinfo(name).file_size
    if size > most:
        raise ValueError(f"{name} unpacks to {size} bytes, expected at most {most}")
    content = archive.read(name)
    if sums is not None and sha256(content).hexdigest() != sums[name]:
        raise ValueError(f"{name} is not what was written: its sum differs")
    return content


def _header(archive: zipfile.ZipFile, path: Path, form: str) -> dict[str, Any]:
    """Return the header, its format looked at first: another one may sum up otherwise."""
    if HEADER not in archive.namelist():
        raise StudyError(f"{path}: not a surrogate (a zip file without {HEADER})")
    header = json.loads(read_entry(archive, HEADER, MOST_HEADER_BYTES))
    found = header.get("format") if isinstance(header, dict) else None
    if found != form:
        raise StudyError.at(f"{path}: format", found, f"{form!r}, the only one this version reads")
    return dict(header)


def _sums(archive: zipfile.ZipFile) -> dict[str, str]:
    """Return the sums of the entries, that of the header compared."""
    sums = json.loads(read_entry(archive, SUMS, MOST_HEADER_BYTES))
    read_entry(archive, HEADER, MOST_HEADER_BYTES, sums)
    return {str(name): str(value) for name, value in sums.items()}
