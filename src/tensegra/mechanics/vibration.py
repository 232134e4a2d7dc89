"""Natural vibrations about an equilibrium, K φ = ω² M φ.

A member's mass is its weight divided by standard gravity, shared among its segments by their lengths
in the given coordinates and carried along by the nodes. A straight segment of mass m between two
nodes has, along each axis, the consistent mass m/6 [[2, 1], [1, 2]] of a linear velocity between
them (Archer, *J. Struct. Div. ASCE* 89 (1963) 161-178): it turns like a rod. Lumped masses, m/2 at
each node, turn too slowly: a rod on a hinge has a moment of inertia of mL²/2 in place of mL²/3.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics.arrays import FloatArray, StructureArrays, segment_spans
from tensegra.mechanics.results import EquilibriumPath
from tensegra.mechanics.stability import LARGEST_SVD, tangent_at
from tensegra.structure import Structure

__all__ = ["MassModel", "Vibration", "mass_matrix", "natural_frequencies"]

MassModel = Literal["consistent", "lumped"]

SHARES: dict[MassModel, tuple[float, float]] = {"consistent": (1 / 3, 1 / 6), "lumped": (1 / 2, 0.0)}
"""Of a segment's mass: at each of its two nodes, and between them."""

STANDARD_GRAVITY = "9.80665 m"
"""Per second squared: what turns a weight into a mass."""

MASSLESS = 1e-12
"""Masses below this share of the largest are none: their vibrations would be all rounding."""


@dataclass(frozen=True, eq=False)
class Vibration:
    """Lowest natural vibrations about an equilibrium.

    Attributes
    ----------
    frequencies
        In hertz, ascending, shape ``(n_modes,)``.
    shapes
        Mode shapes, largest component one, shape ``(n_modes, n_nodes, 3)``.
    """

    frequencies: FloatArray
    shapes: FloatArray


def natural_frequencies(
    path: EquilibriumPath, n_modes: int = 6, *, mass: MassModel = "consistent"
) -> Vibration:
    """Return the lowest natural frequencies about the last equilibrium of a path.

    Nodes that no member gives a mass follow the others without inertia: they are condensed.

    Parameters
    ----------
    path
        A path whose last equilibrium did not fail.
    n_modes
        Number of modes, at most as many as there are free coordinates with a mass.
    mass
        ``consistent``, the default, as a uniform rod has it, or ``lumped``, half and half at the
        nodes of each segment.

    Raises
    ------
    ModelError
        For another kind of mass.
    SolverError
        Where the last equilibrium failed, no movable node has a mass, nothing holds those that have
        none, or the structure is too large for a dense decomposition.

    Examples
    --------
    >>> from tensegra.mechanics import solve_path
    >>> from tensegra.structure import library
    >>> beam = solve_path(library.paper_beam())
    >>> natural_frequencies(beam, 2).shapes.shape
    (2, 24, 3)
    """
    from scipy.linalg import eigh

    tangent = tangent_at(path)
    arrays = tangent.arrays
    if arrays.n_free > LARGEST_SVD:
        raise SolverError(
            f"{arrays.n_free} degrees of freedom: natural frequencies need at most {LARGEST_SVD}"
        )
    # The tangent orders the free coordinates its own way: so do the masses.
    node, axis = tangent.pattern.block_node[tangent.free_index // 3], tangent.free_index % 3
    masses = mass_matrix(path.structure, arrays, mass)[np.ix_(node, node)] * (axis[:, None] == axis)
    stiffness = tangent.matrix()
    heavy = np.diagonal(masses) > MASSLESS * masses.max(initial=0.0)
    if not heavy.any():
        raise SolverError("natural frequencies need a member with a weight at a movable node")
    following = _following(stiffness, heavy)
    reduced = stiffness[np.ix_(heavy, heavy)] + stiffness[np.ix_(heavy, ~heavy)] @ following
    # Along the rigid motions that nothing holds there is no vibration: they come first, with no frequency.
    n_free = len(path.freedom.neutral)
    n_modes = min(n_modes, len(reduced) - n_free)
    wanted = n_free, n_free + n_modes - 1
    squares, vectors = eigh(reduced, masses[np.ix_(heavy, heavy)], subset_by_index=wanted)
    shapes = np.zeros((n_modes, arrays.n_nodes, 3))
    shapes[:, node[heavy], axis[heavy]] = vectors.T
    shapes[:, node[~heavy], axis[~heavy]] = (following @ vectors).T
    shapes /= np.abs(shapes).max(axis=(1, 2), keepdims=True)
    return Vibration(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi), shapes)


def mass_matrix(structure: Structure, arrays: StructureArrays, mass: MassModel = "consistent") -> FloatArray:
    """Return the masses of the nodes along one axis, the same along each, ``(n_nodes, n_nodes)``.

    Parameters
    ----------
    structure, arrays
        The structure, and the same as arrays.
    mass
        ``consistent`` or ``lumped``.

    Returns
    -------
    ndarray
        In units of force times second squared per length.

    Raises
    ------
    ModelError
        For another kind of mass.
    """
    if mass not in SHARES:
        raise ModelError.at("mass", mass, "'consistent' or 'lumped'", candidates=SHARES)
    gravity = structure.units.number(STANDARD_GRAVITY, "length")
    density = np.array([structure.weight_per_length(member) for member in arrays.member_ids]) / gravity
    _, lengths = segment_spans(arrays, arrays.coordinates)
    segment = np.repeat(density, arrays.n_segments) * lengths
    at_node, between = SHARES[mass]
    first, second = arrays.segment_nodes.T
    matrix = np.zeros((arrays.n_nodes, arrays.n_nodes))
    for rows, columns, share in (
        (first, first, at_node),
        (second, second, at_node),
        (first, second, between),
        (second, first, between),
    ):
        np.add.at(matrix, (rows, columns), share * segment)
    return matrix


def _following(stiffness: FloatArray, heavy: np.ndarray) -> FloatArray:
    """Return how the coordinates without a mass follow the others, ``(n_massless, n_heavy)``."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    if heavy.all():
        return np.zeros((0, len(stiffness)))
    try:
        factor = cho_factor(stiffness[np.ix_(~heavy, ~heavy)])
    except LinAlgError:
        raise SolverError(
            "natural frequencies need members with a weight at every movable node that nothing holds"
        ) from None
    following: FloatArray = -cho_solve(factor, stiffness[np.ix_(~heavy, heavy)])
    return following
