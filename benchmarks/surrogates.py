"""Error and time of the surrogates on the source paper's five-variable design.

    python -m benchmarks.surrogates               errors, coverage, time of 100,000 predictions
    python -m benchmarks.surrogates coverage      coverage of the 90 % intervals over seeds and designs
    python -m benchmarks.surrogates derivatives   runs with and without derivatives
    python -m benchmarks.surrogates field         all coordinates and tensions

1,000 runs to learn from, 2,500 held out; the outputs are the displacements v and w of node 23. The source
reports, for 1,000 runs: Gaussian process 630 s and 1e-5 %, network 147 s and 1e-2 %, and 3.0 ms for 100,000
predictions of the network.
"""

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.stats import qmc

from tensegra.mechanics import Batch, solve_batch
from tensegra.structure import library
from tensegra.study.data import TrainingData
from tensegra.surrogate import Surrogate, field_runs, fit, learn
from tensegra.surrogate.network import BLOCK, Network
from tensegra.surrogate.threads import one_thread

BOUNDS = np.array([[0.09, 0.10], [0.09, 0.10], [0.0, 150.0], [0.0, 150.0], [0.0, 150.0]])
INPUTS = (
    ("A14", "actuation"),
    ("A23", "actuation"),
    ("top", "temperature"),
    ("middle", "temperature"),
    ("bottom", "temperature"),
)
CASES = {
    "gpr": ("gpr", {}),
    "nn, two stages (paper)": ("nn", {"training": "two_stage"}),
    "nn, Levenberg-Marquardt": ("nn", {}),
    "nn, ensemble of 4": ("nn", {"ensemble": 4, "hidden": (20, 20)}),
    "pce": ("pce", {}),
    "pce, degree 6": ("pce", {"degree": 6}),
}
INTERVALS = {
    "gpr": ("gpr", {}),
    "nn, ensemble of 4": ("nn", {"ensemble": 4, "hidden": (12, 12)}),
    "pce": ("pce", {}),
    "pce, degree 5": ("pce", {"degree": 5}),
}
DESIGNS: dict[str, Callable[[int, int], np.ndarray]] = {
    "sobol": lambda n, seed: qmc.Sobol(5, seed=seed).random(4096)[:n],
    "latin hypercube": lambda n, seed: qmc.LatinHypercube(5, seed=seed).random(n),
    "random": lambda n, seed: np.random.default_rng(1000 + seed).uniform(size=(n, 5)),
}
TARGETS = (1e-4, 1e-6, 1e-8)
REPETITIONS = 30


def solved(X: np.ndarray) -> Batch:
    given: dict[str, dict[str, np.ndarray]] = {"actuation": {}, "temperature": {}}
    for (name, kind), values in zip(INPUTS, X.T, strict=True):
        given[kind][name] = values
    return solve_batch(library.paper_beam(), **given)


def beam_runs(unit: np.ndarray, *, derivatives: bool = False) -> TrainingData:
    X = qmc.scale(unit, *BOUNDS.T)
    runs = solved(X)
    tip = runs.node_ids.index("23")
    dY = None
    if derivatives:
        dY = np.stack([runs.derivative(name, kind).nodes[:, tip, 1:] for name, kind in INPUTS], axis=2)
    Y = runs.displacements[:, tip, 1:]
    return TrainingData(X=X, Y=Y, dY=dY, bounds=BOUNDS, output_names=("v", "w"))


def milliseconds(function: Callable[[], object]) -> float:
    """Return the best of some repetitions: the others wait for whoever else uses the machine."""
    times = []
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        function()
        times.append(time.perf_counter() - began)
    return 1e3 * min(times)


def matrix_products(surrogate: Surrogate, n: int) -> tuple[float, float]:
    """Return the time of a network's products alone (single precision, one thread) and their Gflop/s."""
    layers = surrogate.model.members[0]
    weights = [W.astype(np.float32) for W, _ in layers]
    states = [np.ones((BLOCK, W.shape[0]), dtype=np.float32) for W in weights]
    results = [np.empty((BLOCK, W.shape[1]), dtype=np.float32) for W in weights]

    def products() -> None:
        for start in range(0, n, BLOCK):
            rows = min(BLOCK, n - start)
            for A, W, out in zip(states, weights, results, strict=True):
                np.matmul(A[:rows], W, out=out[:rows])

    with one_thread():
        took = milliseconds(products)
    return took, 2e-6 * n * sum(W.size for W in weights) / took


