"""Does it stand: self-stress, mechanisms, prestress stability.

The equilibrium matrix A has one column b = ∂ℓ/∂x a member: A t = p balances tensions t with loads p,
Aᵀ v are the rates of the lengths. Its null space holds the states of self-stress, its left null
space the mechanisms, motions that change no length to first order (Pellegrino & Calladine 1986,
doi:10.1016/0020-7683(86)90014-4; for clustered cables Moored & Bart-Smith 2009,
doi:10.1016/j.ijsolstr.2009.05.005).
"""

from dataclasses import dataclass, replace

import numpy as np

from tensegra.errors import SolverError
from tensegra.mechanics.arrays import FloatArray, StructureArrays, segment_spans, structure_arrays
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.rigid import RigidMotions
from tensegra.mechanics.status import most_moved_of_each
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Structure

SINGULAR = 1e-9
"""Eigenvalues of K below this share of the largest EA/l₀ belong to free mechanisms."""

RANK_TOLERANCE = 1e-7
"""Singular values below this share of the largest are zero: coordinates are written to six digits."""

LARGEST_LISTED = 64
"""At most this many mechanisms are looked for in a large structure."""

AT_REST = 1e-9
"""Share of its rest length by which a cable may be shorter and still be told as just taut."""

LARGEST_SVD = 4000
"""Degrees of freedom above which the dense decomposition of the equilibrium matrix is refused."""


@dataclass(frozen=True, eq=False)
class SelfStress:
    """States of self-stress and mechanisms of a structure at a position.

    Attributes
    ----------
    n_free, n_columns, rank
        Free degrees of freedom; columns of the equilibrium matrix, which are the members, or
        segments where the clusters are opened, that touch a free coordinate; and its rank.
    states
        Orthonormal states of self-stress over all members (segments), ``(n_self_stress, n)``.
    mechanisms
        Orthonormal inextensional motions, shape ``(n_mechanisms, n_nodes, 3)``.
    """

    n_free: int
    n_columns: int
    rank: int
    states: FloatArray
    mechanisms: FloatArray

    @property
    def n_self_stress(self) -> int:
        """Number of independent states of self-stress."""
        return self.n_columns - self.rank

    @property
    def n_mechanisms(self) -> int:
        """Number of independent mechanisms."""
        return self.n_free - self.rank


def equilibrium_matrix(
    arrays: StructureArrays, nodes: FloatArray | None = None, *, clustered: bool = True
) -> FloatArray:
    """Return A over the free coordinates, shape ``(n_free, n_members)``.

    Parameters
    ----------
    arrays
        The structure.
    nodes
        Positions, shape ``(n_nodes, 3)``; the given ones where left out.
    clustered
        One column a member; False opens the clusters: one column a segment.
    """
    x = arrays.coordinates if nodes is None else nodes
    first, second = arrays.segment_nodes.T
    along, lengths = segment_spans(arrays, x)
    unit = along / lengths[:, None]
    n_segments = len(along)
    matrix = np.zeros((arrays.n_nodes, 3, n_segments))
    columns = np.arange(n_segments)
    matrix[second, :, columns] += unit
    matrix[first, :, columns] -= unit
    if clustered:
        matrix = np.add.reduceat(matrix, arrays.segment_start[:-1], axis=2)
    return matrix[arrays.free]


def self_stress(
    structure: Structure, nodes: FloatArray | None = None, *, clustered: bool = True
) -> SelfStress:
    """Find the states of self-stress and the mechanisms by the singular values of A.

    Parameters
    ----------
    structure
        The structure.
    nodes
        Positions, shape ``(n_nodes, 3)``; the given ones where left out.
    clustered
        False treats every segment as a member of its own, as if the pulleys were locked.

    Raises
    ------
    SolverError
        For a structure too large for a dense decomposition.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> beam = self_stress(library.paper_beam())
    >>> beam.n_mechanisms, beam.n_self_stress
    (17, 1)
    """
    arrays = structure_arrays(structure)
    if arrays.n_free > LARGEST_SVD:
        raise SolverError(
            f"{arrays.n_free} degrees of freedom: the singular values need at most {LARGEST_SVD}"
        )
    matrix = equilibrium_matrix(arrays, nodes, clustered=clustered)
    # A member between held nodes carries what it likes: it is left out of the count.
    balanced = np.any(matrix != 0.0, axis=0)
    left, singular, right = np.linalg.svd(matrix[:, balanced])
    rank = int((singular > RANK_TOLERANCE * singular.max(initial=0.0)).sum())
    mechanisms = np.zeros((arrays.n_free - rank, arrays.n_nodes, 3))
    mechanisms[:, arrays.free] = left[:, rank:].T
    states = np.zeros((len(right) - rank, len(balanced)))
    states[:, balanced] = right[rank:]
    return SelfStress(arrays.n_free, int(balanced.sum()), rank, states, mechanisms)


