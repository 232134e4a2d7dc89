"""Compiled kernels: internal force, tangent stiffness, block LDLᵀ, all over lanes of runs.

Every array has the lanes (runs in lockstep) as its last, contiguous axis, and every innermost loop
runs over them, so that the compiler turns it into vector instructions. One structure alone is the
case of one lane. Symbols are those of the nomenclature: ℓ path length, l₀ rest length, T tension,
k = EA/l₀, n unit vector along a segment, b = ∂ℓ/∂x.
"""

import numba as nb
import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray

njit = nb.njit(cache=True, error_model="numpy", nogil=True)


@njit
def measure(
    x: FloatArray,
    rest_length: FloatArray,
    stiffness: FloatArray,
    taut: BoolArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    unit: FloatArray,
    inverse_length: FloatArray,
    length: FloatArray,
    tension: FloatArray,
    axial: FloatArray,
) -> None:
    """Measure all members at the positions `x`.

    Fills, per lane: `unit` n (3 n_segments), `inverse_length` 1/s (n_segments), `length` ℓ,
    `tension` T and `axial` k (n_members). T and k are those of a linear member where `taut` says
    that it carries force, and zero elsewhere; the caller keeps `taut` in step with the signs of T.
    """
    lanes = x.shape[1]
    for e in range(segment_start.size - 1):
        for a in range(lanes):
            length[e, a] = 0.0
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for a in range(lanes):
                dx = x[j, a] - x[i, a]
                dy = x[j + 1, a] - x[i + 1, a]
                dz = x[j + 2, a] - x[i + 2, a]
                distance = np.sqrt(dx * dx + dy * dy + dz * dz)
                inverse = 1.0 / distance
                unit[3 * s, a] = dx * inverse
                unit[3 * s + 1, a] = dy * inverse
                unit[3 * s + 2, a] = dz * inverse
                inverse_length[s, a] = inverse
                length[e, a] += distance
        for a in range(lanes):
            k = stiffness[e, a] / rest_length[e, a] if taut[e, a] else 0.0
            tension[e, a] = k * (length[e, a] - rest_length[e, a])
            axial[e, a] = k


@njit
def internal_force(
    unit: FloatArray,
    tension: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    force: FloatArray,
) -> None:
    """Sum f = Σ T b over all members (Eq. 5 of the source), shape ``(3 n_nodes, lanes)``."""
    lanes = unit.shape[1]
    force[:] = 0.0
    for e in range(segment_start.size - 1):
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for c in range(3):
                for a in range(lanes):
                    component = tension[e, a] * unit[3 * s + c, a]
                    force[i + c, a] -= component
                    force[j + c, a] += component


@njit
def force_rate(
    unit: FloatArray,
    inverse_length: FloatArray,
    tension: FloatArray,
    axial: FloatArray,
    segment_nodes: IndexArray,
    segment_start: IndexArray,
    motion: FloatArray,
    tension_rate: FloatArray,
    rate: FloatArray,
) -> None:
    """Differentiate the internal force along a motion of the nodes.

    ``rate = Σ (k (b·v) + Ṫ) b + T ∂²ℓ v`` with the motion v and the rate Ṫ that tensions have
    where the nodes stay (from rest lengths, temperatures, stiffnesses).
    """
    lanes = unit.shape[1]
    rate[:] = 0.0
    total = np.empty(lanes)
    for e in range(segment_start.size - 1):
        for a in range(lanes):
            total[a] = 0.0
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for c in range(3):
                for a in range(lanes):
                    total[a] += unit[3 * s + c, a] * (motion[j + c, a] - motion[i + c, a])
        for a in range(lanes):
            total[a] = axial[e, a] * total[a] + tension_rate[e, a]
        for s in range(segment_start[e], segment_start[e + 1]):
            i, j = 3 * segment_nodes[s, 0], 3 * segment_nodes[s, 1]
            for a in range(lanes):
                vx = motion[j, a] - motion[i, a]
                vy = motion[j + 1, a] - motion[i + 1, a]
                vz = motion[j + 2, a] - motion[i + 2, a]
                nx, ny, nz = unit[3 * s, a], unit[3 * s + 1, a], unit[3 * s + 2, a]
                stress = tension[e, a] * inverse_length[s, a]
                along = total[a] - stress * (nx * vx + ny * vy + nz * vz)
                rx = stress * vx + along * nx
                ry = stress * vy + along * ny
                rz = stress * vz + along * nz
                rate[i, a] -= rx
                rate[i + 1, a] -= ry
                rate[i + 2, a] -= rz
                rate[j, a] += rx
                rate[j + 1, a] += ry
                rate[j + 2, a] += rz


