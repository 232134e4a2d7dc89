import threading

import pytest

from tensegra.analysis import lockstep as module
from tensegra.analysis.lockstep import lockstep


def test_all_that_ask_are_answered_in_one_batch():
    batches = []

    def answer(numbers, questions):
        batches.append((numbers, questions))
        return [10 * q for q in questions]

    def program(n):
        return lambda ask: [ask(n + i) for i in range(n)]

    assert lockstep([program(n) for n in range(4)], answer) == [[], [10], [20, 30], [30, 40, 50]]
    assert batches == [([1, 2, 3], [1, 2, 3]), ([2, 3], [3, 4]), ([3], [5])]


def test_only_one_program_runs_at_a_time():
    running = threading.Lock()

    def program(ask):
        for _ in range(5):
            assert running.acquire(blocking=False)
            running.release()
            ask(0)
        return True

    assert all(lockstep([program] * 20, lambda _, questions: questions))


def test_more_programs_than_threads_go_in_waves(monkeypatch):
    monkeypatch.setattr(module, "MAX_THREADS", 3)
    sizes = []

    def answer(numbers, questions):
        sizes.append(len(numbers))
        return questions

    assert lockstep([lambda ask, n=n: ask(n) for n in range(7)], answer) == list(range(7))
    assert sizes == [3, 3, 1]


@pytest.mark.parametrize("where", ["program", "answer"])
def test_an_error_comes_out_and_leaves_no_thread_behind(where):
    before = threading.active_count()

    def program(ask):
        ask(1)
        if where == "program":
            raise ZeroDivisionError
        return ask(2)

    def answer(_, questions):
        if where == "answer":
            raise ZeroDivisionError
        return questions

    with pytest.raises(ZeroDivisionError):
        lockstep([program] * 5, answer)
    assert threading.active_count() == before


def test_nothing_to_run_is_nothing():
    assert lockstep([], lambda *_: []) == []
