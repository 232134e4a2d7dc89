"""How much of the truth the 90 % interval of a Gaussian process covers, on few runs of known functions.

    python -m benchmarks.coverage_gpr [SEEDS]

100, 200 and 500 runs of a Sobol design of the functions of `functions.py`, 4,000 random points each.
"""

import sys

import numpy as np

from benchmarks.functions import CASES, Case
from tensegra.surrogate import fit

RUNS = (100, 200, 500)
N_FRESH = 4_000


def coverage(case: Case, n: int, seed: int) -> float:
    """Return the share of fresh points within the interval."""
    X = case.points(N_FRESH, 1000 + seed, sobol=False)
    data, box = case.data(n, seed), np.array([law.box for law in case.laws])
    X = np.clip(X, box[:, 0], box[:, 1])
    surrogate = fit(data, "gpr", validation=(X, case.function(X)), seed=seed)
    (share,) = surrogate.validation.coverage_90
    return share


def main(n_seeds: int) -> None:
    print("| runs | " + " | ".join(CASES) + " |")
    print("| --- " * (len(CASES) + 1) + "|")
    for n in RUNS:
        told = []
        for case in CASES.values():
            each = [coverage(case, n, seed) for seed in range(n_seeds)]
            told.append(f"{np.mean(each):.1%} ({min(each):.0%} to {max(each):.0%})".replace("%", " %"))
        print(f"| {n} | " + " | ".join(told) + " |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20)
