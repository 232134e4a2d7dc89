"""Run many optimisers side by side, and answer all their questions in one batch.

A multi-start search is hundreds of independent sequential programs, each asking for one point at a time,
while a surrogate (or the solver's lanes) answers two hundred points almost as fast as one. Each program runs
in a thread of its own as a coroutine: exactly one thread runs at any moment, the others wait. When all live
programs have asked, their questions are answered together, in the order of the programs. So nothing depends
on timing, and the programs may be any code that calls a function, such as `scipy.optimize.minimize`.
"""

import threading
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

Question = TypeVar("Question")
Answer = TypeVar("Answer")
Result = TypeVar("Result")

# Threads alive at a time; a few hundred cost only their (mostly untouched) stacks.
MAX_THREADS = 256


class _Cancelled(BaseException):
    """Unwinds a program that waits for an answer which will not come."""


class _Coroutine(Generic[Question, Answer, Result]):
    def __init__(self, program: Callable[[Callable[[Question], Answer]], Result], number: int) -> None:
        self.program, self.number = program, number
        self.question: Question
        self.answer: Answer
        self.result: Result
        self.error: BaseException | None = None
        self.done = self.cancelled = False
        self._go, self._pause = threading.Semaphore(0), threading.Semaphore(0)
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def resume(self) -> None:
        """Let the program run until it asks or ends; an error of its own comes out here."""
        self._go.release()
        self._pause.acquire()
        if self.done:
            self._thread.join()
        if self.error is not None:
            raise self.error

    def cancel(self) -> None:
        if not self.done and self._thread.is_alive():
            self.cancelled = True
            self._go.release()
            self._thread.join()

    def ask(self, question: Question) -> Answer:
        self.question = question
        self._pause.release()
        self._go.acquire()
        if self.cancelled:
            raise _Cancelled
        return self.answer

    def _run(self) -> None:
        self._go.acquire()
        try:
            if not self.cancelled:
                self.result = self.program(self.ask)
        except _Cancelled:
            pass
        except BaseException as error:  # noqa: BLE001 - raised again in the caller's thread
            self.error = error
        self.done = True
        self._pause.release()


def lockstep(
    programs: Sequence[Callable[[Callable[[Question], Answer]], Result]],
    answer: Callable[[list[int], list[Question]], Sequence[Answer]],
) -> list[Result]:
    """Run `programs` side by side and return their results.

    Parameters
    ----------
    programs
        Each is called with a function `ask`, which takes a question and returns its answer.
    answer
        Called with the numbers of the programs that asked and their questions; returns the answers in that
        order.

    Examples
    --------
    >>> programs = [lambda ask, n=n: ask(n) + ask(10 * n) for n in (1, 2)]
    >>> lockstep(programs, lambda numbers, questions: [question + 1 for question in questions])
    [13, 24]
    """
    results: list[Result] = []
    for first in range(0, len(programs), MAX_THREADS):
        wave = [
            _Coroutine(program, number)
            for number, program in enumerate(programs[first : first + MAX_THREADS], start=first)
        ]
        try:
            _serve(wave, answer)
        finally:
            for coroutine in wave:
                coroutine.cancel()
        results += [coroutine.result for coroutine in wave]
    return results


def _serve(
    wave: Sequence[_Coroutine[Question, Answer, Result]],
    answer: Callable[[list[int], list[Question]], Sequence[Answer]],
) -> None:
    for coroutine in wave:
        coroutine.start()
    live = list(wave)
    while live:
        for coroutine in live:
            coroutine.resume()
        live = [coroutine for coroutine in live if not coroutine.done]
        if live:
            answers = answer([c.number for c in live], [c.question for c in live])
            for coroutine, reply in zip(live, answers, strict=True):
                coroutine.answer = reply
