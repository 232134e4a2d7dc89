"""How far the limit is: the multiply-adds of a factorisation against what the processor can do."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.solver.kernel_times import Pack, fused_rate, kernel_seconds, matrix_product_rate
from benchmarks.solver.timing import REFERENCE, Spread, blas_in_words, cholesky_seconds
from tensegra.mechanics.pattern import Pattern
from tensegra.report.tables import Table
from tensegra.structure import Structure

__all__ = ["Roofline", "Work", "factor_work", "measure_roofline"]

PER_BLOCK = 27
"""Multiply-adds of one product of two 3 × 3 blocks."""

PER_PIVOT, DIVISIONS_PER_PIVOT = 15, 6
"""Of the L D Lᵀ of a 3 × 3 block and its inverse, as `kernels.factorise` does them."""


@dataclass(frozen=True)
class Work:
    """What one numeric factorisation does.

    Attributes
    ----------
    blocks, filled_blocks
        Movable nodes, and stored 3 × 3 blocks of the factor's lower triangle.
    block_updates
        Products that are subtracted from a block, those on the diagonal included.
    scaled_blocks
        Products of a block with the inverse of a pivot.
    multiply_adds, divisions
        Scalars of all these and the pivots; a product or a sum alone counts as one.
    """

    blocks: int
    filled_blocks: int
    block_updates: int
    scaled_blocks: int
    multiply_adds: int
    divisions: int


def factor_work(pattern: Pattern) -> Work:
    """Count the work of a factorisation from its pattern.

    A column k with c blocks below its diagonal updates the c (c + 1)/2 blocks of their lower
    triangle, after c products with the inverse of its pivot.

    Examples
    --------
    >>> from tensegra.mechanics.arrays import structure_arrays
    >>> from tensegra.mechanics.pattern import build_pattern
    >>> from tensegra.structure import library
    >>> work = factor_work(build_pattern(structure_arrays(library.paper_beam())))
    >>> work.blocks, work.filled_blocks
    (20, 137)
    """
    below = np.diff(pattern.column_start) - 1
    updates, scaled = int(np.sum(below * (below + 1) // 2)), int(np.sum(below))
    return Work(
        blocks=pattern.n_blocks,
        filled_blocks=pattern.n_entries,
        block_updates=updates,
        scaled_blocks=scaled,
        multiply_adds=PER_BLOCK * (updates + scaled) + PER_PIVOT * pattern.n_blocks,
        divisions=DIVISIONS_PER_PIVOT * pattern.n_blocks,
    )


@dataclass(frozen=True)
class Roofline:
    """The kernels of one structure beside the machine's limit.

    Attributes
    ----------
    structure
        Its name.
    work
        What a factorisation does.
    reference
        Time of the reference.
    peak, matrix_product
        Multiply-adds a second, one thread: of a loop over packs in registers, and of BLAS dgemm.
    library
        That BLAS.
    kernels
        Time of each kernel for one lane.
    """

    structure: str
    work: Work
    reference: Spread
    peak: Spread
    matrix_product: Spread
    library: str
    kernels: dict[str, Spread]

    @property
    def limit(self) -> float:
        """Multiply-adds a second of the faster of the two measured peaks."""
        return max(self.peak.worst, self.matrix_product.worst)

    @property
    def share_of_peak(self) -> float:
        """Rate of the factorisation over the machine's measured peak."""
        return self.work.multiply_adds / self.kernels["factorise"].best / self.limit

    def tables(self) -> tuple[Table, Table]:
        """Lay out the limit and the kernels."""
        work, factorise = self.work, self.kernels["factorise"]
        at_limit = work.multiply_adds / self.limit
        limit = [
            ("Movable nodes", f"{work.blocks}"),
            ("Blocks of the factor", f"{work.filled_blocks}"),
            ("Block updates", f"{work.block_updates}"),
            ("Multiply-adds of a factorisation", f"{work.multiply_adds:,}"),
            ("Divisions of a factorisation", f"{work.divisions}"),
            ("Measured peak, packs in registers [10⁹ multiply-adds/s]", f"{self.peak.worst / 1e9:.1f}"),
            (f"Measured peak, dgemm of {self.library} [10⁹/s]", f"{self.matrix_product.worst / 1e9:.1f}"),
            ("Factorisation at the peak [µs a run]", f"{1e6 * at_limit:.3f}"),
            ("Factorisation measured [µs a run]", f"{1e6 * factorise.best:.3f}"),
            ("Share of the peak [%]", f"{100 * self.share_of_peak:.0f}"),
            (f"{REFERENCE} measured [µs]", f"{1e6 * self.reference.median:.2f}"),
        ]
        kernels = [
            (
                name,
                f"{1e6 * spread.median:.3f}",
                f"{1e6 * spread.best:.3f}–{1e6 * spread.worst:.3f}",
                f"{spread.median / self.reference.median:.3f}",
            )
            for name, spread in self.kernels.items()
        ]
        return (
            Table.of(f"Limit of a factorisation: {self.structure}", ("Quantity", "Value"), limit, "lr"),
            Table.of(
                f"Kernels alone: {self.structure}",
                ("Kernel", "Time of a run [µs]", "From–to [µs]", f"/ {REFERENCE}"),
                kernels,
                "lrrr",
                "One pack of lanes on one thread, everything in the cache; the tick is the sum of its parts "
                "and the rest lengths and residual.",
            ),
        )


def measure_roofline(
    structure: Structure,
    rounds: int,
    calls: int = 2000,
    *,
    tell: Callable[[int], object] = lambda _done: None,
) -> Roofline:
    """Count the work of a factorisation, and time the kernels and the machine's peak."""
    pack = Pack(structure)
    fused_rate(1)
    times: dict[str, list[float]] = {}
    peak, product, reference = [], [], []
    for done in range(rounds):
        reference.append(cholesky_seconds())
        peak.append(fused_rate())
        product.append(matrix_product_rate())
        for name, seconds in kernel_seconds(pack, 1, calls).items():
            times.setdefault(name, []).extend(seconds.tolist())
        tell(done + 1)
    return Roofline(
        structure.name,
        factor_work(pack.pattern),
        Spread.of(reference),
        Spread.of(peak),
        Spread.of(product),
        blas_in_words(),
        {name: Spread.of(values) for name, values in times.items()},
    )
