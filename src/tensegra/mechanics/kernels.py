"""Compiled kernels: internal force, tangent stiffness, block LDLᵀ.

Every kernel is written for one run and compiled for one run or for eight in lockstep, by the shape
of its arrays: ``(n,)`` or ``(n, WIDTH)`` (`tensegra.mechanics.lanes`). Shapes below leave the lanes
out. Symbols are those of the nomenclature: ℓ path length, l₀ rest length, T tension, k = ∂T/∂ℓ,
n unit vector along a segment, s its length, b = ∂ℓ/∂x.

`topology` is a `Topology`, `lanes` are `Lanes` (`tensegra.mechanics.state`).
"""

import numpy as np

from tensegra.mechanics import law
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import choose, fused, item, less, load, magnitude, root, store, zero

PIVOT_ROUNDING = 1e-13
"""Pivots below this share of the largest EA/l₀ are rounding errors of a zero."""

ZERO_EIGENVALUE = 1e-11
"""Eigenvalues within this share of the largest EA/l₀ of zero cannot be told from it."""

HELD_STIFFNESS = 1e3
"""What holds a held coordinate, as a multiple of the largest EA/l₀: above every eigenvalue of K."""


@njit
def dot3(a0, b0, a1, b1, a2, b2):
    """Sum three products, each rounded with its sum."""
    return fused(a2, b2, fused(a1, b1, a0 * b0))


@njit
def less_dot3(c, a0, b0, a1, b1, a2, b2):
    """Subtract three products, each rounded with its difference."""
    return fused(-1.0 * a2, b2, fused(-1.0 * a1, b1, fused(-1.0 * a0, b0, c)))


@njit
def measure(topology, lanes):
    """Measure all members at the positions `x`, with the cables that `taut` says carry force.

    Fills `unit` n ``(3 n_segments,)``, `inverse_length` 1/s ``(n_segments,)``, and of the members
    `length` ℓ, `tension` T and `axial` k, the last two zero where `taut` is.
    """
    x, segment_nodes, segment_start = lanes.x, topology.segment_nodes, topology.segment_start
    for e in range(topology.n_members):
        total = zero(x)
        for s in range(item(segment_start, e), item(segment_start, e + 1)):
            i, j = 3 * item(segment_nodes, 2 * s), 3 * item(segment_nodes, 2 * s + 1)
            dx = load(x, j) - load(x, i)
            dy = load(x, j + 1) - load(x, i + 1)
            dz = load(x, j + 2) - load(x, i + 2)
            distance = root(dot3(dx, dx, dy, dy, dz, dz))
            inverse = 1.0 / distance
            store(lanes.unit, 3 * s, dx * inverse)
            store(lanes.unit, 3 * s + 1, dy * inverse)
            store(lanes.unit, 3 * s + 2, dz * inverse)
            store(lanes.inverse_length, s, inverse)
            total = total + distance
        l0, ea, taut = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.taut, e)
        store(lanes.length, e, total)
        store(lanes.axial, e, taut * law.by_length(total, l0, ea))
        store(lanes.tension, e, taut * law.tension(total, l0, ea))


@njit
def internal_force(topology, lanes, tension, force):
    """Sum f = Σ T b over all members (Eq. 5 of the paper), ``(3 n_nodes,)``."""
    unit, segment_nodes, segment_start = lanes.unit, topology.segment_nodes, topology.segment_start
    for i in range(topology.n_coordinates):
        store(force, i, zero(force))
    for e in range(topology.n_members):
        t = load(tension, e)
        for s in range(item(segment_start, e), item(segment_start, e + 1)):
            i, j = 3 * item(segment_nodes, 2 * s), 3 * item(segment_nodes, 2 * s + 1)
            for c in range(3):
                component = t * load(unit, 3 * s + c)
                store(force, i + c, load(force, i + c) - component)
                store(force, j + c, load(force, j + c) + component)


@njit
def stretch_rate(topology, lanes, motion, rate):
    """Differentiate the path lengths along a motion v of the nodes: b·v, ``(n_members,)``."""
    unit, segment_nodes, segment_start = lanes.unit, topology.segment_nodes, topology.segment_start
    for e in range(topology.n_members):
        total = zero(rate)
        for s in range(item(segment_start, e), item(segment_start, e + 1)):
            i, j = 3 * item(segment_nodes, 2 * s), 3 * item(segment_nodes, 2 * s + 1)
            for c in range(3):
                total = fused(load(unit, 3 * s + c), load(motion, j + c) - load(motion, i + c), total)
        store(rate, e, total)


