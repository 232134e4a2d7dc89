"""Compiled kernels: internal force, tangent stiffness, block LDLᵀ.

Every kernel is written for one run and compiled for one run or for eight in lockstep, by the shape
of its arrays: ``(n,)`` or ``(n, WIDTH)`` (`tensegra.mechanics.lanes`). Shapes below leave the lanes
out. Symbols are those of the nomenclature: ℓ path length, l₀ rest length, T tension, k = EA/l₀,
n unit vector along a segment, s its length, b = ∂ℓ/∂x.
"""

from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import choose, fused, less, load, magnitude, root, store, zero

PIVOT_ROUNDING = 1e-13
"""Pivots below this share of the largest EA/l₀ are rounding errors of a zero."""


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
def measure(
    x: FloatArray,
    rest_length: FloatArray,
    stiffness: FloatArray,
    taut: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    unit: FloatArray,
    inverse_length: FloatArray,
    length: FloatArray,
    tension: FloatArray,
    axial: FloatArray,
) -> None:
    """Measure all members at the positions `x`, ``(3 n_nodes,)``.

    Fills `unit` n ``(3 n_segments,)``, `inverse_length` 1/s ``(n_segments,)``, `length` ℓ,
    `tension` T and `axial` k ``(n_members,)``. T and k are those of a linear member where `taut` is
    one and zero where it is zero; the caller keeps `taut` in step with the signs of T.
    """
    for e in range(segment_start.size - 1):
        total = zero(length)
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            dx = load(x, j) - load(x, i)
            dy = load(x, j + 1) - load(x, i + 1)
            dz = load(x, j + 2) - load(x, i + 2)
            distance = root(dot3(dx, dx, dy, dy, dz, dz))
            inverse = 1.0 / distance
            store(unit, 3 * s, dx * inverse)
            store(unit, 3 * s + 1, dy * inverse)
            store(unit, 3 * s + 2, dz * inverse)
            store(inverse_length, s, inverse)
            total = total + distance
        k = load(taut, e) * load(stiffness, e) / load(rest_length, e)
        store(length, e, total)
        store(axial, e, k)
        store(tension, e, k * (total - load(rest_length, e)))


@njit
def internal_force(
    unit: FloatArray,
    tension: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    force: FloatArray,
) -> None:
    """Sum f = Σ T b over all members (Eq. 5 of the source), ``(3 n_nodes,)``."""
    for i in range(force.shape[0]):
        store(force, i, zero(force))
    for e in range(segment_start.size - 1):
        t = load(tension, e)
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for c in range(3):
                component = t * load(unit, 3 * s + c)
                store(force, i + c, load(force, i + c) - component)
                store(force, j + c, load(force, j + c) + component)


@njit
def out_of_balance(
    force: FloatArray,
    load: FloatArray,
    free: BoolArray,
    tension: FloatArray,
    length: FloatArray,
    stiffness: FloatArray,
    rest_length: FloatArray,
    rounding: float,
    out: FloatArray,
) -> float:
    """Fill `out` with f − p over the free coordinates; return its largest entry relative to the scale.

    The scale is the largest tension or load, and not less than `rounding` times the largest EA ℓ/l₀.
    """
    largest, scale = 0.0, 0.0
    for i in range(force.size):
        out[i] = 0.0
        if free[i]:
            out[i] = force[i] - load[i]
            # Not `max`: a NaN has to come through.
            if not abs(out[i]) <= largest:
                largest = abs(out[i])
            scale = max(scale, abs(load[i]))
    for e in range(tension.size):
        scale = max(scale, abs(tension[e]), rounding * stiffness[e] * length[e] / rest_length[e])
    return largest / scale


@njit
def stretch_rate(
    unit: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    motion: FloatArray,
    rate: FloatArray,
) -> None:
    """Differentiate the path lengths along a motion v of the nodes: b·v, ``(n_members,)``."""
    for e in range(segment_start.size - 1):
        total = zero(rate)
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for c in range(3):
                total = fused(load(unit, 3 * s + c), load(motion, j + c) - load(motion, i + c), total)
        store(rate, e, total)


@njit
def force_rate(
    unit: FloatArray,
    inverse_length: FloatArray,
    tension: FloatArray,
    tension_rate: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    motion: FloatArray,
    rate: FloatArray,
) -> None:
    """Differentiate the internal force along a motion v of the nodes, ``(3 n_nodes,)``.

    ``rate = Σ Ṫ b + T ∂²ℓ v`` with the whole rate Ṫ of the tensions, ``(n_members,)``.
    """
    for i in range(rate.shape[0]):
        store(rate, i, zero(rate))
    for e in range(segment_start.size - 1):
        t, t_rate = load(tension, e), load(tension_rate, e)
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            vx = load(motion, j) - load(motion, i)
            vy = load(motion, j + 1) - load(motion, i + 1)
            vz = load(motion, j + 2) - load(motion, i + 2)
            nx, ny, nz = load(unit, 3 * s), load(unit, 3 * s + 1), load(unit, 3 * s + 2)
            stress = t * load(inverse_length, s)
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
def path_gradient(
    unit: FloatArray, first_segment: int, last_segment: int, segment_local: IndexArray, gradient: FloatArray
) -> None:
    """Sum b = ∂ℓ/∂x of one member over the distinct nodes of its path, ``(3 m,)``."""
    for i in range(gradient.shape[0]):
        store(gradient, i, zero(gradient))
    for s in range(first_segment, last_segment):
        i, j = 3 * segment_local[s, 0], 3 * segment_local[s, 1]
        for c in range(3):
            component = load(unit, 3 * s + c)
            store(gradient, i + c, load(gradient, i + c) - component)
            store(gradient, j + c, load(gradient, j + c) + component)


