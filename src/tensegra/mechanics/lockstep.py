"""Many runs of one structure in lockstep: the path follower, eight lanes at a time.

Every tick does the same for all lanes of a pack: measure, assemble, factorise, solve. What a lane
does with the outcome is its own affair: correct again, accept the step and predict the next, cut the
step, or finish and make room for the next run of the queue. A run that leaves the plain course (no
convergence, a negative eigenvalue, a step too small) is given back with its last accepted position
and is solved by the follower of `tensegra.mechanics.follow`.

Lanes do not exchange numbers, so a result depends neither on its neighbours nor on the order.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.kernels import njit
from tensegra.mechanics.lanes import WIDTH, choose, load, magnitude, maximum, root, store, zero
from tensegra.mechanics.pattern import Pattern

ACCEPTED = 1e-5
"""Relative residual at which a step on the way is accepted; one more correction follows unchecked."""

CONVERGED = 1e-9
"""Relative residual of a finished run, measured again at its last position."""

MAX_CORRECTIONS = 8
"""Corrections of one step after which it is cut."""

SWEEPS = 3
"""Inverse iterations of three vectors for the lowest eigenvalue."""

CORRECT, ACCEPT, CLOSE, FINISH, CUT, IDLE = range(6)
"""What a lane does with the outcome of a tick."""

DONE, GIVEN_BACK = 1, 0
"""Whether a run was finished here or is left to the single follower."""


class Topology(NamedTuple):
    """What all runs share: `StructureArrays` and `Pattern` as the kernels take them."""

    segment_nodes: IndexArray
    segment_start: IndexArray
    node_block: IndexArray
    block_node: IndexArray
    column_start: IndexArray
    row: IndexArray
    left_start: IndexArray
    left_column: IndexArray
    left_entry: IndexArray
    segment_entry: IndexArray
    path_start: IndexArray
    segment_local: IndexArray
    pair_start: IndexArray
    pair_local: IndexArray
    pair_entry: IndexArray
    held_entry: IndexArray
    held_diagonal: IndexArray
    free: FloatArray
    is_cable: FloatArray
    longest_path: int
    size: float


class Runs(NamedTuple):
    """A block of runs of one stage. An array whose first axis is 1 holds for all of them.

    Attributes
    ----------
    start
        Equilibria at λ = 0, ``(n_runs | 1, 3 n_nodes)``.
    rest_length
        Coefficients of the effective rest lengths by powers of λ, ``(n_runs, n_members, degree + 1)``.
    stiffness
        EA, ``(n_runs | 1, n_members)``.
    loads_start, loads_rate
        Nodal forces at λ = 0 and their change, ``(n_runs | 1, 3 n_nodes)``.
    support_rate
        Change of the held coordinates, ``(n_runs | 1, 3 n_nodes)``.
    modes
        Guess of the three softest modes in elimination order, ``(3, 3 n_blocks)``; no eigenvalue is
        computed where it has no rows.
    by_rest_length, by_stiffness, by_force
        Directions of the derivatives asked for: ``(n_runs | 1, n_directions, n_members)`` twice and
        ``(n_runs | 1, n_directions, 3 n_nodes)``.
    """

    start: FloatArray
    rest_length: FloatArray
    stiffness: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    modes: FloatArray
    by_rest_length: FloatArray
    by_stiffness: FloatArray
    by_force: FloatArray


class Outcome(NamedTuple):
    """Results, filled in by `follow_runs`; one row a run, of the shapes that the names tell."""

    done: IndexArray
    nodes: FloatArray
    tensions: FloatArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    steps: IndexArray
    iterations: IndexArray
    nodes_by: FloatArray
    tensions_by: FloatArray


class Lanes(NamedTuple):
    """State and workspace of one pack; all arrays are ``(n, WIDTH)``."""

    x: FloatArray
    guess: FloatArray
    accepted: FloatArray
    velocity: FloatArray
    bend: FloatArray
    rest_length: FloatArray
    rest_length_rate: FloatArray
    rest_length_bend: FloatArray
    coefficients: FloatArray
    stiffness: FloatArray
    motion: FloatArray
    push: FloatArray
    pull: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    taut: FloatArray
    stress: FloatArray
    tension: FloatArray
    accepted_tension: FloatArray
    tension_rate: FloatArray
    tension_bend: FloatArray
    axial: FloatArray
    length: FloatArray
    length_rate: FloatArray
    unit: FloatArray
    inverse_length: FloatArray
    force: FloatArray
    gradient: FloatArray
    blocks: FloatArray
    pivot_inverse: FloatArray
    rhs: FloatArray
    second: FloatArray
    basis: FloatArray
    image: FloatArray
    parameter: FloatArray
    residual: FloatArray
    n_negative: FloatArray
    shift: FloatArray
    measure_of: FloatArray
    active: FloatArray


def topology_of(arrays: StructureArrays, pattern: Pattern) -> Topology:
    """Collect what the kernels need of a structure."""
    return Topology(
        arrays.segment_nodes,
        arrays.segment_start,
        pattern.node_block,
        pattern.block_node,
        pattern.column_start,
        pattern.row,
        pattern.left_start,
        pattern.left_column,
        pattern.left_entry,
        pattern.segment_entry,
        pattern.path_start,
        pattern.segment_local,
        pattern.pair_start,
        pattern.pair_local,
        pattern.pair_entry,
        pattern.held_entry,
        pattern.held_diagonal,
        arrays.free.reshape(-1).astype(np.float64),
        arrays.is_cable.astype(np.float64),
        int(np.diff(pattern.path_start).max()),
        arrays.size,
    )


def lanes_for(arrays: StructureArrays, pattern: Pattern, degree: int) -> Lanes:
    """Allocate one pack's state and workspace, for rest lengths of the given degree in λ."""
    n, m, s, u = 3 * arrays.n_nodes, arrays.n_members, len(arrays.segment_nodes), 3 * pattern.n_blocks
    rows = Lanes(
        x=n, guess=n, accepted=n, velocity=n, bend=n,
        rest_length=m, rest_length_rate=m, rest_length_bend=m, coefficients=m * (degree + 1), stiffness=m,
        motion=n, push=n, pull=m, loads_start=n, loads_rate=n, support_rate=n,
        taut=m, stress=m, tension=m, accepted_tension=m, tension_rate=m, tension_bend=m, axial=m,
        length=m, length_rate=m, unit=3 * s, inverse_length=s, force=n,
        gradient=3 * int(np.diff(pattern.path_start).max()), blocks=9 * pattern.n_entries,
        pivot_inverse=6 * pattern.n_blocks, rhs=u, second=u, basis=3 * u, image=3 * u,
        parameter=1, residual=1, n_negative=1, shift=1, measure_of=9, active=1,
    )  # type: ignore[arg-type] # fmt: skip - counts here, arrays of as many rows below
    return Lanes(*(np.zeros((count, WIDTH)) for count in rows))  # type: ignore[call-overload]


