"""Least squares in a basis of polynomials, with what its leave-one-out residuals tell.

The rows are triangularised once; every leading part of the basis is then solved, and judged without each run
in turn, by a triangular solve.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.basis import Basis

__all__ = ["LeastSquares", "Rows", "blocks", "independent", "leverages"]

Array: TypeAlias = NDArray[np.float64]
Indices: TypeAlias = NDArray[np.int64]

BLOCK = 4096  # rows at once
LARGEST_LEVERAGE = 1.0 - 1e-9  # a row that determines a coefficient alone has no leave-one-out residual
DEPENDENT = 1e-10  # a column this close to the span of those before it (relative) is left out


class Rows:
    """The rows of the least squares: for each run its values and, where known, its derivatives."""

    def __init__(self, Z: Array, T: Array, dT: Array | None) -> None:
        self.Z, self.dT = Z, dT
        # Shape (n_points, rows per point, n_outputs): the value, then the derivative by each input.
        self.targets = (
            T[:, None] if dT is None else np.concatenate([T[:, None], dT.transpose(0, 2, 1)], axis=1)
        )
        self.n_rows = self.targets.shape[0] * self.targets.shape[1]

    def sample(self, n_rows: int, rng: np.random.Generator) -> "Rows":
        """Return the rows of some runs, about `n_rows`, or these themselves if they are not more."""
        if self.n_rows <= n_rows:
            return self
        chosen = np.sort(rng.choice(len(self.Z), size=n_rows // self.targets.shape[1], replace=False))
        return self.of_runs(chosen)

    def of_runs(self, chosen: NDArray[np.intp]) -> "Rows":
        """Return the rows of some runs."""
        dT = None if self.dT is None else self.dT[chosen]
        return Rows(self.Z[chosen], self.targets[chosen, 0], dT)

    def blocks(self, basis: Basis) -> Iterator[tuple[Array, Array]]:
        """Yield the basis, shape (n, rows per point, n_terms), and the targets, block by block."""
        step = max(1, BLOCK // self.targets.shape[1])
        for i in range(0, len(self.Z), step):
            Z = self.Z[i : i + step]
            if self.dT is None:
                yield basis.values(Z).T[:, None], self.targets[i : i + step]
            else:
                values, slopes = basis.derivatives(Z)
                stacked = np.concatenate([values[None], slopes])
                yield stacked.transpose(2, 0, 1), self.targets[i : i + step]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Triangular factor R and Qᵀ targets of the rows in a basis; leading parts solve leading sub-bases."""

    rows: Rows
    basis: Basis
    factor: Array
    projected: Array

    @classmethod
    def of(cls, rows: Rows, basis: Basis) -> Self:
        """Triangularise block by block, so that tall problems need no tall memory."""
        from scipy.linalg import qr

        m = len(basis)
        R = np.zeros((0, m + rows.targets.shape[2]))
        for phi, targets in rows.blocks(basis):
            block = np.column_stack([phi.reshape(-1, m), targets.reshape(-1, targets.shape[2])])
            R = qr(np.vstack([R, block]), mode="r", overwrite_a=True, check_finite=False)[0]
            R = R[: R.shape[1]]
        return cls(rows, basis, np.triu(R[:m, :m]), R[:m, m:])

    def coefficients(self, size: int) -> Array:
        """Return the coefficients in the first `size` terms, shape (size, n_outputs)."""
        from scipy.linalg import solve_triangular

        return np.asarray(solve_triangular(self.factor[:size, :size], self.projected[:size]))

    def leave_one_out(self, sizes: list[int]) -> tuple[Array, Array]:
        """Return residuals of the runs' values, each predicted without that run.

        Parameters
        ----------
        sizes
            Numbers of leading terms, rising.

        Returns
        -------
        tuple of ndarray
            Residuals, shape (n_sizes, n_points, n_outputs), and the leverages of the points in the fits
            without them, shape (n_sizes, n_points).
        """
        from scipy.linalg import solve_triangular

        solutions = [self.coefficients(size) for size in sizes]
        residuals, leverages = [], []
        for phi, targets in self.rows.blocks(self.basis):
            n, per_point, m = phi.shape
            across = solve_triangular(self.factor, phi.reshape(-1, m).T, trans="T", check_finite=False)
            Q = across.T.reshape(n, per_point, m)
            H: Array = np.zeros((n, per_point, per_point))
            start, block_residuals, block_leverages = 0, [], []
            for size, c in zip(sizes, solutions, strict=True):
                part = Q[:, :, start:size]
                H, start = H + part @ part.transpose(0, 2, 1), size
                left = np.eye(per_point) - LARGEST_LEVERAGE * H
                both = np.concatenate([targets - phi[:, :, :size] @ c, H], axis=2)
                answer = np.linalg.solve(left, both)[:, 0]
                block_residuals.append(answer[:, : targets.shape[2]])
                block_leverages.append(answer[:, targets.shape[2]])
            residuals.append(np.stack(block_residuals))
            leverages.append(np.stack(block_leverages))
        return np.concatenate(residuals, axis=1), np.concatenate(leverages, axis=1)


def independent(rows: Rows, recurrences: Array, indices: Indices) -> LeastSquares:
    """Return the least squares of those terms that the runs can tell apart."""
    while True:
        system = LeastSquares.of(rows, Basis(recurrences, indices))
        norm = np.linalg.norm(system.factor, axis=0)
        dependent = np.abs(np.diagonal(system.factor)) <= DEPENDENT * norm
        if len(indices) > rows.n_rows:
            dependent[rows.n_rows :] = True
        if not dependent.any():
            return system
        indices = indices[~dependent]


def leverages(factor: Array, values: Array) -> Array:
    """Return φᵀ(RᵀR)⁻¹φ of the points whose basis values are the columns of `values`."""
    from scipy.linalg import solve_triangular

    return np.asarray(np.sum(solve_triangular(factor, values, trans="T") ** 2, axis=0))


def blocks(Z: Array) -> Iterator[Array]:
    """Yield the points block by block; one empty block if there are none."""
    for i in range(0, max(len(Z), 1), BLOCK):
        yield Z[i : i + BLOCK]
