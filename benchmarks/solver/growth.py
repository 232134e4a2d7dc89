"""How the time grows: with the stages of a tower, with the runs of a batch, with the nodes of one path."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from benchmarks.solver.batches import beam_designs, solve
from benchmarks.solver.timing import Spread, Stopwatch, exponent, interleaved, one_blas_thread
from tensegra.mechanics import Status, solve_batch, solve_path
from tensegra.report.tables import Table
from tensegra.structure import Structure, library

__all__ = ["Growth", "GrowthRow", "measure_path_growth", "measure_run_growth", "measure_stage_growth"]

BEND = 0.01
"""Largest shortening of a tower's chain in the batches: its runs go from a tenth of this to all of it."""

LONG_BEND = 0.002
"""Shortening of the chain of the long towers."""

GUIDED_EVERY = 5
"""Rings between two guided ones, without which a tall tower's softest mode is lost in rounding."""

N_STRUTS = 4

FITTED_ROWS = 3
"""Rows to which the exponent is fitted: where the time is small, what does not grow hides what does."""

SHORT = 100_000
"""Batches of more runs than this are timed once: they average over what else the machine does."""


@dataclass(frozen=True)
class GrowthRow:
    """One size.

    Attributes
    ----------
    size, free
        What is varied, and the free degrees of freedom of the structure.
    seconds
        Time of one unit: a run, a batch or a path.
    succeeded
        Share of the runs that ended stable.
    """

    size: int
    free: int
    seconds: Spread
    succeeded: float


@dataclass(frozen=True)
class Growth:
    """Rows over growing sizes.

    Attributes
    ----------
    title, size_name, unit
        What was measured, what grew, and what took the time.
    rows
        One a size.
    exponent
        Fitted to the best times of the `FITTED_ROWS` largest; NaN for a single one.
    """

    title: str
    size_name: str
    unit: str
    rows: tuple[GrowthRow, ...]
    exponent: float

    @classmethod
    def of(cls, title: str, size_name: str, unit: str, rows: Iterable[GrowthRow]) -> "Growth":
        """Fit the exponent to the rows."""
        found = tuple(rows)
        large = found[-FITTED_ROWS:]
        power = exponent([row.size for row in large], [row.seconds.best for row in large])
        return cls(title, size_name, unit, found, power)

    def table(self) -> Table:
        """Lay the rows out, with the exponent from each row to the next."""
        local = [float("nan")] + [
            exponent([a.size, b.size], [a.seconds.best, b.seconds.best]) for a, b in pairwise(self.rows)
        ]
        rows = [
            (
                f"{row.size:,}",
                f"{row.free:,}",
                f"{row.seconds.median:.3g}",
                f"{row.seconds.best:.3g}–{row.seconds.worst:.3g}",
                f"{100 * row.succeeded:.0f}",
                f"{power:.2f}" if np.isfinite(power) else "–",
            )
            for row, power in zip(self.rows, local, strict=True)
        ]
        header = (self.size_name, "Free dof", "Time [s]", "From–to [s]", "Stable, %", "Exponent")
        fitted = (
            f"Processor time of {self.unit}. Exponent: from the row above; fitted to the last "
            f"{FITTED_ROWS} rows {self.exponent:.2f}."
        )
        return Table.of(self.title, header, rows, "rrrrrr", fitted if np.isfinite(self.exponent) else "")


def _n_free(structure: Structure) -> int:
    return 3 * len(structure.nodes) - sum(len(axes) for axes in structure.supports.values())


def measure_stage_growth(
    stages: tuple[int, ...], n_runs: int, repeats: int, *, tell: Callable[[int], object] = lambda _done: None
) -> Growth:
    """Time batches of towers without clustered cables, on one thread, that bend to one side."""
    bend = np.linspace(0.1 * BEND, BEND, n_runs)
    rows = []
    for done, n_stages in enumerate(stages):
        tower = library.tower(n_stages, N_STRUTS, guided_every=GUIDED_EVERY)
        timed = interleaved(
            {"batch": partial(solve_batch, tower, actuation={"chain0": bend}, threads=1)}, repeats
        )
        batch = solve_batch(tower, actuation={"chain0": bend}, threads=1)
        stable = float(np.mean(batch.status == Status.STABLE))
        rows.append(GrowthRow(n_stages, _n_free(tower), Spread.of(timed.cpu["batch"] / n_runs), stable))
        tell(done + 1)
    title = f"Towers of growing height, {n_runs} runs on one thread"
    return Growth.of(title, "Stages", "a run", rows)


def measure_run_growth(
    counts: tuple[int, ...],
    repeats: int,
    *,
    threads: int = 1,
    tell: Callable[[int], object] = lambda _done: None,
) -> Growth:
    """Time batches of the five-variable design with growing numbers of runs."""
    rows = []
    for done, n_runs in enumerate(counts):
        design = beam_designs(n_runs)["five"]
        times, stable = [], 0.0
        for _ in range(repeats if n_runs <= SHORT else 1):
            with one_blas_thread():
                watch = Stopwatch()
                batch = solve(design, threads)
                times.append(watch.cpu)
            stable = float(np.mean(batch.status == Status.STABLE))
            del batch
        rows.append(GrowthRow(n_runs, _n_free(design.structure), Spread.of(times), stable))
        tell(done + 1)
    return Growth.of(f"Batches of growing size, {threads} thread(s)", "Runs", "the batch", rows)


def measure_path_growth(
    nodes: tuple[int, ...], repeats: int, *, tell: Callable[[int], object] = lambda _done: None
) -> Growth:
    """Time single paths of guided towers with one clustered cable along the whole length.

    Everything is in it but building the structure: ordering, symbolic factorisation, the
    equilibrium of the start, the path and its certificate.
    """
    solve_path(library.tower(3, N_STRUTS, clustered="one", guided_every=2), {"chain0": LONG_BEND})
    rows = []
    for done, wanted in enumerate(nodes):
        n_stages = max(2, round(wanted / N_STRUTS) - 1)
        tower = library.tower(n_stages, N_STRUTS, clustered="one", guided_every=GUIDED_EVERY)
        times, stable = [], 0.0
        for _ in range(repeats):
            with one_blas_thread():
                watch = Stopwatch()
                path = solve_path(tower, {"chain0": LONG_BEND})
                times.append(watch.cpu)
            stable = float(path.status is Status.STABLE)
        rows.append(GrowthRow(len(tower.nodes), _n_free(tower), Spread.of(times), stable))
        tell(done + 1)
    title = "One path of a tower with a clustered cable along its whole length"
    return Growth.of(title, "Nodes", "the path", rows)