@njit
def force_rate(topology, lanes, motion, tension_rate, rate):
    """Differentiate the internal force along a motion v of the nodes, ``(3 n_nodes,)``.

    ``rate = Σ Ṫ b + T ∂²ℓ v`` with the whole rate Ṫ of the tensions, ``(n_members,)``.
    """
    unit, segment_nodes, segment_start = lanes.unit, topology.segment_nodes, topology.segment_start
    for i in range(topology.n_coordinates):
        store(rate, i, zero(rate))
    for e in range(topology.n_members):
        t, t_rate = load(lanes.tension, e), load(tension_rate, e)
        for s in range(item(segment_start, e), item(segment_start, e + 1)):
            i, j = 3 * item(segment_nodes, 2 * s), 3 * item(segment_nodes, 2 * s + 1)
            vx = load(motion, j) - load(motion, i)
            vy = load(motion, j + 1) - load(motion, i + 1)
            vz = load(motion, j + 2) - load(motion, i + 2)
            nx, ny, nz = load(unit, 3 * s), load(unit, 3 * s + 1), load(unit, 3 * s + 2)
            stress = t * load(lanes.inverse_length, s)
            along = t_rate - stress * dot3(nx, vx, ny, vy, nz, vz)
            rx, ry = fused(stress, vx, along * nx), fused(stress, vy, along * ny)
            rz = fused(stress, vz, along * nz)
            store(rate, i, load(rate, i) - rx)
            store(rate, i + 1, load(rate, i + 1) - ry)
            store(rate, i + 2, load(rate, i + 2) - rz)
            store(rate, j, load(rate, j) + rx)
            store(rate, j + 1, load(rate, j + 1) + ry)
            store(rate, j + 2, load(rate, j + 2) + rz)


@njit
def path_gradient(topology, unit, e, gradient):
    """Sum b = ∂ℓ/∂x of member `e` over the distinct nodes of its path, ``(3 m,)``."""
    for i in range(3 * (item(topology.path_start, e + 1) - item(topology.path_start, e))):
        store(gradient, i, zero(gradient))
    for s in range(item(topology.segment_start, e), item(topology.segment_start, e + 1)):
        i, j = 3 * item(topology.segment_local, 2 * s), 3 * item(topology.segment_local, 2 * s + 1)
        for c in range(3):
            component = load(unit, 3 * s + c)
            store(gradient, i + c, load(gradient, i + c) - component)
            store(gradient, j + c, load(gradient, j + c) + component)


@njit
def assemble(topology, lanes):
    """Assemble K = Σ k b bᵀ + T ∂²ℓ (Eq. 1 of the paper) into `blocks`.

    `stress` are the tensions T of the geometric part, `scale` ``(1,)`` is the structure's largest k:
    held coordinates get a multiple of it on the diagonal.
    """
    blocks, unit, column_start = lanes.blocks, lanes.unit, topology.column_start
    for i in range(9 * topology.n_entries):
        store(blocks, i, zero(blocks))
    for e in range(topology.n_members):
        first, last = item(topology.segment_start, e), item(topology.segment_start, e + 1)
        t, k = load(lanes.stress, e), load(lanes.axial, e)
        for s in range(first, last):
            node_i, node_j = item(topology.segment_nodes, 2 * s), item(topology.segment_nodes, 2 * s + 1)
            block_i, block_j = item(topology.node_block, node_i), item(topology.node_block, node_j)
            across = t * load(lanes.inverse_length, s)
            along = (k if last - first == 1 else zero(blocks)) - across
            for c in range(3):
                scaled = along * load(unit, 3 * s + c)
                for d in range(3):
                    value = fused(scaled, load(unit, 3 * s + d), across if c == d else zero(blocks))
                    if block_i >= 0:
                        place = 9 * item(column_start, block_i) + 3 * c + d
                        store(blocks, place, load(blocks, place) + value)
                    if block_j >= 0:
                        place = 9 * item(column_start, block_j) + 3 * c + d
                        store(blocks, place, load(blocks, place) + value)
                    if item(topology.segment_entry, s) >= 0:
                        place = 9 * item(topology.segment_entry, s) + 3 * c + d
                        store(blocks, place, load(blocks, place) - value)
        if item(topology.pair_start, e + 1) > item(topology.pair_start, e):
            path_gradient(topology, unit, e, lanes.gradient)
            for p in range(item(topology.pair_start, e), item(topology.pair_start, e + 1)):
                row, column = 3 * item(topology.pair_local, 2 * p), 3 * item(topology.pair_local, 2 * p + 1)
                target = 9 * item(topology.pair_entry, p)
                for c in range(3):
                    scaled = k * load(lanes.gradient, row + c)
                    for d in range(3):
                        place = target + 3 * c + d
                        product = fused(scaled, load(lanes.gradient, column + d), load(blocks, place))
                        store(blocks, place, product)
        if item(topology.slide_start, e + 1) > item(topology.slide_start, e):
            # A slack cable does not stretch, but its transports keep a stiffness: they go their own way.
            own = law.by_length(load(lanes.length, e), load(lanes.rest_length, e), load(lanes.stiffness, e))
            n = 1.0 * (last - first)
            for s in range(first, last):
                _slide(topology, lanes, s, item(topology.slide_start, e) + s - first, n * k, n * own)
    for p in range(topology.n_held_entry):
        place = item(topology.held_entry, p)
        store(blocks, place, zero(blocks))
    for p in range(topology.n_held_diagonal):
        place = item(topology.held_diagonal, p)
        store(blocks, place, HELD_STIFFNESS * load(lanes.scale, 0))


