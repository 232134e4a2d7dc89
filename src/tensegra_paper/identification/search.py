"""The search: starts by chance, descents from the best, then the self-stress, on which counts depend."""

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.candidate import AREAS, N_SHAPE, Candidate, reference
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.local import Descent, cost_of, descend
from tensegra_paper.identification.records import EDGE, FAR, NEAR, Records, misses
from tensegra_paper.identification.responses import Effort
from tensegra_paper.identification.starts import random_candidate

__all__ = ["Plan", "Result", "search"]

Array: TypeAlias = NDArray[np.float64]

PROMISING = 60.0
"""Cost of the small actuations up to which the large ones are solved too: the best fifth that stands."""


THINNER = (60.0, 25.0, 12.0, 6.0, 4.0, 2.55)
"""Areas on the way from the printed strut to the other, cm²; only the last is a beam of the family."""

STRESS_FACTOR = 1.35
"""Between two values of the base self-stress."""

SPOILT = 8.0
"""Cost of the small and the nominal actuations from which a beam is not followed further."""


@dataclass(frozen=True)
class Plan:
    """How long the search looks.

    Attributes
    ----------
    seed
        Of all chance.
    n_starts
        Beams by chance.
    n_far
        Best of them that are asked everything.
    n_descents, per_layout
        Of the best of them that are followed to the nearest beam that misses less, and how many of one
        layout, strut area and support.
    n_refined, n_levels
        Best of these that are followed up their self-stress, by how many values, with both struts.
    n_front
        Trials for each pair of findings that may exclude each other.
    """

    seed: int = 1
    n_starts: int = 1200
    n_far: int = 50
    n_descents: int = 5
    per_layout: int = 3
    n_refined: int = 1
    n_levels: int = 3
    n_front: int = 8

    def scaled(self, scale: float) -> "Plan":
        """Return a plan with a share of the numbers, at least one of each."""
        names = ("n_starts", "n_far", "n_descents", "n_refined", "n_levels", "n_front")
        return replace(self, **{name: max(1, round(scale * getattr(self, name))) for name in names})


@dataclass(frozen=True, eq=False)
class Result:
    """A beam with what it answers.

    Attributes
    ----------
    candidate
        The beam.
    values
        Measured, by key of a finding.
    cost
        Of what the fit may see.
    origin
        Number of the start that it came from.
    """

    candidate: Candidate
    values: dict[str, float]
    cost: float
    origin: int

    @property
    def rank(self) -> tuple[int, float]:
        """What the best result has least of: findings of the fit that it misses, then cost."""
        missed = [f for f in FINDINGS if f.fitted and not f.agrees(self.values.get(f.key, np.nan))]
        return len(missed), self.cost

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {
            "candidate": self.candidate.to_dict(),
            "values": self.values,
            "cost": self.cost,
            "origin": self.origin,
        }


def search(folder: Path, plan: Plan, tell: Callable[[str], None]) -> list[Result]:
    """Search, or go on where a search with the same plan was; return the best beams of it, the best first.

    Parameters
    ----------
    folder
        Where the records are, ``records.jsonl``, and the results go, ``results.json``.
    plan
        How long.
    tell
        Told of the progress, a line at a time.
    """
    records = Records(folder / "records.jsonl")
    effort = Effort()
    started = _starts(records, plan, effort, tell)
    asked = []
    for _, number in started[: plan.n_far]:
        asked.append((cost_of(misses(records.values(start_of(plan, number), effort, FAR))), number))
    tell(f"{len(asked)} starts asked everything")
    started = sorted(asked)
    descended = _descents(records, plan, effort, started, tell)
    refined = [_refine(records, plan, effort, each, tell) for each in descended[: plan.n_refined]]
    best = sorted(refined + descended, key=lambda result: result.rank)
    (folder / "results.json").write_text(
        json.dumps([each.to_dict() for each in best], indent=1), encoding="utf-8"
    )
    tell(f"{records.n_solved} candidates solved, {len(records.kept)} kept")
    return best


def _starts(
    records: Records, plan: Plan, effort: Effort, tell: Callable[[str], None]
) -> list[tuple[float, int]]:
    """Return the cost and the number of the starts that stand, the best first."""
    costs = []
    for number in range(plan.n_starts):
        candidate = start_of(plan, number)
        values = records.values(candidate, effort, NEAR)
        if values is None:
            continue
        cost = cost_of(misses(values))
        if cost < PROMISING:
            cost = cost_of(misses(records.values(candidate, effort, EDGE)))
            costs.append((cost, number))
        if number % 250 == 0:
            tell(f"starts: {number} of {plan.n_starts}, {len(costs)} promising")
    tell(f"starts: {len(costs)} of {plan.n_starts} promising")
    return sorted(costs)


