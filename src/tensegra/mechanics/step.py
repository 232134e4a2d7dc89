"""The parts of a step: prescribe, measure, balance, factorise, correct, differentiate.

Everything here is done for all lanes of a pack at once; `active` masks those whose state it changes.
Symbols are those of the nomenclature: ℓ path length, l₀ rest length, T tension, s and n length and
direction of a segment, a dot the derivative by the path parameter λ.
"""

from tensegra.mechanics import kernels, law
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import (
    choose,
    count_lanes,
    fused,
    get,
    item,
    less,
    load,
    magnitude,
    maximum,
    number,
    put,
    store,
    zero,
)

LENGTH_ROUNDING = 2e-15
"""Relative error of a path length by rounding; EA ℓ/l₀ times it is an error of the tension."""


@njit
def row_of(array, r):
    """Return row `r`, or the only row of an array that holds for all runs."""
    return array[r if array.shape[0] > 1 else 0]


@njit
def enter(topology, runs, outcome, lanes, lane, r, row):
    """Put run `r` into a lane, where row `row` of the outcome says that it stands."""
    start, stiffness = row_of(runs.start, r), row_of(runs.stiffness, r)
    loads_start, loads_rate = row_of(runs.loads_start, r), row_of(runs.loads_rate, r)
    support_rate = row_of(runs.support_rate, r)
    parameter = outcome.parameter[row]
    for i in range(start.size):
        held = start[i] + parameter * support_rate[i]
        put(lanes.x, i, lane, outcome.nodes[row, i] if number(topology.free, i) > 0.0 else held)
        put(lanes.loads_start, i, lane, loads_start[i])
        put(lanes.loads_rate, i, lane, loads_rate[i])
        put(lanes.support_rate, i, lane, support_rate[i] * (1.0 - number(topology.free, i)))
    coefficients = runs.rest_length[r]
    n_powers = coefficients.shape[1]
    largest = 0.0
    for e in range(stiffness.size):
        put(lanes.stiffness, e, lane, stiffness[e])
        for d in range(n_powers):
            put(lanes.coefficients, e * n_powers + d, lane, coefficients[e, d])
        largest = max(largest, law.by_length(1.0, coefficients[e, 0], stiffness[e]))
    put(lanes.scale, 0, lane, largest)
    put(lanes.shift, 0, lane, 0.0)
    put(lanes.parameter, 0, lane, parameter)


@njit
def leave(topology, lanes, outcome, lane, row):
    """Write where a lane stands, as it was last measured, into a row of the outcome."""
    outcome.parameter[row] = get(lanes.parameter, 0, lane)
    for i in range(topology.n_coordinates):
        outcome.nodes[row, i] = get(lanes.x, i, lane)
    for e in range(topology.n_members):
        outcome.tensions[row, e] = get(lanes.tension, e, lane) + 0.0  # a slack cable carries 0, not −0
    outcome.residual[row] = get(lanes.residual, 0, lane)


@njit
def prescribe(topology, lanes):
    """Compute the rest lengths at each lane's λ, with their two derivatives."""
    parameter = load(lanes.parameter, 0)
    n_powers = lanes.n_powers
    for e in range(topology.n_members):
        value, rate, bend = zero(lanes.x), zero(lanes.x), zero(lanes.x)
        for d in range(n_powers - 1, -1, -1):
            bend = fused(bend, parameter, 2.0 * rate)
            rate = fused(rate, parameter, value)
            value = value * parameter + load(lanes.coefficients, e * n_powers + d)
        store(lanes.rest_length, e, value)
        store(lanes.rest_length_rate, e, rate)
        store(lanes.rest_length_bend, e, bend)


@njit
def taut_by_stress(topology, lanes):
    """Let the tensions that are predicted say which cables carry force."""
    one = zero(lanes.x) + 1.0
    for e in range(topology.n_members):
        taut = less(zero(lanes.x), load(lanes.stress, e))
        store(lanes.taut, e, taut if number(topology.is_cable, e) > 0.0 else one)


@njit
def measure_by_length(topology, lanes):
    """Measure, and let the lengths say which cables carry force; the stress is the tension measured.

    A cable that pulls by no more than its length is rounded is slack, and a strut with no more carries
    nothing: nothing tells them from members that are not stretched, and a stiffness that rounding decides on
    would decide on the word of the structure.
    """
    one = zero(lanes.x) + 1.0
    for e in range(topology.n_members):
        store(lanes.taut, e, one)
    kernels.measure(topology, lanes)
    for e in range(topology.n_members):
        tension, l0, ea = load(lanes.tension, e), load(lanes.rest_length, e), load(lanes.stiffness, e)
        rounding = LENGTH_ROUNDING * law.size(load(lanes.length, e), l0, ea)
        if number(topology.is_cable, e) > 0.0:
            taut = less(rounding, tension)
            store(lanes.taut, e, taut)
            store(lanes.axial, e, taut * load(lanes.axial, e))
        else:
            taut = less(rounding, magnitude(tension))
        store(lanes.tension, e, choose(taut, tension, zero(lanes.x)))
        store(lanes.stress, e, load(lanes.tension, e))


