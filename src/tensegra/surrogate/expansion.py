"""An expansion in products of orthonormal polynomials: what is kept, saved and evaluated."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.basis import Basis
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.leastsquares import blocks, leverages

__all__ = ["Chaos"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

# Points from which the sum is compiled: five times as quick, and without threads that wait for each other.
VERY_MANY = 1_000


@dataclass(frozen=True, eq=False)
class Chaos:
    """An expansion in orthonormal polynomials (`tensegra.surrogate.problem.Model`).

    Parameters
    ----------
    recurrences
        Recurrence coefficients of each input, shape (n_inputs, 2, max_degree + 1).
    indices
        Degrees of each term, shape (n_terms, n_inputs); the first is the constant.
    coefficients
        Shape (n_terms, n_outputs).
    factor
        Triangular factor R of the rows of the least squares, shape (n_terms, n_terms).
    deviation
        Calibrated amplitude of each output's standard deviation, shape (n_outputs,).
    loo_error
        Leave-one-out root mean square error relative to each output's standard deviation, (n_outputs,).
    coordinates
        What the polynomials are polynomials of.
    """

    recurrences: Array
    indices: Indices
    coefficients: Array
    factor: Array
    deviation: Array
    loo_error: Array
    coordinates: Coordinates

    @property
    def has_std(self) -> bool:
        """True: the leave-one-out residuals tell it."""
        return True

    @cached_property
    def basis(self) -> Basis:
        """The products of polynomials."""
        return Basis(self.recurrences, self.indices)

    def predict(self, Z: Array) -> Array:
        """Return the outputs."""
        basis, W = self.basis, self.coordinates.forward(Z)
        if len(Z) >= VERY_MANY:
            return basis.sums(W, self.coefficients)
        return np.concatenate([basis.values(block).T @ self.coefficients for block in blocks(W)])

    def std(self, Z: Array) -> Array:
        """Return calibrated standard deviations: an amplitude times √(1 + leverage)."""
        basis, W = self.basis, self.coordinates.forward(Z)
        leverage = np.concatenate([leverages(self.factor, basis.values(block)) for block in blocks(W)])
        return np.asarray(np.sqrt(1.0 + leverage)[:, None] * self.deviation)

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the expansion."""
        basis, W = self.basis, self.coordinates.forward(Z)
        slopes = [
            np.einsum("jmn,mk->nkj", basis.derivatives(block)[1], self.coefficients, optimize=True)
            for block in blocks(W)
        ]
        return self.coordinates.gradient(Z, np.concatenate(slopes))

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        own = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "coordinates"}
        arrays, settings = self.coordinates.state()
        return own | arrays, settings

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        own = {name: array for name, array in arrays.items() if not name.startswith("coordinate_")}
        return cls(**own, coordinates=Coordinates.from_state(arrays, settings))