@njit
def follow_runs(topology, runs, outcome, lanes, first, last, first_step, smallest_step, largest_move):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN201, C901, PLR0912, PLR0915, PLR0917 - one loop over ticks
    """Follow the runs `first` to `last` through their stage.

    Parameters
    ----------
    topology, runs, outcome, lanes
        `Topology`, `Runs`, `Outcome` and `Lanes`.
    first, last
        Range of runs.
    first_step, smallest_step
        First increment of λ, and the increment below which a run is given back.
    largest_move
        Largest move of a coordinate in one step, unit of length.
    """
    place = np.zeros(topology.block_node.size, dtype=np.int64)
    run = np.full(WIDTH, -1)
    action = np.full(WIDTH, IDLE)
    closing = np.zeros(WIDTH, dtype=np.bool_)
    corrections = np.zeros(WIDTH, dtype=np.int64)
    step, target, base, last_move, speed = (
        np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    )  # fmt: skip
    queue = first
    n_active = 0
    for lane in range(WIDTH):
        # A lane without a run of its own repeats the first: its numbers stay finite, nothing is kept.
        _enter(topology, runs, lanes, lane, min(queue, last - 1))
        if queue < last:
            run[lane] = queue
            queue += 1
            n_active += 1
        step[lane], target[lane], base[lane], closing[lane], corrections[lane] = first_step, 0.0, 0.0, False, 0
    while n_active > 0:
        _tick(topology, lanes, place)
        for lane in range(WIDTH):
            action[lane] = IDLE
            if run[lane] < 0:
                continue
            small, stands = lanes.residual[0, lane], lanes.n_negative[0, lane] == 0.0
            if closing[lane]:
                action[lane] = FINISH if small <= CONVERGED and stands else CUT
            elif small <= (CONVERGED if target[lane] >= 1.0 else ACCEPTED):
                action[lane] = CUT if not stands else CLOSE if target[lane] >= 1.0 else ACCEPT
            else:
                corrections[lane] += 1
                good = small < np.inf and corrections[lane] <= MAX_CORRECTIONS
                action[lane] = CORRECT if good else CUT
        any_finish, any_accept = np.any(action == FINISH), np.any(action == ACCEPT)
        if any_finish:
            _certify(topology, runs, outcome, lanes, run, action)
        _correct(topology, lanes, action)
        for lane in range(WIDTH):
            if action[lane] == CORRECT or action[lane] == CLOSE:
                move, away = lanes.measure_of[0, lane], lanes.measure_of[1, lane]
                reach = 0.5 * (target[lane] - base[lane]) * speed[lane] + 0.1 * largest_move
                slow = corrections[lane] > 2 and move > 0.5 * last_move[lane]
                last_move[lane] = move
                if not away <= reach and target[lane] > 0.0 or slow and action[lane] == CORRECT:
                    action[lane] = CUT
                elif action[lane] == CLOSE:
                    closing[lane] = True
        if any_accept:
            _differentiate(topology, lanes, action)
        for lane in range(WIDTH):
            r = run[lane]
            if action[lane] == ACCEPT:
                correction = lanes.measure_of[1, lane]
                if target[lane] > 0.0:
                    outcome.steps[r] += 1
                    aim = 0.01 * topology.size / max(correction, 1e-12 * topology.size)
                    step[lane] *= min(2.0, max(0.5, aim ** (1.0 / 3.0)))
                outcome.iterations[r] += corrections[lane] + 1
                base[lane], speed[lane] = target[lane], _keep(lanes, lane)
                step[lane] = min(step[lane], largest_move / max(speed[lane], 1e-300))
            elif action[lane] == CUT:
                outcome.iterations[r] += corrections[lane] + 1
                step[lane] = 0.4 * min(step[lane], target[lane] - base[lane])
                closing[lane] = False
            if action[lane] == ACCEPT or (action[lane] == CUT and step[lane] >= smallest_step):
                left = 1.0 - base[lane]
                # Equal steps rather than a last one that is nearly nothing.
                step_taken = left / np.ceil(left / step[lane] - 1e-9)
                target[lane] = 1.0 if step_taken >= left else base[lane] + step_taken
                corrections[lane], last_move[lane] = 0, np.inf
                _predict(lanes, lane, base[lane], target[lane])
            elif action[lane] == FINISH or action[lane] == CUT:
                if action[lane] == FINISH:
                    outcome.done[r] = DONE
                    outcome.steps[r] += 1
                    outcome.iterations[r] += corrections[lane] + 2
                    _leave(lanes, outcome, lane, r)
                run[lane] = -1
                n_active -= 1
                if queue < last:
                    run[lane] = queue
                    queue += 1
                    n_active += 1
                    _enter(topology, runs, lanes, lane, run[lane])
                    step[lane], target[lane], base[lane] = first_step, 0.0, 0.0
                    closing[lane], corrections[lane] = False, 0


