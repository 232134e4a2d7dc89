"""The contract of an executor: every task once, results as they come, errors told, nothing left over."""

import math
import os
import signal
import sys
import time
from functools import partial
from itertools import count

import pytest
import worker_tasks

from tensegra.errors import StudyError
from tensegra.study.cluster import Dask
from tensegra.study.executors import InProcess, executor_for

EXECUTORS = ("in_process", "dask")

# What a test waits for another process, at most; it fails sooner or not at all on a sound machine.
PATIENCE = 60


@pytest.fixture(scope="module")
def cluster():
    """Start a real cluster of two processes, as somebody else would have set it up."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster


@pytest.fixture(params=EXECUTORS)
def executor(request):
    if request.param == "in_process":
        return InProcess()
    return Dask(scheduler=request.getfixturevalue("cluster").scheduler_address)


def test_every_task_is_carried_out_once(executor):
    assert sorted(executor.map(math.factorial, range(12))) == [math.factorial(n) for n in range(12)]


def test_without_tasks_there_are_no_results(executor):
    assert list(executor.map(math.factorial, [])) == []


def test_an_exception_of_the_function_ends_the_iteration(executor):
    with pytest.raises(ValueError, match="factorial"):
        list(executor.map(math.factorial, [1, -1, 2]))


def test_tasks_are_taken_as_they_are_needed(executor):
    taken = []
    results = executor.map(worker_tasks.wait_a_little, (taken.append(i) or i for i in count()))
    first = next(results)
    assert first in taken
    # Two tasks ahead for each of two workers.
    assert len(taken) <= 4
    results.close()


def test_what_is_not_begun_is_given_up(executor, tmp_path):
    task = partial(worker_tasks.leave_a_mark, tmp_path)
    results = executor.map(task, range(50))
    next(results)
    results.close()
    time.sleep(0.2)
    n_begun = len(list(tmp_path.iterdir()))
    time.sleep(0.2)
    assert len(list(tmp_path.iterdir())) == n_begun < 10


def test_while_a_result_is_dealt_with_the_next_task_is_under_way(executor, tmp_path):
    task = partial(worker_tasks.leave_a_mark, tmp_path)
    results = executor.map(task, range(3))
    next(results)
    # Nobody asks for the second result; its task is carried out all the same.
    wait_until(lambda: len(list(tmp_path.iterdir())) >= 2)
    assert len(list(results)) == 2
    assert len(list(tmp_path.iterdir())) == 3


def test_a_cluster_of_our_own_lasts_as_long_as_the_work():
    pytest.importorskip("distributed")
    results = Dask(workers=2).map(worker_tasks.process, range(4))
    workers = set(results)
    assert os.getpid() not in workers
    assert 1 <= len(workers) <= 2
    wait_until(lambda: not any(worker_tasks.is_running(worker) for worker in workers))


def test_a_killed_worker_costs_no_task(executor, tmp_path):
    if isinstance(executor, InProcess):
        pytest.skip("there is no other process to kill")
    task = partial(worker_tasks.double_but_die_once, tmp_path / "mark")
    assert sorted(executor.map(task, range(6))) == [0, 2, 4, 6, 8, 10]


def test_runs_that_kill_every_worker_are_given_up():
    pytest.importorskip("distributed")
    with pytest.raises(StudyError, match=r"one worker after another, .* run again to go on"):
        list(Dask(workers=2).map(worker_tasks.die, [0]))


def test_a_cluster_without_workers_is_waited_for_and_then_told():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster:
        executor = Dask(scheduler=cluster.scheduler_address, patience=1.0)
        with pytest.raises(StudyError, match="no worker has been there for 1 s"):
            list(executor.map(math.factorial, [1]))


def test_where_no_scheduler_is_it_is_told():
    pytest.importorskip("distributed")
    with pytest.raises(StudyError, match=r"tcp://127.0.0.1:9: no Dask scheduler answers"):
        list(Dask(scheduler="tcp://127.0.0.1:9", patience=1.0).map(math.factorial, [1]))


@pytest.mark.parametrize("address", ["nowhere", "tcp://127.0.0.1", "smoke://127.0.0.1:80"])
def test_an_address_that_cannot_be_is_told(address):
    pytest.importorskip("distributed")
    with pytest.raises(StudyError, match="expected the address of a Dask scheduler"):
        list(Dask(scheduler=address, patience=1.0).map(math.factorial, [1]))


def test_a_scheduler_that_dies_is_told(tmp_path):
    pytest.importorskip("distributed")
    with worker_tasks.scheduler_and_worker(tmp_path) as (address, scheduler):
        results = Dask(scheduler=address, patience=60.0).map(worker_tasks.wait_a_little, count())
        next(results)
        os.kill(scheduler.pid, signal.SIGKILL)
        with pytest.raises(StudyError, match=r"the scheduler is gone.* run again to go on"):
            list(results)


def test_a_worker_with_other_code_is_refused(cluster, monkeypatch):
    monkeypatch.setattr("tensegra.study.cluster.digest_of_code", lambda: "0" * 64)
    with pytest.raises(StudyError, match=r"worker tcp://.*has another code of tensegra than the driver"):
        list(Dask(scheduler=cluster.scheduler_address).map(math.factorial, [1]))


def test_without_dask_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r"pip install 'tensegra\[dask\]'"):
        list(executor_for(2).map(math.factorial, [1]))


def test_what_works_where():
    assert executor_for(1) == executor_for() == InProcess()
    assert executor_for(3) == Dask(workers=3)
    assert executor_for(1, "tcp://node7:8786") == Dask(workers=1, scheduler="tcp://node7:8786")
    assert (InProcess().threads, executor_for(3).threads) == (None, 1)
    with pytest.raises(StudyError, match="workers: found 0, expected a positive number"):
        executor_for(0)


def wait_until(condition):
    for _ in range(PATIENCE * 50):
        if condition():
            return
        time.sleep(0.02)
    pytest.fail("waited too long for another process")
