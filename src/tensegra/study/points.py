"""Design points from a file, and to one."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.files import replacing
from tensegra.structure import Structure
from tensegra.study.tablefile import read_numbers
from tensegra.study.variables import Variable, require_range

__all__ = ["read_points", "write_points"]

ROUNDING = 1e-9
"""What a point may lie outside the support, relative to the box: tables are often printed with ten digits."""


def read_points(
    path: Path, variables: Sequence[Variable], structure: Structure, place: str
) -> NDArray[np.float64]:
    """Read design points from a CSV or Parquet file with a column for each variable.

    Further columns are not read. A value that rounding has moved off the support is moved back.

    Returns
    -------
    ndarray
        Shape (n_points, n_inputs).

    Raises
    ------
    StudyError
        If the file cannot be read, lacks a column or a number, has no row, or a value that the
        variable's law, or the structure, cannot take.
    """
    columns = []
    table = read_numbers(path, place, [variable.name for variable in variables])
    for variable in variables:
        values = table[variable.name]
        found = f"{place}: {path.name}, column {variable.name!r}"
        columns.append(_on_support(values, variable, found))
        require_range(variable, structure, (float(values.min()), float(values.max())), found)
    return np.stack(columns, axis=1) + 0.0


def write_points(path: Path, names: Sequence[str], X: NDArray[np.float64]) -> None:
    """Write design points as CSV or Parquet, by the suffix.

    Raises
    ------
    StudyError
        The file is named otherwise, or cannot be written.
    """
    import pandas as pd

    suffix = path.suffix.lower()
    if suffix not in {".csv", ".parquet"}:
        raise StudyError.at(path.name, path.suffix, "a file named .csv or .parquet")
    table = pd.DataFrame(X, columns=list(names))
    with replacing(path, StudyError) as file:
        if suffix == ".csv":
            table.to_csv(file, index=False)
        else:
            table.to_parquet(file, index=False)


def _on_support(values: NDArray[np.float64], variable: Variable, place: str) -> NDArray[np.float64]:
    low, high = variable.distribution.support
    allowance = ROUNDING * float(np.ptp(variable.distribution.box))
    wrong = ~(np.isfinite(values) & (values >= low - allowance) & (values <= high + allowance))
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise StudyError.at(
            f"{place}, row {row + 1}", float(values[row]), f"a number from {low:.6g} to {high:.6g}"
        )
    return values.clip(low, high)
