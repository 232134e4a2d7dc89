"""Measurements from a CSV file, as columns of plain numbers."""

from pathlib import Path

import numpy as np

from tensegra.errors import StudyError
from tensegra.study.tablefile import as_numbers, read_csv

__all__ = ["read_columns"]


def read_columns(path: Path, place: str = "measurements") -> dict[str, list[float | None]]:
    """Read a CSV file; an empty cell is None.

    Parameters
    ----------
    path
        The file.
    place
        What asks for it, the beginning of every message.

    Raises
    ------
    StudyError
        If the file cannot be read, has no row, or a cell is neither empty nor a finite number.
    """
    columns: dict[str, list[float | None]] = {}
    for name, fields in read_csv(path, place).items():
        numbers = as_numbers(fields)
        for row, (field, number) in enumerate(zip(fields, numbers, strict=True), start=1):
            if field and not np.isfinite(number):
                where = f"{place}: {path.name}, row {row}, column {name!r}"
                raise StudyError.at(where, field, "a finite number, or nothing")
        columns[name] = [None if np.isnan(value) else float(value) for value in numbers]
    return columns
