"""Rigid motions that the supports leave: known from the geometry before any solve.

A body is a part of the structure whose movable nodes hang together by members; a node that is held along
all axes belongs to every body that is tied to it. A rigid motion u = t + ω × x of a body that the supports
leave changes no length. It is stiffened by nothing but loads, K (ω × x) = ω × p, so it is one of three:

- neutral, where no load ever does work along it: the position along it is free, and says nothing against
  the stability of the structure. Coordinates are held that stand for it (as many, and no reaction comes of
  it), so that all else is solved as if the supports held them;
- a motion that loads turn, as a pendulum's: it is a coordinate like any other;
- a translation along which a net force pulls: there is no equilibrium.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tensegra.mechanics.arrays import AXES, BoolArray, FloatArray, StructureArrays

NOTHING = 1e-9
"""Share of the size, of the loads or of one below which a motion, a power or a singular value is rounding."""

MOST_TURNS, MOST_SADDLES = 50, 6
"""Gauss–Newton steps to where the distance of `align` is stationary, which takes five, and times that it is
left because it is not least there."""


@dataclass(frozen=True, eq=False)
class RigidMotions:
    """Rigid motions of the bodies of a structure.

    Attributes
    ----------
    names
        Of each motion, such as ``rotation about x``.
    translation, spin
        t and ω of each motion at each node, zero at the nodes of other bodies, ``(n_motions, n_nodes, 3)``.
    """

    names: tuple[str, ...]
    translation: FloatArray
    spin: FloatArray

    def __len__(self) -> int:
        return len(self.names)

    def fields(self, nodes: FloatArray) -> FloatArray:
        """Return t + ω × x at positions ``(…, n_nodes, 3)``, shape ``(…, n_motions, n_nodes, 3)``."""
        fields: FloatArray = self.translation + np.cross(self.spin, nodes[..., None, :, :])
        return fields

    def bend(self, nodes: FloatArray, along: FloatArray) -> FloatArray:
        """Return how positions bend along a field as the structure goes along the motions.

        The second derivative of x·v by the motions p and q, v·(ω_p × u_q) with both orders' mean, for a
        field v ``(…, n_nodes, 3)``, shape ``(…, n_motions, n_motions)``.
        """
        turned = np.cross(self.spin[:, None], self.fields(nodes)[..., None, :, :, :])
        bent = np.einsum("...pqni,...ni->...pq", turned, along)
        mean: FloatArray = 0.5 * (bent + np.swapaxes(bent, -1, -2))
        return mean

    def combined(self, shares: FloatArray) -> "RigidMotions":
        """Return linear combinations, ``(n, n_motions)``, under the names of what they are made of."""
        names = []
        for row in shares:
            parts = [name for name, share in zip(self.names, row, strict=True) if abs(share) > NOTHING]
            names.append(parts[0] if len(parts) == 1 else "rigid motion of " + " with ".join(parts))
        translation, spin = (np.tensordot(shares, field, axes=1) for field in (self.translation, self.spin))
        return RigidMotions(tuple(names), translation, spin)


def rigid_motions(arrays: StructureArrays) -> RigidMotions:
    """Find the rigid motions that the supports of a structure leave, body by body.

    A motion that the supports leave to first order only, such as that of a bar between two hinges in a line,
    is none of them but a mechanism.
    """
    names: list[str] = []
    translations, spins = [], []
    bodies = _bodies(arrays)
    for members in bodies:
        for translation, spin in _motions_of(arrays, members):
            name = _name_of(translation, spin)
            if len(bodies) > 1:
                first = arrays.node_ids[int(np.flatnonzero(members & arrays.free.any(axis=1))[0])]
                name += f" of the part with node {first}"
            names.append(name)
            centre = arrays.coordinates[members].mean(axis=0)
            whole = np.zeros((2, arrays.n_nodes, 3))
            whole[0, members], whole[1, members] = translation - np.cross(spin, centre), spin
            translations.append(whole[0])
            spins.append(whole[1])
    shape = (len(names), arrays.n_nodes, 3)
    return RigidMotions(tuple(names), np.reshape(translations, shape), np.reshape(spins, shape))


@dataclass(frozen=True, eq=False)
class Freedom:
    """What loads make of the rigid motions of a structure.

    Attributes
    ----------
    neutral
        Motions along which no load does work, wherever the structure is.
    unheld
        Names of the translations along which a net force pulls.
    """

    neutral: RigidMotions
    unheld: tuple[str, ...]

    @cached_property
    def key(self) -> bytes:
        """What tells one freedom from another."""
        return self.neutral.translation.tobytes() + self.neutral.spin.tobytes()


def freedom_under(arrays: StructureArrays, motions: RigidMotions, loads: FloatArray) -> Freedom:
    """Find which motions stay neutral under all of some loads, ``(…, n_nodes, 3)``."""
    loads = np.where(arrays.free, loads, 0.0).reshape(-1, arrays.n_nodes, 3)
    scale = float(np.abs(loads).max(initial=0.0))
    if not len(motions) or scale == 0.0:
        return Freedom(motions, ())
    loads = loads / scale
    # p × ω = 0 for every load p of a node: (tr M − M) ω = 0 with M = Σ p pᵀ, as (p × ω)² = ω·(tr M − M) ω.
    moment = np.einsum("rni,rnj->nij", loads, loads)
    turning = np.trace(moment, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moment
    turned = np.einsum("nij,qnj->qni", turning, motions.spin).reshape(len(motions), -1)
    pulled = np.einsum("rni,qni->qr", loads, motions.fields(arrays.coordinates))
    size = max(arrays.size, NOTHING)
    rows = np.hstack([turned, pulled / size])
    unheld = tuple(
        name
        for name, spin, power in zip(motions.names, motions.spin, pulled, strict=True)
        if not spin.any() and np.abs(power).max() > NOTHING * len(arrays.node_ids)
    )
    _, singular, right = np.linalg.svd(rows.T, full_matrices=True)
    rank = int((singular > NOTHING * max(1.0, singular.max(initial=0.0))).sum())
    if rank == 0:
        return Freedom(motions, unheld)
    return Freedom(motions.combined(_reduced(right[rank:])), unheld)


def held_for(arrays: StructureArrays, motions: RigidMotions, nodes: FloatArray) -> StructureArrays:
    """Hold as many coordinates as there are motions, such that they leave none of them.

    Parameters
    ----------
    arrays
        The structure with its own supports.
    motions
        Neutral motions.
    nodes
        Where it is, ``(n_nodes, 3)``.
    """
    if not len(motions):
        return arrays
    from scipy.linalg import qr

    fields = motions.fields(nodes)[:, arrays.free]
    _, _, order = qr(fields, mode="economic", pivoting=True)
    free = arrays.free.copy()
    rows = np.argwhere(free)[order[: len(motions)]]
    free[tuple(rows.T)] = False
    return replace(arrays, free=free)


def align(nodes: FloatArray, reference: FloatArray, motions: RigidMotions) -> FloatArray:
    """Move positions along neutral motions to where they are nearest to a reference in the mean square.

    Parameters
    ----------
    nodes
        Shape ``(…, n_nodes, 3)``.
    reference
        Positions ``(…, n_nodes, 3)``.
    motions
        Neutral motions; what they are at the positions is a motion that nothing holds.
    """
    if not len(motions) or not nodes.size:
        return nodes
    for _ in range(MOST_SADDLES):
        nodes = _nearest(nodes, reference, motions)
        turn = _off_farthest(nodes, reference, motions)
        if not turn.any():
            break
        nodes = moved_along(nodes, motions, turn)
    return nodes


def _nearest(nodes: FloatArray, reference: FloatArray, motions: RigidMotions) -> FloatArray:
    """Move positions along motions to where the distance to a reference is stationary (Gauss–Newton)."""
    for _ in range(MOST_TURNS):
        fields = motions.fields(nodes)
        flat = fields.reshape(*fields.shape[:-2], -1)
        away = (reference - nodes).reshape(*nodes.shape[:-2], -1)
        normal = flat @ np.swapaxes(flat, -1, -2)
        # Where the nodes have come to lie on a line, a turn about it moves none: it is left out.
        shares = (np.linalg.pinv(normal, rcond=NOTHING, hermitian=True) @ (flat @ away[..., None]))[..., 0]
        moved = moved_along(nodes, motions, shares)
        nodes, change = moved, float(np.abs(moved - nodes).max())
        if change <= 1e-15 * float(np.abs(nodes).max()):
            break
    return nodes


def _off_farthest(nodes: FloatArray, reference: FloatArray, motions: RigidMotions) -> FloatArray:
    """Return shares of the motions, ``(…, n_motions)``, that lead off where the distance is not least.

    A body that is half a turn off is where its distance is stationary, but largest: the second derivative
    of half its square, u_p·u_q − (r − x)·(ω_p × u_q) with both orders' mean, has a negative direction there.
    Shares are zero where it has none.
    """
    fields = motions.fields(nodes)
    flat = fields.reshape(*fields.shape[:-2], -1)
    normal = flat @ np.swapaxes(flat, -1, -2)
    form = normal - motions.bend(nodes, reference - nodes)
    # Motions in a unit of their own: a turn and a shift that move the nodes by as much count alike.
    size = np.sqrt(np.maximum(np.einsum("...qq->...q", normal), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(form / (size[..., :, None] * size[..., None, :]))
    lowest = vectors[..., 0] / size
    spin = np.abs(np.einsum("...q,qni->...ni", lowest, motions.spin)).max(axis=(-1, -2))
    off = (values[..., 0] < -NOTHING) & (spin > 0.0)
    shares: FloatArray = np.where(off, 1.0 / np.where(off, spin, 1.0), 0.0)[..., None] * lowest
    return shares


def in_frame(
    rates: FloatArray, nodes: FloatArray, reference: FloatArray, motions: RigidMotions
) -> FloatArray:
    """Take out of rates of positions what the frame of least squares moves along with them.

    Parameters
    ----------
    rates
        Shape ``(n_runs, n_directions, 3 n_nodes)``.
    nodes, reference
        Positions, and what they are nearest to, ``(n_runs, n_nodes, 3)``.
    motions
        Neutral motions.
    """
    if not len(nodes):
        return rates
    at = motions.fields(nodes).reshape(len(nodes), len(motions), -1)
    before = motions.fields(reference).reshape(at.shape)
    normal = before @ np.swapaxes(at, -1, -2)
    shares = np.linalg.pinv(normal, rcond=NOTHING) @ (before @ np.swapaxes(rates, -1, -2))
    return rates - np.swapaxes(shares, -1, -2) @ at


def moved_along(nodes: FloatArray, motions: RigidMotions, shares: FloatArray) -> FloatArray:
    """Go along a combination of motions for a unit of time: x ↦ exp(ξ) x of each node's ξ = (t, ω)."""
    translation = np.einsum("...q,qni->...ni", shares, motions.translation)
    spin = np.einsum("...q,qni->...ni", shares, motions.spin)
    angle = np.linalg.norm(spin, axis=-1, keepdims=True)
    small = angle < 1e-8
    safe = np.where(small, 1.0, angle)
    sine = np.where(small, 1.0, np.sin(safe) / safe)
    half = np.where(small, 0.5, (1.0 - np.cos(safe)) / safe**2)
    third = np.where(small, 1.0 / 6.0, (safe - np.sin(safe)) / safe**3)
    once = np.cross(spin, nodes)
    turned = nodes + sine * once + half * np.cross(spin, once)
    across = np.cross(spin, translation)
    shift = translation + half * across + third * np.cross(spin, across)
    moved: FloatArray = turned + shift
    return moved


