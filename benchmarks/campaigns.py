"""What a campaign costs beside its solver, and what clustering 100,000 runs takes.

    python -m benchmarks.campaigns [rounds]

Processor time of the same 100,000 points of the five-variable design, solved as a campaign (blocks, shards
with checksums, manifest) and by the solver alone, interleaved in one process; then HDBSCAN, as the study's
selection calls it, on the runs of (A1, A23, A4) over [0, 30] % without gravity, in a process of its own.
"""

import multiprocessing
import sys
import tempfile
import time
from statistics import median

from benchmarks.solver.fresh import peak_bytes
from tensegra.study import Study, design_points, parse_study, select

N_POINTS = 100_000
UNIFORM_ERROR, UNIFORM_HEAT, UNIFORM_WIDE = ({"uniform": u} for u in ([0.09, 0.10], [0, 150], [0, 0.3]))
OUTPUTS = {"v": {"displacement": "y", "nodes": [18, 23]}, "w": {"displacement": "z", "nodes": [18, 23]}}


def five_variables() -> Study:
    """Return the paper's design of two actuations and three temperatures."""
    actuation = {name: {"actuator": name, "distribution": UNIFORM_ERROR} for name in ("A14", "A23")}
    heat = {
        f"T_{group}": {"temperature": group, "distribution": UNIFORM_HEAT}
        for group in ("top", "middle", "bottom")
    }
    return parse_study(
        {
            "structure": "library:paper_beam",
            "variables": actuation | heat,
            "outputs": OUTPUTS,
            "design": {"sampler": "sobol", "sizes": N_POINTS},
        }
    )


def three_actuations() -> Study:
    """Return the design of Appendix B."""
    return parse_study(
        {
            "structure": "library:paper_beam",
            "changes": {"gravity": [0, 0, 0]},
            "variables": {
                name: {"actuator": name, "distribution": UNIFORM_WIDE} for name in ("A1", "A23", "A4")
            },
            "outputs": OUTPUTS,
            "design": {"sampler": "sobol", "sizes": N_POINTS},
        }
    )


def store_overhead(rounds: int) -> None:
    """Print the processor time of a campaign over that of its solver."""
    study = five_variables()
    X = design_points(study)
    study.evaluate(X[:4096])
    ratios = []
    for _ in range(rounds):
        began = time.process_time()
        study.evaluate(X)
        alone = time.process_time() - began
        with tempfile.TemporaryDirectory() as folder:
            began = time.process_time()
            study.run(folder)
            ratios.append((time.process_time() - began) / alone)
        print(f"solver alone {alone:.2f} s, campaign {ratios[-1]:.3f} times as much", flush=True)
    print(f"store: median of {rounds} rounds {100 * (median(ratios) - 1):+.1f} %")


def _select(frame: object) -> None:
    before = peak_bytes()
    began = time.perf_counter()
    selection = select(frame, ["v", "w"], method="hdbscan")
    seconds, peak = time.perf_counter() - began, peak_bytes()
    print(selection.table)
    kept, n_groups = selection.n_kept, selection.labels.max() + 1
    print(
        f"HDBSCAN of {len(selection.keep)} runs: {kept} in the largest of {n_groups} groups, {seconds:.1f} s,"
    )
    print(f"peak {peak / 2**30:.2f} GiB, {before / 2**30:.2f} of it before")


def clustering() -> None:
    """Print time and memory of the paper's selection."""
    with tempfile.TemporaryDirectory() as folder:
        frame = three_actuations().run(folder).frame()
    process = multiprocessing.get_context("spawn").Process(target=_select, args=(frame,))
    process.start()
    process.join()


if __name__ == "__main__":
    store_overhead(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
    clustering()
