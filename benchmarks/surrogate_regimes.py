"""A surrogate that knows where not to answer: the beam over [0, 30] % of three actuators, without gravity.

    python -m benchmarks.surrogate_regimes [number of runs, 100000] [folder to keep the solved runs in]

About 80 % of the designs keep all cables taut, some have slack cables, 16 % collapse. 8,192 further designs
are held out.
"""

import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from tensegra.mechanics import solve_batch
from tensegra.structure import apply_changes, library
from tensegra.surrogate import RegimeData, fit, regime_labels

ACTUATORS = ("A1", "A23", "A4")
LARGEST = 0.3
N_HELD_OUT = 8192


def runs(n: int, seed: int, folder: Path | None) -> RegimeData:
    kept = None if folder is None else folder / f"regimes_{n}_{seed}.npz"
    if kept is not None and kept.exists():
        stored = np.load(kept)
        X, w, labels = stored["X"], stored["w"], stored["labels"]
    else:
        began = time.perf_counter(), time.process_time()
        X = LARGEST * qmc.Sobol(3, seed=seed).random_base2(int(np.ceil(np.log2(n))))[:n]
        beam = apply_changes(library.paper_beam(), {"gravity": [0, 0, 0]})
        batch = solve_batch(beam, actuation=dict(zip(ACTUATORS, X.T, strict=True)))
        w, labels = batch.displacement("z", nodes=["18", "23"]), regime_labels(batch)
        wall, processor = time.perf_counter() - began[0], time.process_time() - began[1]
        print(f"{n} runs solved in {wall:.0f} s ({processor:.0f} s of processor time)")
        if kept is not None:
            np.savez(kept, X=X, w=w, labels=labels)
    bounds = [[0, LARGEST]] * 3
    return RegimeData.of(X, w, labels, bounds=bounds, input_names=ACTUATORS, output_names=("w",))


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    data, held_out = runs(n, 5, folder), runs(N_HELD_OUT, 77, folder)
    print(data)
    surrogate = fit(data, "piecewise", validation=held_out)
    print(surrogate)
    print(
        f"trained in {surrogate.seconds:.0f} s; pieces: {', '.join(p.kind for p in surrogate.model.pieces)}"
    )

    Y = surrogate.predict(held_out.runs.X)
    true, said = held_out.runs.Y[:, 0], Y[:, 0]
    error, answered = np.abs(said - true), np.isfinite(said)
    for name in np.unique(held_out.regimes):
        mine = (held_out.regimes == name) & answered
        print(
            f"{name:<10} mean |error| / mean |w| {100 * error[mine].mean() / np.abs(true[mine]).mean():.1e} %"
        )
    print(f"standing   mean |error| / mean |w| {100 * surrogate.validation.error:.1e} %")
    print(f"of the designs that stand {answered.mean():.3%} are answered")
    print(f"outcome right for {surrogate.validation.outcome_right:.2%} of the held-out designs")
    certain = surrogate.outcome(held_out.X).max(axis=1)
    right = surrogate.predict(held_out.X, return_regime=True)[1] == held_out.labels
    for low, high in ((0.0, 0.9), (0.9, 0.99), (0.99, 1.01)):
        these = (certain >= low) & (certain < high)
        if these.any():
            print(
                f"{np.count_nonzero(these):>6} designs with an outcome {low:.0%} to {min(high, 1):.0%} sure: "
                f"right for {right[these].mean():.1%}, expected for {certain[these].mean():.1%}"
            )


if __name__ == "__main__":
    main()
