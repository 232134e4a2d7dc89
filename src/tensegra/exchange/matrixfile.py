"""The matrices of a .mat or .npz file by their names: only those wanted, and none too large."""

import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tensegra.errors import ModelError
from tensegra.exchange.files import MOST_NUMBERS, require_file
from tensegra.exchange.matlabload import MatlabFileError, load

__all__ = ["load_mat", "load_npz"]

Values = Mapping[str, Any]

HEADER, TAG = 128, 8
"""Bytes of the head of a MATLAB file of version 5 to 7, and of what stands before each variable."""

COMPRESSED = 15
"""Type of a variable that is packed by zlib; its own tag says how large it is."""


def load_mat(path: Path, wanted: Iterable[str]) -> Values:
    """Return the matrices of a MATLAB file of version 4 to 7.

    Where none has the name N, the fields of a struct that has one.

    Raises
    ------
    ModelError
        It is no such file, or a variable in it is too large.
    """
    require_file(path)
    try:
        _require_sizes(path)
        return load(path, wanted)
    except (MatlabFileError, OSError, zlib.error) as error:
        raise _broken(path, "MATLAB's matrices", error) from None


def load_npz(path: Path, wanted: Iterable[str]) -> Values:
    """Return the arrays of a NumPy archive; objects, which could run code, are refused.

    Raises
    ------
    ModelError
        It is no such file, or an array in it is too large.
    """
    require_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            for file in archive.infolist():
                _require_size(f"{path.name}: {file.filename}", file.file_size)
        with np.load(path, allow_pickle=False) as archive:
            return _named({name: archive[name] for name in archive.files if name in set(wanted)}, set(wanted))
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 — as above
        raise _broken(path, "an archive of NumPy's arrays", error) from None


def _named(values: Mapping[str, Any], wanted: set[str]) -> Values:
    return {name: value for name, value in values.items() if name in wanted}


def _require_sizes(path: Path) -> None:
    """Refuse a file of version 5 to 7 with a variable that is larger, unpacked, than any structure's.

    SciPy lists the sizes, too, but of no file that holds a function.
    """
    with path.open("rb") as file:
        head = file.read(HEADER)
        if len(head) < HEADER or head[126:128] not in {b"IM", b"MI"}:
            return
        if 2 in head[124:126]:
            raise ModelError.at(path.name, "MATLAB's version 7.3", "version 7: save(..., '-v7')")
        order: Literal["little", "big"] = "little" if head[126:128] == b"IM" else "big"
        while len(tag := file.read(TAG)) == TAG:
            kind, size = (int.from_bytes(tag[i : i + 4], order) for i in (0, 4))
            if kind == COMPRESSED:
                start = file.tell()
                inner = zlib.decompressobj().decompress(file.read(min(size, 512)), TAG)
                _require_size(path.name, int.from_bytes(inner[4:8], order))
                file.seek(start)
            file.seek(size, 1)


def _require_size(place: str, n_bytes: int) -> None:
    if n_bytes > 8 * MOST_NUMBERS:
        raise ModelError.at(place, f"{n_bytes} bytes", f"at most {8 * MOST_NUMBERS} bytes of one matrix")


def _broken(path: Path, what: str, error: Exception) -> ModelError:
    if isinstance(error, ModelError):
        return error
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return ModelError(f"{path.name}: this does not hold {what} ({reason})")
