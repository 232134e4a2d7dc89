"""The tangent stiffness (M6) of one equilibrium: measure, factorise, solve, look at the spectrum.

`Tangent` drives the kernels for a single run and hides the elimination order, the transports of long
clustered cables and the coordinates that are held for neutral rigid motions: vectors go in and come out as
``(n_nodes, 3)``.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels, step
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.certify import BELOW
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.kernels import ZERO_EIGENVALUE
from tensegra.mechanics.law import plain
from tensegra.mechanics.pattern import Pattern, build_pattern, dense_matrix
from tensegra.mechanics.rigid import RigidMotions, held_for
from tensegra.mechanics.state import LARGEST_IN_LANES, Workspace, share

LARGEST_DENSE = 400
"""Up to this many degrees of freedom a dense eigenvalue solver is faster than Lanczos."""

EIGENVALUE_TOLERANCE = 1e-5
"""Relative residual at which Lanczos ends: the error of the eigenvalue is its square."""

MOVES_NOTHING = 1e-9
"""Share of the largest motion below which another one moves no node."""


class Spectrum(NamedTuple):
    """Lowest eigenvalues of K, ascending, and their unit vectors, ``(n, n_nodes, 3)``."""

    values: FloatArray
    vectors: FloatArray


def lowest_of(spectrum: Spectrum) -> float:
    """Return the lowest eigenvalue of a spectrum; infinite where nothing can move."""
    return float(spectrum.values[0]) if len(spectrum.values) else np.inf


class Tangent:
    """Tangent stiffness K of a structure at one position.

    Parameters
    ----------
    arrays
        The structure with its own supports.
    pattern
        Its pattern where it is known already, and there are no motions.
    motions, nodes
        Neutral rigid motions and where the structure is, or the structure with the coordinates held already
        that stand for them; the spectrum is that of their complement.

    Attributes
    ----------
    free_index
        Rows of the elimination order that are free coordinates.
    n_negative
        Eigenvalues of K (+ shift) that are not positive, found by the last `factorise`.
    """

    def __init__(
        self,
        arrays: StructureArrays,
        pattern: Pattern | None = None,
        motions: RigidMotions | None = None,
        nodes: FloatArray | StructureArrays | None = None,
    ) -> None:
        self.motions = motions if motions is not None and len(motions) else None
        self.given = arrays
        self.arrays = arrays
        if isinstance(nodes, StructureArrays):
            self.arrays = nodes
        elif self.motions is not None:
            self.arrays = held_for(arrays, self.motions, arrays.coordinates if nodes is None else nodes)
            pattern = None
        self.pattern = build_pattern(self.arrays, np.any(arrays.free, axis=1)) if pattern is None else pattern
        self.shared = share(self.arrays, self.pattern)
        self.topology = self.shared.topology
        self.work = Workspace(self.shared, 0, single=self.pattern.n_blocks > LARGEST_IN_LANES)
        self.lanes = self.work.lanes
        self.nodes, self._load = arrays.coordinates, Load(np.ones(0), np.ones(0), np.zeros(0))
        self._whole: Tangent | None = None
        self.n_negative = 0
        block_node = self.pattern.block_node
        free = self.arrays.free[block_node] & (block_node >= 0)[:, None]
        self.free_index: IndexArray = np.flatnonzero(free.ravel())

    @property
    def length(self) -> FloatArray:
        """Path lengths ℓ of the last measure, shape ``(n_members,)``."""
        return self._read(self.work.length)

    @property
    def tension(self) -> FloatArray:
        """Tensions T of the last measure, zero where slack, shape ``(n_members,)``."""
        return self._read(self.work.tension) + 0.0

    @property
    def axial(self) -> FloatArray:
        """Stiffness k = ∂T/∂ℓ of the last measure, zero where slack, shape ``(n_members,)``."""
        return self._read(self.work.axial)

    @property
    def taut(self) -> BoolArray:
        """True for a member that carries force, shape ``(n_members,)``."""
        taut: BoolArray = self._read(self.work.taut) > 0.0
        return taut

    @property
    def stiffness_scale(self) -> float:
        """Largest k of the last measure, slack or not: what is little beside it is rounding."""
        return float(self._read(self.work.scale)[0])

    @property
    def zero_eigenvalue(self) -> float:
        """What an eigenvalue of the last measure has to be larger than to be told from zero."""
        return ZERO_EIGENVALUE * self.stiffness_scale

    def measure(
        self, nodes: FloatArray, load: Load, stress: FloatArray | None = None
    ) -> tuple[FloatArray, float]:
        """Measure all members at some positions; return f − p at the free coordinates, and its relative size.

        Parameters
        ----------
        nodes
            Positions, shape ``(n_nodes, 3)``.
        load
            What acts there.
        stress
            Tensions that are unknowns of their own, ``(n_members,)``: they say which cables carry force, and
            K is built with them. Those of the lengths where left out.
        """
        lanes = self.lanes
        self.nodes, self._load = nodes, load
        self._write(self.work.x, nodes.reshape(-1))
        self._write(self.work.rest_length, load.rest_length)
        self._write(self.work.stiffness, load.stiffness)
        self._write(self.work.loads_start, load.force.reshape(-1))
        if stress is None:
            step.measure_by_length(self.topology, lanes)
        else:
            self._write(self.work.stress, stress)
            step.taut_by_stress(self.topology, lanes)
            step.carried_by(self.topology, lanes)
            kernels.measure(self.topology, lanes)
        step.balance(self.topology, lanes, step.LENGTH_ROUNDING / load.tolerance)
        force = self._read(self.work.force).reshape(-1, 3)
        return np.where(self.arrays.free, force - load.force, 0.0), float(self._read(self.work.residual)[0])

    def energy(self, load: Load) -> float:
        """Strain energy Σ ∫ T dℓ of the last measure."""
        return float(np.sum(self.taut * plain.energy(self.length, load.rest_length, load.stiffness)))

    def potential(self, load: Load) -> float:
        """Potential energy Π = Σ ∫ T dℓ − p·x of the last measure."""
        return self.energy(load) - float(np.sum(load.force * self.nodes, where=self.given.free))

    def force_rate(self, motion: FloatArray, tension_rate: FloatArray | None = None) -> FloatArray:
        """Differentiate the internal force along a motion of all nodes, ``(n_nodes, 3)``.

        Parameters
        ----------
        motion
            Velocity of the nodes, shape ``(n_nodes, 3)``.
        tension_rate
            Rate of the tensions where the nodes stay, shape ``(n_members,)``; none where left out.
        """
        lanes = self.lanes
        rate = self.axial * self.length_rate(motion)
        self._write(self.work.pull, rate if tension_rate is None else rate + tension_rate)
        kernels.force_rate(self.topology, lanes, lanes.motion, lanes.pull, lanes.push)
        return self._read(self.work.push).reshape(-1, 3).copy()

    def length_rate(self, motion: FloatArray) -> FloatArray:
        """Rate b·v of the path lengths along a motion of the nodes, shape ``(n_members,)``."""
        lanes = self.lanes
        self._write(self.work.motion, np.ascontiguousarray(motion).reshape(-1))
        kernels.stretch_rate(self.topology, lanes, lanes.motion, lanes.length_rate)
        return self._read(self.work.length_rate).copy()

    def factorise(self, shift: float = 0.0) -> int:
        """Factorise K + shift·I at the last measure; return how many eigenvalues are not positive."""
        self._write(self.work.shift, np.array([shift]))
        step.factorise(self.topology, self.lanes)
        self.n_negative = int(self._read(self.work.n_negative)[0])
        return self.n_negative

    def solve(self, force: FloatArray) -> FloatArray:
        """Solve K u = force with the last factor; rows of held coordinates are zero.

        Parameters
        ----------
        force
            Shape ``(n_nodes, 3)``.
        """
        if not self.pattern.n_blocks:
            return np.zeros((self.arrays.n_nodes, 3))
        self._write(self.work.second, self._gather(force))
        kernels.solve(self.topology, self.lanes, self.lanes.second)
        return self._scatter(self._read(self.work.second))

    def matrix(self) -> FloatArray:
        """Return K at the last measure as a dense matrix over the free coordinates in elimination order."""
        kernels.assemble(self.topology, self.lanes)
        blocks = np.ascontiguousarray(self._read(self.work.blocks))
        return dense_matrix(self.pattern, blocks, self.free_index)

    def spectrum(self, n_lowest: int = 1) -> Spectrum:
        """Return the lowest eigenvalues of K at the last measure with their modes.

        There are none where every coordinate is held. Neutral rigid motions are not among them.
        """
        free = self.free_index
        n_lowest = min(n_lowest, len(free))
        if n_lowest == 0:
            return Spectrum(np.zeros(0), np.zeros((0, self.arrays.n_nodes, 3)))
        if len(free) <= LARGEST_DENSE and self.motions is not None:
            return self._apart_from(self.motions, n_lowest)
        rigid = self._rigid()
        if len(free) <= LARGEST_DENSE:
            from scipy.linalg import eigh

            # Divide and conquer is the quickest where nearly all are asked for.
            some = {"driver": "evd"} if n_lowest == len(free) else {"subset_by_index": (0, n_lowest - 1)}
            values, vectors = eigh(self.matrix(), check_finite=False, overwrite_a=True, **some)
        else:
            values, vectors = self._lanczos(n_lowest, rigid)
        modes = np.zeros((n_lowest, 3 * self.pattern.n_blocks))
        modes[:, free] = vectors.T
        if rigid is not None:
            modes -= (modes @ rigid.T) @ rigid
        fields = np.array([self._scatter(mode) for mode in modes])
        return Spectrum(values, fields)

    def _apart_from(self, motions: RigidMotions, n_lowest: int) -> Spectrum:
        """Return the lowest eigenvalues of P K P, with P the projection that takes neutral motions out.

        The motions themselves are moved to the top of the spectrum.
        """
        from scipy.linalg import eigh

        if self._whole is None:
            self._whole = Tangent(self.given)
        whole = self._whole
        whole.measure(self.nodes, self._load)
        free = whole.free_index
        rigid = whole._rows(motions.fields(self.nodes))[:, free]  # noqa: SLF001 - another one of these
        basis, singular, _ = np.linalg.svd(rigid.T, full_matrices=False)
        basis = basis[:, singular > MOVES_NOTHING * singular.max(initial=0.0)]
        matrix = whole.matrix()
        top = 2.0 * float(np.abs(matrix).sum(axis=1).max(initial=1.0))
        half = matrix - basis @ (basis.T @ matrix)
        apart = half - (half @ basis) @ basis.T + top * basis @ basis.T
        n = min(n_lowest, len(free) - basis.shape[1])
        if n == 0:
            return Spectrum(np.zeros(0), np.zeros((0, self.arrays.n_nodes, 3)))
        values, vectors = eigh(apart, check_finite=False, subset_by_index=(0, n - 1))
        modes = np.zeros((n, 3 * whole.pattern.n_blocks))
        modes[:, free] = vectors.T
        return Spectrum(values, np.array([whole._scatter(mode) for mode in modes]))  # noqa: SLF001

    def _rows(self, fields: FloatArray) -> FloatArray:
        """Return nodal fields as rows in elimination order."""
        block_node = self.pattern.block_node
        return np.where((block_node >= 0)[:, None], fields[:, block_node], 0.0).reshape(len(fields), -1)

    def lowest_eigenvalue(self) -> float:
        """Return the lowest eigenvalue of K at the last measure; infinite where nothing can move."""
        return lowest_of(self.spectrum(1))

    def _rigid(self) -> FloatArray | None:
        """Return the neutral motions, orthonormal rows in elimination order."""
        if self.motions is None:
            return None
        return np.linalg.qr(self._rows(self.motions.fields(self.nodes)).T)[0].T

    def _lanczos(self, n_lowest: int, rigid: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Shift-invert Lanczos, to the tolerance that a certificate needs, and its proof by inertia.

        The shift lies below the spectrum, so the nearest are the lowest. Where K shifted to just below the
        value found has a negative pivot, one was missed: more are asked for.
        """
        from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

        free, shift = self.free_index, 0.0
        while self.factorise(shift) > 0:
            shift = max(4.0 * shift, 1e-9 * self.stiffness_scale)
        n = len(free)
        padded = np.zeros(3 * self.pattern.n_blocks)

        def product(vector: FloatArray) -> FloatArray:
            padded[free] = vector.ravel()
            return self._gather(self.force_rate(self._scatter(padded)))[free]

        def metric(vector: FloatArray) -> FloatArray:
            inner = rigid[:, free] if rigid is not None else np.zeros((0, n))
            apart: FloatArray = vector.ravel() - inner.T @ (inner @ vector.ravel())
            return apart

        operator = {name: LinearOperator((n, n), matvec=f, dtype=np.float64) for name, f in (
            ("inverse", self._inverse(shift, rigid)), ("product", product), ("metric", metric))}  # fmt: skip
        start = np.random.default_rng(0).standard_normal(n)
        wanted = n_lowest
        while True:
            try:
                values, vectors = eigsh(
                    operator["product"],
                    k=min(wanted, n - 1),
                    M=operator["metric"] if rigid is not None else None,
                    sigma=-shift,
                    OPinv=operator["inverse"],
                    v0=start,
                    ncv=min(n, max(20, 2 * wanted + 1)),
                    tol=EIGENVALUE_TOLERANCE,
                )
            except ArpackNoConvergence as stopped:
                values, vectors = np.real(stopped.eigenvalues), np.real(stopped.eigenvectors)
            order = np.argsort(values.real)
            values, vectors = np.real(values)[order], np.real(vectors)[:, order]
            if len(values) >= n_lowest and (wanted > 64 or self._proved(values[0], rigid)):
                return values[:n_lowest], vectors[:, :n_lowest]
            wanted = 2 * wanted + 2
            while self.factorise(shift) > 0:
                shift = max(4.0 * shift, 1e-9 * self.stiffness_scale)

    def _inverse(self, shift: float, rigid: FloatArray | None) -> Callable[[FloatArray], FloatArray]:
        """Return what multiplies by the inverse of A − σ R Rᵀ, with the factor of A = K + σ I at hand.

        It is A⁻¹ + σ A⁻¹ R (I − σ Rᵀ A⁻¹ R)⁻¹ Rᵀ A⁻¹ (Woodbury's formula).
        """
        free = self.free_index
        padded = np.zeros(3 * self.pattern.n_blocks)
        images = np.zeros((0, len(free))) if rigid is None else self._solved(rigid)[:, free]
        among = np.eye(len(images))
        if rigid is not None:
            among -= shift * images @ rigid[:, free].T

        def inverse(vector: FloatArray) -> FloatArray:
            padded[free] = vector.ravel()
            self._write(self.work.second, padded)
            kernels.solve(self.topology, self.lanes, self.lanes.second)
            solved = self._read(self.work.second)[free]
            if not shift or not len(images):
                return solved
            corrected: FloatArray = solved + shift * images.T @ np.linalg.solve(
                among, images @ vector.ravel()
            )
            return corrected

        return inverse

    def _proved(self, lowest: float, rigid: FloatArray | None) -> bool:
        """Whether no eigenvalue lies below one that was found.

        With neutral motions R the matrix is A + σ R Rᵀ with A = K − σ I, which has as many negative
        eigenvalues as A less those of σ⁻¹ I + Rᵀ A⁻¹ R (as in `tensegra.mechanics.certify`).
        """
        shift = lowest - BELOW * abs(lowest)
        below = self.factorise(-shift)
        if rigid is not None:
            small = np.eye(len(rigid)) / shift + rigid @ self._solved(rigid).T
            below -= int((np.linalg.eigvalsh(0.5 * (small + small.T)) < 0.0).sum())
        return below == 0

    def _solved(self, rows: FloatArray) -> FloatArray:
        """Solve for right-hand sides in elimination order, ``(n, 3 n_blocks)``, held coordinates at rest."""
        solved = np.zeros_like(rows)
        for row, right in zip(solved, rows, strict=True):
            padded = np.zeros(rows.shape[1])
            padded[self.free_index] = right[self.free_index]
            self._write(self.work.second, padded)
            kernels.solve(self.topology, self.lanes, self.lanes.second)
            row[self.free_index] = self._read(self.work.second)[self.free_index]
        return solved

    @staticmethod
    def _read(field: FloatArray) -> FloatArray:
        return field[:, 0] if field.ndim == 2 else field

    @staticmethod
    def _write(field: FloatArray, values: FloatArray) -> None:
        field[:] = values[:, None] if field.ndim == 2 else values

    def _gather(self, field: FloatArray) -> FloatArray:
        block_node = self.pattern.block_node
        masked = np.where(self.arrays.free, field, 0.0)[block_node]
        return np.where((block_node >= 0)[:, None], masked, 0.0).ravel()

    def _scatter(self, vector: FloatArray) -> FloatArray:
        field = np.zeros((self.arrays.n_nodes, 3))
        nodal = self.pattern.block_node >= 0
        field[self.pattern.block_node[nodal]] = vector.reshape(-1, 3)[nodal]
        return field
