"""Saving and loading: one file, without pickle, so that reading one never runs anything.

The header holds format, kind, names, units, joint law, seed, options, validation and the study's hash; beside
it stand the arrays. See `tensegra.surrogate.archive` for the file itself.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.surrogate.archive import Arrays, open_archive, write_archive
from tensegra.surrogate.jointlaw import read_joint_law, written_joint_law
from tensegra.surrogate.kinds import kind_of
from tensegra.surrogate.problem import Scaling
from tensegra.surrogate.surrogate import Surrogate
from tensegra.surrogate.validation import Validation

__all__ = ["FORMAT", "load", "save"]

FORMAT = "tensegra/surrogate/2"
_PLAIN: dict[str, tuple[type, ...]] = {
    "kind": (str,),
    "n_train": (int,),
    "seconds": (int, float),
    "seed": (int,),
    "study_fingerprint": (str,),
}
"""Fields of the header that are a surrogate's own, and what each may be."""

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
    header = {"format": FORMAT} | {name: getattr(surrogate, name) for name in (*_PLAIN, *_TUPLES)}
    header |= {
        "options": dict(surrogate.options),
        "validation": None if surrogate.validation is None else surrogate.validation.to_dict(),
        "joint_law": None if surrogate.space is None else written_joint_law(surrogate.space),
        "model": settings,
    }
    text = json.dumps(header, indent=1, ensure_ascii=False, default=_plain)
    write_archive(path, text.encode(), arrays)
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
    with open_archive(path, FORMAT) as (header, arrays):
        surrogate = _build(header, arrays)
        _require_answer(surrogate)
    return surrogate


def _build(header: dict[str, Any], arrays: Arrays) -> Surrogate:
    """Return the surrogate of a header and its arrays."""
    validation = header["validation"]
    scaling = Scaling(**{name: arrays[f"scaling.{name}"] for name in _SCALING})
    return Surrogate(
        **_named(header),
        options=dict(header["options"]),
        space=None if header["joint_law"] is None else read_joint_law(header["joint_law"]),
        validation=None if validation is None else Validation.from_dict(validation),
        bounds=arrays["bounds"],
        scaling=scaling,
        model=kind_of(header["kind"]).model.from_state(arrays.below("model."), header["model"]),
    )


def _require_answer(surrogate: Surrogate) -> None:
    """Refuse one whose arrays do not fit together: it has to answer at the middle of its box."""
    d, k = len(surrogate.input_names), len(surrogate.output_names)
    low, high = _box(surrogate.bounds, d)
    for name in _SCALING:
        expected = (d if name.startswith("input") else k,)
        if getattr(surrogate.scaling, name).shape != expected:
            raise ValueError(f"the scaling has another shape than {expected}")
    if not (np.all(surrogate.scaling.input_scale > 0) and np.all(surrogate.scaling.output_scale >= 0)):
        raise ValueError("a scale is not positive")
    with np.errstate(all="ignore"):
        answers = [surrogate.predict((low + high)[None] / 2)]
        if surrogate.has_std:
            answers.append(surrogate.predict((low + high)[None] / 2, return_std=True)[1])
    for answer in answers:
        if answer.shape != (1, k):
            raise ValueError(f"it answers in the shape {answer.shape} for {k} outputs")


def _box(bounds: np.ndarray, d: int) -> np.ndarray:
    if bounds.shape != (d, 2) or bounds.dtype.kind != "f" or np.any(bounds[:, 0] > bounds[:, 1]):
        raise ValueError(f"the bounds have the shape {bounds.shape}, expected {d} rows (lower, upper)")
    return np.ascontiguousarray(bounds.T)


def _named(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return those fields of the surrogate that stand in the header under their own names."""
    values = {name: header[name] for name in _PLAIN}
    for name, value in values.items():
        if type(value) not in _PLAIN[name]:
            raise TypeError(f"{name} is a {type(value).__name__}")
    for name in _TUPLES:
        if not isinstance(header[name], list) or not all(isinstance(item, str) for item in header[name]):
            raise TypeError(f"{name} is no list of texts")
        values[name] = tuple(header[name])
    return values


def _plain(value: object) -> object:
    """Return a NumPy number or array among the options as JSON has it."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{value!r} cannot be saved")
