"""The contract of an executor: every task once, results as they come, errors told, nothing left over."""

import math
import multiprocessing
from functools import partial
from itertools import count

import pytest

from tensegra.errors import StudyError
from tensegra.study.executors import InProcess, Processes, executor_for

EXECUTORS = {"in process": InProcess(), "processes": Processes(2)}


@pytest.fixture(params=EXECUTORS, ids=lambda name: name.replace(" ", "_"))
def executor(request):
    return EXECUTORS[request.param]


def test_every_task_is_carried_out_once(executor):
    assert sorted(executor.map(math.factorial, range(12))) == [math.factorial(n) for n in range(12)]


def test_without_tasks_there_are_no_results(executor):
    assert list(executor.map(math.factorial, [])) == []


def test_an_exception_of_the_function_ends_the_iteration(executor):
    with pytest.raises(ValueError, match="factorial"):
        list(executor.map(math.factorial, [1, -1, 2]))


def test_tasks_are_taken_as_they_are_needed_and_nothing_is_left_running(executor):
    taken = []
    results = executor.map(math.factorial, (taken.append(i) or i for i in count()))
    assert next(results) == 1
    # Two tasks ahead for each of two workers, and those that finished while we waited.
    assert len(taken) <= 8
    del results
    assert multiprocessing.active_children() == []


def test_a_worker_computes_on_one_thread():
    import worker_tasks

    assert list(Processes(1).map(worker_tasks.threads, [0])) == [{1}]


def test_a_killed_worker_costs_no_task(tmp_path):
    import worker_tasks

    task = partial(worker_tasks.double_but_die_once, tmp_path / "mark")
    assert sorted(Processes(2).map(task, range(6))) == [0, 2, 4, 6, 8, 10]


def test_workers_that_are_killed_again_and_again_are_given_up():
    import worker_tasks

    with pytest.raises(StudyError, match="run again with fewer workers"):
        list(Processes(1).map(worker_tasks.die, [0]))


def test_one_worker_needs_no_process_of_its_own():
    assert executor_for(1) == InProcess()
    assert executor_for(3) == Processes(3)
    with pytest.raises(StudyError, match="workers: found 0, expected a positive number"):
        executor_for(0)