@njit
def _row(array, r):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    return array[r if array.shape[0] > 1 else 0]


@njit
def _enter(topology, runs, lanes, lane, r):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Put a run at its start into a lane."""
    start, stiffness = _row(runs.start, r), _row(runs.stiffness, r)
    loads_start, loads_rate = _row(runs.loads_start, r), _row(runs.loads_rate, r)
    support_rate = _row(runs.support_rate, r)
    for i in range(start.size):
        lanes.x[i, lane] = lanes.guess[i, lane] = start[i]
        lanes.loads_start[i, lane] = loads_start[i]
        lanes.loads_rate[i, lane] = loads_rate[i]
        lanes.support_rate[i, lane] = support_rate[i]
    coefficients = runs.rest_length[r]
    n_powers = coefficients.shape[1]
    for e in range(stiffness.size):
        lanes.stiffness[e, lane] = stiffness[e]
        for d in range(n_powers):
            lanes.coefficients[e * n_powers + d, lane] = coefficients[e, d]
        total = 0.0
        for s in range(topology.segment_start[e], topology.segment_start[e + 1]):
            i, j = 3 * topology.segment_nodes[s, 0], 3 * topology.segment_nodes[s, 1]
            total += np.sqrt(
                (start[j] - start[i]) ** 2 + (start[j + 1] - start[i + 1]) ** 2 + (start[j + 2] - start[i + 2]) ** 2
            )
        tension = stiffness[e] * (total / coefficients[e, 0] - 1.0)
        lanes.stress[e, lane] = max(tension, 0.0) if topology.is_cable[e] > 0.0 else tension
    lanes.parameter[0, lane] = 0.0


@njit
def _leave(lanes, outcome, lane, r):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Take a finished run out of its lane."""
    for i in range(lanes.x.shape[0]):
        outcome.nodes[r, i] = lanes.x[i, lane]
    for e in range(lanes.tension.shape[0]):
        outcome.tensions[r, e] = lanes.tension[e, lane]
    outcome.residual[r] = lanes.residual[0, lane]


