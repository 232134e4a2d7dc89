"""Gradient methods from many starts: what SLSQP and L-BFGS-B share.

All starts run in `lockstep`, so the model sees one batch per round. A formula with kinks is followed through
a series of ever sharper smooth stand-ins (`LEVELS`): Eq. 12 of the source paper, |w|/(|v| + |w|), has its
maximum on its own kink v = 0, where a line search along an exact gradient zigzags and stops anywhere. The
trace and the result always hold the formula as it was written.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.lockstep import lockstep
from tensegra.analysis.problem import Local, Problem, Recorder, Scales

Array = NDArray[np.float64]

# Widths of the smooth stand-ins, relative to the typical size of a kink's argument. At the last one the
# stand-in is nowhere further from the formula than 1e-8 of that size.
LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)
# Of a missed condition against the objective, both in units of their spread over the starts: where starts are
# chosen from, one that nearly holds and is good beats one that holds and is poor.
PENALTY = 3.0


@dataclass(frozen=True)
class Question:
    """A point of the unit cube, and how far the kinks are to be rounded there."""

    z: Array
    smoothing: float

    @property
    def key(self) -> tuple[bytes, float]:
        """What makes two questions the same."""
        return self.z.tobytes(), self.smoothing


@dataclass(frozen=True)
class Finish:
    """Where one start ended in the unit cube, whether its method says that it converged, and its words."""

    z: Array
    converged: bool
    reason: str


class View:
    """One start's view of the problem.

    It remembers the last answer, so that value, slope and margins of a point cost one question.
    """

    def __init__(self, ask: Callable[[Question], Local]) -> None:
        self._ask = ask
        self._key: tuple[bytes, float] | None = None
        self._local: Local
        self.smoothing = 0.0

    def at(self, z: Array) -> Local:
        """Return the scaled problem at `z`."""
        question = Question(np.clip(z, 0.0, 1.0), self.smoothing)
        if question.key != self._key:
            self.remember(question, self._ask(question))
        return self._local

    def remember(self, question: Question, local: Local) -> None:
        """Take the answer to a question as known."""
        self._key, self._local = question.key, local


Descent = Callable[[View, Array, Problem, NDArray[np.bool_]], Finish]


def room(z: Array, frozen: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Return the bounds of a descent: the unit cube, without width where a variable is frozen."""
    return [
        (value, value) if held else (0.0, 1.0)
        for value, held in zip(z.tolist(), frozen.tolist(), strict=True)
    ]


def multistart(
    problem: Problem,
    recorder: Recorder,
    descend: Descent,
    starts: Array,
    *,
    follow: int | None = None,
    frozen: NDArray[np.bool_] | None = None,
    scales: Scales | None = None,
    first_number: int = 0,
) -> tuple[list[Finish], Scales]:
    """Run `descend` from `starts` (n_starts, d) in the unit cube: from each, or from the `follow` best.

    Parameters
    ----------
    problem, recorder, descend, starts, follow
        What is searched, who keeps the evaluations, by which method, and from where.
    frozen
        Which variables keep their values, shape (d,); those without room in any case.
    scales
        Those of an earlier call, else they are measured over the starts.
    first_number
        Number of the first start in the trace.

    Returns
    -------
    finishes, scales
        Where each start that was followed ended, and the scales that all of them worked in.
    """
    X, found, first = recorder.evaluate(starts, range(first_number, first_number + len(starts)))
    scales = problem.scales(first) if scales is None else scales
    still = problem.fixed if frozen is None else problem.fixed | frozen
    levels = LEVELS if problem.has_kinks else (0.0,)
    known = problem.localise(X, found, scales, np.full(len(X), levels[0]))

    def answer(numbers: list[int], questions: list[Question]) -> list[Local]:
        Z = np.array([question.z for question in questions])
        X, found, _ = recorder.evaluate(Z, [first_number + number for number in numbers])
        return problem.localise(X, found, scales, np.array([question.smoothing for question in questions]))

    def program(number: int) -> Callable[[Callable[[Question], Local]], Finish]:
        def run(ask: Callable[[Question], Local]) -> Finish:
            z = starts[number]
            if not np.isfinite(known[number].f):
                return Finish(z, converged=False, reason="the model failed at the starting point")
            if still.all():
                return Finish(z, converged=True, reason="there is one point only")
            view = View(ask)
            view.remember(Question(z, levels[0]), known[number])
            finish = Finish(z, converged=False, reason="")
            for level in levels:
                view.smoothing = level
                finish = descend(view, finish.z, problem, still)
            return finish

        return run

    followed = range(len(starts)) if follow is None else _most_promising(known, follow)

    def answer_numbered(places: list[int], questions: list[Question]) -> list[Local]:
        return answer([followed[place] for place in places], questions)

    return lockstep([program(number) for number in followed], answer_numbered), scales


def _most_promising(known: Sequence[Local], n: int) -> list[int]:
    """Return the numbers of the `n` best starts; to miss a condition by its spread counts as `PENALTY`."""
    merit = [local.f + PENALTY * float(np.maximum(-local.c, 0.0).sum()) for local in known]
    return sorted(np.argsort(merit, kind="stable")[:n].tolist())
