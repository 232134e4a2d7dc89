"""Outcomes of random actuations: the path follower beside the plain stepped procedure.

Two questions that are easily mixed are kept apart. The status is the solver's certificate: did the
structure get there along stable equilibria? The shape is an output: did the tip go up? A run can be
stable and hang down; a run of the plain procedure can stand upright and be no equilibrium that the
structure would ever reach.

    python examples/outcomes.py [runs]
"""

import sys
from collections import Counter

import numpy as np

from tensegra.mechanics import Batch, PathSettings, Status, solve_batch
from tensegra.structure import Structure, apply_changes, library

TIP = ["18", "23"]


def actuations(n_runs: int, seed: int = 1) -> dict[str, dict[str, np.ndarray]]:
    """Draw the two groups of Fig. 6: two actuators in [1, 10] %, and four in [1, 30] %."""
    rng = np.random.default_rng(seed)
    two, four = rng.uniform(0.01, 0.10, (2, n_runs)), rng.uniform(0.01, 0.30, (4, n_runs))
    return {
        "with gravity": dict(zip(("A14", "A23"), two, strict=True)),
        "without gravity": dict(zip(("A1", "A2", "A3", "A4"), four, strict=True)),
    }


def outcomes(runs: Batch) -> Counter[str]:
    """Count runs by status, and standing ones by whether the tip is above its start."""
    stands = np.isin(runs.status, (Status.STABLE, Status.SNAPPED))
    upward = stands & (np.nan_to_num(runs.displacement("z", TIP)) > 0.0)
    counts: Counter[str] = Counter(runs.status)
    counts["upward"], counts["not upward"] = int(upward.sum()), int((stands & ~upward).sum())
    return counts


def compare(structure: Structure, actuation: dict[str, np.ndarray]) -> dict[str, Counter[str]]:
    """Solve the same runs by both procedures."""
    procedures = {"path": PathSettings(), "stepped": PathSettings(path="stepped")}
    return {
        name: outcomes(solve_batch(structure, actuation=actuation, settings=settings))
        for name, settings in procedures.items()
    }


def main(n_runs: int = 200) -> dict[tuple[str, str, str], Counter[str]]:
    """Print the table of outcomes, in per cent, and return the counts."""
    columns = [*(str(status) for status in Status), "upward", "not upward"]
    print(f"{'structure':<20}{'':<17}{'procedure':<10}" + "".join(f"{name:>11}" for name in columns))
    table = {}
    for beam in (library.paper_beam(), library.paper_beam_slender()):
        for group, actuation in actuations(n_runs).items():
            gravity = [0, 0, -1] if group == "with gravity" else [0, 0, 0]
            structure = apply_changes(beam, {"gravity": gravity})
            for procedure, counts in compare(structure, actuation).items():
                table[beam.name, group, procedure] = counts
                shares = "".join(f"{100 * counts[name] / n_runs:>10.1f}%" for name in columns)
                print(f"{beam.name:<20}{group:<17}{procedure:<10}{shares}")
    return table


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
