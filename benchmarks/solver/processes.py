"""What only a fresh process shows: the first call, with and without compiled kernels, and the memory."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tensegra.report.tables import Table

__all__ = ["FirstCall", "Memory", "measure_first_call", "measure_memory"]

MIB = 2.0**20

ROOT = Path(__file__).parents[2]
"""The folder in which the package `benchmarks` lies."""


@dataclass(frozen=True)
class FirstCall:
    """Seconds of what a process does first, without and with compiled kernels on disk.

    Attributes
    ----------
    compiling, cached
        Wall-clock and processor seconds by the name of the step.
    """

    compiling: dict[str, tuple[float, float]]
    cached: dict[str, tuple[float, float]]

    def table(self) -> Table:
        """Lay the steps out, and their sum."""
        columns = [list(zip(*steps.values(), strict=True)) for steps in (self.compiling, self.cached)]
        sums = [sum(seconds) for pair in columns for seconds in pair]
        rows = [
            (step, *(f"{seconds:.2f}" for seconds in (*self.compiling[step], *self.cached[step])))
            for step in self.compiling
        ]
        rows.append(("together", *(f"{seconds:.2f}" for seconds in sums)))
        header = ("First", "Compiling [s]", "processor [s]", "From disk [s]", "processor [s]")
        note = "Compiling: no kernels on disk. From disk: kernels compiled by an earlier process."
        return Table.of("First call in a fresh process", header, rows, "lrrrr", note)


@dataclass(frozen=True)
class Memory:
    """Peak memory of a fresh process, in bytes.

    Attributes
    ----------
    n_runs, threads
        The batch of the five-variable design.
    before, peak
        Peak before the batch (interpreter, libraries, a small batch) and after it.
    results
        Size of the arrays that the batch returns.
    """

    n_runs: int
    threads: int
    before: int
    peak: int
    results: int

    def table(self) -> Table:
        """Lay the figures out."""
        beyond = self.peak - self.before - self.results
        rows = [
            ("Process before the batch", f"{self.before / MIB:,.0f}"),
            ("Peak", f"{self.peak / MIB:,.0f}"),
            ("Results", f"{self.results / MIB:,.0f}"),
            ("Peak beyond process and results", f"{beyond / MIB:,.0f}"),
        ]
        title = f"Memory of {self.n_runs:,} runs on {self.threads} thread(s)"
        return Table.of(title, ("Part", "MiB"), rows, "lr")


def measure_first_call(*, tell: Callable[[int], object] = lambda _done: None) -> FirstCall:
    """Time the first call of two processes, the first of which finds no compiled kernels."""
    with tempfile.TemporaryDirectory() as cache:
        compiling = _in_fresh_process(["first-call"], cache)
        tell(1)
        cached = _in_fresh_process(["first-call"], cache)
        tell(2)
    return FirstCall(compiling, cached)


def measure_memory(n_runs: int, threads: int) -> Memory:
    """Solve the five-variable design in a fresh process and ask for its peak memory."""
    return Memory(n_runs, threads, **_in_fresh_process(["memory", str(n_runs), str(threads)]))


def _in_fresh_process(arguments: list[str], cache: str | None = None) -> dict[str, Any]:
    """Run `fresh` by its name; the packages above it import nothing, so its clock sees all."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    environment = os.environ | {"PYTHONPATH": path} | ({} if cache is None else {"NUMBA_CACHE_DIR": cache})
    command = [sys.executable, "-P", "-m", "benchmarks.solver.fresh", *arguments]
    done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found
