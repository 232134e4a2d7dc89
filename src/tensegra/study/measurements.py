"""Measurements from a CSV file, as columns of plain numbers."""

from pathlib import Path

import numpy as np

from tensegra.errors import StudyError

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
    import pandas as pd

    try:
        table = pd.read_csv(path, dtype=str, skipinitialspace=True)
    except (OSError, UnicodeDecodeError, pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise StudyError.at(place, path.name, f"a CSV file ({error})") from None
    if table.empty:
        raise StudyError(f"{place}: {path.name} has no row")
    columns: dict[str, list[float | None]] = {}
    for name in table.columns:
        text = table[name].fillna("").str.strip()
        numbers = pd.to_numeric(text.where(text != "", None), errors="coerce").to_numpy(dtype=np.float64)
        wrong = (text != "").to_numpy() & ~np.isfinite(numbers)
        if wrong.any():
            row = int(np.flatnonzero(wrong)[0])
            where = f"{place}: {path.name}, row {row + 1}, column {name.strip()!r}"
            raise StudyError.at(where, text.iloc[row], "a finite number, or nothing")
        columns[name.strip()] = [None if np.isnan(value) else float(value) for value in numbers]
    return columns