@njit
def _tick(topology, lanes, place):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Measure, assemble and factorise all lanes; leave p − f in `rhs` and its relative size."""
    parameter = load(lanes.parameter, 0)
    n_powers = lanes.coefficients.shape[0] // lanes.rest_length.shape[0]
    for e in range(lanes.rest_length.shape[0]):
        value, rate, bend = zero(lanes.x), zero(lanes.x), zero(lanes.x)
        for d in range(n_powers - 1, -1, -1):
            bend = bend * parameter + 2.0 * rate
            rate = rate * parameter + value
            value = value * parameter + load(lanes.coefficients, e * n_powers + d)
        store(lanes.rest_length, e, value)
        store(lanes.rest_length_rate, e, rate)
        store(lanes.rest_length_bend, e, bend)
        is_taut = choose(maximum(load(lanes.stress, e), zero(lanes.x)), zero(lanes.x) + 1.0, zero(lanes.x))
        store(lanes.taut, e, is_taut if topology.is_cable[e] > 0.0 else zero(lanes.x) + 1.0)
    kernels.measure(
        lanes.x, lanes.rest_length, lanes.stiffness, lanes.taut, topology.segment_nodes, topology.segment_start,
        lanes.unit, lanes.inverse_length, lanes.length, lanes.tension, lanes.axial,
    )  # fmt: skip
    kernels.internal_force(lanes.unit, lanes.tension, topology.segment_nodes, topology.segment_start, lanes.force)
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
    kernels.assemble(
        lanes.unit, lanes.inverse_length, lanes.stress, lanes.axial, topology.segment_nodes,
        topology.segment_start, topology.node_block, topology.column_start, topology.segment_entry,
        topology.path_start, topology.segment_local, topology.pair_start, topology.pair_local,
        topology.pair_entry, topology.held_entry, topology.held_diagonal, lanes.gradient, lanes.blocks,
    )  # fmt: skip
    kernels.factorise(
        topology.column_start, topology.row, topology.left_start, topology.left_column, topology.left_entry,
        lanes.shift, place, lanes.blocks, lanes.pivot_inverse, lanes.n_negative,
    )  # fmt: skip


@njit
def _solve(topology, lanes, vector):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    kernels.solve(topology.column_start, topology.row, lanes.blocks, lanes.pivot_inverse, vector)


@njit
def _correct(topology, lanes, action):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Apply the correction to the lanes that want one, with the tensions that it predicts."""
    for lane in range(WIDTH):
        wants = action[lane] == CORRECT or action[lane] == ACCEPT or action[lane] == CLOSE
        lanes.active[0, lane] = 1.0 if wants else 0.0
    active = load(lanes.active, 0)
    _solve(topology, lanes, lanes.rhs)
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


@njit
def _differentiate(topology, lanes, action):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
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
            store(lanes.second, 3 * b + c, topology.free[i] * (load(lanes.loads_rate, i) - load(lanes.push, i)))
    _solve(topology, lanes, lanes.second)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(lanes.motion, i, load(lanes.motion, i) + load(lanes.second, 3 * b + c))
    _curvature(topology, lanes)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            store(lanes.second, 3 * b + c, zero(lanes.x) - topology.free[i] * load(lanes.push, i))
    _solve(topology, lanes, lanes.second)
    for i in range(lanes.motion.shape[0]):
        store(lanes.velocity, i, choose(active, load(lanes.motion, i), load(lanes.velocity, i)))
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


@njit
def _curvature(topology, lanes):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
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
            along = load(lanes.unit, 3 * s) * vx + load(lanes.unit, 3 * s + 1) * vy + load(lanes.unit, 3 * s + 2) * vz
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
            for c, value in ((0, on_n * nx + on_w * wx), (1, on_n * ny + on_w * wy), (2, on_n * nz + on_w * wz)):
                store(lanes.push, i + c, load(lanes.push, i + c) - value)
                store(lanes.push, j + c, load(lanes.push, j + c) + value)