@njit
def balance(topology, lanes, smallest_scale):
    """Leave p − f of the last measure in `rhs`, and its largest entry, relative to the scale, in `residual`.

    The scale is the largest tension or load, and not less than `smallest_scale` times the largest EA ℓ/l₀,
    below which a residual is rounding. A cable on the wrong side of slack counts as out of balance by what
    it would carry.
    """
    nothing = zero(lanes.x)
    kernels.internal_force(topology, lanes, lanes.tension, lanes.force)
    largest, scale, carried, stiffest = nothing, nothing, nothing, nothing
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        tension = magnitude(load(lanes.tension, e))
        scale = maximum(scale, tension)
        scale = maximum(scale, smallest_scale * law.size(length, l0, ea))
        carried = maximum(carried, number(topology.moving, e) * tension)
        stiffest = maximum(stiffest, law.by_length(length, l0, ea))
        if number(topology.is_cable, e) > 0.0:
            pull = law.tension(length, l0, ea)
            largest = maximum(largest, choose(load(lanes.taut, e), nothing - pull, pull))
    store(lanes.scale, 0, stiffest)
    parameter = load(lanes.parameter, 0)
    pushed, no_number = nothing, nothing
    for b in range(topology.n_blocks):
        for c in range(3):
            missing = nothing
            if item(topology.block_node, b) >= 0:
                i = 3 * item(topology.block_node, b) + c
                p = load(lanes.loads_start, i) + parameter * load(lanes.loads_rate, i)
                missing = number(topology.free, i) * (p - load(lanes.force, i))
                pushed = maximum(pushed, number(topology.free, i) * magnitude(p))
                largest = maximum(largest, magnitude(missing))
                # A NaN is larger than nothing in no comparison: let it through to the residual.
                no_number = no_number + 0.0 * missing
            store(lanes.rhs, 3 * b + c, missing)
    store(lanes.residual, 0, largest / maximum(scale, pushed) + no_number)
    store(lanes.measure_of, 0, carried)
    store(lanes.measure_of, 1, pushed)


@njit
def factorise(topology, lanes):
    """Assemble and factorise K at the last measure, with the tensions in `stress`."""
    kernels.assemble(topology, lanes)
    kernels.factorise(topology, lanes)


@njit
def tick(topology, lanes, smallest_scale):
    """Measure with the cables that `taut` says carry force, balance, and factorise."""
    prescribe(topology, lanes)
    kernels.measure(topology, lanes)
    balance(topology, lanes, smallest_scale)
    factorise(topology, lanes)


@njit
def spread(topology, vector, field):
    """Write a vector in elimination order, ``(3 n_blocks,)``, as a nodal field; held coordinates rest."""
    for i in range(topology.n_coordinates):
        store(field, i, zero(field))
    for b in range(topology.n_blocks):
        if item(topology.block_node, b) >= 0:
            for c in range(3):
                store(field, 3 * item(topology.block_node, b) + c, load(vector, 3 * b + c))


@njit
def gather(topology, field, vector, factor):
    """Write `factor` times a nodal field as a vector in elimination order; held rows are zero."""
    for b in range(topology.n_blocks):
        for c in range(3):
            value = zero(vector)
            if item(topology.block_node, b) >= 0:
                i = 3 * item(topology.block_node, b) + c
                value = number(topology.free, i) * factor * load(field, i)
            store(vector, 3 * b + c, value)


@njit
def correct(topology, lanes):
    """Apply the correction to the active lanes, with the tensions that it predicts.

    Newton's method runs in positions and tensions together: T = k (ℓ − l₀ + b·u) is what K is built with
    next, so that a stiff strut that turns does not spoil K, and a cable goes slack by what it will carry
    (after Magisano, Leonetti & Garcea 2017, doi:10.1016/j.cma.2016.10.043). Leaves the largest move, and the
    distance from the guess, in `measure_of`.
    """
    active = load(lanes.active, 0)
    kernels.solve(topology, lanes, lanes.rhs)
    spread(topology, lanes.rhs, lanes.motion)
    move, away = zero(lanes.x), zero(lanes.x)
    for i in range(topology.n_coordinates):
        u, x = load(lanes.motion, i), load(lanes.x, i)
        x = choose(active, x + u, x)
        store(lanes.x, i, x)
        move = maximum(move, magnitude(u))
        away = maximum(away, magnitude(x - load(lanes.guess, i)))
    store(lanes.measure_of, 0, move)
    store(lanes.measure_of, 1, away)
    kernels.stretch_rate(topology, lanes, lanes.motion, lanes.length_rate)
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        predicted = law.tension(length, l0, ea) + law.by_length(length, l0, ea) * load(lanes.length_rate, e)
        store(lanes.stress, e, choose(active, predicted, load(lanes.stress, e)))


@njit
def carried_by(topology, lanes):
    """Put nothing in place of the tensions that no cable carries, before K is built with `stress`."""
    for e in range(topology.n_members):
        if number(topology.is_cable, e) > 0.0:
            store(lanes.stress, e, maximum(load(lanes.stress, e), zero(lanes.x)))