@njit
def assemble(
    unit: FloatArray,
    inverse_length: FloatArray,
    stress: FloatArray,
    axial: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    node_block: IndexArray,
    column_start: IndexArray,
    segment_entry: IndexArray,
    path_start: IndexArray,
    segment_local: IndexArray,
    pair_start: IndexArray,
    pair_local: IndexArray,
    pair_entry: IndexArray,
    held_entry: IndexArray,
    held_diagonal: IndexArray,
    scale: FloatArray,
    gradient: FloatArray,
    blocks: FloatArray,
) -> None:
    """Assemble K = Σ k b bᵀ + T ∂²ℓ (Eq. 1 of the source) into the blocks of the pattern.

    `stress` are the tensions T of the geometric part; `scale` ``(1,)`` is the structure's largest
    EA/l₀: held coordinates get a multiple of it on the diagonal.
    The term k b bᵀ of a clustered member without pairs in the pattern is left out: it is the
    low-rank term of the caller. `gradient` is workspace, as long as the longest path.
    """
    for i in range(blocks.shape[0]):
        store(blocks, i, zero(blocks))
    for e in range(segment_start.size - 1):
        single = segment_start[e + 1] - segment_start[e] == 1
        t, k = load(stress, e), load(axial, e)
        for s in range(segment_start[e], segment_start[e + 1]):
            block_i, block_j = node_block[segment_nodes[s, 0]], node_block[segment_nodes[s, 1]]
            across = t * load(inverse_length, s)
            along = (k if single else zero(axial)) - across
            for c in range(3):
                scaled = along * load(unit, 3 * s + c)
                for d in range(3):
                    value = fused(scaled, load(unit, 3 * s + d), across if c == d else zero(stress))
                    if block_i >= 0:
                        place = 9 * column_start[block_i] + 3 * c + d
                        store(blocks, place, load(blocks, place) + value)
                    if block_j >= 0:
                        place = 9 * column_start[block_j] + 3 * c + d
                        store(blocks, place, load(blocks, place) + value)
                    if segment_entry[s] >= 0:
                        place = 9 * segment_entry[s] + 3 * c + d
                        store(blocks, place, load(blocks, place) - value)
        if pair_start[e + 1] > pair_start[e]:
            n = 3 * (path_start[e + 1] - path_start[e])
            path_gradient(unit, segment_start[e], segment_start[e + 1], segment_local, gradient[:n])
            for p in range(pair_start[e], pair_start[e + 1]):
                row, column, target = 3 * pair_local[p, 0], 3 * pair_local[p, 1], 9 * pair_entry[p]
                for c in range(3):
                    scaled = k * load(gradient, row + c)
                    for d in range(3):
                        place = target + 3 * c + d
                        store(blocks, place, fused(scaled, load(gradient, column + d), load(blocks, place)))
    for place in held_entry:
        store(blocks, place, zero(blocks))
    for place in held_diagonal:
        store(blocks, place, HELD_STIFFNESS * load(scale, 0))


@njit
def write_dense(column_start: IndexArray, row: IndexArray, blocks: FloatArray, matrix: FloatArray) -> None:
    """Write the lower-triangular blocks ``(9 n_entries,)`` as a full symmetric matrix of zeros so far."""
    for j in range(column_start.size - 1):
        for p in range(column_start[j], column_start[j + 1]):
            for c in range(3):
                for d in range(c + 1 if row[p] == j else 3):
                    value = blocks[9 * p + 3 * c + d]
                    matrix[3 * row[p] + c, 3 * j + d] = value
                    matrix[3 * j + d, 3 * row[p] + c] = value


