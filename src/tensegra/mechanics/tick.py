"""One tick of a pack of lanes: measure, assemble, factorise, correct, differentiate, certify.

Everything here is done for all lanes at once; `active` masks those whose state it changes. Symbols
are those of the nomenclature: ℓ path length, l₀ rest length, T tension, s and n length and direction
of a segment, a dot the derivative by the path parameter λ.
"""

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.compiled import njit, njit_once
from tensegra.mechanics.lanes import WIDTH, choose, fused, load, magnitude, maximum, root, store, zero

CORRECT, ACCEPT, CLOSE, FINISH, CUT, IDLE = range(6)
"""What a lane does with the outcome of a tick."""


@njit
def row_of(array, r):
    """Return row `r`, or the only row of an array that holds for all runs."""
    return array[r if array.shape[0] > 1 else 0]


@njit_once
def prescribe(lanes):
    """Compute the rest lengths at each lane's λ, with their two derivatives."""
    parameter = load(lanes.parameter, 0)
    n_powers = lanes.coefficients.shape[0] // lanes.rest_length.shape[0]
    for e in range(lanes.rest_length.shape[0]):
        value, rate, bend = zero(lanes.x), zero(lanes.x), zero(lanes.x)
        for d in range(n_powers - 1, -1, -1):
            bend = fused(bend, parameter, 2.0 * rate)
            rate = fused(rate, parameter, value)
            value = value * parameter + load(lanes.coefficients, e * n_powers + d)
        store(lanes.rest_length, e, value)
        store(lanes.rest_length_rate, e, rate)
        store(lanes.rest_length_bend, e, bend)


@njit_once
def factorise(topology, lanes, place):
    """Assemble and factorise K at the last measure, with the tensions in `stress`."""
    kernels.assemble(
        lanes.unit, lanes.inverse_length, lanes.stress, lanes.axial, topology.segment_nodes,
        topology.segment_start, topology.node_block, topology.column_start, topology.segment_entry,
        topology.path_start, topology.segment_local, topology.pair_start, topology.pair_local,
        topology.pair_entry, topology.held_entry, topology.held_diagonal, lanes.scale,
        lanes.gradient, lanes.blocks,
    )  # fmt: skip
    kernels.factorise(
        topology.column_start, topology.row, topology.left_start, topology.left_column, topology.left_entry,
        lanes.shift, lanes.scale, place, lanes.blocks, lanes.pivot_inverse, lanes.n_negative,
    )  # fmt: skip


@njit_once
def tick(topology, lanes, place):
    """Measure, assemble and factorise all lanes; leave p − f in `rhs` and its relative size."""
    parameter = load(lanes.parameter, 0)
    prescribe(lanes)
    for e in range(lanes.rest_length.shape[0]):
        is_taut = choose(maximum(load(lanes.stress, e), zero(lanes.x)), zero(lanes.x) + 1.0, zero(lanes.x))
        store(lanes.taut, e, is_taut if topology.is_cable[e] > 0.0 else zero(lanes.x) + 1.0)
    kernels.measure(
        lanes.x, lanes.rest_length, lanes.stiffness, lanes.taut, topology.segment_nodes,
        topology.segment_start, lanes.unit, lanes.inverse_length, lanes.length, lanes.tension, lanes.axial,
    )  # fmt: skip
    kernels.internal_force(
        lanes.unit, lanes.tension, topology.segment_nodes, topology.segment_start, lanes.force
    )
    largest, scale = zero(lanes.x), zero(lanes.x)
    for e in range(lanes.tension.shape[0]):
        scale = maximum(scale, magnitude(load(lanes.tension, e)))
        if topology.is_cable[e] > 0.0:
            # A cable on the wrong side of slack is as far from equilibrium as what it would carry.
            l0 = load(lanes.rest_length, e)
            pull = load(lanes.stiffness, e) / l0 * (load(lanes.length, e) - l0)
            wrong = choose(load(lanes.taut, e), zero(lanes.x) - pull, pull)
            largest = maximum(largest, wrong)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            p = load(lanes.loads_start, i) + parameter * load(lanes.loads_rate, i)
            missing = topology.free[i] * (p - load(lanes.force, i))
            scale = maximum(scale, topology.free[i] * magnitude(p))
            largest = maximum(largest, magnitude(missing))
            store(lanes.rhs, 3 * b + c, missing)
    # A NaN is larger than nothing in no comparison: let it through to the residual.
    store(lanes.residual, 0, largest / scale + zero(lanes.x) * load(lanes.rhs, 0))
    factorise(topology, lanes, place)


