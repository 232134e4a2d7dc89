"""What a beam answers to everything that the publication did with its own: few runs of each study."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations_with_replacement
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

import tensegra as tg

__all__ = ["TIP", "Edge", "Effort", "Responses", "respond", "total_indices"]

Array: TypeAlias = NDArray[np.float64]

TIP = ("18", "23")
"""Nodes of the free end; the publication speaks of 23 alone or of the mean of both."""

INPUTS = ("A14", "A23", "top", "middle", "bottom")
LOW, HIGH = np.array([0.09, 0.09, 0.0, 0.0, 0.0]), np.array([0.10, 0.10, 150.0, 150.0, 150.0])
"""The design of Sect. 3.1: two actuations and three temperatures."""

FARTHEST = 0.088
"""Actuation down to which a quadratic is fitted: the largest of 10,000 exponential errors is about 0.9 %."""

A4_GRID = np.linspace(0.0, 0.30, 31)

CORNERS = ((0.30, 0.30), (0.29, 0.30), (0.30, 0.29))
"""A1 and A23 of the printed optimum, and a little inside the box."""


@dataclass(frozen=True)
class Effort:
    """Numbers of runs.

    Attributes
    ----------
    design
        Of the quadratic in five inputs.
    samples
        Of the laws of Table 2, drawn from that quadratic.
    outcomes
        Of each random group of Fig. 6, and of the three actuations of Sect. 4.1.
    blocks
        Saltelli blocks of the four actuations of Fig. 13.
    direct
        Whether the laws of Table 2 and the blocks of Fig. 19 are solved too, not drawn from the quadratic.
    """

    design: int = 96
    samples: int = 2048
    outcomes: int = 256
    blocks: int = 64
    direct: bool = False


@dataclass(frozen=True, eq=False)
class Edge:
    """The edge A1 = A23 = 30 % of the box of actuations, over A4, without gravity.

    Attributes
    ----------
    v, w
        Means of the two nodes of the tip over `A4_GRID`, cm; NaN where nothing stands.
    tip
        Coordinates of the two nodes, shape (31, 2, 3).
    """

    v: Array
    w: Array
    tip: Array

    def at(self, v: float) -> tuple[float, float]:
        """Return A4 and w where v has a value, at the largest such A4; NaN where it has nowhere."""
        crossed = np.flatnonzero((self.v[:-1] - v) * (self.v[1:] - v) <= 0.0)
        if not len(crossed):
            return np.nan, np.nan
        i = int(crossed[-1])
        part = (v - self.v[i]) / (self.v[i + 1] - self.v[i]) if self.v[i + 1] != self.v[i] else 0.0
        # The grid is fine enough that w needs no more than the line that v takes.
        return (
            float(A4_GRID[i] + part * (A4_GRID[i + 1] - A4_GRID[i])),
            float(self.w[i] + part * (self.w[i + 1] - self.w[i])),
        )


@dataclass(frozen=True, eq=False)
class Responses:
    """What a beam answers.

    Attributes
    ----------
    nominal
        (v, w) of node 23 at A14 = A23 = 1, 5, 10 %, with gravity, shape (3, 2); NaN where it does not stand.
    polynomial
        By node ("23" or "mean"), coefficients of the quadratics of (v, w) in the five inputs, shape (21, 2).
    edges
        By what A1 and A23 are.
    outcomes
        By group of Fig. 6 ("6a", "6b") and for the three actuations ("4.1"): shares upward, irregular and not
        converged of the stepped procedure, in percent.
    four
        Total indices of (v, w) for A1 to A4 in [0, 30 %], shape (2, 4); NaN where too few blocks stand.
    samples
        By law of Table 2, w of node 23 of every sample solved, cm; empty unless it was asked for.
    five
        Total indices of (v, w) of node 23 for the five inputs, solved, shape (2, 5); None likewise.
    """

    nominal: Array
    polynomial: Mapping[str, Array]
    edges: Mapping[tuple[float, float], Edge]
    outcomes: Mapping[str, Array]
    four: Array
    samples: Mapping[str, Array] = field(default_factory=dict)
    five: Array | None = None

    @cached_property
    def corner(self) -> Edge:
        """The edge on which the printed optimum lies."""
        return self.edges[0.30, 0.30]


def respond(
    structure: tg.Structure, effort: Effort, *, stages: tuple[str, ...] = ("near", "edge", "far")
) -> Responses | None:
    """Solve what the publication solved.

    Parameters
    ----------
    structure
        The beam, under gravity.
    effort
        Numbers of runs.
    stages
        Which to solve: ``near`` the small actuations, ``edge`` that of the optimum, ``far`` the random ones.

    Returns
    -------
    Responses or None
        None where the beam does not stand under the nominal actuations.
    """
    small = _small(structure, effort.design)
    if small is None:
        return None
    nominal, polynomial = small
    light = structure.replace(gravity=(0.0, 0.0, 0.0))
    far = "far" in stages
    edges = _edges(light, CORNERS if far else CORNERS[:1]) if "edge" in stages else {}
    return Responses(
        nominal,
        polynomial,
        edges,
        _outcomes(structure, light, effort.outcomes) if far else {},
        _four(light, effort.blocks) if far else np.full((2, 4), np.nan),
        _samples(structure, effort.samples) if effort.direct else {},
        _five(structure) if effort.direct else None,
    )


def _solve(structure: tg.Structure, inputs: Mapping[str, Array], **settings: Any) -> tg.Batch:  # noqa: ANN401
    actuation = {name: values for name, values in inputs.items() if name.startswith("A")}
    temperature = {name: values for name, values in inputs.items() if not name.startswith("A")}
    return tg.solve_batch(structure, actuation=actuation, temperature=temperature, threads=1, **settings)


def _stands(runs: tg.Batch) -> NDArray[np.bool_]:
    stands: NDArray[np.bool_] = np.isin(runs.status, (str(tg.Status.STABLE), str(tg.Status.SNAPPED)))
    return stands


def sobol_points(dimension: int, n: int, seed: int) -> Array:
    """Return the first points of a scrambled Sobol sequence in the unit cube, shape (n, dimension)."""
    from scipy.stats import qmc

    points = qmc.Sobol(dimension, scramble=True, rng=seed).random_base2(int(np.ceil(np.log2(n))))
    return np.asarray(points[:n])


STEPS = (0.01, 0.05, 0.10)
"""Of the nominal actuation, Fig. 4."""


def _small(structure: tg.Structure, n: int) -> tuple[Array, dict[str, Array]] | None:
    """Return the nominal displacements and the quadratics, or None where a run does not stand."""
    low = np.array([FARTHEST, FARTHEST, *LOW[2:]])
    inputs = low + sobol_points(5, n, 5) * (HIGH - low)
    nominal = np.array([[step, step, 0.0, 0.0, 0.0] for step in STEPS])
    columns = np.concatenate([nominal, inputs]).T
    runs = _solve(structure, dict(zip(INPUTS, columns, strict=True)), policy="stop")
    if not _stands(runs).all():
        return None
    terms = quadratic_terms(inputs)
    found: dict[str, Array] = {}
    for name, nodes in (("23", ["23"]), ("mean", list(TIP))):
        outputs = np.column_stack([runs.displacement(axis, nodes) for axis in "yz"])
        found[name] = np.asarray(
            np.linalg.lstsq(terms, outputs[len(STEPS) :], rcond=None)[0], dtype=np.float64
        )
    return np.column_stack([runs.displacement(axis, "23")[: len(STEPS)] for axis in "yz"]), found


def quadratic_terms(inputs: Array) -> Array:
    """Return the 21 terms of a quadratic in the five inputs, each scaled to its range, shape (n, 21)."""
    scaled = (inputs - LOW) / (HIGH - LOW) - 0.5
    pairs = [scaled[:, i] * scaled[:, j] for i, j in combinations_with_replacement(range(5), 2)]
    return np.column_stack([np.ones(len(scaled)), scaled, *pairs])


def law_inputs(n: int) -> dict[str, Array]:
    """Return the five inputs by law of Table 2, errors of the two actuations independent, shape (n, 5)."""
    unit = sobol_points(5, n, 12)
    error = {"uniform": 0.01 * unit[:, :2], "exponential": -0.001 * np.log1p(-unit[:, :2])}
    return {law: np.column_stack([0.1 - phi, HIGH[2:] * unit[:, 2:]]) for law, phi in error.items()}


def design_blocks(n: int) -> Array:
    """Return Saltelli blocks of the five inputs in their design, shape (6, n, 5)."""
    unit = sobol_points(10, n, 19)
    blocks: Array = LOW + saltelli(unit[:, :5], unit[:, 5:]) * (HIGH - LOW)
    return blocks


def _samples(structure: tg.Structure, n: int) -> dict[str, Array]:
    found = {}
    for law, inputs in law_inputs(n).items():
        runs = _solve(structure, dict(zip(INPUTS, inputs.T, strict=True)))
        found[law] = np.where(_stands(runs), runs.displacement("z", "23"), np.nan)
    return found


def _five(structure: tg.Structure) -> Array:
    blocks = design_blocks(1024)
    runs = _solve(structure, dict(zip(INPUTS, blocks.reshape(-1, len(INPUTS)).T, strict=True)))
    outputs = (runs.displacement(axis, "23").reshape(blocks.shape[:2]) for axis in "yz")
    return np.array([total_indices(output) for output in outputs])


def _edges(light: tg.Structure, corners: tuple[tuple[float, float], ...]) -> dict[tuple[float, float], Edge]:
    a1, a23 = (np.repeat([corner[i] for corner in corners], len(A4_GRID)) for i in (0, 1))
    # A shape reached by a snap is not taken for the publication's, which it reached in plain increments.
    runs = _solve(light, {"A1": a1, "A23": a23, "A4": np.tile(A4_GRID, len(corners))}, policy="stop")
    stands = _stands(runs)
    rows = [runs.node_ids.index(node) for node in TIP]
    tip = np.where(stands[:, None, None], runs.nodes[:, rows], np.nan)
    v, w = (np.where(stands, runs.displacement(axis, list(TIP)), np.nan) for axis in "yz")
    n = len(A4_GRID)
    return {
        corner: Edge(v[i * n : (i + 1) * n], w[i * n : (i + 1) * n], tip[i * n : (i + 1) * n])
        for i, corner in enumerate(corners)
    }


def _outcomes(heavy: tg.Structure, light: tg.Structure, n: int) -> dict[str, Array]:
    groups = {
        "6a": (heavy, ("A14", "A23"), 0.01, 0.10),
        "6b": (light, ("A1", "A2", "A3", "A4"), 0.01, 0.30),
        "4.1": (light, ("A1", "A23", "A4"), 0.0, 0.30),
    }
    found = {}
    for name, (structure, actuators, low, high) in groups.items():
        values = low + (high - low) * sobol_points(len(actuators), n, 6)
        runs = _solve(structure, dict(zip(actuators, values.T, strict=True)), path="stepped")
        failed = runs.status == str(tg.Status.FAILED)
        with np.errstate(invalid="ignore"):
            upward = _stands(runs) & (runs.displacement("z", list(TIP)) > 0.0)
        found[name] = 100.0 * np.array([upward.mean(), (~upward & ~failed).mean(), failed.mean()])
    return found


def _four(light: tg.Structure, n: int) -> Array:
    names = ("A1", "A2", "A3", "A4")
    unit = sobol_points(8, n, 13)
    blocks = saltelli(0.3 * unit[:, :4], 0.3 * unit[:, 4:])
    runs = _solve(light, dict(zip(names, blocks.reshape(-1, 4).T, strict=True)))
    stands = _stands(runs).reshape(blocks.shape[:2]).all(axis=0)
    if stands.sum() < n // 4:
        return np.full((2, 4), np.nan)
    return np.array(
        [
            total_indices(runs.displacement(axis, list(TIP)).reshape(blocks.shape[:2])[:, stands])
            for axis in "yz"
        ]
    )


def saltelli(first: Array, second: Array) -> Array:
    """Return the first design and, for each input, it with that column of the second, (d + 1, n, d)."""
    n, d = first.shape
    blocks = np.repeat(first[None], d + 1, axis=0)
    for i in range(d):
        blocks[i + 1, :, i] = second[:, i]
    return blocks.reshape(d + 1, n, d)


def total_indices(outputs: Array) -> Array:
    """Return Jansen's estimate of the total indices.

    Parameters
    ----------
    outputs
        Of `saltelli`, shape (d + 1, n).

    Notes
    -----
    M. J. W. Jansen, Analysis of variance designs for model output, Comput. Phys. Commun. 117 (1999).
    """
    indices: Array = 0.5 * ((outputs[1:] - outputs[0]) ** 2).mean(axis=1) / outputs.var()
    return indices
