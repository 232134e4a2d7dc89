"""The tangent system of one structure: measure, factorise, solve, look at the spectrum.

`Tangent` owns the workspace of the kernels for a single lane and hides the elimination order and
the low-rank terms of long clustered cables: vectors go in and come out as ``(n_nodes, 3)``.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import Pattern, build_pattern, dense_matrix

LARGEST_DENSE = 400
"""Up to this many degrees of freedom a dense eigenvalue solver is faster than Lanczos."""


class Spectrum(NamedTuple):
    """Lowest eigenvalues of K, ascending, and their unit vectors, ``(n, n_nodes, 3)``."""

    values: FloatArray
    vectors: FloatArray


def lowest_of(spectrum: Spectrum) -> float:
    """Return the lowest eigenvalue of a spectrum; infinite where nothing can move."""
    return float(spectrum.values[0]) if len(spectrum.values) else np.inf


class Tangent:
    """Tangent stiffness of a structure at one position, K = A + B diag(k) Bᵀ.

    Attributes
    ----------
    length, tension, axial
        Path lengths ℓ, tensions T and k = EA/l₀ (both zero where slack) of the last `measure`.
    stress
        Tensions in the geometric part T ∂²ℓ/∂x² of K: those of the last `measure` unless the
        caller puts others in their place before it factorises.
    stiffness_scale
        Largest EA/l₀ of the last `measure`, slack or not: what is little beside it is rounding.
    n_negative
        Eigenvalues of K (+ shift) that are not positive, found by the last `factorise`.
    free_index
        Rows of the elimination order that are free coordinates.
    """

    def __init__(self, arrays: StructureArrays, pattern: Pattern | None = None) -> None:
        self.arrays = arrays
        self.pattern = build_pattern(arrays) if pattern is None else pattern
        segments, members, pattern = len(arrays.segment_nodes), arrays.n_members, self.pattern
        self._unit = np.zeros(3 * segments)
        self._inverse_length = np.zeros(segments)
        self.length = np.zeros(members)
        self.tension = np.zeros(members)
        self.axial = np.zeros(members)
        self.stress = self.tension
        self._force = np.zeros(3 * arrays.n_nodes)
        self._gradient = np.zeros(3 * int(np.diff(pattern.path_start).max()))
        self._blocks = np.zeros(9 * pattern.n_entries)
        self._pivot_inverse = np.zeros(6 * pattern.n_blocks)
        self._place = np.zeros(pattern.n_blocks, dtype=np.int64)
        self._negative = np.zeros(1)
        self._low_rank: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self.n_negative = 0
        self.stiffness_scale = 1.0
        self.free_index: IndexArray = np.flatnonzero(arrays.free[pattern.block_node].ravel())

    @property
    def taut(self) -> BoolArray:
        """True for a member that carries force, shape ``(n_members,)``."""
        taut: BoolArray = self.axial > 0.0
        return taut

    def measure(
        self,
        x: FloatArray,
        rest_length: FloatArray,
        stiffness: FloatArray,
        taut: BoolArray | None = None,
    ) -> FloatArray:
        """Measure all members at the positions `x` and return the internal force, ``(n_nodes, 3)``.

        Parameters
        ----------
        x
            Positions, shape ``(n_nodes, 3)``.
        rest_length, stiffness
            Effective rest lengths and EA, shape ``(n_members,)``.
        taut
            Which members carry force, shape ``(n_members,)``; by the sign of their tension (every
            strut, and every cable longer than its rest length) where left out.
        """
        arrays = self.arrays
        kernels.measure(
            np.ascontiguousarray(x).reshape(-1),
            rest_length,
            stiffness,
            np.ones(arrays.n_members) if taut is None else taut.astype(np.float64),
            arrays.segment_nodes,
            arrays.segment_start,
            self._unit,
            self._inverse_length,
            self.length,
            self.tension,
            self.axial,
        )
        if taut is None:
            slack = arrays.is_cable & (self.tension <= 0.0)
            self.tension[slack] = 0.0
            self.axial[slack] = 0.0
        self.stress = self.tension
        self.stiffness_scale = float((stiffness / rest_length).max(initial=0.0))
        kernels.internal_force(
            self._unit, self.tension, arrays.segment_nodes, arrays.segment_start, self._force
        )
        return self._force.reshape(-1, 3).copy()

    def energy(self, rest_length: FloatArray) -> float:
        """Strain energy Σ T (ℓ − l₀)/2 of the last measure."""
        return 0.5 * float(np.dot(self.tension, self.length - rest_length))

    def force_rate(self, motion: FloatArray, tension_rate: FloatArray | None = None) -> FloatArray:
        """Differentiate the internal force along a motion of all nodes, ``(n_nodes, 3)``.

        Parameters
        ----------
        motion
            Velocity of the nodes, shape ``(n_nodes, 3)``.
        tension_rate
            Rate of the tensions where the nodes stay, shape ``(n_members,)``; none where left out.
        """
        arrays = self.arrays
        whole_rate = self.axial * self.length_rate(motion)
        if tension_rate is not None:
            whole_rate += tension_rate
        rate = np.empty_like(self._force)
        kernels.force_rate(
            self._unit,
            self._inverse_length,
            self.tension,
            whole_rate,
            arrays.segment_nodes,
            arrays.segment_start,
            np.ascontiguousarray(motion).reshape(-1),
            rate,
        )
        return rate.reshape(-1, 3)

    def length_rate(self, motion: FloatArray) -> FloatArray:
        """Rate b·v of the path lengths along a motion of the nodes, shape ``(n_members,)``."""
        arrays = self.arrays
        rate = np.empty(arrays.n_members)
        flat = np.ascontiguousarray(motion).reshape(-1)
        kernels.stretch_rate(self._unit, arrays.segment_nodes, arrays.segment_start, flat, rate)
        return rate

    def assemble(self) -> None:
        """Assemble the blocks of K at the last measure."""
        arrays, pattern = self.arrays, self.pattern
        kernels.assemble(
            self._unit,
            self._inverse_length,
            self.stress,
            self.axial,
            arrays.segment_nodes,
            arrays.segment_start,
            pattern.node_block,
            pattern.column_start,
            pattern.segment_entry,
            pattern.path_start,
            pattern.segment_local,
            pattern.pair_start,
            pattern.pair_local,
            pattern.pair_entry,
            pattern.held_entry,
            pattern.held_diagonal,
            np.array([self.stiffness_scale]),
            self._gradient,
            self._blocks,
        )

    def factorise(self, shift: float = 0.0) -> int:
        """Factorise K + shift·I at the last measure; return how many eigenvalues are not positive."""
        self.assemble()
        pattern = self.pattern
        kernels.factorise(
            pattern.column_start,
            pattern.row,
            pattern.left_start,
            pattern.left_column,
            pattern.left_entry,
            np.array([shift]),
            np.array([self.stiffness_scale]),
            self._place,
            self._blocks,
            self._pivot_inverse,
            self._negative,
        )
        self.n_negative = int(self._negative[0]) + self._factorise_low_rank()
        return self.n_negative

    def solve(self, force: FloatArray) -> FloatArray:
        """Solve K u = force with the last factor; rows of held coordinates are zero.

        Parameters
        ----------
        force
            Shape ``(n_nodes, 3)``.
        """
        u = self._solve_filled(self._gather(force))
        if self._low_rank is not None:
            columns, solved, capacitance = self._low_rank
            u -= solved @ np.linalg.solve(capacitance, columns.T @ u)
        return self._scatter(u)

    def matrix(self) -> FloatArray:
        """Return K at the last measure as a dense matrix over the free coordinates in elimination order."""
        self.assemble()
        free = self.free_index
        matrix = dense_matrix(self.pattern, self._blocks, free)
        if not len(self.pattern.low_rank_member):
            return matrix
        columns, axial = self._low_rank_columns()
        return matrix + (columns[free] * axial) @ columns[free].T

    def spectrum(self, n_lowest: int = 1) -> Spectrum:
        """Return the lowest eigenvalues of K at the last measure with their modes.

        There are none where every coordinate is held.
        """
        free = self.free_index
        n_lowest = min(n_lowest, len(free))
        if n_lowest == 0:
            return Spectrum(np.zeros(0), np.zeros((0, self.arrays.n_nodes, 3)))
        if len(free) <= LARGEST_DENSE:
            from scipy.linalg import eigh

            # Divide and conquer is the quickest where nearly all are asked for.
            some = {"driver": "evd"} if n_lowest == len(free) else {"subset_by_index": (0, n_lowest - 1)}
            values, vectors = eigh(self.matrix(), check_finite=False, overwrite_a=True, **some)
        else:
            values, vectors = self._lanczos(n_lowest)
        modes = np.zeros((n_lowest, 3 * self.pattern.n_blocks))
        modes[:, free] = vectors.T
        fields = np.zeros((n_lowest, self.arrays.n_nodes, 3))
        fields[:, self.pattern.block_node] = modes.reshape(n_lowest, -1, 3)
        return Spectrum(values, fields)

    def lowest_eigenvalue(self) -> float:
        """Return the lowest eigenvalue of K at the last measure; infinite where nothing can move."""
        return lowest_of(self.spectrum(1))

    def all_eigenvalues_exceed(self, bound: float) -> bool:
        """Whether K at the last measure has no eigenvalue below a bound.

        The inertia that `factorise` finds is only as good as its pivots, which is no good next to a
        singular K; this is: Cholesky's factorisation is stable.
        """
        if len(self.free_index) > LARGEST_DENSE:
            return self.lowest_eigenvalue() > bound
        matrix = self.matrix()
        matrix[np.diag_indices(len(matrix))] -= bound
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            return False
        return True

    def _lanczos(self, n_lowest: int) -> tuple[FloatArray, FloatArray]:
        """Shift-invert Lanczos; the shift lies below the spectrum, so the nearest are the lowest."""
        from scipy.sparse.linalg import LinearOperator, eigsh

        free = self.free_index
        shift = 0.0
        while self.factorise(shift) > 0:
            shift = max(4.0 * shift, 1e-9 * self.stiffness_scale)
        n = len(free)

        def inverse(vector: FloatArray) -> FloatArray:
            full = np.zeros(3 * self.pattern.n_blocks)
            full[free] = vector
            u = self._gather(self.solve(self._scatter(full)))
            return u[free]

        def product(vector: FloatArray) -> FloatArray:
            full = np.zeros(3 * self.pattern.n_blocks)
            full[free] = vector
            return self._gather(self.force_rate(self._scatter(full)))[free]

        start = np.random.default_rng(0).standard_normal(n)
        values, vectors = eigsh(
            LinearOperator((n, n), matvec=product, dtype=np.float64),
            k=n_lowest,
            sigma=-shift,
            OPinv=LinearOperator((n, n), matvec=inverse, dtype=np.float64),
            v0=start,
        )
        order = np.argsort(values)
        return values[order], vectors[:, order]

    def _gather(self, field: FloatArray) -> FloatArray:
        return np.where(self.arrays.free, field, 0.0)[self.pattern.block_node].ravel()

    def _scatter(self, vector: FloatArray) -> FloatArray:
        field = np.zeros((self.arrays.n_nodes, 3))
        field[self.pattern.block_node] = vector.reshape(-1, 3)
        return field

    def _solve_filled(self, rhs: FloatArray) -> FloatArray:
        """Solve with the filled part A alone; `rhs` has shape ``(n,)`` or ``(n, n_columns)``."""
        factor = (self.pattern.column_start, self.pattern.row, self._blocks, self._pivot_inverse)
        if rhs.ndim == 1:
            solution = rhs.copy()
            kernels.solve(*factor, solution)
            return solution
        solved = np.empty_like(rhs)
        for first in range(0, rhs.shape[1], WIDTH):
            some = rhs[:, first : first + WIDTH]
            columns = np.zeros((len(rhs), WIDTH))
            columns[:, : some.shape[1]] = some
            kernels.solve(*factor, columns)
            solved[:, first : first + WIDTH] = columns[:, : some.shape[1]]
        return solved

    def _low_rank_columns(self) -> tuple[FloatArray, FloatArray]:
        """Return B over the elimination order, ``(3 n_blocks, n_taut)``, and k of its taut columns."""
        arrays, pattern = self.arrays, self.pattern
        members = pattern.low_rank_member[self.taut[pattern.low_rank_member]]
        columns = np.zeros((3 * pattern.n_blocks, len(members)))
        for c, e in enumerate(members):
            nodes = pattern.path_node[pattern.path_start[e] : pattern.path_start[e + 1]]
            gradient = np.zeros(3 * len(nodes))
            kernels.path_gradient(
                self._unit,
                arrays.segment_start[e],
                arrays.segment_start[e + 1],
                pattern.segment_local,
                gradient,
            )
            field = np.zeros((arrays.n_nodes, 3))
            field[nodes] = gradient.reshape(-1, 3)
            columns[:, c] = self._gather(field)
        return columns, self.axial[members]

    def _factorise_low_rank(self) -> int:
        """Factorise the capacitance matrix S = diag(1/k) + Bᵀ A⁻¹ B.

        By Sylvester's law on [[A, B], [Bᵀ, −diag(1/k)]], K has as many negative eigenvalues as A
        less those of S; the correction (≤ 0) is returned.
        """
        self._low_rank = None
        if not len(self.pattern.low_rank_member):
            return 0
        columns, axial = self._low_rank_columns()
        if not len(axial):
            return 0
        solved = self._solve_filled(columns)
        capacitance = np.diag(1.0 / axial) + columns.T @ solved
        self._low_rank = columns, solved, capacitance
        symmetric = 0.5 * (capacitance + capacitance.T)
        return -int((np.linalg.eigvalsh(symmetric) < 0.0).sum())