@njit
def solve(topology, lanes, vector):
    """Solve K u = vector with the last factor, in place."""
    kernels.solve(topology.column_start, topology.row, lanes.blocks, lanes.pivot_inverse, vector)


@njit_once
def correct(topology, lanes, action):
    """Apply the correction to the lanes that want one, with the tensions that it predicts."""
    for lane in range(WIDTH):
        wants = action[lane] == CORRECT or action[lane] == ACCEPT or action[lane] == CLOSE
        lanes.active[0, lane] = 1.0 if wants else 0.0
    active = load(lanes.active, 0)
    solve(topology, lanes, lanes.rhs)
    move, away = zero(lanes.x), zero(lanes.x)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            u = load(lanes.rhs, 3 * b + c)
            store(lanes.motion, i, u)
            x = load(lanes.x, i)
            x = choose(active, x + u, x)
            store(lanes.x, i, x)
            move = maximum(move, magnitude(u))
            away = maximum(away, magnitude(x - load(lanes.guess, i)))
    store(lanes.measure_of, 0, move)
    store(lanes.measure_of, 1, away)
    kernels.stretch_rate(
        lanes.unit, topology.segment_nodes, topology.segment_start, lanes.motion, lanes.length_rate
    )
    for e in range(lanes.stress.shape[0]):
        l0 = load(lanes.rest_length, e)
        stretch = load(lanes.length, e) - l0 + load(lanes.length_rate, e)
        predicted = load(lanes.stiffness, e) / l0 * stretch
        if topology.is_cable[e] > 0.0:
            predicted = maximum(predicted, zero(lanes.x))
        store(lanes.stress, e, choose(active, predicted, load(lanes.stress, e)))


@njit_once
def differentiate(topology, lanes, action):
    """Differentiate accepted points by λ, twice: K ẋ = −∂r/∂λ and K ẍ = −D²r[(ẋ, 1), (ẋ, 1)]."""
    for lane in range(WIDTH):
        lanes.active[0, lane] = 1.0 if action[lane] == ACCEPT else 0.0
    active = load(lanes.active, 0)
    for i in range(lanes.motion.shape[0]):
        store(lanes.motion, i, (1.0 - topology.free[i]) * load(lanes.support_rate, i))
    kernels.stretch_rate(
        lanes.unit, topology.segment_nodes, topology.segment_start, lanes.motion, lanes.length_rate
    )
    for e in range(lanes.pull.shape[0]):
        drop = load(lanes.length, e) / load(lanes.rest_length, e) * load(lanes.rest_length_rate, e)
        store(lanes.pull, e, load(lanes.axial, e) * (load(lanes.length_rate, e) - drop))
    kernels.force_rate(
        lanes.unit, lanes.inverse_length, lanes.tension, lanes.pull, topology.segment_nodes,
        topology.segment_start, lanes.motion, lanes.push,
    )  # fmt: skip
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(
                lanes.second, 3 * b + c, topology.free[i] * (load(lanes.loads_rate, i) - load(lanes.push, i))
            )
    solve(topology, lanes, lanes.second)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(lanes.motion, i, load(lanes.motion, i) + load(lanes.second, 3 * b + c))
    _curvature(topology, lanes)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(lanes.second, 3 * b + c, zero(lanes.x) - topology.free[i] * load(lanes.push, i))
    solve(topology, lanes, lanes.second)
    for i in range(lanes.motion.shape[0]):
        store(lanes.velocity, i, choose(active, load(lanes.motion, i), load(lanes.velocity, i)))
        store(lanes.motion, i, zero(lanes.x))  # also that of the supports, which do not bend
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(lanes.motion, i, load(lanes.second, 3 * b + c))
            store(lanes.bend, i, choose(active, load(lanes.second, 3 * b + c), load(lanes.bend, i)))
    kernels.stretch_rate(
        lanes.unit, topology.segment_nodes, topology.segment_start, lanes.motion, lanes.length_rate
    )
    for e in range(lanes.pull.shape[0]):
        bend = load(lanes.pull, e) + load(lanes.axial, e) * load(lanes.length_rate, e)
        store(lanes.tension_bend, e, choose(active, bend, load(lanes.tension_bend, e)))


