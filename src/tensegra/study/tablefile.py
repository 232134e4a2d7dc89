"""Tables from files: CSV and Parquet, read in one place that lets no row and no column be taken for another.

A CSV file has a header and as many fields in each row as there are names; readers of data frames take a
surplus field for an index, and shift all the others.
"""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError

__all__ = ["as_numbers", "read_csv", "read_numbers", "read_parquet"]


def read_csv(path: Path, place: str) -> dict[str, list[str]]:
    """Return the columns of a CSV file, as texts without spaces around them.

    Parameters
    ----------
    path
        The file, UTF-8, separated by commas. Empty lines are passed over.
    place
        What asks for it, the beginning of every message.

    Raises
    ------
    StudyError
        If the file cannot be read, has no row, a row has more or fewer fields than the header, or a
        name stands for two columns.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True, skipinitialspace=True)
            header = [name.strip() for name in next(reader, [])]
            if not header:
                raise StudyError.at(place, path.name, "a CSV file (it is empty)")
            _require_distinct(header, path, place)
            rows = []
            for row in reader:
                if not row:
                    continue
                if len(row) != len(header):
                    where = f"{place}: {path.name}, line {reader.line_num}"
                    expected = f"as many as the header has, {len(header)} ({', '.join(header)})"
                    raise StudyError.at(where, f"{len(row)} fields", expected)
                rows.append(row)
    except (OSError, ValueError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise StudyError.at(place, path.name, f"a CSV file ({str(reason).lower()})") from None
    if not rows:
        raise StudyError(f"{place}: {path.name} has no row")
    return {
        name: [field.strip() for field in column]
        for name, column in zip(header, zip(*rows, strict=True), strict=True)
        if name
    }


def read_parquet(path: Path, place: str) -> Any:  # noqa: ANN401 - a DataFrame, imported where it is used
    """Return the table in a Parquet file.

    Raises
    ------
    StudyError
        If the file cannot be read, or a name stands for two columns.
    """
    import pandas as pd
    import pyarrow as pa

    try:
        table = pd.read_parquet(path)
    except (OSError, ValueError, TypeError, LookupError, pa.ArrowException, NotImplementedError) as error:
        reason = str(error).partition("\n")[0].rstrip(".")
        raise StudyError.at(place, path.name, f"a Parquet file ({reason})") from None
    _require_distinct([str(name) for name in table.columns], path, place)
    return table


def read_numbers(path: Path, place: str, names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return some columns of a table as numbers; further columns are not looked at.

    Parameters
    ----------
    path
        A file named `.csv` or `.parquet`.
    place
        What asks for it, the beginning of every message.
    names
        The columns wanted.

    Returns
    -------
    dict of ndarray
        A column each, NaN where a field is no number.

    Raises
    ------
    StudyError
        If the file cannot be read, has no row or lacks a column.
    """
    if path.suffix.lower() not in {".csv", ".parquet"}:
        raise StudyError.at(place, path.name, "a file named .csv or .parquet")
    is_csv = path.suffix.lower() == ".csv"
    table: Mapping[str, Any] = read_csv(path, place) if is_csv else read_parquet(path, place)
    known = [str(name) for name in table]
    for name in names:
        if name not in known:
            raise StudyError.at(place, known, f"a column {name!r} in {path.name}")
    columns = {name: as_numbers(table[name]) for name in names}
    if any(len(column) == 0 for column in columns.values()):
        raise StudyError(f"{place}: {path.name} has no row")
    return columns


def as_numbers(fields: Any) -> NDArray[np.float64]:  # noqa: ANN401 - texts, or a column of a DataFrame
    """Return fields as numbers, NaN where one is none.

    Examples
    --------
    >>> as_numbers(["1", "2e-3", "", "a"])
    array([1.   , 0.002,   nan,   nan])
    """
    values = list(fields) if isinstance(fields, list) else fields.tolist()
    return np.array([_number(value) for value in values], dtype=np.float64)


def _number(value: object) -> float:
    # A float, correctly rounded, so that a point written out is the same point when it is read.
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return float("nan")
    try:
        return float(value)
    except (ValueError, OverflowError):
        return float("nan")


def _require_distinct(names: Sequence[str], path: Path, place: str) -> None:
    seen: set[str] = set()
    for name in names:
        if name and name in seen:
            raise StudyError.at(f"{place}: {path.name}", name, "a name for one column only")
        seen.add(name)
