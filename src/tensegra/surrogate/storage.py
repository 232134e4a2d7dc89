"""Saving and loading: one file, without pickle, so that reading one never runs anything.

The file is a zip of ``surrogate.json`` (format, kind, names, units, joint law, seed, options, validation, the
study's hash) and one ``arrays/NAME.npy`` for each array. The same surrogate always gives the same bytes.
"""

import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.jointlaw import read_joint_law, written_joint_law
from tensegra.surrogate.kinds import kind_of
from tensegra.surrogate.problem import Scaling
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import Validation

__all__ = ["FORMAT", "load", "save"]

FORMAT = "tensegra/surrogate/2"
_HEADER = "surrogate.json"
_PLAIN = ("kind", "n_train", "seconds", "seed", "study_fingerprint")
_TUPLES = ("input_names", "output_names", "input_units", "output_units")
_SCALING = ("input_shift", "input_scale", "output_shift", "output_scale")


def save(surrogate: Surrogate, path: str | Path) -> Path:
    """Write a surrogate to one file.

    Parameters
    ----------
    surrogate
        Any kind.
    path
        The file, by habit ``NAME.tg``. It is replaced whole or not at all.

    Returns
    -------
    Path
        The file.
    """
    path = Path(path)
    arrays, settings = surrogate.model.state()
    arrays = {f"model.{name}": array for name, array in arrays.items()}
    arrays |= {f"scaling.{name}": getattr(surrogate.scaling, name) for name in _SCALING}
    arrays["bounds"] = surrogate.bounds
    header = {"format": FORMAT} | {name: getattr(surrogate, name) for name in _PLAIN + _TUPLES}
    header |= {
        "options": dict(surrogate.options),
        "validation": None if surrogate.validation is None else surrogate.validation.to_dict(),
        "joint_law": None if surrogate.space is None else written_joint_law(surrogate.space),
        "model": settings,
    }
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive:
            _write(
                archive, _HEADER, json.dumps(header, indent=1, ensure_ascii=False, default=_plain).encode()
            )
            for name in sorted(arrays):
                buffer = io.BytesIO()
                np.lib.format.write_array(buffer, np.ascontiguousarray(arrays[name]), allow_pickle=False)
                _write(archive, f"arrays/{name}.npy", buffer.getvalue())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def load(path: str | Path) -> Surrogate:
    """Read a surrogate that `save` wrote.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Surrogate
        Its predictions are those of the saved one to the last bit.

    Raises
    ------
    StudyError
        If there is no such file, it is not a surrogate, it is damaged, or it was written by another version
        of the format.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            header = _header(archive, path)
            arrays = {
                name.removeprefix("arrays/").removesuffix(".npy"): _array(archive.read(name))
                for name in archive.namelist()
                if name.startswith("arrays/")
            }
        return _build(header, arrays)
    except FileNotFoundError:
        raise StudyError(f"{path}: no such file") from None
    except (zipfile.BadZipFile, OSError):
        raise StudyError(f"{path}: not a surrogate, or damaged (expected a file written by save)") from None
    except (KeyError, TypeError, ValueError) as error:
        raise StudyError(f"{path}: damaged surrogate ({type(error).__name__}: {error})") from error


def _header(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the header, its format checked."""
    if _HEADER not in archive.namelist():
        raise StudyError(f"{path}: not a surrogate (a zip file without {_HEADER})")
    header = json.loads(archive.read(_HEADER))
    found = header.get("format") if isinstance(header, dict) else None
    if found != FORMAT:
        raise StudyError.at(f"{path}: format", found, f"{FORMAT!r}, the only one this version reads")
    return dict(header)


def _build(header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Surrogate:
    """Return the surrogate of a header and its arrays."""
    model_arrays = {
        name.removeprefix("model."): array for name, array in arrays.items() if name.startswith("model.")
    }
    validation = header["validation"]
    return Surrogate(
        **_named(header),
        options=header["options"],
        space=None if header["joint_law"] is None else read_joint_law(header["joint_law"]),
        validation=None if validation is None else Validation.from_dict(validation),
        bounds=arrays["bounds"],
        scaling=Scaling(**{name: arrays[f"scaling.{name}"] for name in _SCALING}),
        model=kind_of(header["kind"]).model.from_state(model_arrays, header["model"]),
    )


def _named(header: dict[str, Any]) -> dict[str, Any]:
    """Return those fields of the surrogate that stand in the header under their own names."""
    return {name: header[name] for name in _PLAIN} | {name: tuple(header[name]) for name in _TUPLES}


def _plain(value: object) -> object:
    """Return a NumPy number or array among the options as JSON has it."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be saved")


def _write(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    """Add an entry without the time of writing."""
    archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)


def _array(content: bytes) -> NDArray[Any]:
    """Read an array; one that holds objects is refused."""
    array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    return array