@njit_once
def _curvature(topology, lanes):
    """Leave D²r along (ẋ, 1) in `push`, with ẋ in `motion`, and the part of T̈ without ẍ in `pull`.

    Along a straight motion d²(T b)/dλ² = T̈ n + 2 Ṫ ṅ + T n̈ on every segment, with w the part of
    ẋ₂ − ẋ₁ across the segment: ṡ = n·(ẋ₂ − ẋ₁), s̈ = w²/s, ṅ = w/s, n̈ = −(2 ṡ ṅ + s̈ n)/s.
    """
    active = load(lanes.active, 0)
    for i in range(lanes.push.shape[0]):
        store(lanes.push, i, zero(lanes.x))
    for e in range(lanes.pull.shape[0]):
        stretch, bulge = zero(lanes.x), zero(lanes.x)
        for s in range(topology.segment_start[e], topology.segment_start[e + 1]):
            i, j = 3 * topology.segment_nodes[s, 0], 3 * topology.segment_nodes[s, 1]
            vx = load(lanes.motion, j) - load(lanes.motion, i)
            vy = load(lanes.motion, j + 1) - load(lanes.motion, i + 1)
            vz = load(lanes.motion, j + 2) - load(lanes.motion, i + 2)
            along = (
                load(lanes.unit, 3 * s) * vx
                + load(lanes.unit, 3 * s + 1) * vy
                + load(lanes.unit, 3 * s + 2) * vz
            )
            stretch = stretch + along
            bulge = bulge + load(lanes.inverse_length, s) * (vx * vx + vy * vy + vz * vz - along * along)
        l0, ratio = load(lanes.rest_length, e), load(lanes.length, e) / load(lanes.rest_length, e)
        l0_rate, l0_bend = load(lanes.rest_length_rate, e), load(lanes.rest_length_bend, e)
        k, t = load(lanes.axial, e), load(lanes.tension, e)
        t_rate = k * (stretch - ratio * l0_rate)
        t_bend = k * (bulge - ratio * l0_bend - 2.0 * l0_rate / l0 * (stretch - ratio * l0_rate))
        store(lanes.pull, e, t_bend)
        store(lanes.tension_rate, e, choose(active, t_rate, load(lanes.tension_rate, e)))
        for s in range(topology.segment_start[e], topology.segment_start[e + 1]):
            i, j = 3 * topology.segment_nodes[s, 0], 3 * topology.segment_nodes[s, 1]
            inverse = load(lanes.inverse_length, s)
            nx, ny, nz = load(lanes.unit, 3 * s), load(lanes.unit, 3 * s + 1), load(lanes.unit, 3 * s + 2)
            vx = load(lanes.motion, j) - load(lanes.motion, i)
            vy = load(lanes.motion, j + 1) - load(lanes.motion, i + 1)
            vz = load(lanes.motion, j + 2) - load(lanes.motion, i + 2)
            along = nx * vx + ny * vy + nz * vz
            wx, wy, wz = inverse * (vx - along * nx), inverse * (vy - along * ny), inverse * (vz - along * nz)
            on_n = t_bend - t * (wx * wx + wy * wy + wz * wz)
            on_w = 2.0 * (t_rate - t * along * inverse)
            for c, value in (
                (0, on_n * nx + on_w * wx),
                (1, on_n * ny + on_w * wy),
                (2, on_n * nz + on_w * wz),
            ):
                store(lanes.push, i + c, load(lanes.push, i + c) - value)
                store(lanes.push, j + c, load(lanes.push, j + c) + value)