def errors(data: TrainingData) -> None:
    many = np.random.default_rng(0).uniform(*BOUNDS.T, size=(100_000, 5))
    print(
        f"{'surrogate':<26}{'E(v) %':>10}{'E(w) %':>10}{'R2':>12}{'90 % covers':>16}{'fit s':>8}"
        f"{'1e5 ms':>9}{'fast ms':>9}{'products ms':>13}{'ratio':>7}{'fast error %':>14}"
    )
    for name, (kind, options) in CASES.items():
        surrogate = fit(
            data.rows(np.arange(1000)), kind, validation=data.rows(np.arange(1000, 3500)), **options
        )
        v = surrogate.validation
        covered = "–" if v.coverage_90 is None else " ".join(f"{c:.1%}" for c in v.coverage_90)
        text = "".join(f"{100 * e:>10.1e}" for e in v.relative_error)
        print(f"{name:<26}{text}{min(v.r2):>12.8f}{covered:>16}{surrogate.seconds:>8.2f}", end="")
        if isinstance(surrogate.model, Network) and len(surrogate.model.members) == 1:
            exact, fast = (milliseconds(partial(surrogate.predict, many, fast=f)) for f in (False, True))
            limit, rate = matrix_products(surrogate, len(many))
            difference = surrogate.predict(many, fast=True) / surrogate.predict(many) - 1
            print(f"{exact:>9.0f}{fast:>9.1f}{limit:>7.1f} ({rate:.0f})", end="")
            print(f"{fast / limit:>7.2f}{100 * np.abs(difference).mean():>14.1e}")
        else:
            began = time.perf_counter()
            surrogate.predict(many)
            print(f"{1e3 * (time.perf_counter() - began):>9.0f}")
    print(
        "products: in single precision on one thread (Gflop/s); the paper reports 3.0 ms for 100,000 points"
    )


def coverage() -> None:
    held_out = beam_runs(np.random.default_rng(999).uniform(size=(2500, 5)))
    n_seeds = 6
    print(f"coverage of the 90 % interval, {n_seeds} seeds, two outputs, 1,000 runs: mean (least to most)")
    for name, (kind, options) in INTERVALS.items():
        for design, draw in DESIGNS.items():
            covered = np.array(
                [
                    fit(
                        beam_runs(draw(1000, seed)), kind, validation=held_out, seed=seed, **options
                    ).validation.coverage_90
                    for seed in range(n_seeds)
                ]
            )
            print(
                f"{name:<20}{design:<18}{covered.mean():>7.1%} ({covered.min():.1%} to {covered.max():.1%})",
                flush=True,
            )


def derivatives(data: TrainingData) -> None:
    held_out = data.rows(np.arange(1000, 3500))
    print(f"{'surrogate':<10}{'runs':>6}{'derivatives':>13}{'E(v) %':>10}{'E(w) %':>10}{'fit s':>8}")
    for kind in ("pce", "nn"):
        for n in (100, 400):
            for used in (True, False):
                surrogate = fit(data.rows(np.arange(n)), kind, validation=held_out, derivatives=used)
                text = "".join(f"{100 * e:>10.1e}" for e in surrogate.validation.relative_error)
                print(f"{kind:<10}{n:>6}{'yes' if used else 'no':>13}{text}{surrogate.seconds:>8.2f}")

    def solve(X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        unit = (X - BOUNDS[:, 0]) / (BOUNDS[:, 1] - BOUNDS[:, 0])
        runs = beam_runs(unit, derivatives=True)
        return runs.Y, runs.dY

    for target in TARGETS:
        print(learn(solve, target, bounds=BOUNDS, compare=True, first=20, batch=10))


def field() -> None:
    runs = field_runs(solved(qmc.scale(DESIGNS["sobol"](3500, 1), *BOUNDS.T)), bounds=BOUNDS)
    n_tensions = sum(name.startswith("T_") for name in runs.runs.output_names)
    print(f"{'tolerance':<12}{'modes':>6}{'largest error: coordinate':>27}{'tension':>10}{'fit s':>8}")
    for tolerance in (1e-3, 1e-6, 1e-8):
        surrogate = fit(
            runs.rows(np.arange(1000)),
            "field",
            tolerance=tolerance,
            validation=runs.rows(np.arange(1000, 3500)),
        )
        error = np.array(surrogate.validation.max_abs_error)
        coordinate, tension = error[:-n_tensions].max(), error[-n_tensions:].max()
        n_modes = len(surrogate.model.modes)
        print(f"{tolerance:<12.0e}{n_modes:>6}{coordinate:>27.1e}{tension:>10.1e}{surrogate.seconds:>8.2f}")


def main() -> None:
    what = sys.argv[1] if len(sys.argv) > 1 else "errors"
    if what in {"coverage", "field"}:
        {"coverage": coverage, "field": field}[what]()
        return
    data = beam_runs(DESIGNS["sobol"](3500, 1), derivatives=what == "derivatives")
    derivatives(data) if what == "derivatives" else errors(data)


if __name__ == "__main__":
    main()
