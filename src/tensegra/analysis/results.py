"""What every result shares: an estimate with its interval, and the way into JSON."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Estimate:
    """A number with its confidence interval.

    Attributes
    ----------
    value
        The estimate; NaN where nothing can be said.
    low, high
        The interval's ends; NaN where none exists (the ends of a sample have no distribution-free interval),
        infinite where nothing bounds it on that side.
    """

    value: float
    low: float = float("nan")
    high: float = float("nan")

    def __str__(self) -> str:
        if not np.isnan(self.low) and not np.isnan(self.high):
            return f"{self.value:.6g} [{self.low:.6g}, {self.high:.6g}]"
        return f"{self.value:.6g}"

    def to_dict(self) -> dict[str, float | None]:
        """Return plain numbers, None for what is not known."""
        return {key: _finite(getattr(self, key)) for key in ("value", "low", "high")}


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def plain(value: Any) -> Any:  # noqa: ANN401 - it converts whatever a result holds
    """Return `value` in JSON's own types; NaN and infinity, which JSON lacks, become None.

    Examples
    --------
    >>> plain({"a": np.array([1.0, np.nan]), "b": Estimate(2.0)})
    {'a': [1.0, None], 'b': {'value': 2.0, 'low': None, 'high': None}}
    """
    # A result is a hundred thousand numbers: they come first.
    if isinstance(value, float):
        return _finite(value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    return value if isinstance(value, bool | int | str | None) else str(value)
