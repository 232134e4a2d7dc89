"""Error and time of the surrogates on the source paper's five-variable design.

    python benchmarks/surrogates.py

1,000 runs to learn from, 2,500 held out; the outputs are the displacements v and w of node 23. The source
reports, for 1,000 runs: Gaussian process 630 s and 1e-5 %, network 147 s and 1e-2 %, and 3.0 ms for 100,000
predictions of the network.
"""

import time

import numpy as np
from scipy.stats import qmc

from tensegra.mechanics import solve_batch
from tensegra.structure import library
from tensegra.study.data import TrainingData
from tensegra.surrogate import fit

BOUNDS = np.array([[0.09, 0.10], [0.09, 0.10], [0.0, 150.0], [0.0, 150.0], [0.0, 150.0]])
CASES = {
    "gpr": ("gpr", {}),
    "nn, two stages (paper)": ("nn", {"training": "two_stage"}),
    "nn, Levenberg-Marquardt": ("nn", {}),
    "nn, ensemble of 4": ("nn", {"ensemble": 4, "hidden": (20, 20)}),
    "pce": ("pce", {}),
    "pce, degree 6": ("pce", {"degree": 6}),
}


def beam_runs(n: int) -> TrainingData:
    X = qmc.scale(qmc.Sobol(5, seed=1).random(4096)[:n], *BOUNDS.T)
    runs = solve_batch(
        library.paper_beam(),
        actuation={"A14": X[:, 0], "A23": X[:, 1]},
        temperature={"top": X[:, 2], "middle": X[:, 3], "bottom": X[:, 4]},
    )
    Y = np.stack([runs.displacement(axis, nodes=[23]) for axis in "yz"], axis=1)
    return TrainingData(X=X, Y=Y, bounds=BOUNDS, output_names=("v", "w"))


def main() -> None:
    data = beam_runs(3500)
    many = np.random.default_rng(0).uniform(*BOUNDS.T, size=(100_000, 5))
    print(
        f"{'surrogate':<26}{'E(v) %':>10}{'E(w) %':>10}{'R2':>12}{'90 % covers':>16}{'fit s':>8}{'1e5 ms':>9}"
    )
    for name, (kind, options) in CASES.items():
        surrogate = fit(
            data.rows(np.arange(1000)), kind, validation=data.rows(np.arange(1000, 3500)), **options
        )
        v = surrogate.validation
        covered = "–" if v.coverage_90 is None else " ".join(f"{c:.1%}" for c in v.coverage_90)
        began = time.perf_counter()
        surrogate.predict(many)
        milliseconds = 1e3 * (time.perf_counter() - began)
        errors = "".join(f"{100 * e:>10.1e}" for e in v.relative_error)
        print(
            f"{name:<26}{errors}{min(v.r2):>12.8f}{covered:>16}{surrogate.seconds:>8.2f}{milliseconds:>9.0f}"
        )


if __name__ == "__main__":
    main()