@njit
def _keep(lanes, lane):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Keep the accepted point of a lane to predict from; return the largest speed of a coordinate."""
    speed = 0.0
    for i in range(lanes.x.shape[0]):
        lanes.accepted[i, lane] = lanes.x[i, lane]
        speed = max(speed, abs(lanes.velocity[i, lane]))
    for e in range(lanes.stress.shape[0]):
        lanes.accepted_tension[e, lane] = lanes.stress[e, lane]
    return speed


@njit
def _predict(lanes, lane, base, target):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Put a lane at its prediction for λ = `target`, to second order from the point kept at `base`."""
    h = target - base
    for i in range(lanes.x.shape[0]):
        x = lanes.accepted[i, lane] + h * (lanes.velocity[i, lane] + 0.5 * h * lanes.bend[i, lane])
        lanes.x[i, lane] = lanes.guess[i, lane] = x
    lanes.parameter[0, lane] = target
    for e in range(lanes.stress.shape[0]):
        rate = lanes.tension_rate[e, lane] + 0.5 * h * lanes.tension_bend[e, lane]
        lanes.stress[e, lane] = lanes.accepted_tension[e, lane] + h * rate


@njit
def _certify(topology, runs, outcome, lanes, run, action):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Compute the lowest eigenvalue and the derivatives of the lanes that finish, with their last factor."""
    if runs.modes.shape[0] > 0:
        _softest(topology, runs.modes, lanes)
        for lane in range(WIDTH):
            if action[lane] == FINISH:
                outcome.lowest_eigenvalue[run[lane]] = 1.0 / _largest_of_three(lanes.measure_of, lane)
    for q in range(runs.by_force.shape[1]):
        for lane in range(WIDTH):
            r = max(run[lane], 0)
            by_rest_length, by_stiffness = _row(runs.by_rest_length, r), _row(runs.by_stiffness, r)
            by_force = _row(runs.by_force, r)
            for e in range(lanes.pull.shape[0]):
                ratio = lanes.length[e, lane] / lanes.rest_length[e, lane]
                by_length = lanes.axial[e, lane] * ratio * by_rest_length[q, e]
                lanes.pull[e, lane] = lanes.taut[e, lane] * (ratio - 1.0) * by_stiffness[q, e] - by_length
            for i in range(lanes.motion.shape[0]):
                lanes.motion[i, lane] = by_force[q, i]
        kernels.internal_force(lanes.unit, lanes.pull, topology.segment_nodes, topology.segment_start, lanes.push)
        for b in range(topology.block_node.size):
            for c in range(3):
                i = 3 * topology.block_node[b] + c
                push = topology.free[i] * (load(lanes.motion, i) - load(lanes.push, i))
                store(lanes.second, 3 * b + c, push)
        _solve(topology, lanes, lanes.second)
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


@njit
def _softest(topology, modes, lanes):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Iterate three vectors with K⁻¹; leave the 3 × 3 matrix Xᵀ K⁻¹ X of the last in `measure_of`."""
    n = lanes.second.shape[0]
    for k in range(3):
        for i in range(n):
            store(lanes.basis, k * n + i, zero(lanes.x) + modes[k, i])
    for sweep in range(SWEEPS + 1):
        for k in range(3):
            for i in range(n):
                store(lanes.second, i, load(lanes.basis, k * n + i))
            _solve(topology, lanes, lanes.second)
            for i in range(n):
                store(lanes.image, k * n + i, load(lanes.second, i))
        if sweep == SWEEPS:
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
    for k in range(3):
        for other in range(3):
            store(lanes.measure_of, 3 * k + other, _dot(lanes.basis, k * n, lanes.image, other * n, n))


@njit
def _dot(left, i, right, j, n):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    total = zero(left)
    for at in range(n):
        total = total + load(left, i + at) * load(right, j + at)
    return total


@njit
def _largest_of_three(matrix, lane):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Largest eigenvalue of a symmetric 3 × 3 matrix, by the cosine of a third of an angle."""
    a, b, c = matrix[0, lane], matrix[4, lane], matrix[8, lane]
    d, e, f = matrix[1, lane], matrix[2, lane], matrix[5, lane]
    mean = (a + b + c) / 3.0
    spread = np.sqrt(((a - mean) ** 2 + (b - mean) ** 2 + (c - mean) ** 2 + 2.0 * (d * d + e * e + f * f)) / 6.0)
    if spread == 0.0:
        return mean
    a, b, c, d, e, f = (
        (a - mean) / spread, (b - mean) / spread, (c - mean) / spread, d / spread, e / spread, f / spread
    )  # fmt: skip
    half = 0.5 * (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))
    return mean + 2.0 * spread * np.cos(np.arccos(min(1.0, max(-1.0, half))) / 3.0)
