"""The matrices of a .mat or .npz file by their names: only those wanted, and none too large."""

import zipfile
from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.errors import ModelError
from tensegra.exchange.files import MOST_NUMBERS, require_file

__all__ = ["load_mat", "load_npz"]

Values = Mapping[str, Any]


def load_mat(path: Path, wanted: Iterable[str]) -> Values:
    """Return the matrices of a MATLAB file of version 4 to 7.

    Where none has the name N, the fields of a struct that has one.

    Raises
    ------
    ModelError
        It is no such file, or a matrix in it is too large.
    """
    from scipy.io import loadmat, whosmat

    require_file(path)
    try:
        listed = whosmat(path)
        _require_size(path.name, {name: shape for name, shape, _ in listed})
        names = [name for name, _, _ in listed]
        if "N" in names:
            return dict(loadmat(path, variable_names=[name for name in wanted if name in names]))
        structs = [name for name, _, kind in listed if kind == "struct"]
        for name, value in loadmat(path, variable_names=structs, simplify_cells=True).items():
            if name in structs and isinstance(value, dict) and "N" in value:
                return {key: item for key, item in value.items() if key in set(wanted)}
    except NotImplementedError:
        raise ModelError.at(path.name, "MATLAB's version 7.3", "version 7: save(..., '-v7')") from None
    except MemoryError:
        raise
    except Exception as error:  # noqa: BLE001 — SciPy tells a broken file by whatever its reader trips over
        raise _broken(path, "MATLAB's matrices", error) from None
    return dict.fromkeys(names)


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
            _require_size(path.name, {file.filename: (file.file_size // 8,) for file in archive.infolist()})
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files if name in set(wanted)}
    except MemoryError:
        raise
    except Exception as error:
        if isinstance(error, ModelError):
            raise
        raise _broken(path, "an archive of NumPy's arrays", error) from None


def _require_size(source: str, shapes: Mapping[str, tuple[int, ...]]) -> None:
    for name, shape in shapes.items():
        if prod(shape) > MOST_NUMBERS:
            raise ModelError.at(f"{source}: {name}", f"{prod(shape)} numbers", f"at most {MOST_NUMBERS}")


def _broken(path: Path, what: str, error: Exception) -> ModelError:
    if isinstance(error, ModelError):
        return error
    reason = " ".join(str(error).split())[:200] or type(error).__name__
    return ModelError(f"{path.name}: this does not hold {what} ({reason})")
