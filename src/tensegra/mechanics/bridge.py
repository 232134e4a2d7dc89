"""Whether a fall was a leap: a branch of stable equilibria may lead continuously to where it has landed.

Where a branch bends so sharply that no step in λ follows it (a cable pair that is unloaded, P = k z³; a strut
that is nearly straight where it buckles), the structure moves far while λ hardly changes, and yet does not
leap. So the branch on which a fall has landed is followed back by arc length: where it leads back to where
the fall began, over stable equilibria and with λ falling all along, nothing has leapt.
"""

import numpy as np

from tensegra.mechanics.account import SAME_POINT
from tensegra.mechanics.arc import Branch, BranchPoint
from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.rigid import RigidMotions, align

CLOSE = 0.05
"""Share of the way of the fall to which the branch has to come to where it began, and below which a step may
turn as it likes."""

TURN = 0.95
"""Least cosine between the tangents at both ends of a step."""

STRAY = 0.2
"""Largest distance of a point from its prediction, as a share of the step that led to it."""

LONGEST, SMALLEST, MOST_STEPS = 0.01, 1e-3, 500
"""Longest step, as a share of the size; shortest, as a share of what is close; and steps after which the way
back is held to lead elsewhere."""


def leads_back(
    branch: Branch,
    motions: RigidMotions,
    landed: tuple[FloatArray, float],
    left: tuple[FloatArray, float],
) -> bool:
    """Return whether a branch leads from where a fall has landed back to where it began.

    Parameters
    ----------
    branch
        The branch on which the fall has landed.
    motions
        Neutral motions, along which positions are alike.
    landed, left
        Positions ``(n_nodes, 3)`` and λ where the fall has ended and where it began.
    """
    size = branch.tangent.arrays.size

    def away(nodes: FloatArray) -> float:
        return float(np.abs(align(left[0], nodes, motions) - nodes).max(initial=0.0)) / size

    first = branch.point(*landed)
    if first.n_negative:
        return False
    here = BranchPoint(first.parameter, first.nodes, -first.motion, -first.rate, 0)
    close = CLOSE * away(here.nodes)
    arc = min(LONGEST, 2.0 * close)
    for _ in range(MOST_STEPS):
        if away(here.nodes) <= close:
            return True
        if here.parameter < left[1] - SAME_POINT:
            return False
        there = branch.step(here, arc)
        if there is None or not _belongs(here, there, arc, size, close):
            if arc <= SMALLEST * close:
                return False
            arc *= 0.4
            continue
        if there.n_negative or (there.rate > 0.0 and arc <= close):
            # What is not seen between two points this close is no leap; where λ turns it is one.
            return away(there.nodes) <= close
        if there.rate > 0.0:
            arc *= 0.4
            continue
        here = there
        arc = min(LONGEST, 1.5 * arc, max(0.5 * close, 0.5 * away(here.nodes)))
    return False


def _belongs(here: BranchPoint, there: BranchPoint, arc: float, size: float, close: float) -> bool:
    """Whether two points are neighbours on one branch, as far as their tangents and their distance tell."""
    if arc <= close:
        return True
    along = float(np.sum(here.motion * there.motion)) / size**2 + here.rate * there.rate
    stray = np.sqrt(
        float(np.sum((here.nodes + arc * here.motion - there.nodes) ** 2)) / size**2
        + (here.parameter + arc * here.rate - there.parameter) ** 2
    )
    return along >= TURN and float(stray) <= STRAY * arc
