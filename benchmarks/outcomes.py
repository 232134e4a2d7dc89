"""What a run costs by either procedure, as a multiple of one `dpotrf` of 60 unknowns.

    python -m benchmarks.outcomes [runs] [rounds]

The random actuations of `examples/outcomes.py`: both beams, two actuators in [1, 10] % with gravity and
four in [1, 30] % without, by the path follower and by the plain procedure of the source, on one thread;
and the collapsing runs of the path follower alone.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.solver.timing import REFERENCE, Spread, blas_in_words, interleaved
from tensegra.mechanics import PathSettings, Status, solve_batch
from tensegra.structure import apply_changes, library

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from outcomes import actuations

PROCEDURES = {"path": PathSettings(), "stepped": PathSettings(path="stepped")}


def works(n_runs: int) -> dict[str, tuple[int, partial]]:
    """Return what is timed by its name: how many runs, and the call that solves them."""
    found = {}
    for beam in (library.paper_beam(), library.paper_beam_slender()):
        for group, actuation in actuations(n_runs).items():
            structure = apply_changes(beam, {"gravity": [0, 0, -1 if group == "with gravity" else 0]})
            for name, settings in PROCEDURES.items():
                solve = partial(solve_batch, structure, settings=settings, threads=1)
                batch = solve(actuation=actuation)
                found[f"{beam.name}, {group}, {name}"] = n_runs, partial(solve, actuation=actuation)
                collapsed = batch.status == Status.COLLAPSED
                if name == "path" and collapsed.any():
                    some = {actuator: values[collapsed] for actuator, values in actuation.items()}
                    found[f"{beam.name}, {group}, {name}, the collapsing"] = (
                        int(collapsed.sum()),
                        partial(solve, actuation=some),
                    )
    return found


def main(n_runs: int = 2000, rounds: int = 5) -> None:
    timed_works = works(n_runs)
    timed = interleaved({name: work for name, (_, work) in timed_works.items()}, rounds)
    reference = Spread.of(1e6 * timed.reference)
    print(f"{REFERENCE}: {reference.median:.2f} µs by {blas_in_words()}")
    print(f"{'runs':<58}{'number':>8}{'ratio':>8}{'from–to':>14}{'µs a run':>10}")
    for name, (n, _) in timed_works.items():
        ratio = timed.ratio(name, n)
        micro = 1e6 * float(np.median(timed.cpu[name])) / n
        spread = f"{ratio.best:.1f}–{ratio.worst:.1f}"
        print(f"{name:<58}{n:>8,}{ratio.median:>8.1f}{spread:>14}{micro:>10.1f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
