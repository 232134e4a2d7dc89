"""Measurements to calibrate a model on: a row per measured state.

A table has a column for every input that was known (an actuator's setting, a temperature), one for every
output that was measured, and one for each of their standard deviations, ``<output>_std``. A cell left empty
was not measured.

    A14,  w,     w_std, T_K1, T_K1_std
    0.02, 10.41, 0.05,  71.3, 0.4
    0.04, 20.82, 0.05,  ,
"""

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.model import Model
from tensegra.errors import StudyError

Array = NDArray[np.float64]

STD = "_std"


@dataclass(frozen=True)
class Measurements:
    """Measured states.

    Attributes
    ----------
    known
        By input: its value in each state, (n_states,).
    outputs
        Names of the outputs that were measured.
    values, stds
        Shape (n_states, n_outputs); NaN where nothing was measured.
    """

    known: Mapping[str, Array]
    outputs: tuple[str, ...]
    values: Array
    stds: Array

    @property
    def n_states(self) -> int:
        """Number of measured states."""
        return len(self.values)

    @property
    def n_values(self) -> int:
        """Number of measured values."""
        return int(np.isfinite(self.values).sum())

    @classmethod
    def of(cls, columns: Mapping[str, ArrayLike], model: Model) -> "Measurements":
        """Sort the columns of a table by what the model calls them.

        Raises
        ------
        StudyError
            If a column is neither an input nor an output nor a standard deviation, lacks its counterpart, has
            another length, or holds a number that cannot be.
        """
        table = {name: np.atleast_1d(np.asarray(column, dtype=float)) for name, column in columns.items()}
        outputs = tuple(name for name in table if name in model.output_names)
        known = {name: column for name, column in table.items() if name in model.input_names}
        names = (*model.input_names, *model.output_names, *(f"{name}{STD}" for name in model.output_names))
        for name in table:
            if name not in names:
                expected = "a variable, an output or <output>_std"
                raise StudyError.at("measurements", name, expected, candidates=names)
        if not outputs:
            raise StudyError.at("measurements", list(table), f"one of the outputs {list(model.output_names)}")
        sizes = {name: column.shape for name, column in table.items()}
        if len(set(sizes.values())) != 1 or len(next(iter(sizes.values()))) != 1:
            raise StudyError.at("measurements", sizes, "columns of one length")
        for name, column in known.items():
            if not np.isfinite(column).all():
                row = int(np.flatnonzero(~np.isfinite(column))[0])
                raise StudyError.at(
                    f"measurements.{name}, row {row + 1}", float(column[row]), "a finite number"
                )
        for name in outputs:
            _require_stds(name, table)
        for name in table:
            if name.endswith(STD) and name not in known and name.removesuffix(STD) not in outputs:
                raise StudyError.at("measurements", name, f"a column {name.removesuffix(STD)!r} beside it")
        values = np.stack([table[name] for name in outputs], axis=1)
        stds = np.stack([table[f"{name}{STD}"] for name in outputs], axis=1)
        return cls(known, outputs, values, np.where(np.isfinite(values), stds, np.nan))


def read_measurements(path: str | PathLike[str]) -> dict[str, Array]:
    """Read the columns of a CSV file, empty cells as NaN.

    Raises
    ------
    StudyError
        If it cannot be read, or a cell is no number.
    """
    from tensegra.study.measurements import read_columns

    return {name: np.array(column, dtype=float) for name, column in read_columns(Path(path)).items()}


def _require_stds(name: str, table: Mapping[str, Array]) -> None:
    """Refuse an output without a positive standard deviation wherever it was measured."""
    if f"{name}{STD}" not in table:
        raise StudyError.at("measurements", list(table), f"a column '{name}{STD}', its standard deviation")
    measured = np.isfinite(table[name])
    if not measured.any():
        raise StudyError(f"measurements.{name}: the column is empty")
    stds = table[f"{name}{STD}"]
    wrong = measured & ~(np.isfinite(stds) & (stds > 0.0))
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        place = f"measurements.{name}{STD}, row {row + 1}"
        raise StudyError.at(place, float(stds[row]), "a positive number")