@njit
def path_gradient(
    unit: FloatArray,
    first_segment: int,
    last_segment: int,
    segment_local: IndexArray,
    gradient: FloatArray,
) -> None:
    """Sum b = ∂ℓ/∂x of one member over the distinct nodes of its path, ``(3 m, lanes)``."""
    lanes = unit.shape[1]
    gradient[:] = 0.0
    for s in range(first_segment, last_segment):
        i, j = 3 * segment_local[s, 0], 3 * segment_local[s, 1]
        for c in range(3):
            for a in range(lanes):
                gradient[i + c, a] -= unit[3 * s + c, a]
                gradient[j + c, a] += unit[3 * s + c, a]


@njit
def assemble(
    unit: FloatArray,
    inverse_length: FloatArray,
    tension: FloatArray,
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
    blocks: FloatArray,
) -> None:
    """Assemble K = Σ k b bᵀ + T ∂²ℓ (Eq. 1 of the source) into the blocks of the pattern.

    The term k b bᵀ of a clustered member without pairs in the pattern is left out: it is the
    low-rank term of the caller.
    """
    lanes = unit.shape[1]
    blocks[:] = 0.0
    longest = 0
    for e in range(path_start.size - 1):
        longest = max(longest, path_start[e + 1] - path_start[e])
    gradient = np.empty((3 * longest, lanes))
    for e in range(segment_start.size - 1):
        single = segment_start[e + 1] - segment_start[e] == 1
        for s in range(segment_start[e], segment_start[e + 1]):
            block_i = node_block[segment_nodes[s, 0]]
            block_j = node_block[segment_nodes[s, 1]]
            diagonal_i = 9 * column_start[block_i] if block_i >= 0 else -1
            diagonal_j = 9 * column_start[block_j] if block_j >= 0 else -1
            coupling = 9 * segment_entry[s] if segment_entry[s] >= 0 else -1
            for c in range(3):
                for d in range(3):
                    for a in range(lanes):
                        stress = tension[e, a] * inverse_length[s, a]
                        along = axial[e, a] - stress if single else -stress
                        value = along * unit[3 * s + c, a] * unit[3 * s + d, a]
                        if c == d:
                            value += stress
                        if diagonal_i >= 0:
                            blocks[diagonal_i + 3 * c + d, a] += value
                        if diagonal_j >= 0:
                            blocks[diagonal_j + 3 * c + d, a] += value
                        if coupling >= 0:
                            blocks[coupling + 3 * c + d, a] -= value
        if pair_start[e + 1] > pair_start[e]:
            path_gradient(unit, segment_start[e], segment_start[e + 1], segment_local, gradient)
            for p in range(pair_start[e], pair_start[e + 1]):
                row, column, target = 3 * pair_local[p, 0], 3 * pair_local[p, 1], 9 * pair_entry[p]
                for c in range(3):
                    for d in range(3):
                        for a in range(lanes):
                            blocks[target + 3 * c + d, a] += (
                                axial[e, a] * gradient[row + c, a] * gradient[column + d, a]
                            )
    for flat in held_entry:
        for a in range(lanes):
            blocks[flat, a] = 0.0
    for flat in held_diagonal:
        for a in range(lanes):
            blocks[flat, a] = 1.0


