"""The space of a study's variables: names, box, and the ways to and from the unit cube."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.distributions import Distribution
from tensegra.study.variables import Variable

__all__ = ["Space"]

Array = NDArray[np.float64]

_OPEN = (2.0**-54, 1.0 - 2.0**-53)
"""The unit interval without its ends, where a quantile may be infinite."""


@dataclass(frozen=True, eq=False)
class Space:
    """Random variables, independent or joined by a Gaussian copula.

    The unit cube and the standard normal space hold *independent* coordinates: with a correlation,
    coordinate j of a point depends on the variables 1 to j (the Rosenblatt transform of the Gaussian
    copula, which is Nataf's with rank correlations).

    Parameters
    ----------
    variables
        In the order of the columns of every array.
    correlation
        Matrix of Spearman's rank correlations ρ, shape (n_inputs, n_inputs), or None for
        independence. The normal variables of the copula then have Pearson's correlation
        r = 2 sin(πρ/6) (Kruskal, *J. Amer. Statist. Assoc.* 53 (1958) 814-861).

    Raises
    ------
    StudyError
        If the matrix has the wrong shape or is no correlation matrix.
    """

    variables: tuple[Variable, ...]
    correlation: Array | None = None

    def __post_init__(self) -> None:
        if self.correlation is not None:
            object.__setattr__(self, "correlation", np.array(self.correlation, dtype=np.float64))
            self._factor  # noqa: B018 - refuses an impossible matrix now rather than at first use

    @property
    def n_inputs(self) -> int:
        """Number of variables."""
        return len(self.variables)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return tuple(variable.name for variable in self.variables)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the variables, ``""`` for a ratio."""
        return tuple(variable.unit for variable in self.variables)

    @property
    def distributions(self) -> tuple[Distribution, ...]:
        """Marginal laws of the variables."""
        return tuple(variable.distribution for variable in self.variables)

    @cached_property
    def bounds(self) -> Array:
        """A finite box, shape (n_inputs, 2); see `Distribution.box`."""
        bounds = np.array([law.box for law in self.distributions], dtype=np.float64).reshape(-1, 2)
        bounds.flags.writeable = False
        return bounds

    @cached_property
    def _factor(self) -> Array | None:
        """Cholesky factor of the copula's correlation matrix, or None if there is none."""
        if self.correlation is None:
            return None
        ranks, n = self.correlation, self.n_inputs
        if ranks.shape != (n, n):
            raise StudyError.at("correlation", ranks.shape, f"a matrix of {n} x {n}")
        if not (
            np.allclose(ranks, ranks.T) and np.allclose(np.diag(ranks), 1.0) and np.abs(ranks).max() <= 1.0
        ):
            raise StudyError(
                "correlation: expected a symmetric matrix with ones on its diagonal, others in [-1, 1]"
            )
        normal = 2.0 * np.sin(np.pi * ranks / 6.0)
        try:
            return np.asarray(np.linalg.cholesky(normal), dtype=np.float64)
        except np.linalg.LinAlgError:
            least = float(np.linalg.eigvalsh(normal)[0])
            raise StudyError(
                f"correlation: found a least eigenvalue of {least:.3g}, expected a positive definite matrix; "
                "the correlations contradict each other"
            ) from None

    def from_normal(self, Z: ArrayLike) -> Array:
        """Map independent standard normal coordinates to the variables, (n_points, n_inputs) both."""
        from scipy.special import ndtr

        Z = self._points(Z)
        if self._factor is not None:
            Z = Z @ self._factor.T
        return self._quantiles(ndtr(Z))

    def to_normal(self, X: ArrayLike) -> Array:
        """Map the variables to independent standard normal coordinates, (n_points, n_inputs) both."""
        from scipy.linalg import solve_triangular
        from scipy.special import ndtri

        Z = ndtri(np.clip(self._probabilities(self._points(X)), *_OPEN))
        if self._factor is not None:
            Z = solve_triangular(self._factor, Z.T, lower=True).T
        return np.ascontiguousarray(Z)

    def from_unit(self, U: ArrayLike) -> Array:
        """Map points of the unit cube to the variables, (n_points, n_inputs) both."""
        from scipy.special import ndtri

        U = self._points(U)
        if self._factor is None:
            return self._quantiles(U)
        return self.from_normal(ndtri(np.clip(U, *_OPEN)))

    def to_unit(self, X: ArrayLike) -> Array:
        """Map the variables to the unit cube, (n_points, n_inputs) both."""
        from scipy.special import ndtr

        if self._factor is None:
            return self._probabilities(self._points(X))
        return np.asarray(ndtr(self.to_normal(X)), dtype=np.float64)

    def clip(self, X: ArrayLike) -> Array:
        """Move points outside the box to its faces."""
        return np.clip(self._points(X), self.bounds[:, 0], self.bounds[:, 1])

    def _points(self, values: ArrayLike) -> Array:
        points = np.asarray(values, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != self.n_inputs:
            raise StudyError.at("points: shape", points.shape, f"a row per point, {self.n_inputs} columns")
        return points

    def _quantiles(self, U: Array) -> Array:
        return _columns([law.ppf(u) for law, u in zip(self.distributions, U.T, strict=True)], len(U))

    def _probabilities(self, X: Array) -> Array:
        return _columns([law.cdf(x) for law, x in zip(self.distributions, X.T, strict=True)], len(X))

    def __repr__(self) -> str:
        copula = ", correlated" if self.correlation is not None else ""
        return f"Space({', '.join(self.names)}{copula})"


def _columns(columns: Sequence[Array], n_points: int) -> Array:
    return np.stack(columns, axis=1) if columns else np.empty((n_points, 0))