def _bodies(arrays: StructureArrays) -> list[BoolArray]:
    """Return the nodes of each body, held ones that it is tied to included."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    movable: BoolArray = np.any(arrays.free, axis=1)
    first, second = arrays.segment_nodes.T
    tied = movable[first] & movable[second]
    graph = coo_array((np.ones(tied.sum()), (first[tied], second[tied])), shape=(arrays.n_nodes,) * 2)
    _, label = connected_components(graph, directed=False)
    bodies = []
    for one in np.unique(label[movable]):
        members = movable & (label == one)
        inside = members[first] | members[second]
        members[first[inside]] = members[second[inside]] = True
        bodies.append(members)
    return bodies


def _motions_of(arrays: StructureArrays, members: BoolArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return t at the centre, and ω, of the rigid motions that the supports leave to one body."""
    x = arrays.coordinates[members]
    x = x - x.mean(axis=0)
    size = max(float(np.abs(x).max(initial=0.0)), NOTHING)
    free = arrays.free[members]
    fields = np.zeros((6, len(x), 3))
    fields[:3] = np.eye(3)[:, None, :]
    fields[3:] = np.cross(np.eye(3)[:, None, :], x[None]) / size
    held, moving = fields[:, ~free], fields[:, free]
    left = _null_space(held.T)
    # What moves no node is no motion: the turn of a straight rod about itself.
    _, singular, right = np.linalg.svd((left @ moving).T, full_matrices=False)
    left = right[singular > 1e2 * NOTHING * max(1.0, singular.max(initial=0.0))] @ left
    left = _beyond_first_order(left, held, x[np.nonzero(~free)[0]] / size, np.nonzero(~free)[1])
    return [(row[:3], row[3:] / size) for row in _by_axes(left)]


