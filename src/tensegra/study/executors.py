"""What carries out the blocks of a campaign: this process, or a pool of them.

An executor is handed a function and tasks, and yields the results as they come; it neither knows
what the tasks are nor writes anything. Another one (a cluster's) needs `map` alone.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from typing import Protocol, TypeVar

from tensegra.errors import StudyError

__all__ = ["Executor", "InProcess", "Processes", "executor_for"]

_THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

T = TypeVar("T")
R = TypeVar("R")


class Executor(Protocol):
    """Carries out tasks, in any order, each exactly once as far as the caller can see."""

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield ``function(task)`` of every task, in order of completion.

        Tasks are taken as they are needed, so that they need not all exist at once. An exception of
        the function ends the iteration. Closing the iterator early gives up the tasks not yet begun.
        """
        ...


@dataclass(frozen=True)
class InProcess:
    """Carries out the tasks in this process, one after the other."""

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the results in the order of the tasks."""
        return map(function, tasks)


@dataclass(frozen=True)
class Processes:
    """Carries out the tasks in processes of their own, each on one thread.

    Functions and tasks are pickled. A pool that breaks because one of its processes was killed is
    built anew, and what was under way is done again; only when that happens repeatedly without any
    result in between is it given up.

    Parameters
    ----------
    workers
        Number of processes.
    """

    workers: int

    MAX_BREAKS = 3
    """Pools in a row that may break without a result."""

    TASKS_AHEAD = 2
    """Tasks handed out for each worker: one to work on, one so that it need not wait."""

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the results in order of completion."""
        remaining = iter(tasks)
        unfinished: list[T] = []
        breaks = 0
        while True:
            pending: dict[Future[R], T] = {}
            pool = self._pool()
            try:
                while True:
                    wanted = self.TASKS_AHEAD * self.workers - len(pending)
                    for task in [
                        *_take(unfinished, wanted),
                        *islice(remaining, max(0, wanted - len(unfinished))),
                    ]:
                        # A pool that has broken refuses the task before there is a future to lose.
                        unfinished.append(task)
                        pending[pool.submit(function, task)] = unfinished.pop()
                    if not pending:
                        return
                    for future in wait(pending, return_when=FIRST_COMPLETED).done:
                        result = future.result()
                        del pending[future]
                        breaks = 0
                        yield result
            except BrokenProcessPool:
                breaks += 1
                if breaks >= self.MAX_BREAKS:
                    raise StudyError(
                        f"{breaks} pools of processes broke in a row: a worker was killed each time, perhaps "
                        "for want of memory. What was finished is stored; run again with fewer workers"
                    ) from None
                unfinished.extend(pending.values())
            finally:
                pool.shutdown(wait=True, cancel_futures=True)

    def _pool(self) -> ProcessPoolExecutor:
        # Spawned, because a process with threads (a BLAS's, JAX's) must not be forked.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.workers, mp_context=context, initializer=_start_worker)


def executor_for(workers: int) -> Executor:
    """Return the executor for a number of workers.

    Raises
    ------
    StudyError
        If the number is not positive.
    """
    if workers < 1:
        raise StudyError.at("workers", workers, "a positive number")
    return InProcess() if workers == 1 else Processes(workers)


def _take(items: list[T], count: int) -> list[T]:
    """Remove up to `count` items from the end of a list and return them."""
    return [items.pop() for _ in range(min(max(count, 0), len(items)))]


def _start_worker() -> None:
    """Prepare a worker: one thread, no reaction to Ctrl-C, no life after the driver's death."""
    # The driver answers Ctrl-C: it lets the blocks under way finish and stores them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_driver, daemon=True).start()

    # For the libraries that are yet to be loaded, then for those that are.
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)
    if "numba" in sys.modules:
        import numba

        numba.set_num_threads(1)


def _die_with_driver() -> None:
    """End this process as soon as the driver is gone; its pool would wait for tasks for ever."""
    driver = multiprocessing.parent_process()
    if driver is not None:
        driver.join()
        os._exit(1)
