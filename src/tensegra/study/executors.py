"""What carries out the blocks of a campaign: this process, or a cluster of them.

An executor is handed a function and tasks, and yields the results as they come; it neither knows
what the tasks are nor writes anything.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, TypeVar

from tensegra.errors import StudyError

__all__ = ["Executor", "InProcess", "executor_for"]

T = TypeVar("T")
R = TypeVar("R")


class Executor(Protocol):
    """Carries out tasks, in any order, each exactly once as far as the caller can see."""

    @property
    def threads(self) -> int | None:
        """Threads that a task may compute on, or None for one a core."""
        ...

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield ``function(task)`` of every task, in order of completion.

        Tasks are taken as they are needed, so that they need not all exist at once. An exception of
        the function ends the iteration. Closing the iterator early gives up the tasks not yet begun.
        """
        ...


@dataclass(frozen=True)
class InProcess:
    """Carries out the tasks in this process, one after the other, each on all its threads.

    While the caller deals with a result the next task is under way.

    Parameters
    ----------
    threads
        Threads that a task may compute on; one a core if left out.
    """

    threads: int | None = None

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the results in the order of the tasks."""
        pool = ThreadPoolExecutor(1, thread_name_prefix="campaign")
        ahead: Future[R] | None = None
        try:
            for task in tasks:
                following = pool.submit(function, task)
                if ahead is not None:
                    yield ahead.result()
                ahead = following
            if ahead is not None:
                yield ahead.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def executor_for(workers: int = 1, scheduler: str | None = None) -> Executor:
    """Return the executor for a number of workers, or for a scheduler that has its own.

    Parameters
    ----------
    workers
        With 1 this process does the work, on all its threads; with more, as many processes of a local
        Dask cluster.
    scheduler
        Address of a Dask scheduler, such as ``tcp://node7:8786``; `workers` is then its own affair.

    Raises
    ------
    StudyError
        If the number is not positive.
    """
    if workers < 1:
        raise StudyError.at("workers", workers, "a positive number")
    if workers == 1 and scheduler is None:
        return InProcess()
    from tensegra.study.cluster import Dask

    return Dask(workers=workers, scheduler=scheduler)