def _beyond_first_order(left: FloatArray, held: FloatArray, at: FloatArray, axis: np.ndarray) -> FloatArray:
    """Leave out the motions whose acceleration ω × (t + ω × x) no further motion makes the supports allow."""
    for weights in _null_space(held) if len(left) else ():
        form = np.zeros((6, 6))
        for weight, x, c in zip(weights, at, axis, strict=True):
            if weight == 0.0:
                continue
            # e·(ω × (τ + σ × x)) as a bilinear form in (t, ω) and (τ, σ).
            cross = np.cross(np.eye(3), np.eye(3)[c])  # rows: e_i × e_c, so that ω·(v × e) = e·(ω × v)
            form[3:, :3] -= weight * cross.T
            turn = np.cross(np.eye(3), x)  # rows: σ = e_j gives e_j × x
            form[3:, 3:] -= weight * (turn @ cross).T
        form = 0.5 * (form + form.T)
        if not len(left):
            break
        inner = left @ form @ left.T
        left = _null_space(inner) @ left
    return left


def _null_space(matrix: FloatArray) -> FloatArray:
    """Return orthonormal rows that span {v: matrix v = 0}."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    _, singular, right = np.linalg.svd(matrix, full_matrices=matrix.shape[0] < matrix.shape[1])
    rank = int((singular > 1e2 * NOTHING * max(1.0, singular.max(initial=0.0))).sum())
    return right[rank:]


def _by_axes(motions: FloatArray) -> FloatArray:
    """Return a basis of motions ``(n, 6)`` that is as plain as can be: translations first, along the axes."""
    if not len(motions):
        return motions
    _, singular, _ = np.linalg.svd(motions[:, 3:])
    n_turning = int((singular > 1e2 * NOTHING).sum())
    left, _, _ = np.linalg.svd(motions[:, 3:])
    turning, gliding = left[:, :n_turning].T @ motions, left[:, n_turning:].T @ motions
    glides = _reduced(gliding[:, :3])
    turns = _reduced(turning[:, 3:])
    # Each turn with the translation that belongs to it.
    shares = np.linalg.lstsq(turning[:, 3:].T, turns.T, rcond=None)[0].T
    plain = np.zeros((len(motions), 6))
    plain[: len(glides), :3] = glides
    plain[len(glides) :] = shares @ turning
    plain[len(glides) :, 3:] = turns
    return plain


def _reduced(rows: FloatArray) -> FloatArray:
    """Return the reduced echelon form of independent rows, each of length one."""
    rows = rows.copy()
    done: list[int] = []
    for k in range(len(rows)):
        sizes = np.abs(rows[k:])
        sizes[:, done] = 0.0
        i, j = np.unravel_index(int(np.argmax(sizes > 0.3 * sizes.max())), sizes.shape)
        swapped = rows[k + int(i)].copy()
        rows[k + int(i)], rows[k] = rows[k], swapped
        rows[k] /= rows[k, j]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, j] * rows[k]
        done.append(int(j))
    rows[np.abs(rows) < NOTHING] = 0.0
    order = np.argsort([int(np.argmax(np.abs(row) > NOTHING)) for row in rows], kind="stable")
    rows = rows[order]
    reduced: FloatArray = rows / np.linalg.norm(rows, axis=1, keepdims=True) if len(rows) else rows
    return reduced


def _name_of(translation: FloatArray, spin: FloatArray) -> str:
    """Return the name of a motion by its axis."""
    what, along = ("rotation about", spin) if np.abs(spin).max() > 0.0 else ("translation along", translation)
    along = along / np.linalg.norm(along)
    nearest = int(np.argmax(np.abs(along)))
    if abs(along[nearest]) > 1.0 - NOTHING:
        return f"{what} {AXES[nearest]}"
    return f"{what} ({', '.join(f'{c:.3g}' for c in along)})"
