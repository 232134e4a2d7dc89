"""Quantiles of a stream: ours beside the sketches of libraries.

    pip install datasketches ddsketch fastdigest
    python -m benchmarks.sketches [number of values, 1000000]

Blocks of 4,096 values, as a propagation takes them in, of three laws. Printed are the nanoseconds of a value,
the largest error in rank over the levels 0.0001 to 0.9999 (the share of all values between the answer and the
true quantile), and whether a program says within which bounds a quantile lies, and whether it must.
"""

import importlib.util
import sys
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.sketch import Sketch

BLOCK = 4096
LEVELS = np.array([1e-4, 1e-3, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999, 0.9999])
Array = NDArray[np.float64]
Quantiles = Callable[[Array], list[float]]
LAWS: dict[str, Callable[[np.random.Generator, int], Array]] = {
    "normal": lambda rng, n: rng.normal(50.0, 2.0, n),
    "lognormal, two": lambda rng, n: rng.lognormal(0.0, 2.0, n),
    "two clouds": lambda rng, n: np.where(
        rng.random(n) < 0.16, rng.normal(-40, 0.1, n), rng.normal(50, 0.1, n)
    ),
}


def ours(blocks: list[Array]) -> Quantiles:
    sketch = Sketch()
    for block in blocks:
        sketch.add(block)
    return lambda levels: [sketch.quantile(level) for level in levels]


def kll(blocks: list[Array]) -> Quantiles:
    from datasketches import kll_doubles_sketch

    sketch = kll_doubles_sketch(200)
    for block in blocks:
        sketch.update(block)
    return lambda levels: [sketch.get_quantile(level) for level in levels]


def tdigest(blocks: list[Array]) -> Quantiles:
    from datasketches import tdigest_double

    sketch = tdigest_double(200)
    for block in blocks:
        sketch.update(block)
    return lambda levels: [sketch.get_quantile(level) for level in levels]


def ddsketch(blocks: list[Array]) -> Quantiles:
    from ddsketch import DDSketch

    sketch = DDSketch(relative_accuracy=1e-3)
    for block in blocks:
        for value in block.tolist():
            sketch.add(value)
    return lambda levels: [sketch.get_quantile_value(level) for level in levels]


def fastdigest(blocks: list[Array]) -> Quantiles:
    from fastdigest import TDigest

    sketch = TDigest()
    for block in blocks:
        sketch.batch_update(block.tolist())
    return lambda levels: [sketch.quantile(level) for level in levels]


PROGRAMS = {
    "ours": (ours, "numpy", "yes, certain"),
    "KLL (datasketches)": (kll, "datasketches", "yes, likely"),
    "t-digest (datasketches)": (tdigest, "datasketches", "no"),
    "t-digest (fastdigest)": (fastdigest, "fastdigest", "no"),
    "DDSketch": (ddsketch, "ddsketch", "of the value, certain"),
}


def rank_error(ordered: Array, levels: Array, answers: list[float]) -> float:
    """Return the largest share of values between an answer and what is asked for."""
    low = np.searchsorted(ordered, answers, side="left") / len(ordered)
    high = np.searchsorted(ordered, answers, side="right") / len(ordered)
    return float(np.max(np.maximum(np.maximum(low - levels, levels - high), 0.0)))


def main(n: int) -> None:
    print("| law | program | ns a value | largest error of a rank | bounds |")
    print("| --- | --- | ---: | ---: | --- |")
    for law, draw in LAWS.items():
        values = draw(np.random.default_rng(0), n)
        blocks, ordered = np.split(values, range(BLOCK, n, BLOCK)), np.sort(values)
        for name, (program, package, bounds) in PROGRAMS.items():
            if importlib.util.find_spec(package) is None:
                continue
            program(blocks[:2])([0.5])
            began = time.process_time()
            answers = program(blocks)(LEVELS)
            spent = 1e9 * (time.process_time() - began) / n
            error = rank_error(ordered, LEVELS, answers)
            print(f"| {law} | {name} | {spent:.0f} | {error:.1e} | {bounds} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
