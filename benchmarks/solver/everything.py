"""All measurements together: sizes, order, tables, Markdown."""

import platform
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from functools import partial
from importlib.metadata import version
from math import isfinite
from typing import Any

from benchmarks.solver.batches import Batches, measure_batches
from benchmarks.solver.growth import Growth, measure_path_growth, measure_run_growth, measure_stage_growth
from benchmarks.solver.peers import Peers, measure_peers
from benchmarks.solver.processes import FirstCall, Memory, measure_first_call, measure_memory
from benchmarks.solver.roofline import Roofline, measure_roofline
from benchmarks.solver.timing import n_cores
from tensegra.report.pipeline import Listener, deaf
from tensegra.report.tables import Table
from tensegra.structure import library

__all__ = ["FULL", "QUICK", "Benchmark", "Sizes", "measure", "to_markdown"]


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Attributes
    ----------
    repeats
        Rounds of every measurement.
    threads
        Numbers of threads.
    n_runs, many_runs
        Runs of each design, and of the five-variable design in one go; none of the latter if 0.
    run_counts, stages, stage_runs, nodes
        Sizes over which the time is followed: runs; stages of a tower and runs of each; nodes.
    calls
        Repetitions of a kernel that are one measurement.
    memory_runs
        Runs of the batch whose memory is asked for.
    fresh_processes, peers
        Whether to start processes, and whether to ask other programs.
    """

    repeats: int
    threads: tuple[int, ...]
    n_runs: int
    many_runs: int
    run_counts: tuple[int, ...]
    stages: tuple[int, ...]
    stage_runs: int
    nodes: tuple[int, ...]
    calls: int
    memory_runs: int
    fresh_processes: bool = True
    peers: bool = True


FULL = Sizes(
    repeats=5,
    threads=(1, 2),
    n_runs=4096,
    many_runs=100_000,
    run_counts=(100, 1_000, 10_000, 100_000, 1_000_000),
    stages=(3, 10, 30, 100),
    stage_runs=512,
    nodes=(100, 300, 1_000, 3_000, 10_000, 30_000),
    calls=2000,
    memory_runs=100_000,
)
QUICK = Sizes(
    repeats=3,
    threads=(1, 2),
    n_runs=512,
    many_runs=10_000,
    run_counts=(100, 1_000, 10_000),
    stages=(3, 10, 30),
    stage_runs=64,
    nodes=(100, 300, 1_000, 3_000),
    calls=500,
    memory_runs=10_000,
)


@dataclass(frozen=True)
class Benchmark:
    """Everything that was measured on one machine.

    Attributes
    ----------
    machine, versions
        What it was measured on and with.
    batches, roofline, stage_growth, run_growth, path_growth, first_call, memory, peers
        The measurements; None where one was left out.
    """

    machine: str
    versions: dict[str, str]
    batches: Batches
    roofline: Roofline
    stage_growth: Growth
    run_growth: Growth
    path_growth: Growth
    first_call: FirstCall | None
    memory: Memory | None
    peers: Peers | None

    def tables(self) -> list[Table]:
        """Lay all measurements out."""
        results = (getattr(self, field.name) for field in fields(self))
        tables: list[Table] = []
        for result in results:
            if isinstance(result, Roofline | Batches):
                tables.extend(result.tables())
            elif isinstance(result, Growth | FirstCall | Memory | Peers):
                tables.append(result.table())
        return tables

    def to_dict(self) -> dict[str, Any]:
        """Return everything in plain types; a number that there is not is None."""
        content = {"schema": "tensegra/benchmark/1", **asdict(self)}
        content["roofline"]["share_of_peak"] = self.roofline.share_of_peak
        plain: dict[str, Any] = _without_nan(content)
        return plain


def _without_nan(content: Any) -> Any:  # noqa: ANN401 - any plain content
    if isinstance(content, dict):
        return {key: _without_nan(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_without_nan(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def measure(sizes: Sizes = FULL, listener: Listener = deaf) -> Benchmark:
    """Measure everything; nothing is downloaded.

    Parameters
    ----------
    sizes
        How much: `FULL` takes some minutes, `QUICK` less than one.
    listener
        Told of the progress.
    """

    def telling(task: str, total: int) -> Callable[[int], object]:
        return lambda done: listener(task, done, total)

    s = sizes
    # Memory first: a child reports at least the peak that its parent had when it was started.
    memory = partial(measure_memory, s.memory_runs, max(s.threads))
    return Benchmark(
        machine=_machine(),
        versions={name: version(name) for name in ("tensegra", "numpy", "scipy", "numba")},
        memory=memory() if s.fresh_processes else None,
        first_call=measure_first_call(tell=telling("First calls", 2)) if s.fresh_processes else None,
        batches=measure_batches(
            s.n_runs, s.repeats, threads=s.threads, many=s.many_runs, tell=telling("Batches", s.repeats)
        ),
        roofline=measure_roofline(
            library.paper_beam(), s.repeats, s.calls, tell=telling("Kernels", s.repeats)
        ),
        stage_growth=measure_stage_growth(
            s.stages, s.stage_runs, s.repeats, tell=telling("Towers", len(s.stages))
        ),
        run_growth=measure_run_growth(s.run_counts, s.repeats, tell=telling("Runs", len(s.run_counts))),
        path_growth=measure_path_growth(s.nodes, s.repeats, tell=telling("Nodes", len(s.nodes))),
        peers=measure_peers(tell=telling("Other programs", 0)) if s.peers else None,
    )


def _machine() -> str:
    return f"{_processor()}, {n_cores()} cores, {platform.system()}, Python {platform.python_version()}"


def _processor() -> str:
    """Name the processor; numba asks LLVM, which knows more than the standard library."""
    from llvmlite.binding import get_host_cpu_name

    name: str = get_host_cpu_name()
    return f"{platform.machine()} {name}"


def to_markdown(benchmark: Benchmark) -> str:
    """Write all tables as Markdown."""
    return "\n".join(_markdown_lines(benchmark))


def _markdown_lines(benchmark: Benchmark) -> Iterator[str]:
    versions = ", ".join(f"{name} {number}" for name, number in benchmark.versions.items())
    yield f"{benchmark.machine}; {versions}."
    yield ""
    for table in benchmark.tables():
        yield f"### {table.title}"
        yield ""
        yield _row_of(table.header)
        yield _row_of("---:" if align == "r" else "---" for align in table.align)
        for row in table.rows:
            yield _row_of(row)
        yield ""
        if table.note:
            yield table.note
            yield ""


def _row_of(cells: Any) -> str:  # noqa: ANN401 - any texts
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