@njit
def differentiate(topology, lanes):
    """Differentiate the point last measured by λ, twice: K ẋ = −∂r/∂λ and K ẍ = −D²r[(ẋ, 1), (ẋ, 1)].

    Leaves ẋ in `velocity`, ẍ in `bend`, and in `stress_rate` and `stress_bend` the derivatives of what each
    member would carry if it were taut: of a slack cable they say when it comes to carry again.
    """
    velocity(topology, lanes)
    _curvature(topology, lanes)
    gather(topology, lanes.push, lanes.second, -1.0)
    kernels.solve(topology, lanes, lanes.second)
    spread(topology, lanes.second, lanes.bend)
    kernels.stretch_rate(topology, lanes, lanes.bend, lanes.length_rate)
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        along = law.by_length(length, l0, ea) * load(lanes.length_rate, e)
        store(lanes.stress_bend, e, load(lanes.stress_bend, e) + along)


@njit
def velocity(topology, lanes):
    """Leave ẋ in `velocity`, the rates of the lengths in `length_rate` and Ṫ in `stress_rate`."""
    kernels.stretch_rate(topology, lanes, lanes.support_rate, lanes.length_rate)
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        rate = law.rate(length, l0, ea, load(lanes.length_rate, e), load(lanes.rest_length_rate, e))
        store(lanes.pull, e, load(lanes.taut, e) * rate)
    kernels.force_rate(topology, lanes, lanes.support_rate, lanes.pull, lanes.push)
    for i in range(topology.n_coordinates):
        store(lanes.push, i, load(lanes.loads_rate, i) - load(lanes.push, i))
    gather(topology, lanes.push, lanes.second, 1.0)
    kernels.solve(topology, lanes, lanes.second)
    spread(topology, lanes.second, lanes.velocity)
    for i in range(topology.n_coordinates):
        store(lanes.velocity, i, load(lanes.velocity, i) + load(lanes.support_rate, i))
    kernels.stretch_rate(topology, lanes, lanes.velocity, lanes.length_rate)
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        rate = law.rate(length, l0, ea, load(lanes.length_rate, e), load(lanes.rest_length_rate, e))
        store(lanes.stress_rate, e, rate)


@njit
def _curvature(topology, lanes):
    """Leave D²r along (ẋ, 1) in `push`, and in `stress_bend` the part of T̈ without ẍ.

    Along a straight motion d²(T b)/dλ² = T̈ n + 2 Ṫ ṅ + T n̈ on every segment, with w the part of
    ẋ₂ − ẋ₁ across the segment: ṡ = n·(ẋ₂ − ẋ₁), s̈ = w²/s, ṅ = w/s, n̈ = −(2 ṡ ṅ + s̈ n)/s.
    """
    for i in range(topology.n_coordinates):
        store(lanes.push, i, zero(lanes.x))
    for e in range(topology.n_members):
        bulge = zero(lanes.x)
        for s in range(item(topology.segment_start, e), item(topology.segment_start, e + 1)):
            vx, vy, vz, along = _apart(topology, lanes, s)
            across = vx * vx + vy * vy + vz * vz - along * along
            bulge = bulge + load(lanes.inverse_length, s) * across
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        l0_rate, l0_bend = load(lanes.rest_length_rate, e), load(lanes.rest_length_bend, e)
        taut, t = load(lanes.taut, e), load(lanes.tension, e)
        t_bend = law.by_length(length, l0, ea) * bulge
        t_bend = t_bend + law.bend(length, l0, ea, load(lanes.length_rate, e), l0_rate, l0_bend)
        store(lanes.stress_bend, e, t_bend)
        t_rate, t_bend = taut * load(lanes.stress_rate, e), taut * t_bend
        for s in range(item(topology.segment_start, e), item(topology.segment_start, e + 1)):
            i, j = 3 * item(topology.segment_nodes, 2 * s), 3 * item(topology.segment_nodes, 2 * s + 1)
            inverse = load(lanes.inverse_length, s)
            nx, ny, nz = load(lanes.unit, 3 * s), load(lanes.unit, 3 * s + 1), load(lanes.unit, 3 * s + 2)
            vx, vy, vz, along = _apart(topology, lanes, s)
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


@njit
def _apart(topology, lanes, s):
    """Return ẋ₂ − ẋ₁ of a segment, and its part along the segment."""
    i, j = 3 * item(topology.segment_nodes, 2 * s), 3 * item(topology.segment_nodes, 2 * s + 1)
    vx = load(lanes.velocity, j) - load(lanes.velocity, i)
    vy = load(lanes.velocity, j + 1) - load(lanes.velocity, i + 1)
    vz = load(lanes.velocity, j + 2) - load(lanes.velocity, i + 2)
    along = load(lanes.unit, 3 * s) * vx + load(lanes.unit, 3 * s + 1) * vy + load(lanes.unit, 3 * s + 2) * vz
    return vx, vy, vz, along


@njit
def n_lanes(lanes):
    """Return how many runs go side by side."""
    return count_lanes(lanes.x)
