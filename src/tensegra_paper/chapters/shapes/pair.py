"""An actuation that the stepped procedure answers with two shapes, by other lengths of its steps."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from tensegra.mechanics import EquilibriumPath, PathSettings, Status, solve_path
from tensegra.structure import Structure
from tensegra_paper.beam_model import TIP
from tensegra_paper.setting import Setting

__all__ = ["ELSEWHERE", "INCREMENTS", "NOMINAL", "N_RANDOM", "Pair", "find_pair", "tip"]

NOMINAL = (0.10, 0.20, 0.30)
"""Actuations A14 = A23 among which one with two shapes is looked for, the publication's own first."""

N_RANDOM, FOLLOWED = 8192, 8
"""Random actuations of the range of Fig. 6a that are looked at then, and how many of those that fit."""

RANGE = (0.01, 0.10)

INCREMENTS = (0.01, 0.005, 0.02, 0.03, 0.04, 0.05, 0.10, 0.15)
"""Increments of the stepped procedure that are tried, the publication's own 1 % first."""

ELSEWHERE = 0.1
"""Centimetres between two ends of the tip that are different equilibria: far above the residual's
effect on the softest mode (below 1e-3), far below the distance of any two branches that were seen."""


@dataclass(frozen=True, eq=False)
class Pair:
    """An actuation with two ends of the stepped procedure.

    Attributes
    ----------
    structure, actuation
        The beam with or without gravity, and A14 and A23.
    stepped
        End of the stepped procedure by increment.
    robust
        End of the path that is followed along its stable equilibria.
    regular, irregular
        Increments that end where the path ends, and elsewhere.
    """

    structure: Structure
    actuation: Mapping[str, float]
    stepped: dict[float, EquilibriumPath]
    robust: EquilibriumPath
    regular: float
    irregular: float

    @property
    def admissible(self) -> bool:
        """Whether both ends are within small strain and the regular one is upward."""
        small = not self.stepped[self.irregular].final.warnings and not self.robust.final.warnings
        return small and tip(self.robust, "z") > 0.0

    @property
    def told(self) -> str:
        """The actuation in words."""
        values = [f"{name} = {100 * value:.4g} %" for name, value in self.actuation.items()]
        gravity = "with gravity" if any(self.structure.gravity) else "without gravity"
        return f"{', '.join(values)} {gravity}"


def find_pair(setting: Setting) -> Pair | None:
    """Look for an actuation with a regular and an irregular end by different increments.

    First A14 = A23 = 10, 20, 30 %, with and without gravity, then random ones of Fig. 6a. A pair within small
    strain is taken before any other; where there is none, the first that is found, its lowest tip: a root
    beyond the law.

    Returns
    -------
    Pair or None
        None where no increment leads elsewhere.
    """
    beyond: Pair | None = None
    for structure, actuation in _tried(setting):
        pair = _pair(structure, actuation)
        if pair is not None and pair.admissible:
            return pair
        beyond = beyond or pair
    return beyond


def _tried(setting: Setting) -> Iterator[tuple[Structure, dict[str, float]]]:
    """Give the actuations, those that need no search first."""
    for value in NOMINAL:
        for structure in (setting.structure, setting.without_gravity):
            yield structure, {"A14": value, "A23": value}
    rng = np.random.default_rng(setting.seed_of("two shapes"))
    inputs = {name: rng.uniform(*RANGE, N_RANDOM) for name in ("A14", "A23")}
    stepped = setting.runs("two-shapes-stepped", setting.structure, inputs, PathSettings(path="stepped"))
    path = setting.runs("two-shapes-path", setting.structure, inputs)
    off = np.linalg.norm(stepped.tip - path.tip, axis=2).max(axis=1) > ELSEWHERE
    small = stepped.stands & path.stands & ~stepped.beyond_law & ~path.beyond_law
    fit = np.flatnonzero(off & small & (path.w > 0.0))
    for run in fit[np.argsort(stepped.w[fit], kind="stable")][:FOLLOWED]:
        yield setting.structure, {name: float(column[run]) for name, column in inputs.items()}


def _pair(structure: Structure, actuation: Mapping[str, float]) -> Pair | None:
    robust = solve_path(structure, actuation)
    stepped = {
        increment: solve_path(
            structure, actuation, settings=PathSettings(path="stepped", increment=increment)
        )
        for increment in INCREMENTS
    }
    away = {i: _distance(path, robust) for i, path in stepped.items()}
    regular = [i for i, distance in away.items() if distance <= ELSEWHERE]
    irregular = [i for i, distance in away.items() if ELSEWHERE < distance < np.inf]
    if not (robust.final.succeeded and regular and irregular):
        return None
    small = [i for i in irregular if not stepped[i].final.warnings]
    lowest = min(small or irregular, key=lambda i: tip(stepped[i], "z"))
    return Pair(structure, actuation, stepped, robust, regular[0], lowest)


def _distance(path: EquilibriumPath, other: EquilibriumPath) -> float:
    """Return how far apart two paths end at the tip; infinity where one has no end."""
    if Status.FAILED in (path.status, other.status):
        return np.inf
    return float(max(np.linalg.norm(path.final.node(node) - other.final.node(node)) for node in TIP))


def tip(path: EquilibriumPath, axis: str) -> float:
    """Return the mean displacement of the tip's nodes along an axis, cm."""
    return float(path.displacement(axis, nodes=list(TIP)))
