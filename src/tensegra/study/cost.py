"""What a campaign will cost, from a few of its runs."""

from collections import Counter
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.study.driver import BLOCKS_PER_CAMPAIGN
from tensegra.study.solver import Solver
from tensegra.study.study import Study, design_points

__all__ = ["Probe", "probe"]

SIZES = (1, 8, 64, 512)
"""Runs tried, until they are enough to tell their time."""

ENOUGH = 0.5
"""Seconds of work that tell the time of a run."""


_UNITS = ((0.1, 1e-3, "ms"), (120.0, 1.0, "s"), (7200.0, 60.0, "min"), (172_800.0, 3600.0, "h"))
"""Up to which time, in seconds, which unit of so many seconds is used."""


@dataclass(frozen=True)
class Probe:
    """Expected cost of the runs that are pending.

    Attributes
    ----------
    n_pending
        Runs to be done.
    n_runs
        Runs that were tried, spread over those.
    statuses
        How many of them have each status, the most frequent first.
    seconds_per_run
        Time of a run among many.
    seconds_per_block
        Time that a block of runs takes beside its runs.
    workers
        Processes that share the work.
    """

    n_pending: int
    n_runs: int
    statuses: dict[str, int]
    seconds_per_run: float
    seconds_per_block: float
    workers: int = 1

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {**asdict(self), "expected_seconds": self.expected_seconds}

    def __str__(self) -> str:
        if self.n_pending == 0:
            return "Nothing is left to run."
        outcome = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        where = f"{self.workers} processes" if self.workers > 1 else "this process"
        return (
            f"{self.n_pending} runs to be done, expected in {duration(self.expected_seconds)} in {where} "
            f"({duration(self.seconds_per_run)} a run, from a probe of {self.n_runs}: {outcome})."
        )

    @property
    def expected_seconds(self) -> float:
        """Expected time of the campaign, without that of starting workers."""
        blocks = min(self.n_pending, BLOCKS_PER_CAMPAIGN) * self.seconds_per_block
        return (self.n_pending * self.seconds_per_run + blocks) / self.workers


def duration(seconds: float) -> str:
    """Return a time in a unit that a person would use.

    Examples
    --------
    >>> duration(2.4e-5), duration(0.8), duration(75.0), duration(9000.0)
    ('0.024 ms', '0.8 s', '75 s', '2.5 h')
    """
    for limit, unit, name in _UNITS:
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds / 86_400.0:.2g} days"


def probe(
    study: Study, points: NDArray[np.int64] | None = None, *, workers: int = 1, solver: Solver | None = None
) -> Probe:
    """Solve a few runs of a study and tell how long all will take.

    Parameters
    ----------
    study
        The study.
    points
        Indices of the pending points, as `pending_points` returns them; all if left out.
    workers
        As for `Study.run`; nothing is started here.
    solver
        As for `Study.run`.

    Returns
    -------
    Probe
        Times as they are on this machine, now.
    """
    X = design_points(study)
    points = np.arange(len(X)) if points is None else points
    if len(points) == 0:
        return Probe(0, 0, {}, 0.0, 0.0, workers)
    threads = None if workers == 1 else 1
    # The first call compiles, which is not what a run costs.
    study.evaluate(X[points[:1]], derivatives=study.derivatives, threads=threads, solver=solver)
    alone = 0.0
    for size in SIZES:
        tried = points[np.unique(np.linspace(0, len(points) - 1, size).astype(np.int64))]
        began = perf_counter()
        runs = study.evaluate(X[tried], derivatives=study.derivatives, threads=threads, solver=solver)
        seconds = perf_counter() - began
        alone = alone or seconds
        if seconds >= ENOUGH or len(tried) == len(points):
            break
    per_run = max(seconds - alone, 0.0) / (len(tried) - 1) if len(tried) > 1 else seconds
    return Probe(
        n_pending=len(points),
        n_runs=len(tried),
        statuses=dict(Counter(runs.status.tolist()).most_common()),
        seconds_per_run=per_run,
        seconds_per_block=max(alone - per_run, 0.0),
        workers=workers,
    )
