"""Self-stressed shapes of a layout: coordinates and forces that balance, the nearest to what is asked for."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.identification.layout import N_SECTIONS, N_SIDES, N_TIES, Layout

__all__ = ["N_KINDS", "N_STAGES", "Shape", "balance", "free_directions", "shape_of"]

Array: TypeAlias = NDArray[np.float64]

N_STAGES = 3

N_KINDS = N_STAGES + N_TIES + 1
"""Kinds of members: struts of three stages, classical cables, clustered cables."""

LENGTH_UNIT = 30.0
"""Centimetres of an axial position that count as much as a factor e of a radius or of a force."""

MAX_ITERATIONS, BALANCED = 40, 1e-11


@dataclass(frozen=True, eq=False)
class Shape:
    """Sections of four nodes and the force in each kind of member.

    Attributes
    ----------
    radius, angle, x
        By section, shape (6,): of the circle through its nodes, cm; of its side 0, radians; along the
        beam's axis, cm.
    force
        Magnitude by kind over that of the clustered cables, shape (12,): compression of struts, tension of
        cables.
    """

    radius: Array
    angle: Array
    x: Array
    force: Array

    def to_vector(self) -> Array:
        """Return the 30 numbers in which distance is measured."""
        return np.concatenate([np.log(self.radius), self.angle, self.x / LENGTH_UNIT, np.log(self.force)])

    @classmethod
    def of_vector(cls, vector: Array) -> "Shape":
        """Build it from `to_vector`."""
        radius, angle, x = (vector[n * N_SECTIONS : (n + 1) * N_SECTIONS] for n in range(3))
        return cls(np.exp(radius), angle, LENGTH_UNIT * x, np.exp(vector[3 * N_SECTIONS :]))

    def positions(self, section: int, side: Array | int) -> Array:
        """Return the positions of a section's nodes by side, shape (..., 3)."""
        turned = self.angle[section] + 2.0 * np.pi / N_SIDES * np.asarray(side)
        x = np.broadcast_to(self.x[section], turned.shape)
        return np.stack(
            [x, self.radius[section] * np.cos(turned), self.radius[section] * np.sin(turned)], axis=-1
        )


def balance(layout: Layout, vectors: Array) -> Array:
    """Return the forces that are left at a node of each section, over that of a clustered cable.

    Parameters
    ----------
    layout
        Whose members pull and push.
    vectors
        `Shape.to_vector` of shapes, shape (n, 30).

    Returns
    -------
    numpy.ndarray
        Along the axis, outwards and along the circle by section, shape (n, 18).
    """
    n = N_SECTIONS
    radius, angle, x = np.exp(vectors[:, :n]), vectors[:, n : 2 * n], LENGTH_UNIT * vectors[:, 2 * n : 3 * n]
    force = np.exp(vectors[:, 3 * n :])
    left = np.zeros((len(vectors), n, 3))
    for kind, s, t, shift in layout.segments():
        pull = force[:, kind] / force[:, -1] * (-1.0 if kind < N_STAGES else 1.0)
        turn = angle[:, t] - angle[:, s] + 2.0 * np.pi / N_SIDES * shift
        along = x[:, t] - x[:, s]
        length = np.sqrt(
            along**2
            + radius[:, s] ** 2
            + radius[:, t] ** 2
            - 2.0 * radius[:, s] * radius[:, t] * np.cos(turn)
        )
        for here, there, sign in ((s, t, 1.0), (t, s, -1.0)):
            outwards = radius[:, there] * np.cos(turn) - radius[:, here]
            sideways = sign * radius[:, there] * np.sin(turn)
            left[:, here] += (pull / length)[:, None] * np.stack([sign * along, outwards, sideways], axis=1)
    return left.reshape(len(vectors), -1)


def shape_of(layout: Layout, wanted: Array) -> Shape | None:
    """Return the balanced shape nearest to what is wanted, or None where the way to it fails.

    Parameters
    ----------
    layout
        Of the members.
    wanted
        `Shape.to_vector` of a shape that need not balance; the first section's angle and position and the
        sum of the logarithms of the radii are kept: roll, place and size are free for the caller.

    Notes
    -----
    Gauss–Newton steps of least length onto the 18 equations of balance, of which two (the axial sum and the
    torque) follow from the others.
    """
    vector = np.array(wanted, dtype=np.float64)
    kept = np.zeros((3, len(vector)))
    kept[0, N_SECTIONS], kept[1, 2 * N_SECTIONS], kept[2, :N_SECTIONS] = 1.0, 1.0, 1.0
    for _ in range(MAX_ITERATIONS):
        left, slopes = _linearised(layout, vector)
        if not (np.all(np.isfinite(left)) and np.all(np.isfinite(slopes))):
            return None
        if np.abs(left).max() < BALANCED:
            return Shape.of_vector(vector)
        correction = np.linalg.lstsq(np.vstack([slopes, kept]), np.append(-left, np.zeros(3)), rcond=1e-9)[0]
        longest = np.abs(correction).max()
        vector += correction * min(1.0, 0.5 / longest)
        if np.abs(vector - wanted).max() > 3.0:
            return None
    return None


def _linearised(layout: Layout, vector: Array) -> tuple[Array, Array]:
    """Return the forces left, shape (18,), and their slopes by the numbers of a shape, shape (18, 30)."""
    step = 1e-7
    left = balance(layout, vector + np.concatenate([np.zeros((1, len(vector))), step * np.eye(len(vector))]))
    return left[0], (left[1:] - left[0]).T / step


def free_directions(layout: Layout, vector: Array) -> Array:
    """Return an orthonormal basis of the ways to change a balanced shape that keep its balance and its place.

    Parameters
    ----------
    layout
        Of the members.
    vector
        `Shape.to_vector` of a balanced shape.

    Returns
    -------
    numpy.ndarray
        Rows of 30 numbers.
    """
    slopes = _linearised(layout, vector)[1]
    place = np.zeros((2, len(vector)))
    place[0, 2 * N_SECTIONS], place[1, -1] = 1.0, 1.0  # of the first section; the unit of the forces
    sizes, directions = np.linalg.svd(np.vstack([slopes, place]))[1:]
    rank = int(np.sum(sizes > 1e-5 * sizes[0]))
    return directions[rank:]
