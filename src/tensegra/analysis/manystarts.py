"""A gradient method from many starts, over variables that may be discrete."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.discrete import MOST_COMBINATIONS
from tensegra.analysis.multistart import Descent, Finish, multistart
from tensegra.analysis.problem import FEASIBLE, Problem, Recorder, Scales

Array = NDArray[np.float64]

# Starts of `direct` that are followed to their end, the best of all that were tried: a start takes some
# dozens of solutions of the structure.
N_FOLLOWED = 12
# Starts that every combination of discrete values has at least, where something else is left to search.
FEWEST_STARTS = 3
# Relaxed ends whose neighbouring combinations are tried, and rounds in which the best of them moves on.
N_RELAXED, MOST_ROUNDS = 4, 30


@dataclass(frozen=True)
class Ends:
    """How the starts of a search ended (a method without starts has one), and its scales.

    Attributes
    ----------
    scales
        Those that all starts worked in.
    converged, reasons
        What the method says of each start.
    z
        Where each ended in the unit cube, (n, d); None for a method without starts.
    """

    scales: Scales
    converged: NDArray[np.bool_]
    reasons: tuple[str, ...]
    z: Array | None = None

    @classmethod
    def of(cls, finishes: list[Finish], scales: Scales) -> "Ends":
        """Gather the ends of several starts."""
        return cls(
            scales,
            np.array([finish.converged for finish in finishes]),
            tuple(finish.reason for finish in finishes),
            np.array([finish.z for finish in finishes]),
        )

    def commonest_failure(self) -> str:
        """Return what most of the starts that did not converge say."""
        pairs = zip(self.reasons, self.converged.tolist(), strict=True)
        told = Counter(reason for reason, converged in pairs if not converged)
        return told.most_common(1)[0][0] if told else ""


def many_starts(problem: Problem, recorder: Recorder, method: str, starts: int, seed: int) -> Ends:
    """Search from a Latin hypercube of starts, in the combinations of discrete values that promise."""
    from scipy.stats import qmc

    from tensegra.analysis import bfgs, slsqp

    rng = np.random.default_rng(seed)
    descend: Descent = {"slsqp": slsqp.descend, "bfgs": bfgs.descend, "direct": slsqp.descend}[method]
    follow = N_FOLLOWED if method == "direct" else None
    levels = problem.levels
    sampler = qmc.LatinHypercube(problem.n_inputs, rng=rng)
    if not levels.mask.any() or levels.n_combinations > MOST_COMBINATIONS:
        finishes, scales = multistart(problem, recorder, descend, sampler.random(starts), follow=follow)
        if levels.mask.any():
            finishes = _branch(problem, recorder, descend, finishes, scales, starts)
        return Ends.of(finishes, scales)
    combinations = levels.combinations()
    each = max(-(-starts // len(combinations)), FEWEST_STARTS)
    if (levels.mask | problem.fixed).all():
        each = 1
    Z = sampler.random(each * len(combinations))
    chosen = np.repeat(combinations, each, axis=0)
    Z = np.where(np.isnan(chosen), Z, chosen)
    finishes, scales = multistart(problem, recorder, descend, Z, follow=follow, frozen=levels.mask)
    return Ends.of(finishes, scales)


def _branch(
    problem: Problem, recorder: Recorder, descend: Descent, relaxed: list[Finish], scales: Scales, number: int
) -> list[Finish]:
    """Round the best relaxed ends both ways, search on in what is left, and move on from the best."""
    levels = problem.levels
    tried: set[bytes] = set()
    finishes: list[Finish] = []

    def follow(points: Array) -> None:
        nonlocal number
        new = [z for z in points if _key(problem, z) not in tried]
        if not new:
            return
        tried.update(_key(problem, z) for z in new)
        found, _ = multistart(
            problem, recorder, descend, np.array(new), frozen=levels.mask, scales=scales, first_number=number
        )
        finishes.extend(found)
        number += len(new)

    order = np.argsort([_merit(problem, finish.z, scales) for finish in relaxed], kind="stable")
    follow(np.concatenate([levels.around(relaxed[i].z) for i in order[:N_RELAXED]]))
    best, lowest = _best(problem, finishes, scales)
    for _ in range(MOST_ROUNDS):
        follow(levels.beside(best.z))
        found, merit = _best(problem, finishes, scales)
        if merit >= lowest:
            break
        best, lowest = found, merit
    return finishes


def _key(problem: Problem, z: Array) -> bytes:
    return np.round(z[problem.levels.mask], 9).tobytes()


def _best(problem: Problem, finishes: list[Finish], scales: Scales) -> tuple[Finish, float]:
    merits = [_merit(problem, finish.z, scales) for finish in finishes]
    place = int(np.argmin(merits))
    return finishes[place], merits[place]


def _merit(problem: Problem, z: Array, scales: Scales) -> float:
    """Return the scaled objective of an end, less being better; a missed condition comes last."""
    X = problem.from_unit(z[None])
    found = problem.assess(X, problem.model.evaluate(X))
    sign = -1.0 if problem.maximise else 1.0
    value = sign * float(found.objective[0]) / scales.objective
    missed = float(problem.violation(found.margins, scales)[0])
    if not np.isfinite(value):
        return np.inf
    return value if missed <= FEASIBLE else 1e12 * (1.0 + missed)