@njit
def factorise(
    column_start: IndexArray,
    row: IndexArray,
    left_start: IndexArray,
    left_column: IndexArray,
    left_entry: IndexArray,
    shift: FloatArray,
    scale: FloatArray,
    place: IndexArray,
    blocks: FloatArray,
    pivot_inverse: FloatArray,
    n_negative: FloatArray,
) -> None:
    """Factorise A + shift·I = L D Lᵀ by 3 × 3 blocks, in place, left-looking.

    On return `blocks` holds U = L D below the diagonal and `pivot_inverse` the inverses of the
    blocks of D (00, 01, 02, 11, 12, 22); `n_negative` ``(1,)`` counts the scalar pivots that are
    not positive, by Sylvester's law the eigenvalues that are not. A pivot that is nothing but
    rounding beside `scale` ``(1,)``, the structure's largest EA/l₀, counts as one and is replaced
    by that rounding. `place` is workspace, one a block row.
    """
    negative = zero(n_negative)
    moved, floor = load(shift, 0), PIVOT_ROUNDING * load(scale, 0)
    above = 1.5 * floor  # a pivot that was put at the floor is none
    for j in range(column_start.size - 1):
        for p in range(column_start[j], column_start[j + 1]):
            place[row[p]] = 9 * p
        b = 9 * column_start[j]
        for t in range(left_start[j], left_start[j + 1]):
            k = left_column[t]
            u, q = 9 * left_entry[t], 6 * k
            p00, p01, p02 = load(pivot_inverse, q), load(pivot_inverse, q + 1), load(pivot_inverse, q + 2)
            p11, p12, p22 = load(pivot_inverse, q + 3), load(pivot_inverse, q + 4), load(pivot_inverse, q + 5)
            u0, u1, u2 = load(blocks, u), load(blocks, u + 1), load(blocks, u + 2)
            w00 = dot3(p00, u0, p01, u1, p02, u2)
            w10 = dot3(p01, u0, p11, u1, p12, u2)
            w20 = dot3(p02, u0, p12, u1, p22, u2)
            u0, u1, u2 = load(blocks, u + 3), load(blocks, u + 4), load(blocks, u + 5)
            w01 = dot3(p00, u0, p01, u1, p02, u2)
            w11 = dot3(p01, u0, p11, u1, p12, u2)
            w21 = dot3(p02, u0, p12, u1, p22, u2)
            u0, u1, u2 = load(blocks, u + 6), load(blocks, u + 7), load(blocks, u + 8)
            w02 = dot3(p00, u0, p01, u1, p02, u2)
            w12 = dot3(p01, u0, p11, u1, p12, u2)
            w22 = dot3(p02, u0, p12, u1, p22, u2)
            for p in range(left_entry[t], column_start[k + 1]):
                target = place[row[p]]
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
        # L⁻¹ has the entries −l10, m20 = l10 l21 − l20, −l21; D⁻¹ = L⁻ᵀ diag(1/d) L⁻¹.
        m20 = fused(l10, l21, -1.0 * l20)
        i0, i1, i2 = 1.0 / d0, 1.0 / d1, 1.0 / d2
        q = 6 * j
        store(pivot_inverse, q, fused(m20 * m20, i2, fused(l10 * l10, i1, i0)))
        store(pivot_inverse, q + 1, -1.0 * fused(m20 * l21, i2, l10 * i1))
        store(pivot_inverse, q + 2, m20 * i2)
        store(pivot_inverse, q + 3, fused(l21 * l21, i2, i1))
        store(pivot_inverse, q + 4, -1.0 * (l21 * i2))
        store(pivot_inverse, q + 5, i2)
    store(n_negative, 0, negative)


@njit
def _kept_from_zero(pivot, floor):
    return choose(less(magnitude(pivot), floor), choose(less(pivot, 0.0 * floor), -1.0 * floor, floor), pivot)


@njit
def solve(
    column_start: IndexArray,
    row: IndexArray,
    blocks: FloatArray,
    pivot_inverse: FloatArray,
    rhs: FloatArray,
) -> None:
    """Solve L D Lᵀ x = rhs in place; `rhs` is in elimination order, ``(3 n_blocks,)``."""
    for j in range(column_start.size - 1):
        r = 3 * j
        y0, y1, y2 = _times_pivot(pivot_inverse, 6 * j, load(rhs, r), load(rhs, r + 1), load(rhs, r + 2))
        store(rhs, r, y0)
        store(rhs, r + 1, y1)
        store(rhs, r + 2, y2)
        for p in range(column_start[j] + 1, column_start[j + 1]):
            u, i = 9 * p, 3 * row[p]
            for c in range(3):
                at = u + 3 * c
                u0, u1, u2 = load(blocks, at), load(blocks, at + 1), load(blocks, at + 2)
                store(rhs, i + c, less_dot3(load(rhs, i + c), u0, y0, u1, y1, u2, y2))
    for j in range(column_start.size - 2, -1, -1):
        r = 3 * j
        z0, z1, z2 = zero(rhs), zero(rhs), zero(rhs)
        for p in range(column_start[j] + 1, column_start[j + 1]):
            u, i = 9 * p, 3 * row[p]
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
    p00, p01, p02 = load(pivot_inverse, q), load(pivot_inverse, q + 1), load(pivot_inverse, q + 2)
    p11, p12, p22 = load(pivot_inverse, q + 3), load(pivot_inverse, q + 4), load(pivot_inverse, q + 5)
    return (
        dot3(p00, y0, p01, y1, p02, y2),
        dot3(p01, y0, p11, y1, p12, y2),
        dot3(p02, y0, p12, y1, p22, y2),
    )