@njit
def _slide(topology, lanes, s, at, k, own):
    """Add a segment of a long clustered cable: k w wᵀ over its nodes and the transports at its ends."""
    for i in range(8):
        left = _along(lanes, s, i)
        for j in range(8):
            place = item(topology.slide_target, 64 * at + 8 * i + j)
            if place >= 0:
                stiffness = own if i > 5 and j > 5 else k
                value = fused(stiffness * left, _along(lanes, s, j), load(lanes.blocks, place))
                store(lanes.blocks, place, value)


@njit
def _along(lanes, s, i):
    """Entry of w: how a segment stretches with its nodes, and as the cable runs in and out at its ends."""
    one = zero(lanes.x) + 1.0
    if i < 3:
        return zero(lanes.x) - load(lanes.unit, 3 * s + i)
    if i < 6:
        return load(lanes.unit, 3 * s + i - 3)
    return one if i == 6 else zero(lanes.x) - one


@njit
def factorise(topology, lanes):
    """Factorise K + shift·I = L D Lᵀ by 3 × 3 blocks, in place, left-looking.

    On return `blocks` holds U = L D below the diagonal and `pivot_inverse` the factors of the blocks
    of D (l10, l20, l21, 1/d0, 1/d1, 1/d2); `n_negative` ``(1,)`` counts the scalar pivots that are
    not positive, by Sylvester's law the eigenvalues that are not. A pivot that is nothing but
    rounding beside `scale` ``(1,)``, the structure's largest k, counts as one and is replaced
    by that rounding. Transports are not shifted: what is counted is the inertia of K on the nodes.
    """
    blocks, pivot_inverse = lanes.blocks, lanes.pivot_inverse
    column_start, row, left_start = topology.column_start, topology.row, topology.left_start
    left_column, left_entry = topology.left_column, topology.left_entry
    place = np.empty(topology.n_blocks, dtype=np.int64)
    negative = zero(blocks)
    shift, floor = load(lanes.shift, 0), PIVOT_ROUNDING * load(lanes.scale, 0)
    above = 1.5 * floor  # a pivot that was put at the floor is none
    for j in range(topology.n_blocks):
        for p in range(item(column_start, j), item(column_start, j + 1)):
            place[item(row, p)] = 9 * p
        moved = shift if item(topology.block_node, j) >= 0 else zero(blocks)
        b = 9 * item(column_start, j)
        for t in range(item(left_start, j), item(left_start, j + 1)):
            k = item(left_column, t)
            u, q = 9 * item(left_entry, t), 6 * k
            w00, w10, w20 = _times_pivot(
                pivot_inverse, q, load(blocks, u), load(blocks, u + 1), load(blocks, u + 2)
            )
            w01, w11, w21 = _times_pivot(
                pivot_inverse, q, load(blocks, u + 3), load(blocks, u + 4), load(blocks, u + 5)
            )
            w02, w12, w22 = _times_pivot(
                pivot_inverse, q, load(blocks, u + 6), load(blocks, u + 7), load(blocks, u + 8)
            )
            for p in range(item(left_entry, t), item(column_start, k + 1)):
                target = place[item(row, p)]
                for c in range(0, 9, 3):
                    u0, u1, u2 = (
                        load(blocks, 9 * p + c),
                        load(blocks, 9 * p + c + 1),
                        load(blocks, 9 * p + c + 2),
                    )
                    at = target + c
                    store(blocks, at, less_dot3(load(blocks, at), u0, w00, u1, w10, u2, w20))
                    store(blocks, at + 1, less_dot3(load(blocks, at + 1), u0, w01, u1, w11, u2, w21))
                    store(blocks, at + 2, less_dot3(load(blocks, at + 2), u0, w02, u1, w12, u2, w22))
        a10, a20 = load(blocks, b + 3), load(blocks, b + 6)
        d0 = _kept_from_zero(load(blocks, b) + moved, floor)
        l10, l20 = a10 / d0, a20 / d0
        d1 = _kept_from_zero(fused(-1.0 * l10, a10, load(blocks, b + 4) + moved), floor)
        u21 = fused(-1.0 * l20, a10, load(blocks, b + 7))
        l21 = u21 / d1
        d2 = _kept_from_zero(
            fused(-1.0 * l21, u21, fused(-1.0 * l20, a20, load(blocks, b + 8) + moved)), floor
        )
        negative = negative + less(d0, above) + less(d1, above) + less(d2, above)
        q = 6 * j
        store(pivot_inverse, q, l10)
        store(pivot_inverse, q + 1, l20)
        store(pivot_inverse, q + 2, l21)
        store(pivot_inverse, q + 3, 1.0 / d0)
        store(pivot_inverse, q + 4, 1.0 / d1)
        store(pivot_inverse, q + 5, 1.0 / d2)
    store(lanes.n_negative, 0, negative)


