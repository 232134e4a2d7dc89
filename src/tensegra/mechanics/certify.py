"""Certificates of many runs: residual, inertia, the lowest eigenvalue with its proof, and derivatives.

The lowest eigenvalue comes of inverse iterations of three vectors, which begin near the modes of a run that
is like them and have a random part, so that no mode is missed for reasons of symmetry. That nothing lies
below it is then proved by the inertia of K shifted to just below it (Sylvester's law), (P7). Rigid motions
that nothing holds are taken out of every vector, and out of the shift.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels, law
from tensegra.mechanics.arrays import FloatArray, IndexArray
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import (
    choose,
    count_lanes,
    fused,
    get,
    item,
    less,
    load,
    number,
    put,
    root,
    store,
    zero,
)
from tensegra.mechanics.state import N_VECTORS
from tensegra.mechanics.step import (
    balance,
    enter,
    factorise,
    gather,
    measure_by_length,
    prescribe,
    row_of,
    spread,
)

MOST_SWEEPS, SETTLED = 40, 1e-7
"""Inverse iterations for the lowest eigenvalue, and the relative change below which they end."""

BELOW = 1e-6
"""Share of the lowest eigenvalue by which the shift of its proof lies below it."""

RANDOM_SHARE = 0.03
"""Size of the random part of the vectors that the iterations begin with."""

DEPENDENT = 1e-20
"""Share of the square of a vector that is rounding, where it depends on those before it."""

UNKNOWN, PROVED, NOT_DEFINITE = 0, 1, -1
"""What is known of the lowest eigenvalue: not settled, proved, or that K has one that is not positive."""


class Certificate(NamedTuple):
    """What is found of each run, ``(n_runs,)``; `modes` ``(3, 3 n_blocks)`` is where to begin.

    `strain_energy` is Σ ∫ T dℓ; `proof` is one of the codes above.
    """

    modes: FloatArray
    lowest_eigenvalue: FloatArray
    n_negative: IndexArray
    strain_energy: FloatArray
    proof: IndexArray


class Directions(NamedTuple):
    """What to differentiate by, and the derivatives.

    ``(n_runs | 1, n_directions, n)`` with n = n_members twice and 3 n_nodes; an array whose last axis is
    empty changes nothing. Derivatives are ``(n_runs, n_directions, …)``.
    """

    by_rest_length: FloatArray
    by_stiffness: FloatArray
    by_force: FloatArray
    nodes_by: FloatArray
    tensions_by: FloatArray


@njit
def certify_runs(topology, runs, outcome, certificate, directions, smallest_scale, lanes, first, last):
    """Certify the runs `first` to `last` where they stand.

    Parameters
    ----------
    topology, runs, outcome, certificate, directions, lanes
        `Topology`, `Runs`, `Outcome`, `Certificate`, `Directions` and `Lanes`.
    smallest_scale
        As in `balance`.
    first, last
        Range of runs.
    """
    n = count_lanes(lanes.x)
    for begin in range(first, last, n):
        for lane in range(n):
            r = min(begin + lane, last - 1)
            enter(topology, runs, outcome, lanes, lane, r, r)
        prescribe(topology, lanes)
        measure_by_length(topology, lanes)
        balance(topology, lanes, smallest_scale)
        factorise(topology, lanes)
        for lane in range(n):
            r = begin + lane
            if r < last:
                outcome.residual[r] = get(lanes.residual, 0, lane)
                certificate.n_negative[r] = int(get(lanes.n_negative, 0, lane))
                energy = 0.0
                for e in range(topology.n_members):
                    outcome.tensions[r, e] = get(lanes.tension, e, lane) + 0.0
                    l0, ea = get(lanes.rest_length, e, lane), get(lanes.stiffness, e, lane)
                    energy += get(lanes.taut, e, lane) * law.energy(get(lanes.length, e, lane), l0, ea)
                certificate.strain_energy[r] = energy
        _differentiate(topology, directions, lanes, begin, last)
        if certificate.modes.shape[0] > 0:
            _rigid_basis(topology, lanes)
            _lowest(topology, certificate, lanes, begin, last)
            _prove(topology, certificate, lanes, begin, last)


@njit
def _differentiate(topology, directions, lanes, begin, last):
    """Differentiate the lanes by what is asked for, with their factor."""
    n = count_lanes(lanes.x)
    stiffens, pushes = directions.by_stiffness.shape[2] > 0, directions.by_force.shape[2] > 0
    lengthens = directions.by_rest_length.shape[2] > 0
    for q in range(directions.nodes_by.shape[1]):
        for lane in range(n):
            r = min(begin + lane, last - 1)
            by_rest_length = row_of(directions.by_rest_length, r)
            by_stiffness, by_force = row_of(directions.by_stiffness, r), row_of(directions.by_force, r)
            for e in range(topology.n_members):
                l0, ea = get(lanes.rest_length, e, lane), get(lanes.stiffness, e, lane)
                length, pull = get(lanes.length, e, lane), 0.0
                if lengthens:
                    pull += law.by_rest_length(length, l0, ea) * by_rest_length[q, e]
                if stiffens:
                    pull += law.by_stiffness(length, l0) * by_stiffness[q, e]
                put(lanes.pull, e, lane, get(lanes.taut, e, lane) * pull)
            for i in range(topology.n_coordinates):
                put(lanes.motion, i, lane, by_force[q, i] if pushes else 0.0)
        kernels.internal_force(topology, lanes, lanes.pull, lanes.push)
        for i in range(topology.n_coordinates):
            store(lanes.push, i, load(lanes.motion, i) - load(lanes.push, i))
        gather(topology, lanes.push, lanes.second, 1.0)
        kernels.solve(topology, lanes, lanes.second)
        spread(topology, lanes.second, lanes.motion)
        kernels.stretch_rate(topology, lanes, lanes.motion, lanes.length_rate)
        for lane in range(n):
            r = begin + lane
            if r < last:
                for i in range(topology.n_coordinates):
                    directions.nodes_by[r, q, i] = get(lanes.motion, i, lane)
                for e in range(topology.n_members):
                    along = get(lanes.axial, e, lane) * get(lanes.length_rate, e, lane)
                    directions.tensions_by[r, q, e] = along + get(lanes.pull, e, lane)


@njit
def _rigid_basis(topology, lanes):
    """Lay out the rigid motions t + ω × x that nothing holds, orthonormal, in elimination order."""
    unknowns = 3 * topology.n_blocks
    for q in range(topology.n_rigid):
        for b in range(topology.n_blocks):
            for c in range(3):
                value = zero(lanes.x)
                if item(topology.block_node, b) >= 0:
                    i = 3 * item(topology.block_node, b)
                    after, before = (c + 1) % 3, (c + 2) % 3
                    turn = number(topology.spin, q * topology.n_coordinates + i + after) * load(
                        lanes.x, i + before
                    )
                    turn = turn - number(topology.spin, q * topology.n_coordinates + i + before) * load(
                        lanes.x, i + after
                    )
                    value = turn + number(topology.translation, q * topology.n_coordinates + i + c)
                store(lanes.rigid, q * unknowns + 3 * b + c, value)
        _orthonormalise(lanes.rigid, q, lanes.rigid, 0, unknowns)


@njit
def _orthogonalise(vectors, k, others, n_others, n):
    """Take the first `n_others` of some unit vectors out of vector `k`."""
    for other in range(n_others):
        product = _dot(vectors, k * n, others, other * n, n)
        for i in range(n):
            rest = load(vectors, k * n + i) - product * load(others, other * n + i)
            store(vectors, k * n + i, rest)


@njit
def _orthonormalise(vectors, k, rigid, n_rigid, n):
    """Make vector `k` a unit vector apart from the rigid motions and those before it; zero if it is none.

    A structure may have fewer motions than there are vectors: what is left of the others is rounding.
    """
    before = _dot(vectors, k * n, vectors, k * n, n)
    _orthogonalise(vectors, k, rigid, n_rigid, n)
    _orthogonalise(vectors, k, vectors, k, n)
    after = _dot(vectors, k * n, vectors, k * n, n)
    scale = choose(less(DEPENDENT * before, after), 1.0 / root(after), 0.0 * before)
    for i in range(n):
        store(vectors, k * n + i, scale * load(vectors, k * n + i))


@njit
def _solve_free(topology, lanes):
    """Solve K u = second for the coordinates that are free, the held ones and transports at rest."""
    for b in range(topology.n_blocks):
        for c in range(3):
            free = (
                number(topology.free, 3 * item(topology.block_node, b) + c)
                if item(topology.block_node, b) >= 0
                else 0.0
            )
            store(lanes.second, 3 * b + c, free * load(lanes.second, 3 * b + c))
    kernels.solve(topology, lanes, lanes.second)
    for b in range(topology.n_blocks):
        if item(topology.block_node, b) < 0:
            for c in range(3):
                store(lanes.second, 3 * b + c, zero(lanes.x))


@njit
def _lowest(topology, certificate, lanes, begin, last):
    """Iterate three vectors X with K⁻¹ and take the largest eigenvalue of Xᵀ K⁻¹ X for that of K⁻¹.

    A lane takes the value at which its own has settled, whatever its neighbours still need.
    """
    n, unknowns, n_rigid = count_lanes(lanes.x), 3 * topology.n_blocks, topology.n_rigid
    pending = np.zeros(n)
    for lane in range(n):
        r = begin + lane
        if r < last:
            definite = certificate.n_negative[r] == 0
            pending[lane] = 1.0 if definite else 0.0
            certificate.proof[r] = UNKNOWN if definite else NOT_DEFINITE
    seed = 12345
    for k in range(N_VECTORS):
        for b in range(topology.n_blocks):
            for c in range(3):
                # Park and Miller's generator: the same numbers on every machine.
                seed = seed * 16807 % 2147483647
                value = certificate.modes[k, 3 * b + c] + RANDOM_SHARE * (seed / 1073741823.5 - 1.0)
                moves = (
                    item(topology.block_node, b) >= 0
                    and number(topology.free, 3 * item(topology.block_node, b) + c) > 0.0
                )
                store(lanes.basis, k * unknowns + 3 * b + c, zero(lanes.x) + (value if moves else 0.0))
        _orthonormalise(lanes.basis, k, lanes.rigid, n_rigid, unknowns)
    for sweep in range(MOST_SWEEPS):
        if not np.any(pending):
            break
        for k in range(N_VECTORS):
            for i in range(unknowns):
                store(lanes.second, i, load(lanes.basis, k * unknowns + i))
            _solve_free(topology, lanes)
            for i in range(unknowns):
                store(lanes.image, k * unknowns + i, load(lanes.second, i))
            _orthogonalise(lanes.image, k, lanes.rigid, n_rigid, unknowns)
        for k in range(N_VECTORS):
            for other in range(N_VECTORS):
                product = _dot(lanes.basis, k * unknowns, lanes.image, other * unknowns, unknowns)
                store(lanes.measure_of, N_VECTORS * k + other, product)
        for lane in range(n):
            if pending[lane] > 0.0:
                r = begin + lane
                before = certificate.lowest_eigenvalue[r]
                now = 1.0 / _largest_of_three(lanes.measure_of, lane)
                certificate.lowest_eigenvalue[r] = now
                if sweep > 0 and abs(now - before) <= SETTLED * abs(now):
                    pending[lane] = 0.0
                    certificate.proof[r] = PROVED
        for k in range(N_VECTORS):
            _orthonormalise(lanes.image, k, lanes.rigid, 0, unknowns)
        for i in range(N_VECTORS * unknowns):
            store(lanes.basis, i, load(lanes.image, i))


@njit
def _prove(topology, certificate, lanes, begin, last):
    """Prove that nothing lies below the values found: K − σ (I − R Rᵀ) is definite, with σ just below them.

    With the rigid motions R taken out of the shift there is σ R Rᵀ over the coordinates that are free more
    than A = K − σ I has: it has as many negative eigenvalues as A less those of σ⁻¹ I + Rᵀ A⁻¹ R.
    """
    n, unknowns, n_rigid = count_lanes(lanes.x), 3 * topology.n_blocks, topology.n_rigid
    for lane in range(n):
        r = min(begin + lane, last - 1)
        proved = certificate.proof[r] == PROVED
        put(lanes.shift, 0, lane, (BELOW - 1.0) * certificate.lowest_eigenvalue[r] if proved else 0.0)
    factorise(topology, lanes)
    below = np.zeros(n)
    for lane in range(n):
        below[lane] = get(lanes.n_negative, 0, lane)
    if n_rigid > 0:
        small = np.zeros((n, n_rigid, n_rigid))
        for q in range(n_rigid):
            for i in range(unknowns):
                store(lanes.second, i, load(lanes.rigid, q * unknowns + i))
            _solve_free(topology, lanes)
            for p in range(n_rigid):
                store(lanes.measure_of, 0, _dot(lanes.second, 0, lanes.rigid, p * unknowns, unknowns))
                for lane in range(n):
                    shift = 0.0 - get(lanes.shift, 0, lane)
                    small[lane, p, q] = get(lanes.measure_of, 0, lane)
                    if p == q:
                        small[lane, p, q] += 1.0 / shift if shift > 0.0 else 1.0
        for lane in range(n):
            below[lane] -= _n_negative_of(small[lane])
    for lane in range(n):
        r = begin + lane
        if r < last and certificate.proof[r] == PROVED and below[lane] > 0.0:
            certificate.proof[r] = UNKNOWN
        put(lanes.shift, 0, lane, 0.0)


@njit
def _n_negative_of(matrix):
    """Count the negative eigenvalues of a small symmetric matrix by its pivots; it is overwritten."""
    count = 0
    for k in range(matrix.shape[0]):
        if matrix[k, k] < 0.0:
            count += 1
        for i in range(k + 1, matrix.shape[0]):
            share = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, matrix.shape[0]):
                matrix[i, j] -= share * matrix[k, j]
    return count


@njit
def _dot(left, i, right, j, n):
    total = zero(left)
    for at in range(n):
        total = fused(load(left, i + at), load(right, j + at), total)
    return total


@njit
def _largest_of_three(matrix, lane):
    """Largest eigenvalue of a symmetric 3 × 3 matrix, by the cosine of a third of an angle."""
    a, b, c = get(matrix, 0, lane), get(matrix, 4, lane), get(matrix, 8, lane)
    d = 0.5 * (get(matrix, 1, lane) + get(matrix, 3, lane))
    e = 0.5 * (get(matrix, 2, lane) + get(matrix, 6, lane))
    f = 0.5 * (get(matrix, 5, lane) + get(matrix, 7, lane))
    mean = (a + b + c) / 3.0
    spread = np.sqrt(
        ((a - mean) ** 2 + (b - mean) ** 2 + (c - mean) ** 2 + 2.0 * (d * d + e * e + f * f)) / 6.0
    )
    if spread == 0.0:
        return mean
    a, b, c, d, e, f = (
        (a - mean) / spread, (b - mean) / spread, (c - mean) / spread, d / spread, e / spread, f / spread
    )  # fmt: skip
    half = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    return mean + 2.0 * spread * np.cos(np.arccos(min(1.0, max(-1.0, half))) / 3.0)
