"""Many runs of the beam: how many a second, and how many Cholesky factorisations one run costs."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.solver.timing import REFERENCE, Spread, Timed, blas_in_words, interleaved
from tensegra.mechanics import Batch, solve_batch
from tensegra.mechanics.arrays import FloatArray
from tensegra.report.tables import Table
from tensegra.structure import Structure, library

__all__ = ["BatchRow", "Batches", "Design", "beam_designs", "measure_batches", "solve"]

DERIVED = ("A14", "A23", "top", "middle", "bottom")
"""Inputs of the five-variable design by which its runs are differentiated."""

SEED = 0


@dataclass(frozen=True, eq=False)
class Design:
    """Runs to be solved.

    Attributes
    ----------
    name
        What they are.
    structure
        The structure.
    actuation, temperature
        As `solve_batch` takes them.
    """

    name: str
    structure: Structure
    actuation: Mapping[str, FloatArray]
    temperature: Mapping[str, FloatArray]

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(next(iter(self.actuation.values())))


@dataclass(frozen=True)
class BatchRow:
    """One way of solving one design.

    Attributes
    ----------
    design
        What was solved.
    n_runs, threads
        How many runs on how many threads.
    seconds_per_run
        Wall-clock time over the number of runs.
    ratio
        Processor time of a run over the time of the reference, round by round.
    cores
        Processor time over wall-clock time, the median: what the machine gave.
    lost
        Runs with the status `failed`.
    largest_residual
        Of all runs that did not fail.
    iterations
        Newton iterations a run, the mean.
    against_plain
        Time with derivatives over time without; None where no derivative was asked for.
    """

    design: str
    n_runs: int
    threads: int
    seconds_per_run: Spread
    ratio: Spread
    cores: float
    lost: int
    largest_residual: float
    iterations: float
    against_plain: Spread | None = None


@dataclass(frozen=True)
class Batches:
    """Rows of all designs on one and on several threads."""

    reference: Spread
    library: str
    rows: tuple[BatchRow, ...]

    def tables(self) -> tuple[Table, Table]:
        """Lay out the times, and what the runs came to."""
        return self._times(), self._outcomes()

    def _times(self) -> Table:
        rows = [
            (
                row.design,
                f"{row.n_runs:,}",
                str(row.threads),
                f"{1.0 / row.seconds_per_run.median:,.0f}",
                f"{row.ratio.median:.2f}",
                f"{row.ratio.best:.2f}–{row.ratio.worst:.2f}",
                f"{row.cores:.2f}",
            )
            for row in self.rows
        ]
        header = ("Runs", "Number", "Threads", "Runs/s", "Ratio", "From–to", "Cores")
        note = (
            f"Ratio: processor time of a run over the time of one {REFERENCE}, "
            f"{1e6 * self.reference.median:.2f} µs ({1e6 * self.reference.best:.2f}–"
            f"{1e6 * self.reference.worst:.2f}) by {self.library}, on one thread, called from Python. "
            "Cores: processor time over wall-clock time. "
            "Medians of the rounds, each of which times everything once; from the best to the worst round."
        )
        return Table.of("Many runs of the beam: time", header, rows, "lrrrrrr", note)

    def _outcomes(self) -> Table:
        first = {(row.design, row.n_runs): row for row in reversed(self.rows)}
        rows = [
            (
                row.design,
                f"{row.n_runs:,}",
                f"{row.iterations:.1f}",
                str(row.lost),
                f"{row.largest_residual:.1e}",
                "–" if row.against_plain is None else f"{row.against_plain.median:.2f}",
            )
            for row in reversed(first.values())
        ]
        header = ("Runs", "Number", "Iterations", "Failed", "Residual", "Derivatives")
        note = "Residual: the largest. Derivatives: processor time with them over that without."
        return Table.of("Many runs of the beam: outcome", header, rows, "lrrrrr", note)


def beam_designs(n_runs: int, seed: int = SEED) -> dict[str, Design]:
    """Return the designs by a short name, `n_runs` runs each.

    Examples
    --------
    >>> [design.name for design in beam_designs(4).values()]
    ['10 % path', 'five variables', '30 %, no gravity']
    """
    rng = np.random.default_rng(seed)
    beam = library.paper_beam()
    full = np.full(n_runs, 0.10)
    within = {"A14": (0.09, 0.10), "A23": (0.09, 0.10)}
    warm = dict.fromkeys(("top", "middle", "bottom"), (0.0, 150.0))
    strong = dict.fromkeys(("A1", "A23", "A4"), (0.0, 0.30))

    def drawn(bounds: Mapping[str, tuple[float, float]]) -> dict[str, FloatArray]:
        return {name: rng.uniform(*limits, n_runs) for name, limits in bounds.items()}

    return {
        "path": Design("10 % path", beam, {"A14": full, "A23": full}, {}),
        "five": Design("five variables", beam, drawn(within), drawn(warm)),
        "strong": Design("30 %, no gravity", replace(beam, gravity=(0.0, 0.0, 0.0)), drawn(strong), {}),
    }


def solve(design: Design, threads: int, derivatives: tuple[str, ...] = ()) -> Batch:
    """Solve a design, and differentiate its runs."""
    return solve_batch(
        design.structure,
        actuation=design.actuation,
        temperature=design.temperature,
        derivatives=derivatives,
        threads=threads,
    )


def measure_batches(
    n_runs: int,
    repeats: int,
    *,
    threads: tuple[int, ...] = (1, 2),
    many: int = 0,
    tell: Callable[[int], object] = lambda _done: None,
) -> Batches:
    """Time all designs on all numbers of threads, interleaved with the reference.

    Parameters
    ----------
    n_runs
        Runs of each design.
    repeats
        Rounds.
    threads
        Numbers of threads.
    many
        Runs of the five-variable design that are solved once more in one go, on the most threads.
    tell
        Called with the number of rounds done.
    """
    kept: dict[str, Batch] = {}
    works = dict(_works(n_runs, threads, many))
    labels = {name: (design, n) for name, (design, n, _) in works.items()}

    def doing(name: str, work: Callable[[], Batch]) -> None:
        kept[name] = work()

    timed = interleaved(
        {name: partial(doing, name, work) for name, (_, _, work) in works.items()}, repeats, tell=tell
    )
    rows = tuple(_row(design, n, name, kept[name], timed) for name, (design, n) in labels.items())
    return Batches(Spread.of(timed.reference), blas_in_words(), rows)


def _works(
    n_runs: int, threads: tuple[int, ...], many: int
) -> Iterator[tuple[str, tuple[Design, int, Callable[[], Batch]]]]:
    for name, design in beam_designs(n_runs).items():
        for n in threads:
            yield f"{name} {n}", (design, n, partial(solve, design, n))
            if name == "five":
                named = replace(design, name=f"{design.name} + derivatives")
                yield f"derivatives {n}", (named, n, partial(solve, design, n, DERIVED))
    if many:
        design = beam_designs(many)["five"]
        yield "many", (design, max(threads), partial(solve, design, max(threads)))


def _row(design: Design, threads: int, name: str, batch: Batch, timed: Timed) -> BatchRow:
    plain = f"five {threads}" if name.startswith("derivatives") else None
    failed = batch.status == "failed"
    return BatchRow(
        design=design.name,
        n_runs=batch.n_runs,
        threads=threads,
        seconds_per_run=Spread.of(timed.wall[name] / batch.n_runs),
        ratio=timed.ratio(name, batch.n_runs),
        cores=float(np.median(timed.cpu[name] / timed.wall[name])),
        lost=int(np.sum(failed)),
        largest_residual=float(np.max(batch.residual[~failed], initial=0.0)),
        iterations=float(np.mean(batch.iterations)),
        against_plain=None if plain is None else timed.ratio(name, to=plain),
    )
