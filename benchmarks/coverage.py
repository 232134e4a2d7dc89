"""How often the 95 % intervals of a propagation hold the truth.

    python -m benchmarks.coverage [--repeats 200]

Smooth, lognormal and counted outputs of three random inputs, by Monte Carlo and by randomised quasi-Monte
Carlo. Every truth is a closed form. Printed is the share of repeats (each of its own seed) in which the
interval held; 91 to 99 % of 200 repeats are what an interval of 95 % may show. An output that counts has no
quantile between two numbers, so its interval holds more often.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import stats

from tensegra.analysis import FunctionModel, propagate

INPUTS = {name: {"normal": {"mean": 0, "std": 1}} for name in "abc"}
EVENTS = (3, 10, 100, 1000)
LEVELS = (0.05, 0.5, 0.99)


@dataclass(frozen=True)
class Case:
    """An output of three standard normal inputs, and its law in closed form."""

    name: str
    function: object
    law: object


def counted(n_samples: int) -> Iterator[Case]:
    """Yield outputs that are 1 or 0, and that count 0 to 3, with so many expected events."""
    for events in EVENTS:
        if events <= n_samples / 2:
            share = events / n_samples
            limit = stats.norm.isf(share) * np.sqrt(3)
            yield Case(f"happens, {events}", lambda X, t=limit: X.sum(axis=1) > t, stats.bernoulli(share))
            edge = stats.norm.isf(share / 3)
            yield Case(f"counts, {events}", lambda X, t=edge: (t < X).sum(axis=1), stats.binom(3, share / 3))


SMOOTH = (
    Case("normal", lambda X: X.sum(axis=1), stats.norm(0, np.sqrt(3))),
    Case("uniform", lambda X: stats.norm.cdf(X[:, 0]), stats.uniform()),
    Case("lognormal, 0.3", lambda X: np.exp(0.3 * X.sum(axis=1) / np.sqrt(3)), stats.lognorm(0.3)),
    Case("lognormal, 0.6", lambda X: np.exp(0.6 * X.sum(axis=1) / np.sqrt(3)), stats.lognorm(0.6)),
    Case("lognormal, 1.0", lambda X: np.exp(X.sum(axis=1) / np.sqrt(3)), stats.lognorm(1.0)),
)


def coverage(case: Case, method: str, n_samples: int, repeats: int) -> dict[str, float]:
    """Return the share of repeats in which each statistic's interval held."""
    model = FunctionModel(lambda X: np.asarray(case.function(X), dtype=float), ("a", "b", "c"), ("y",))
    limits = [float(case.law.isf(events / n_samples)) for events in EVENTS if events <= n_samples / 2]
    held: dict[str, list[bool]] = {}
    for seed in range(repeats):
        result = propagate(model, INPUTS, samples=n_samples, method=method, seed=seed)
        summary = result.outputs["y"]
        truths = {"mean": (summary.mean, case.law.mean()), "std": (summary.std, case.law.std())}
        for level in LEVELS:
            truths[f"q {level:g}"] = (summary.quantile(level), float(case.law.ppf(level)))
        for limit, events in zip(limits, EVENTS, strict=False):
            truths[f"P, {events}"] = (summary.exceedance(limit), float(case.law.sf(limit)))
        for name, (found, truth) in truths.items():
            slack = 1e-12 * abs(truth)  # an interval without width holds what it is equal to
            held.setdefault(name, []).append(bool(found.low - slack <= truth <= found.high + slack))
    return {name: float(np.mean(each)) for name, each in held.items()}


def table(repeats: int, sizes: tuple[int, ...]) -> None:
    """Print a row per output, kind of sample and size."""
    for n_samples in sizes:
        names: list[str] = []
        for case in (*SMOOTH, *counted(n_samples)):
            for method in ("monte_carlo", "quasi_monte_carlo"):
                found = coverage(case, method, n_samples, repeats)
                if list(found) != names:
                    names = list(found)
                    print(f"\n{n_samples} samples".ljust(36), *(f"{name:>8}" for name in names))
                cells = (f"{100 * share:8.1f}" for share in found.values())
                print(f"{case.name:16} {method:18}", *cells, flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1024, 8192])
    arguments = parser.parse_args()
    table(arguments.repeats, tuple(arguments.sizes))