@njit
def factorise(
    column_start: IndexArray,
    row: IndexArray,
    left_start: IndexArray,
    left_column: IndexArray,
    left_entry: IndexArray,
    shift: FloatArray,
    floor: FloatArray,
    blocks: FloatArray,
    pivot_inverse: FloatArray,
    n_negative: IndexArray,
    smallest_pivot: FloatArray,
) -> None:
    """Factorise A + shift·I = L D Lᵀ by 3 × 3 blocks, in place, left-looking.

    On return `blocks` holds U = L D below the diagonal and `pivot_inverse` the inverse of each
    block of D; `n_negative` counts the negative scalar pivots, by Sylvester's law the negative
    eigenvalues, and `smallest_pivot` is the least of them. A pivot smaller in size than `floor` is
    replaced by it.
    """
    lanes = blocks.shape[1]
    n_blocks = column_start.size - 1
    place = np.empty(n_blocks, dtype=np.int64)
    w = np.empty((9, lanes))
    for a in range(lanes):
        n_negative[a] = 0
        smallest_pivot[a] = np.inf
    for j in range(n_blocks):
        for p in range(column_start[j], column_start[j + 1]):
            place[row[p]] = 9 * p
        for t in range(left_start[j], left_start[j + 1]):
            k = left_column[t]
            u, inverse = 9 * left_entry[t], 9 * k
            for c in range(3):
                for d in range(3):
                    for a in range(lanes):
                        w[3 * c + d, a] = (
                            pivot_inverse[inverse + 3 * c, a] * blocks[u + 3 * d, a]
                            + pivot_inverse[inverse + 3 * c + 1, a] * blocks[u + 3 * d + 1, a]
                            + pivot_inverse[inverse + 3 * c + 2, a] * blocks[u + 3 * d + 2, a]
                        )
            for p in range(left_entry[t], column_start[k + 1]):
                target, u = place[row[p]], 9 * p
                for c in range(3):
                    for d in range(3):
                        for a in range(lanes):
                            blocks[target + 3 * c + d, a] -= (
                                blocks[u + 3 * c, a] * w[d, a]
                                + blocks[u + 3 * c + 1, a] * w[3 + d, a]
                                + blocks[u + 3 * c + 2, a] * w[6 + d, a]
                            )
        b, inverse = 9 * column_start[j], 9 * j
        for a in range(lanes):
            a10, a20, a21 = blocks[b + 3, a], blocks[b + 6, a], blocks[b + 7, a]
            d0 = blocks[b, a] + shift[a]
            if abs(d0) < floor[a]:
                d0 = floor[a] if d0 >= 0.0 else -floor[a]
            l10, l20 = a10 / d0, a20 / d0
            d1 = blocks[b + 4, a] + shift[a] - l10 * a10
            if abs(d1) < floor[a]:
                d1 = floor[a] if d1 >= 0.0 else -floor[a]
            u21 = a21 - l20 * a10
            l21 = u21 / d1
            d2 = blocks[b + 8, a] + shift[a] - l20 * a20 - l21 * u21
            if abs(d2) < floor[a]:
                d2 = floor[a] if d2 >= 0.0 else -floor[a]
            n_negative[a] += (d0 < 0.0) + (d1 < 0.0) + (d2 < 0.0)
            smallest_pivot[a] = min(smallest_pivot[a], d0, d1, d2)
            # L⁻¹ has the entries −l10, m20 = l10 l21 − l20, −l21; D⁻¹ = L⁻ᵀ diag(1/d) L⁻¹.
            m20 = l10 * l21 - l20
            i0, i1, i2 = 1.0 / d0, 1.0 / d1, 1.0 / d2
            pivot_inverse[inverse, a] = i0 + l10 * l10 * i1 + m20 * m20 * i2
            pivot_inverse[inverse + 1, a] = -l10 * i1 - m20 * l21 * i2
            pivot_inverse[inverse + 2, a] = m20 * i2
            pivot_inverse[inverse + 3, a] = pivot_inverse[inverse + 1, a]
            pivot_inverse[inverse + 4, a] = i1 + l21 * l21 * i2
            pivot_inverse[inverse + 5, a] = -l21 * i2
            pivot_inverse[inverse + 6, a] = pivot_inverse[inverse + 2, a]
            pivot_inverse[inverse + 7, a] = pivot_inverse[inverse + 5, a]
            pivot_inverse[inverse + 8, a] = i2


@njit
def solve(
    column_start: IndexArray,
    row: IndexArray,
    blocks: FloatArray,
    pivot_inverse: FloatArray,
    rhs: FloatArray,
) -> None:
    """Solve L D Lᵀ x = rhs in place; rows of `rhs` are in elimination order, ``(3 n_blocks, lanes)``."""
    lanes = rhs.shape[1]
    n_blocks = column_start.size - 1
    for j in range(n_blocks):
        q, r = 9 * j, 3 * j
        for a in range(lanes):
            y0, y1, y2 = rhs[r, a], rhs[r + 1, a], rhs[r + 2, a]
            for c in range(3):
                rhs[r + c, a] = (
                    pivot_inverse[q + 3 * c, a] * y0
                    + pivot_inverse[q + 3 * c + 1, a] * y1
                    + pivot_inverse[q + 3 * c + 2, a] * y2
                )
        for p in range(column_start[j] + 1, column_start[j + 1]):
            u, i = 9 * p, 3 * row[p]
            for c in range(3):
                for a in range(lanes):
                    rhs[i + c, a] -= (
                        blocks[u + 3 * c, a] * rhs[r, a]
                        + blocks[u + 3 * c + 1, a] * rhs[r + 1, a]
                        + blocks[u + 3 * c + 2, a] * rhs[r + 2, a]
                    )
    z = np.empty((3, lanes))
    for j in range(n_blocks - 1, -1, -1):
        q, r = 9 * j, 3 * j
        if column_start[j + 1] - column_start[j] == 1:
            continue
        z[:] = 0.0
        for p in range(column_start[j] + 1, column_start[j + 1]):
            u, i = 9 * p, 3 * row[p]
            for c in range(3):
                for a in range(lanes):
                    z[c, a] += (
                        blocks[u + c, a] * rhs[i, a]
                        + blocks[u + 3 + c, a] * rhs[i + 1, a]
                        + blocks[u + 6 + c, a] * rhs[i + 2, a]
                    )
        for c in range(3):
            for a in range(lanes):
                rhs[r + c, a] -= (
                    pivot_inverse[q + 3 * c, a] * z[0, a]
                    + pivot_inverse[q + 3 * c + 1, a] * z[1, a]
                    + pivot_inverse[q + 3 * c + 2, a] * z[2, a]
                )
