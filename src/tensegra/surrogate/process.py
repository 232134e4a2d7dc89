"""A Gaussian process of one output, conditioned on its runs."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Process", "kernel"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Process:
    """The process of one output: k(x, centres) @ weights, and what its variance needs.

    Without inducing points `posterior` is None and the variance is 1 − ‖L⁻¹k‖², L the Cholesky factor of
    K + nugget; with them it is 1 − ‖L⁻¹k‖² + nugget ‖P⁻¹k‖² with the factors L of the centres' kernel matrix
    and P of the normal equations (the deterministic training conditional).
    """

    length_scale: Array
    centres: Array
    weights: Array
    factor: Array
    posterior: Array | None
    nugget: float
    deviation: float  # calibrated amplitude of the standard deviation

    def kernel(self, Z: Array) -> Array:
        """Return k(Z, centres), shape (n_points, n_centres)."""
        return kernel(Z, self.centres, self.length_scale)

    def variance(self, Z: Array) -> Array:
        """Return the variance for a unit amplitude, shape (n_points,)."""
        from scipy.linalg import solve_triangular

        k = self.kernel(Z).T
        reduction = np.sum(solve_triangular(self.factor, k, lower=True) ** 2, axis=0)
        if self.posterior is not None:
            left = solve_triangular(self.posterior, k, lower=True)
            reduction -= self.nugget * np.sum(left**2, axis=0)
        # The nugget is rounding's share of the variance, at a fresh point as at one that is left out.
        return np.asarray(np.maximum(1.0 - reduction, 0.0) + self.nugget)

    def slope(self, Z: Array) -> Array:
        """Return the derivatives of the mean, Σ_c w_c k(z, c) (c − z)/ℓ², shape (n_points, n_inputs)."""
        K = self.kernel(Z)
        pull = K @ (self.weights[:, None] * self.centres) - Z * (K @ self.weights)[:, None]
        return np.asarray(pull / self.length_scale**2)


def kernel(Z: Array, centres: Array, length_scale: Array) -> Array:
    """Return exp(−½ Σ ((z − c)/ℓ)²), shape (n_points, n_centres).

    The differences are formed before they are squared: ‖z‖² + ‖c‖² − 2 z·c would cost half the digits that
    the weights, large and of alternating sign, need.
    """
    from scipy.spatial.distance import cdist

    K: Array = cdist(Z / length_scale, centres / length_scale, "sqeuclidean")
    K *= -0.5
    return np.exp(K, out=K)