@njit
def _kept_from_zero(pivot, floor):
    return choose(less(magnitude(pivot), floor), choose(less(pivot, 0.0 * floor), -1.0 * floor, floor), pivot)


@njit
def solve(topology, lanes, rhs):
    """Solve L D Lᵀ x = rhs in place; `rhs` is in elimination order, ``(3 n_blocks,)``."""
    blocks, pivot_inverse = lanes.blocks, lanes.pivot_inverse
    column_start, row = topology.column_start, topology.row
    for j in range(topology.n_blocks):
        r = 3 * j
        y0, y1, y2 = _times_pivot(pivot_inverse, 6 * j, load(rhs, r), load(rhs, r + 1), load(rhs, r + 2))
        store(rhs, r, y0)
        store(rhs, r + 1, y1)
        store(rhs, r + 2, y2)
        for p in range(item(column_start, j) + 1, item(column_start, j + 1)):
            u, i = 9 * p, 3 * item(row, p)
            for c in range(3):
                at = u + 3 * c
                u0, u1, u2 = load(blocks, at), load(blocks, at + 1), load(blocks, at + 2)
                store(rhs, i + c, less_dot3(load(rhs, i + c), u0, y0, u1, y1, u2, y2))
    for j in range(topology.n_blocks - 1, -1, -1):
        r = 3 * j
        z0, z1, z2 = zero(rhs), zero(rhs), zero(rhs)
        for p in range(item(column_start, j) + 1, item(column_start, j + 1)):
            u, i = 9 * p, 3 * item(row, p)
            for c in range(3):
                x = load(rhs, i + c)
                at = u + 3 * c
                z0 = fused(load(blocks, at), x, z0)
                z1 = fused(load(blocks, at + 1), x, z1)
                z2 = fused(load(blocks, at + 2), x, z2)
        z0, z1, z2 = _times_pivot(pivot_inverse, 6 * j, z0, z1, z2)
        store(rhs, r, load(rhs, r) - z0)
        store(rhs, r + 1, load(rhs, r + 1) - z1)
        store(rhs, r + 2, load(rhs, r + 2) - z2)


@njit
def _times_pivot(pivot_inverse, q, y0, y1, y2):
    """Return D⁻¹ y for a block of D = L diag(d) Lᵀ, by substitution.

    An inverse of its own would lose digits where the block is nearly singular.
    """
    l10, l20, l21 = load(pivot_inverse, q), load(pivot_inverse, q + 1), load(pivot_inverse, q + 2)
    y1 = fused(-1.0 * l10, y0, y1)
    y2 = fused(-1.0 * l21, y1, fused(-1.0 * l20, y0, y2))
    y2 = y2 * load(pivot_inverse, q + 5)
    y1 = fused(-1.0 * l21, y2, y1 * load(pivot_inverse, q + 4))
    y0 = fused(-1.0 * l10, y1, fused(-1.0 * l20, y2, y0 * load(pivot_inverse, q + 3)))
    return y0, y1, y2
