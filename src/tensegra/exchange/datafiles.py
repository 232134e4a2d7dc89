"""Data sets as files: NetCDF for xarray and most else, MATLAB's .mat, NumPy's .npz, and CSV."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np

from tensegra.exchange.datasets import Dataset
from tensegra.exchange.files import library, replacing

__all__ = ["write_csv", "write_mat", "write_netcdf", "write_npz"]

LONGEST_NAME = 60
"""Letters of a variable's name in MATLAB, less three for a number behind it."""


def write_netcdf(dataset: Dataset, path: Path) -> None:
    """Write NetCDF (version 3, which needs SciPy alone), by xarray."""
    xarray = library("xarray", "NetCDF")
    variables: dict[str, Any] = {}
    for name, variable in dataset.variables.items():
        values = variable.values
        if values.dtype.kind in "iub":
            values = values.astype(np.int32)
        attributes = {"units": variable.unit} if variable.unit else {}
        own = _plain_name(name, set(variables), "-+.@")
        if own != name:
            attributes["long_name"] = name
        variables[own] = (variable.dimensions, values, attributes)
    labels = {name: list(labels) for name, labels in dataset.labels.items()}
    made = xarray.Dataset(variables, coords=labels, attrs=dict(dataset.attributes))
    with replacing(path) as draft:
        made.to_netcdf(draft, engine="scipy", format="NETCDF3_64BIT")


def write_mat(dataset: Dataset, path: Path) -> None:
    """Write a variable for each array, vectors as columns and texts as cells."""
    from scipy.io import savemat

    with replacing(path) as draft:
        savemat(
            str(draft),
            {name: _for_matlab(value) for name, value in _arrays(dataset).items()},
            long_field_names=True,
        )


def write_npz(dataset: Dataset, path: Path) -> None:
    """Write the same as NumPy's arrays."""
    with replacing(path) as draft, draft.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **_arrays(dataset))


def _arrays(dataset: Dataset) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    names = []
    for name, variable in dataset.variables.items():
        own = _plain_name(name, set(arrays))
        arrays[own] = variable.values
        names.append((own, name, variable.unit))
    arrays["columns"] = np.array(names)
    arrays |= {f"{name}_ids": np.array(labels) for name, labels in dataset.labels.items()}
    return arrays | {name: np.array([text]) for name, text in dataset.attributes.items()}


def _for_matlab(value: Any) -> Any:  # noqa: ANN401 — an array of numbers or of texts
    if value.dtype.kind == "U":
        value = value.astype(object)
    return value.reshape(-1, 1) if value.ndim == 1 else value


def _plain_name(name: str, taken: set[str], others: str = "") -> str:
    """Return a name of letters, digits and underscores that is not taken: dw/dA14 becomes dw_dA14."""
    plain = re.sub(rf"[^A-Za-z0-9_{re.escape(others)}]", "_", name)
    plain = plain if plain[:1].isalpha() else f"v_{plain}"
    plain = plain[:LONGEST_NAME]
    numbered = (plain if number == 1 else f"{plain}_{number}" for number in range(1, len(taken) + 2))
    return next(candidate for candidate in numbered if candidate not in taken)


def write_csv(dataset: Dataset, path: Path) -> None:
    """Write a row for each run, with all digits; a run that failed has empty cells."""
    columns = dataset.columns()
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*(values.tolist() for values in columns.values()), strict=True):
            writer.writerow(["" if isinstance(cell, float) and np.isnan(cell) else cell for cell in row])
