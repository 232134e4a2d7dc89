"""Marginal distributions: density, quantiles, moments and a finite box of what a study file writes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.entry import parse_entry
from tensegra.study.law_entries import LAWS, DistributionEntry, Empirical, LawEntry
from tensegra.study.laws import Law
from tensegra.study.tablefile import as_numbers, read_csv

__all__ = ["TAIL", "Distribution", "as_distribution", "with_plain_numbers"]

TAIL = 1e-6
"""Probability left outside the box on each side where a law has no end to put the box at: a normal law
is cut at 4.75 standard deviations, which two of a million design points would pass."""


@dataclass(frozen=True, repr=False)
class Distribution:
    """The law of one variable.

    Parameters
    ----------
    kind
        Name of the law, such as ``normal``.
    parameters
        Its parameters, checked.

    Examples
    --------
    >>> actuation = as_distribution({"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}})
    >>> round(actuation.mean, 4), actuation.support
    (0.099, (-inf, 0.1))
    >>> as_distribution({"uniform": [0.09, 0.10]})
    Distribution(uniform, low=0.09, high=0.1)
    """

    kind: str
    parameters: LawEntry

    @cached_property
    def _law(self) -> Law:
        return self.parameters.law()

    def ppf(self, q: ArrayLike) -> NDArray[np.float64]:
        """Return the quantiles at the probabilities `q`, of the same shape."""
        return np.asarray(self._law.ppf(np.asarray(q, dtype=np.float64)), dtype=np.float64)

    def isf(self, q: ArrayLike) -> NDArray[np.float64]:
        """Return the values exceeded with the probabilities `q`, exact in the upper tail, of its shape."""
        q = np.asarray(q, dtype=np.float64)
        isf = getattr(self._law, "isf", None)
        return np.asarray(self._law.ppf(1.0 - q) if isf is None else isf(q), dtype=np.float64)

    def quadrature(self, order: int) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the law's own points and their probabilities, or None where it has none of its own.

        Parameters
        ----------
        order
            They are exact for polynomials to degree 2 · `order` − 1.
        """
        own = getattr(self._law, "quadrature", None)
        return None if own is None else own(order)

    def cdf(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the probabilities of values up to `x`, of the same shape."""
        return np.asarray(self._law.cdf(np.asarray(x, dtype=np.float64)), dtype=np.float64)

    def pdf(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the density at `x` (for ``discrete`` the probability of `x`), of the same shape."""
        with np.errstate(divide="ignore"):  # a density may be infinite at its end
            return np.asarray(self._law.pdf(np.asarray(x, dtype=np.float64)), dtype=np.float64)

    @property
    def mean(self) -> float:
        """The mean."""
        return float(self._law.mean())

    @property
    def std(self) -> float:
        """The standard deviation."""
        return float(self._law.std())

    @property
    def support(self) -> tuple[float, float]:
        """The ends of the support, infinite where it has none."""
        low, high = self._law.support()
        return float(low), float(high)

    @cached_property
    def box(self) -> tuple[float, float]:
        """A finite interval in which surrogates are trained and designs are kept.

        It is the support, if that is bounded. An open side ends at the quantile of `TAIL`; so does a
        bounded side of a half-open support if the density vanishes there, for nothing happens near it.
        """
        low, high = self.support
        if math.isfinite(low) and math.isfinite(high):
            return low, high
        lower, upper = self.ppf([TAIL, 1.0 - TAIL])
        if math.isfinite(low) and self.pdf(low) > 0.0:
            lower = low
        if math.isfinite(high) and self.pdf(high) > 0.0:
            upper = high
        return float(lower), float(upper)

    def to_mapping(self) -> dict[str, Any]:
        """Return the entry that a study file would hold, all parameters explicit."""
        return {self.kind: self.parameters.written()}

    def __repr__(self) -> str:
        parameters = self.parameters.model_dump(exclude_defaults=True)
        shown = [
            f"{name}=<{len(value)} numbers>"
            if isinstance(value, tuple) and len(value) > 6
            else f"{name}={value}"
            for name, value in parameters.items()
        ]
        return f"Distribution({', '.join([self.kind, *shown])})"


def as_distribution(
    written: Distribution | DistributionEntry | Mapping[str, Any], place: str = "distribution"
) -> Distribution:
    """Return a distribution from what a study file, or a user, writes.

    Parameters
    ----------
    written
        Such as ``{"normal": {"mean": 11500, "std": 200}}``; a `Distribution` is handed through.
    place
        Where it stands, the beginning of an error message.

    Raises
    ------
    StudyError
        If there is no such law or parameter, or its value cannot be.
    """
    if isinstance(written, Distribution):
        return written
    entry = (
        written if isinstance(written, DistributionEntry) else parse_entry(DistributionEntry, written, place)
    )
    parameters = entry.value
    if isinstance(parameters, Empirical) and parameters.file is not None:
        raise StudyError(f"{place}.empirical.file: the file has not been read; give the values")
    return Distribution(entry.kind, parameters)


def with_plain_numbers(
    written: object, number: Callable[[object], float], folder: Path, place: str
) -> object:
    """Return a distribution's mapping with measurements read in and quantities as plain numbers.

    Parameters
    ----------
    written
        What the study file holds; whatever is wrong with its form is left for the schema to refuse.
    number
        Converts a text such as ``"115 GPa"`` to the variable's unit; raises ValueError with the phrase
        that says what was expected.
    folder
        The folder that the names of files are relative to.
    place
        Where the entry stands.
    """
    if not isinstance(written, Mapping) or len(written) != 1:
        return written
    ((kind, parameters),) = written.items()
    law = LAWS.get(kind) if isinstance(kind, str) else None
    if law is None:
        return written
    if isinstance(parameters, list | tuple) and len(parameters) <= len(law.known_keys()):
        parameters = dict(zip(law.known_keys(), parameters, strict=False))
    if not isinstance(parameters, Mapping):
        return written
    parameters = dict(parameters)
    if law is Empirical and isinstance(parameters.get("file"), str):
        parameters["values"] = _read_measurements(parameters, folder, f"{place}.empirical")
        del parameters["file"]
        parameters.pop("column", None)
    for key in law.in_variable_units:
        if key in parameters:
            parameters[key] = _plain(parameters[key], number, f"{place}.{kind}.{key}")
    return {kind: parameters}


def _plain(value: object, number: Callable[[object], float], place: str) -> object:
    if isinstance(value, list | tuple):
        return [_plain(item, number, f"{place}[{i}]") for i, item in enumerate(value)]
    if not isinstance(value, str):
        return value
    try:
        return number(value)
    except ValueError as error:
        raise StudyError.at(place, value, str(error)) from None


def _read_measurements(parameters: Mapping[str, Any], folder: Path, place: str) -> list[float]:
    path = folder / parameters["file"]
    table = read_csv(path, f"{place}.file")
    column = parameters.get("column")
    if column is None and len(table) != 1:
        raise StudyError(f"{place}.column: the key is missing, and {path.name} has {len(table)} columns")
    if column is not None and not (isinstance(column, str) and column in table):
        raise StudyError.at(f"{place}.column", column, f"a column of {path.name}", candidates=table)
    numbers = as_numbers(next(iter(table.values())) if column is None else table[column])
    if not np.isfinite(numbers).all():
        row = int(np.flatnonzero(~np.isfinite(numbers))[0])
        raise StudyError(f"{place}: row {row + 2} of {path.name} holds no finite number")
    return [float(value) for value in numbers]
