"""Timing on a machine that others use too: interleaved repetitions, ratios, best and median."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tensegra.mechanics.arrays import FloatArray

__all__ = [
    "REFERENCE",
    "Spread",
    "Stopwatch",
    "Timed",
    "blas_in_words",
    "cholesky_seconds",
    "exponent",
    "interleaved",
    "n_cores",
    "one_blas_thread",
]

REFERENCE = "dpotrf(60)"
"""What times are divided by: LAPACK's Cholesky factorisation of as many unknowns as the beam has."""

REFERENCE_ORDER = 60
REFERENCE_CALLS = 200
"""Factorisations of which the median is one measurement: about as long as a glance away of the machine."""


@dataclass(frozen=True)
class Spread:
    """Several measurements of one quantity.

    Attributes
    ----------
    best, median, worst
        Smallest, middle and largest of them.
    repeats
        How many there are.
    """

    best: float
    median: float
    worst: float
    repeats: int

    @classmethod
    def of(cls, values: Iterable[float]) -> "Spread":
        """Summarise measurements.

        Examples
        --------
        >>> Spread.of([3.0, 1.0, 2.0])
        Spread(best=1.0, median=2.0, worst=3.0, repeats=3)
        """
        found = np.sort(np.fromiter(values, dtype=np.float64))
        return cls(float(found[0]), float(np.median(found)), float(found[-1]), len(found))


class Stopwatch:
    """Wall-clock and processor time from its making on.

    On a machine that is shared, processor time is what the work costs; wall-clock time is what is left
    of the machine. Waiting costs no processor time.
    """

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    @property
    def wall(self) -> float:
        """Seconds on the clock."""
        return time.perf_counter() - self._wall

    @property
    def cpu(self) -> float:
        """Seconds of all threads of this process on a processor."""
        return time.process_time() - self._cpu


@dataclass(frozen=True, eq=False)
class Timed:
    """Repetitions of some works, each done once in every round.

    Attributes
    ----------
    wall, cpu
        Wall-clock and processor time of every work, ``(repeats,)`` each.
    reference
        Time of the reference in every round, ``(repeats,)``: the mean of before and after.
    """

    wall: Mapping[str, FloatArray]
    cpu: Mapping[str, FloatArray]
    reference: FloatArray

    def ratio(self, name: str, per: int = 1, to: str | None = None) -> Spread:
        """Return the processor time of a work over that of the reference, or of another work, by rounds."""
        other = self.reference if to is None else self.cpu[to]
        return Spread.of(self.cpu[name] / per / other)


def interleaved(
    works: Mapping[str, Callable[[], object]],
    repeats: int,
    *,
    tell: Callable[[int], object] = lambda _done: None,
) -> Timed:
    """Time works one after the other, in rounds: what slows the machine down for a while slows all.

    Parameters
    ----------
    works
        Functions by name; each is called once beforehand, so that nothing is timed that happens once.
    repeats
        Rounds.
    tell
        Called with the number of rounds done.
    """
    for work in works.values():
        work()
    wall: dict[str, list[float]] = {name: [] for name in works}
    cpu: dict[str, list[float]] = {name: [] for name in works}
    reference = []
    with one_blas_thread():
        for repeat in range(repeats):
            before = cholesky_seconds()
            for name, work in works.items():
                watch = Stopwatch()
                work()
                wall[name].append(watch.wall)
                cpu[name].append(watch.cpu)
            reference.append(0.5 * (before + cholesky_seconds()))
            tell(repeat + 1)
    return Timed(_arrays(wall), _arrays(cpu), np.array(reference))


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS to one thread: its idle threads would go on using a processor for a while."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        yield


def _arrays(lists: Mapping[str, list[float]]) -> dict[str, FloatArray]:
    return {name: np.array(values) for name, values in lists.items()}


def cholesky_seconds(order: int = REFERENCE_ORDER, calls: int = REFERENCE_CALLS) -> float:
    """Return the median wall-clock time of one LAPACK ``dpotrf`` on one thread, called from SciPy.

    One call is too short to be interrupted but rarely, so that the median is its processor time.
    The matrix is positive definite and stored by columns, so that nothing is copied in the call.
    """
    from scipy.linalg.lapack import dpotrf

    random = np.random.default_rng(0).standard_normal((order, order))
    matrix = np.asfortranarray(random @ random.T + order * np.eye(order))
    seconds = np.empty(calls)
    with one_blas_thread():
        for call in range(calls):
            work = matrix.copy(order="F")
            began = time.perf_counter()
            dpotrf(work, lower=1, clean=0, overwrite_a=1)
            seconds[call] = time.perf_counter() - began
    return float(np.median(seconds))


def blas_in_words() -> str:
    """Name the library behind SciPy's LAPACK and the kernel that it chose for this processor."""
    import scipy.linalg.lapack  # noqa: F401 - loads the library
    from threadpoolctl import threadpool_info

    libraries = [library for library in threadpool_info() if library["user_api"] == "blas"]
    of_scipy = [library for library in libraries if "scipy" in Path(library["filepath"]).parent.name]
    for library in of_scipy or libraries:
        kernel = library.get("architecture")
        return f"{library['internal_api']} {library['version']}" + (f", kernel {kernel}" if kernel else "")
    return "unknown"


def exponent(sizes: Iterable[float], seconds: Iterable[float]) -> float:
    """Fit the power of the size with which the time grows, by least squares of the logarithms.

    Examples
    --------
    >>> round(exponent([1, 10, 100], [2.0, 20.0, 200.0]), 3)
    1.0
    """
    x, y = np.log(np.fromiter(sizes, np.float64)), np.log(np.fromiter(seconds, np.float64))
    return float(np.polyfit(x, y, 1)[0]) if len(x) > 1 else float("nan")


def n_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
