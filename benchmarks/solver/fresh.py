"""What `processes` runs in a process of its own: nothing is imported before the clock runs."""

import json
import sys
import time
from pathlib import Path


def first_call() -> dict[str, tuple[float, float]]:
    """Return wall-clock and processor seconds of the steps of a first session."""
    steps: dict[str, tuple[float, float]] = {}

    def ended(step: str) -> None:
        steps[step] = (time.perf_counter() - wall, time.process_time() - cpu)

    wall, cpu = time.perf_counter(), time.process_time()
    import tensegra

    ended("import tensegra")
    beam = tensegra.library.paper_beam()
    wall, cpu = time.perf_counter(), time.process_time()
    tensegra.solve_path(beam, {"A14": 0.10, "A23": 0.10})
    ended("solve_path")
    wall, cpu = time.perf_counter(), time.process_time()
    tensegra.solve_batch(beam, actuation={"A14": [0.05, 0.10], "A23": [0.05, 0.10]}, threads=1)
    ended("solve_batch")
    return steps


def memory(n_runs: int, threads: int) -> dict[str, int]:
    """Return the bytes that a batch of the five-variable design needs."""
    from benchmarks.solver.batches import beam_designs, solve

    solve(beam_designs(16)["five"], threads)
    design = beam_designs(n_runs)["five"]
    before = peak_bytes()
    batch = solve(design, threads)
    arrays = (batch.nodes, batch.tensions, batch.slack, batch.residual, batch.lowest_eigenvalue)
    others = (batch.status, batch.reason, batch.steps, batch.iterations, batch.seconds)
    return {
        "before": before,
        "peak": peak_bytes(),
        "results": sum(array.nbytes for array in (*arrays, *others)),
    }


def peak_bytes() -> int:
    """Return the most memory that this process has held, 0 where the system does not tell.

    On Linux `getrusage` would begin with what its parent held when it was started.
    """
    status = Path("/proc/self/status")
    if status.is_file():
        return 1024 * int(status.read_text().partition("VmHWM:")[2].split()[0])
    if sys.platform == "win32":  # which does not tell without another library
        return 0
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak  # bytes there, KiB elsewhere


if __name__ == "__main__":
    what, *numbers = sys.argv[1:]
    result = first_call() if what == "first-call" else memory(*map(int, numbers))
    sys.stdout.write(json.dumps(result))