@njit_once
def certify(topology, runs, outcome, lanes, run, action, most_sweeps, settled):
    """Compute the lowest eigenvalue and the derivatives of the lanes that finish, with their last factor.

    The eigenvalue comes of inverse iterations of three vectors: `most_sweeps` of them, or as many as
    change it by more than the share `settled` of itself.
    """
    if runs.modes.shape[0] > 0:
        _softest(topology, runs, outcome, lanes, run, action, most_sweeps, settled)
    stiffens, pushes = runs.by_stiffness.shape[2] > 0, runs.by_force.shape[2] > 0
    lengthens = runs.by_rest_length.shape[2] > 0
    for q in range(runs.by_force.shape[1]):
        for lane in range(WIDTH):
            r = max(run[lane], 0)
            by_rest_length, by_stiffness = row_of(runs.by_rest_length, r), row_of(runs.by_stiffness, r)
            by_force = row_of(runs.by_force, r)
            for e in range(lanes.pull.shape[0]):
                ratio = lanes.length[e, lane] / lanes.rest_length[e, lane]
                pull = 0.0
                if lengthens:
                    pull -= lanes.axial[e, lane] * ratio * by_rest_length[q, e]
                if stiffens:
                    pull += lanes.taut[e, lane] * (ratio - 1.0) * by_stiffness[q, e]
                lanes.pull[e, lane] = pull
            if pushes:
                for i in range(lanes.motion.shape[0]):
                    lanes.motion[i, lane] = by_force[q, i]
        if not pushes:
            for i in range(lanes.motion.shape[0]):
                store(lanes.motion, i, zero(lanes.x))
        kernels.internal_force(
            lanes.unit, lanes.pull, topology.segment_nodes, topology.segment_start, lanes.push
        )
        for b in range(topology.block_node.size):
            for c in range(3):
                i = 3 * topology.block_node[b] + c
                push = topology.free[i] * (load(lanes.motion, i) - load(lanes.push, i))
                store(lanes.second, 3 * b + c, push)
        solve(topology, lanes, lanes.second)
        for i in range(lanes.motion.shape[0]):
            store(lanes.motion, i, zero(lanes.x))
        for b in range(topology.block_node.size):
            for c in range(3):
                store(lanes.motion, 3 * topology.block_node[b] + c, load(lanes.second, 3 * b + c))
        kernels.stretch_rate(
            lanes.unit, topology.segment_nodes, topology.segment_start, lanes.motion, lanes.length_rate
        )
        for lane in range(WIDTH):
            if action[lane] == FINISH:
                for i in range(lanes.motion.shape[0]):
                    outcome.nodes_by[run[lane], q, i] = lanes.motion[i, lane]
                for e in range(lanes.pull.shape[0]):
                    rate = lanes.axial[e, lane] * lanes.length_rate[e, lane] + lanes.pull[e, lane]
                    outcome.tensions_by[run[lane], q, e] = rate


@njit_once
def _softest(topology, runs, outcome, lanes, run, action, most_sweeps, settled):
    """Iterate three vectors X with K⁻¹ and take the largest eigenvalue of Xᵀ K⁻¹ X for that of K⁻¹.

    A lane takes the value at which its own has settled, whatever its neighbours still need.
    """
    n = lanes.second.shape[0]
    pending = np.zeros(WIDTH)
    for lane in range(WIDTH):
        pending[lane] = 1.0 if action[lane] == FINISH else 0.0
        if action[lane] == FINISH:
            outcome.lowest_eigenvalue[run[lane]] = 0.0
    for k in range(3):
        for i in range(n):
            store(lanes.basis, k * n + i, zero(lanes.x) + runs.modes[k, i])
    for sweep in range(most_sweeps + 1):
        for k in range(3):
            for i in range(n):
                store(lanes.second, i, load(lanes.basis, k * n + i))
            solve(topology, lanes, lanes.second)
            for i in range(n):
                store(lanes.image, k * n + i, load(lanes.second, i))
        if settled > 0.0 or sweep == most_sweeps:
            for k in range(3):
                for other in range(3):
                    store(
                        lanes.measure_of, 3 * k + other, _dot(lanes.basis, k * n, lanes.image, other * n, n)
                    )
            for lane in range(WIDTH):
                if pending[lane] > 0.0:
                    before = outcome.lowest_eigenvalue[run[lane]]
                    now = 1.0 / _largest_of_three(lanes.measure_of, lane)
                    outcome.lowest_eigenvalue[run[lane]] = now
                    # The modes that the iteration starts with are not told to be unit vectors.
                    if sweep > 1 and abs(now - before) <= settled * abs(now):
                        pending[lane] = 0.0
        if sweep == most_sweeps or not np.any(pending):
            break
        for k in range(3):
            for other in range(k):
                product = _dot(lanes.basis, other * n, lanes.image, k * n, n)
                for i in range(n):
                    rest = load(lanes.image, k * n + i) - product * load(lanes.basis, other * n + i)
                    store(lanes.image, k * n + i, rest)
            scale = 1.0 / root(_dot(lanes.image, k * n, lanes.image, k * n, n))
            for i in range(n):
                store(lanes.basis, k * n + i, scale * load(lanes.image, k * n + i))


@njit
def _dot(left, i, right, j, n):
    total = zero(left)
    for at in range(n):
        total = fused(load(left, i + at), load(right, j + at), total)
    return total


@njit
def _largest_of_three(matrix, lane):
    """Largest eigenvalue of a symmetric 3 × 3 matrix, by the cosine of a third of an angle."""
    a, b, c = matrix[0, lane], matrix[4, lane], matrix[8, lane]
    d, e, f = matrix[1, lane], matrix[2, lane], matrix[5, lane]
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