def start_of(plan: Plan, number: int) -> Candidate:
    """Return a start by its number; the first two are the beam of the library with either strut."""
    if number < len(AREAS):
        known = reference()
        return Candidate(known.layout, known.numbers, AREAS[number]).balanced()
    return random_candidate(np.random.default_rng([plan.seed, number])).balanced()


def _descents(
    records: Records,
    plan: Plan,
    effort: Effort,
    started: list[tuple[float, int]],
    tell: Callable[[str], None],
) -> list[Result]:
    chosen: list[int] = []
    taken: Counter[tuple[str, float, str]] = Counter()
    for _, number in started:
        start = start_of(plan, number)
        kind = (start.layout.name, start.area, start.held)
        if taken[kind] < plan.per_layout and len(chosen) < plan.n_descents:
            taken[kind] += 1
            chosen.append(number)
    ends: list[tuple[float, Result]] = []
    for number in chosen:
        start = start_of(plan, number)
        end = _descend(records, effort, start)
        candidate = start.moved(end.numbers).balanced()
        values = records.values(candidate, effort, FAR)
        if values is None:
            continue
        ends.append((end.cost, Result(candidate, values, cost_of(misses(values)), number)))
        tell(
            f"descent from {number} ({candidate.layout.name}, {candidate.area:g} cm², {candidate.held}): "
            f"{end.cost:.2f} after {end.n_steps} steps, {ends[-1][1].cost:.2f} with all of the fit"
        )
    # By what descents can see: the counted outcomes follow with the self-stress.
    return [result for _, result in sorted(ends, key=lambda pair: pair[0])]


def _refine(
    records: Records, plan: Plan, effort: Effort, begin: Result, tell: Callable[[str], None]
) -> Result:
    """Follow a beam up its self-stress, to the thinner strut, and up again: counted outcomes depend on both.

    On the way it is brought again and again to what the small actuations and the optimum ask for; at its end
    and at each value of the self-stress it is asked everything.
    """
    best, candidate = begin, begin.candidate
    thinner = [area for area in THINNER if area < candidate.area]
    for area in [candidate.area] * plan.n_levels + thinner + [AREAS[1]] * plan.n_levels:
        if area == candidate.area:
            moved = _with_stress(records, effort, candidate, STRESS_FACTOR * candidate.self_stress)
        else:
            moved = _with_area(records, effort, candidate, area)
        if moved is None:
            if area == AREAS[1]:
                break
            continue  # no more self-stress with this strut; perhaps with the thinner one
        candidate = moved
        if area not in AREAS:
            continue
        values = records.values(candidate, effort, FAR)
        if values is not None:
            there = Result(candidate, values, cost_of(misses(values)), begin.origin)
            best = min(best, there, key=lambda result: result.rank)
    tell(
        f"refined {begin.origin}: {begin.cost:.2f} to {best.cost:.2f} with {best.candidate.area:g} cm² and "
        f"{best.candidate.self_stress:.0f} kN"
    )
    return best


def _with_area(
    records: Records, effort: Effort, candidate: Candidate, area: float, parts: int = 4
) -> Candidate | None:
    """Return the beam with another strut, brought to agreement, or None; in parts where a step spoils it."""
    end = _descend(records, effort, replace(candidate, area=area))
    if end.cost <= SPOILT:
        return replace(candidate, numbers=end.numbers, area=area).balanced()
    if parts == 1:
        return None
    half = _with_area(records, effort, candidate, float(np.sqrt(candidate.area * area)), parts // 2)
    return half and _with_area(records, effort, half, area, parts // 2)


def _with_stress(
    records: Records, effort: Effort, candidate: Candidate, self_stress: float, parts: int = 4
) -> Candidate | None:
    """Return the beam with another base self-stress, likewise."""
    numbers = candidate.numbers.copy()
    numbers[N_SHAPE] = np.log(self_stress)
    end = _descend(records, effort, candidate.moved(numbers), held=(N_SHAPE,))
    if end.cost <= SPOILT:
        return candidate.moved(end.numbers).balanced()
    if parts == 1:
        return None
    half = _with_stress(
        records, effort, candidate, float(np.sqrt(candidate.self_stress * self_stress)), parts // 2
    )
    return half and _with_stress(records, effort, half, self_stress, parts // 2)


def _descend(records: Records, effort: Effort, start: Candidate, held: tuple[int, ...] = ()) -> Descent:
    """Descend from a beam, some of its numbers held."""

    def ways(numbers: Array) -> Array:
        directions = start.moved(numbers).directions
        return directions[~np.any(directions[:, list(held)] != 0.0, axis=1)] if held else directions

    return descend(
        lambda numbers: misses(records.values(start.moved(numbers), effort, EDGE)),
        start.numbers,
        ways,
        max_steps=25,
    )
