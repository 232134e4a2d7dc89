"""A Dask cluster as an executor: a scheduler that is there, or processes of this machine.

The only place that imports Dask, which comes with the extra ``dask``.
"""

import signal
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import islice
from queue import Empty, SimpleQueue
from time import monotonic
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from tensegra.errors import StudyError
from tensegra.study.code import digest_of_code
from tensegra.study.scheduler import quiet_logs, require_address, require_scheduler

if TYPE_CHECKING:
    from distributed import Client, Future

__all__ = ["Dask"]

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Dask:
    """Carries out tasks on a Dask cluster, each on one thread.

    What a lost worker had under way is done again by another; Dask gives a task up that has taken
    several workers with it.

    Parameters
    ----------
    workers
        Number of processes of a local cluster, which lasts as long as the work.
    scheduler
        Address of a scheduler, such as ``tcp://node7:8786``, instead of a local cluster.
    patience
        Seconds to wait for a scheduler, and for a worker where there is none.
    """

    workers: int = 2
    scheduler: str | None = None
    patience: float = 60.0

    threads: ClassVar[int] = 1

    TASKS_AHEAD: ClassVar[int] = 2
    """Tasks handed out for each thread of the workers: one to work on, one so that it need not wait."""

    POLL: ClassVar[float] = 0.5
    """Seconds between two looks at who works, when no result comes."""

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the results in order of completion."""
        with quiet_logs(), self._client() as client:
            remaining = iter(tasks)
            known: set[str] = set()
            done: SimpleQueue[Future] = SimpleQueue()
            pending: dict[str, Future] = {}
            last_seen = monotonic()
            try:
                while True:
                    slots = self._slots(client, known)
                    last_seen = monotonic() if slots else last_seen
                    for task in islice(remaining, max(0, self.TASKS_AHEAD * max(1, slots) - len(pending))):
                        future = client.submit(_carry_out, function, task, digest_of_code(), pure=False)
                        pending[future.key] = future
                        future.add_done_callback(done.put)
                    if not pending:
                        return
                    for future in _finished(done, self.POLL):
                        del pending[future.key]
                        with self._explained():
                            result: R = future.result()
                        yield result
                    if monotonic() - last_seen > self.patience:
                        raise StudyError(
                            f"{self._place}: no worker has been there for {self.patience:g} s{_SAFE}"
                        )
            finally:
                _give_up(client, list(pending.values()))

    def __post_init__(self) -> None:
        if self.scheduler is not None:
            require_address(self.scheduler)

    @property
    def _place(self) -> str:
        return self.scheduler or "local Dask cluster"

    @contextmanager
    def _client(self) -> "Iterator[Client]":
        """Connect to the scheduler, or start a local cluster for as long as the context lasts."""
        try:
            from distributed import Client, LocalCluster
        except ImportError:
            raise StudyError(
                "several workers, or a scheduler, need Dask: pip install 'tensegra[dask]'; "
                "without them this process works on all its threads"
            ) from None
        with ExitStack() as stack:
            address: Any = self.scheduler
            if self.scheduler is None:
                scratch = stack.enter_context(tempfile.TemporaryDirectory(prefix="tensegra-"))
                # The page of the cluster is for this machine, on whatever port is free.
                with _ctrl_c_not_inherited():
                    cluster = LocalCluster(
                        n_workers=self.workers,
                        threads_per_worker=1,
                        host="127.0.0.1",
                        dashboard_address="127.0.0.1:0",
                        local_directory=scratch,
                    )
                address = stack.enter_context(cluster)
            if self.scheduler is not None:
                require_scheduler(self.scheduler, self.patience)
            try:
                client = Client(address, timeout=self.patience, set_as_default=False)
            except (OSError, ValueError, TypeError, RuntimeError) as error:
                raise StudyError(f"{self._place}: no Dask scheduler answers ({error})") from None
            yield stack.enter_context(client)

    def _slots(self, client: "Client", known: set[str]) -> int:
        """Return the number of threads that work, 0 while there is none, after a look at new workers.

        `known` holds the workers that have been looked at, and is added to.
        """
        try:
            threads: dict[str, int] = client.nthreads()
            self._require_same_code(client, sorted(threads.keys() - known))
        except OSError:
            raise StudyError(f"{self._place}: the scheduler is gone{_SAFE}") from None
        known.update(threads)
        return sum(threads.values())

    def _require_same_code(self, client: "Client", workers: list[str]) -> None:
        """Refuse workers that lack the package, or have another one.

        What is asked is a text, for a worker without the package cannot be handed a function of it.
        """
        if not workers:
            return
        answers = client.run(eval, _QUESTION, workers=workers, on_error="return")
        for worker, answer in answers.items():
            if isinstance(answer, ImportError | AttributeError):
                raise StudyError(f"worker {worker}: cannot import this version of tensegra ({answer}){_SAFE}")
            # A worker that is gone by now has no answer, and is no matter.
            if isinstance(answer, str) and answer != digest_of_code():
                raise StudyError(f"worker {worker}: {_OTHER_CODE}{_SAFE}")

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Say what the loss of workers, or of the scheduler, means."""
        from concurrent.futures import CancelledError

        from distributed.scheduler import KilledWorker

        try:
            yield
        except KilledWorker:
            raise StudyError(
                f"{self._place}: the same runs have ended one worker after another, perhaps for want of "
                f"memory{_SAFE} with fewer workers"
            ) from None
        except ImportError as error:
            raise StudyError(
                f"{self._place}: a worker cannot import what it needs ({error}){_SAFE}"
            ) from None
        except (CancelledError, OSError) as error:
            raise StudyError(f"{self._place}: the scheduler is gone ({error}){_SAFE}") from None


_SAFE = ". What was finished is stored; run again to go on"


_QUESTION = "__import__('tensegra.study.code', fromlist=['code']).digest_of_code()"

_OTHER_CODE = "has another code of tensegra than the driver, expected the same files on both"


def _carry_out(function: Callable[[T], R], task: T, digest: str) -> R:
    """Do a task on a worker, if the worker would do it as the driver does."""
    if digest_of_code() != digest:
        raise StudyError(f"a worker {_OTHER_CODE}")
    return function(task)


def _finished(done: "SimpleQueue[Future]", patience: float) -> "Iterator[Future]":
    """Yield the futures that are done, after waiting for the first of them for some seconds."""
    try:
        yield done.get(timeout=patience)
        while True:
            yield done.get_nowait()
    except Empty:
        return


def _give_up(client: "Client", futures: "list[Future]") -> None:
    """Withdraw what is not finished, where there is still somebody to withdraw it from."""
    if futures and client.status == "running":
        client.cancel(futures, force=True)


@contextmanager
def _ctrl_c_not_inherited() -> Iterator[None]:
    """Let the processes that start meanwhile ignore Ctrl-C, which is the driver's to answer."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
