"""What was solved is kept: a search that is run again reads it and goes on where it was."""

import json
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.candidate import Candidate
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.local import ABSENT
from tensegra_paper.identification.measured import measure
from tensegra_paper.identification.responses import Effort, respond

__all__ = ["Records"]

NEAR, EDGE, FAR = ("near",), ("near", "edge"), ("near", "edge", "far")


class Records:
    """Measured values of candidates, kept in a file of lines.

    Parameters
    ----------
    file
        Created where it is missing; a last line that a kill has cut short is dropped.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self.kept: dict[str, dict[str, float] | None] = {}
        self.n_solved = 0
        file.parent.mkdir(parents=True, exist_ok=True)
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True) if file.is_file() else []
        whole = [line for line in lines if line.endswith("\n")]
        if len(whole) < len(lines):
            file.write_text("".join(whole), encoding="utf-8")
        for line in whole:
            entry = json.loads(line)
            self.kept[entry["key"]] = entry["values"]

    def values(
        self, candidate: Candidate, effort: Effort, stages: tuple[str, ...]
    ) -> dict[str, float] | None:
        """Return the measured values of a candidate, or None where it does not stand.

        Parameters
        ----------
        candidate
            The beam.
        effort, stages
            As for `respond`.
        """
        parts = [candidate.to_dict(), vars(effort), stages]
        key = sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]
        if key not in self.kept:
            found = self._solve(candidate, effort, stages)
            self.kept[key] = found
            self.n_solved += 1
            with self.file.open("a", encoding="utf-8") as out:
                out.write(
                    json.dumps({"key": key, "stages": stages[-1], "values": found, "candidate": parts[0]})
                    + "\n"
                )
        return self.kept[key]

    def answers(self) -> Iterator[tuple[Candidate, dict[str, float]]]:
        """Give all candidates that stand with their measured values, in the order of their solution."""
        for line in self.file.read_text(encoding="utf-8").splitlines():
            entry = json.loads(line)
            if entry["values"] is not None:
                yield Candidate.of_dict(entry["candidate"]), entry["values"]

    def _solve(
        self, candidate: Candidate, effort: Effort, stages: tuple[str, ...]
    ) -> dict[str, float] | None:
        from tensegra import TensegraError

        try:
            structure = candidate.structure()
            found = None if structure is None else respond(structure, effort, stages=stages)
        except TensegraError:
            # A shape without a length left, or one that cannot carry its self-stress: no beam.
            return None
        if found is None:
            return None
        with np.errstate(invalid="ignore", divide="ignore"):
            return {name: float(value) for name, value in measure(found, effort).items()}


def misses(values: dict[str, float] | None, *, fitted: bool = True) -> NDArray[np.float64]:
    """Return what the fitted findings miss, each over its scale; what has no answer misses by `ABSENT`.

    Parameters
    ----------
    values
        Measured, or None for a beam that does not stand.
    fitted
        Those in the fit, or all.
    """
    wanted = [finding for finding in FINDINGS if finding.fitted or not fitted]
    if values is None:
        return np.full(len(wanted), ABSENT)
    found = [
        (finding.off(values[finding.key]) / finding.scale if finding.key in values else 0.0)
        for finding in wanted
    ]
    return np.where(np.isfinite(found), found, ABSENT)