def prestress_stiffness(path: EquilibriumPath) -> float:
    """Return the lowest eigenvalue of the geometric stiffness on the mechanisms, force per length.

    A structure whose mechanisms are all stiffened by its prestress (a positive value) stands
    however stiff its members are; without mechanisms the value is infinite.
    """
    tangent = tangent_at(path)
    mechanisms = self_stress(path.structure, path.final.nodes).mechanisms
    if not len(mechanisms):
        return np.inf
    # Along a mechanism b·v = 0, so K v is the geometric part T ∂²ℓ/∂x² v alone.
    geometric = np.array([tangent.force_rate(motion).ravel() for motion in mechanisms])
    reduced = geometric @ mechanisms.reshape(len(mechanisms), -1).T
    return float(np.linalg.eigvalsh(0.5 * (reduced + reduced.T))[0])


def free_mechanisms(
    arrays: StructureArrays, motions: RigidMotions, nodes: FloatArray, load: Load
) -> tuple[tuple[str, ...], ...]:
    """Name the nodes that each mode without stiffness moves most.

    Modes of a multiple eigenvalue are not unique; together they span the free motions.

    Parameters
    ----------
    arrays
        The structure.
    motions
        Neutral rigid motions, which are none of the mechanisms.
    nodes
        Positions about the arrays' own origin, ``(n_nodes, 3)``.
    load
        What acts there.
    """
    tangent = Tangent(arrays, motions=motions, nodes=nodes)
    tangent.measure(nodes, load)
    modes = _free_modes(tangent)
    return most_moved_of_each(arrays.node_ids, np.linalg.norm(modes, axis=2))


def _free_modes(tangent: Tangent) -> FloatArray:
    """Return the modes of K without stiffness, where a tangent was last measured, ``(n, n_nodes, 3)``."""
    spectrum = tangent.spectrum(LARGEST_LISTED)
    return spectrum.vectors[np.abs(spectrum.values) <= SINGULAR * tangent.stiffness_scale]


def is_rigid_to_second_order(
    arrays: StructureArrays, nodes: FloatArray, load: Load, modes: FloatArray
) -> bool:
    """Tell whether members without prestress resist some mechanisms, if only with the square of the motion.

    It is so where a state of self-stress, none negative in a cable, would stiffen every one of them: then no
    second motion makes up for what the first one stretches (Connelly & Whiteley 1996,
    doi:10.1137/S0895480192229236). A cable that is longer than its way resists nothing.

    Parameters
    ----------
    arrays, nodes, load
        The structure, its positions about its own origin, ``(n_nodes, 3)``, and what acts there.
    modes
        The mechanisms, ``(n, n_nodes, 3)``.
    """
    from scipy.optimize import linprog

    along, lengths = segment_spans(arrays, nodes)
    length = np.add.reduceat(lengths, arrays.segment_start[:-1])
    resists = ~arrays.is_cable | (length >= load.rest_length * (1.0 - AT_REST))
    if not resists.any():
        return False
    matrix = equilibrium_matrix(arrays, nodes)[:, resists]
    unit = along / lengths[:, None]
    first, second = arrays.segment_nodes.T
    apart = modes[:, second] - modes[:, first]
    apart = apart - np.einsum("nsi,si->ns", apart, unit)[..., None] * unit
    bulge = np.einsum("msi,nsi,s->mns", apart, apart, 1.0 / lengths)
    second_order = np.add.reduceat(bulge, arrays.segment_start[:-1], axis=2)[..., resists]
    bounds = [(0.0 if cable else -1.0, 1.0) for cable in arrays.is_cable[resists]]
    trace = np.einsum("nne->e", second_order)
    found = linprog(-trace, A_eq=matrix, b_eq=np.zeros(len(matrix)), bounds=bounds)
    if found.x is None:
        return False
    stiffness = np.linalg.eigvalsh(second_order @ found.x)
    return bool(stiffness[0] > RANK_TOLERANCE * max(float(np.abs(second_order).max()), 0.0) > 0.0)


def with_mechanisms(result: Equilibrium, motions: RigidMotions, nodes: FloatArray, load: Load) -> Equilibrium:
    """Return an equilibrium where K is singular with its free mechanisms, named in its reason too.

    Parameters
    ----------
    result
        The equilibrium.
    motions, nodes, load
        As in `free_mechanisms`.
    """
    tangent = Tangent(result.arrays, motions=motions, nodes=nodes)
    tangent.measure(nodes, load)
    modes = _free_modes(tangent)
    if not len(modes):
        return result
    free = most_moved_of_each(result.arrays.node_ids, np.linalg.norm(modes, axis=2))
    names = sorted({node for moved in free for node in moved}, key=result.arrays.node_ids.index)
    what = f"{len(free)} free mechanisms, which move" if len(free) > 1 else "a free mechanism, which moves"
    reason = f"{result.reason}; {what} nodes {', '.join(names)}"
    if is_rigid_to_second_order(result.arrays, nodes, load, modes):
        reason += (
            "; rigid to second order: without prestress members resist with the square of the motion alone"
        )
    return replace(result, mechanisms=free, reason=reason)


def tangent_at(path: EquilibriumPath) -> Tangent:
    """Return the tangent system, measured at the last equilibrium of a path.

    Raises
    ------
    SolverError
        Where this failed.
    """
    if not np.all(np.isfinite(path.final.nodes)):
        raise SolverError("a failed run has no stiffness")
    tangent = Tangent(path.given.arrays)
    tangent.measure(path.final.nodes - path.given.arrays.origin, path.load)
    return tangent
