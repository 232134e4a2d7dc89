"""Beams to start from: a layout and a shape by chance."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.candidate import AREAS, HELD, N_NUMBERS, N_SHAPE, Candidate, reference
from tensegra_paper.identification.layout import N_SECTIONS, N_TIES, Layout, all_layouts
from tensegra_paper.identification.shape import LENGTH_UNIT

__all__ = ["random_candidate"]

RADIUS, STAGE, OVERLAP = 35.0, (80.0, 140.0), (-0.1, 0.6)
"""Of the sections and of the stages, cm; share of a stage that lies within its neighbour. About those of a
beam whose tip rises by 54 cm at 10 %: some 10 % of its squared length over its height."""

STRESS = (5.0, 250.0)
"""Base self-stress of a clustered cable, kN."""

EXPANSION = (0.8e-5, 2.5e-5)
"""Of stainless steels, 1/K; the publication prints none."""


@cache
def _layouts() -> tuple[list[Layout], list[Layout]]:
    everything = all_layouts()
    squares = [layout for layout in everything if sum(s == t for s, t, _ in layout.ties) == N_SECTIONS]
    return squares, [layout for layout in everything if layout not in set(squares)]


def random_candidate(rng: np.random.Generator) -> Candidate:
    """Return a beam by chance: a third near the one of the library; of the rest two in three have squares.

    Parameters
    ----------
    rng
        Source of the chance.
    """
    if rng.random() < 1 / 3:
        near = reference()
        numbers = near.numbers.copy()
        numbers[:N_SHAPE] += rng.normal(0.0, 0.2, N_SHAPE)
        layout = near.layout
    else:
        squares, saddles = _layouts()
        pool = squares if rng.random() < 2 / 3 else saddles
        layout = pool[int(rng.integers(len(pool)))]
        numbers = np.zeros(N_NUMBERS)
        numbers[:N_SHAPE] = _shape(layout, rng)
    numbers[N_SHAPE] = rng.uniform(*np.log(STRESS))
    numbers[N_SHAPE + 1] = rng.uniform(*np.log(EXPANSION))
    held = HELD[int(rng.choice(len(HELD), p=[0.7, 0.15, 0.15]))]
    return Candidate(layout, numbers, float(rng.choice(AREAS)), held)


def _shape(layout: Layout, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the numbers of a shape that is alike from both ends and need not balance."""
    outer = rng.uniform(*STAGE)
    lengths = (outer, outer * rng.uniform(0.8, 1.25), outer)
    overlap = outer * rng.uniform(*OVERLAP)
    between = rng.uniform(-0.25, 0.25) * np.pi
    x, angle, place, turned = [], [], 0.0, 0.0
    signs = {
        shift: (1.0 if shift == 1 else -1.0 if shift == 3 else rng.choice([-1.0, 1.0]))
        for shift in layout.shifts
    }
    for length, shift in zip(lengths, layout.shifts, strict=True):
        # A strut of a stage of four turns by about three eighths of a circle, forwards or back.
        twist = 0.25 * np.pi * rng.uniform(0.7, 1.3) * signs[shift]
        x += [place, place + length]
        angle += [turned, turned + twist]
        place += length - overlap
        turned += twist + between
    roll = np.pi / 4 - np.mean(angle) + rng.uniform(-0.6, 0.6)
    half = np.log(RADIUS) + rng.normal(0.0, 0.15, N_SECTIONS // 2)
    force = [*(np.log(4.0) + rng.normal(0.0, 0.4, 3)), *rng.normal(-0.3, 0.7, N_TIES), 0.0]
    return np.concatenate([half, half[::-1], np.array(angle) + roll, np.array(x) / LENGTH_UNIT, force])
