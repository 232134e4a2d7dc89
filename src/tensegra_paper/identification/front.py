"""What excludes what: of two findings, how near a beam of the family comes to the one that has the other."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.candidate import Candidate
from tensegra_paper.identification.findings import FINDINGS, Finding
from tensegra_paper.identification.records import FAR, Records
from tensegra_paper.identification.responses import Effort

__all__ = ["PAIRS", "Front", "find_front"]

Array: TypeAlias = NDArray[np.float64]

PAIRS = (
    ("6a upward", "6b irregular"),
    ("6b irregular", "runs kept"),
    ("top over bottom", "6a upward"),
    ("top over bottom", "A4 at v = 1.00"),
    ("uniform mean", "exponential mean"),
    ("w at v = 1.00", "w at v = 0"),
    ("6a irregular", "6a not converged"),
    ("T_top first on w", "A14 on v"),
)
"""Pairs that are looked at: each of one finding that the best beams have and one that they miss."""

_BY_KEY = {finding.key: finding for finding in FINDINGS}


@dataclass(frozen=True, eq=False)
class Front:
    """The beams that no other beats in both findings of a pair.

    Attributes
    ----------
    keys
        Of the two findings.
    values
        Measured, shape (n, 2), from the nearest to the first finding to the nearest to the second.
    n_candidates
        Beams that answer both.
    both
        Whether one agrees with both.
    """

    keys: tuple[str, str]
    values: Array
    n_candidates: int
    both: bool


def miss(finding: Finding, value: float) -> float:
    """Return by how many tolerances and scales a value misses a finding: 0 where it agrees.

    Examples
    --------
    >>> finding = Finding("w", "optimum", "Fig. 14", "about 144", 144.0, 0.5, fitted=False, scale=0.5)
    >>> miss(finding, 144.3), miss(finding, 145.5)
    (0.0, 2.0)
    """
    return max(0.0, abs(finding.off(value)) - finding.tolerance) / finding.scale


def nondominated(misses: Array) -> NDArray[np.intp]:
    """Return the places of the rows that no other row beats in both columns, by the first column.

    Examples
    --------
    >>> nondominated(np.array([[0.0, 3.0], [1.0, 1.0], [2.0, 2.0], [3.0, 0.0]])).tolist()
    [0, 1, 3]
    """
    order = np.lexsort((misses[:, 1], misses[:, 0]))
    kept, lowest = [], np.inf
    for place in order:
        if misses[place, 1] < lowest:
            kept.append(place)
            lowest = misses[place, 1]
    return np.array(kept, dtype=np.intp)


def find_front(records: Records, keys: tuple[str, str], n_trials: int, seed: int, effort: Effort) -> Front:
    """Return the front of a pair among all beams that were solved, after trials near it.

    Parameters
    ----------
    records
        Of a search; trials are added to them.
    keys
        Of two findings.
    n_trials
        Beams tried near those of the front.
    seed
        Of the chance.
    effort
        As that of the search.
    """
    findings = tuple(_BY_KEY[key] for key in keys)
    rng = np.random.default_rng([seed, *(list(_BY_KEY).index(key) for key in keys)])
    known = list(_known(records, keys))
    size = 0.05
    for _ in range(n_trials):
        misses = _misses(known, findings)
        front = nondominated(misses)
        if not len(front) or misses[front].max(axis=1).min() == 0.0:
            break
        begin = known[int(rng.choice(front))][0]
        ways = begin.directions
        shift = size * rng.exponential() * rng.standard_normal(len(ways)) @ ways
        trial = begin.moved(begin.numbers + shift).balanced()
        values = records.values(trial, effort, FAR)
        if values is not None and all(np.isfinite(values.get(key, np.nan)) for key in keys):
            known.append((trial, (values[keys[0]], values[keys[1]])))
    misses = _misses(known, findings)
    front = nondominated(misses)
    measured = np.array([known[place][1] for place in front]).reshape(-1, 2)
    return Front(keys, measured, len(known), bool(len(front) and misses[front].max(axis=1).min() == 0.0))


def _misses(known: Sequence[tuple[Candidate, tuple[float, float]]], findings: tuple[Finding, ...]) -> Array:
    rows = [[miss(f, value) for f, value in zip(findings, values, strict=True)] for _, values in known]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _known(records: Records, keys: tuple[str, str]) -> Iterable[tuple[Candidate, tuple[float, float]]]:
    for candidate, values in records.answers():
        found = tuple(values.get(key, np.nan) for key in keys)
        if np.all(np.isfinite(found)):
            yield candidate, (found[0], found[1])


def fronts(
    records: Records, n_trials: int, seed: int, effort: Effort, tell: Callable[[str], None]
) -> list[Front]:
    """Return the fronts of all `PAIRS`.

    Parameters
    ----------
    records, n_trials, seed, effort
        As for `find_front`.
    tell
        Told of each.
    """
    found = []
    for keys in PAIRS:
        front = find_front(records, keys, n_trials, seed, effort)
        tell(f"{keys[0]} and {keys[1]}: {'both' if front.both else 'not both'} in {front.n_candidates} beams")
        found.append(front)
    return found
