"""What ties a point to its base: prediction, evidence, events between slack and taut.

A base is the last accepted point of a lane, with its derivatives by λ (`base_…` of `Lanes`): a point of the
branch, from which the next one is predicted, and against which it is weighed.
"""

import numpy as np

from tensegra.mechanics import law
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import (
    choose,
    fused,
    get,
    item,
    less,
    load,
    magnitude,
    maximum,
    number,
    put,
    root,
    store,
    zero,
)
from tensegra.mechanics.step import LENGTH_ROUNDING

EDGE = 1e-8
"""Share of the largest tension below which a cable is on the edge between slack and taut."""

NEARLY_GONE, TOGETHER = 1e-2, 1e-2
"""Share of the reference tension below which a collapse is foreseen, and share of what is left of it that any
member may carry where the strongest carries nothing."""


@njit
def begin(topology, lanes, lane):
    """Let the lengths at the start say what the members carry; nothing is known of any derivative."""
    for e in range(topology.n_members):
        total = 0.0
        for s in range(item(topology.segment_start, e), item(topology.segment_start, e + 1)):
            i, j = 3 * item(topology.segment_nodes, 2 * s), 3 * item(topology.segment_nodes, 2 * s + 1)
            square = 0.0
            for c in range(3):
                square += (get(lanes.x, j + c, lane) - get(lanes.x, i + c, lane)) ** 2
            total += np.sqrt(square)
        n_powers = lanes.n_powers
        l0, at = 0.0, get(lanes.parameter, 0, lane)
        for d in range(n_powers - 1, -1, -1):
            l0 = l0 * at + get(lanes.coefficients, e * n_powers + d, lane)
        put(lanes.stress, e, lane, law.tension(total, l0, get(lanes.stiffness, e, lane)))
        put(lanes.edge, e, lane, 0.0)
    for i in range(topology.n_coordinates):
        put(lanes.guess, i, lane, get(lanes.x, i, lane))


@njit
def reread(topology, lanes, lane):
    """Put what each member would carry at its length, were it taut, in place of what was predicted."""
    for e in range(topology.n_members):
        l0, ea, length = (
            get(lanes.rest_length, e, lane),
            get(lanes.stiffness, e, lane),
            get(lanes.length, e, lane),
        )
        put(lanes.stress, e, lane, law.tension(length, l0, ea))


@njit
def hold_taut(topology, lanes, lane, all_members, member):
    """Keep the set of the base: of all members, or of the one whose event is sought."""
    for e in range(topology.n_members):
        if all_members or e == member:
            put(lanes.taut, e, lane, get(lanes.base_taut, e, lane))


@njit
def predict(topology, lanes, lane, base, target):
    """Put a lane at its prediction for λ = `target`, to third order from its base."""
    h = target - base
    for i in range(topology.n_coordinates):
        slope = get(lanes.base_bend, i, lane) + h / 3.0 * get(lanes.base_third, i, lane)
        slope = get(lanes.base_velocity, i, lane) + 0.5 * h * slope
        x = get(lanes.base_x, i, lane) + h * slope
        put(lanes.x, i, lane, x)
        put(lanes.guess, i, lane, x)
    for e in range(topology.n_members):
        put(lanes.stress, e, lane, _foreseen(lanes, lane, e, h))
    put(lanes.parameter, 0, lane, target)


@njit
def _foreseen(lanes, lane, e, h):
    """Return what a member would carry by prediction, a step h from the base, were it taut."""
    slope = get(lanes.base_stress_bend, e, lane) + h / 3.0 * get(lanes.base_stress_third, e, lane)
    slope = get(lanes.base_stress_rate, e, lane) + 0.5 * h * slope
    return get(lanes.base_stress, e, lane) + h * slope


@njit
def move_along(topology, lanes, lane, member):
    """Change λ such that the member of an event carries nothing, and move along the branch with it."""
    rate = get(lanes.stress_rate, member, lane)
    change = 0.0 - get(lanes.stress, member, lane) / rate
    if not abs(change) < np.inf:
        change = np.inf
    for i in range(topology.n_coordinates):
        put(lanes.x, i, lane, get(lanes.x, i, lane) + change * get(lanes.velocity, i, lane))
    for e in range(topology.n_members):
        moved = get(lanes.stress, e, lane) + change * get(lanes.stress_rate, e, lane)
        put(lanes.stress, e, lane, 0.0 if e == member else moved)
    put(lanes.parameter, 0, lane, get(lanes.parameter, 0, lane) + change)
    return change


@njit
def weigh(topology, lanes):
    """Weigh the evidence that the points of all lanes lie on the branches of their bases, `step` behind.

    Leaves in `measure_of`: 2 the miss of the way between base and point, 3 the longest move, 4 whether a
    cable changed between slack and taut, 5 whether one on the edge did, 7 whether one dipped through zero.
    """
    nothing, one = zero(lanes.x), zero(lanes.x) + 1.0
    h, largest = load(lanes.step, 0), zero(lanes.x)
    for e in range(topology.n_members):
        largest = maximum(largest, magnitude(load(lanes.tension, e)))
    crossed, turned, dipped = nothing, nothing, nothing
    for e in range(topology.n_members):
        if number(topology.is_cable, e) == 0.0:
            continue
        before, after = load(lanes.base_stress, e), load(lanes.stress, e)
        was_taut, on_edge = load(lanes.base_taut, e), load(lanes.edge, e)
        changed = magnitude(less(nothing, after) - was_taut)
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        least = maximum(EDGE * largest, 10.0 * LENGTH_ROUNDING * law.size(length, l0, ea))
        crossed = maximum(crossed, changed * (one - on_edge) * less(least, magnitude(after)))
        turned = maximum(turned, changed * on_edge)
        side = was_taut + was_taut - one
        falls, rises = h * side * load(lanes.base_stress_rate, e), h * side * load(lanes.stress_rate, e)
        low = _lowest(side * before, falls, side * after, rises)
        may = less(falls, nothing) * less(nothing, rises) * (one - changed) * (one - on_edge)
        dipped = maximum(dipped, may * less(low, nothing))
    miss, most = nothing, nothing
    for i in range(topology.n_coordinates):
        mean = 0.5 * (load(lanes.base_velocity, i) + load(lanes.velocity, i))
        turn = (load(lanes.base_bend, i) - load(lanes.bend, i)) / 12.0
        moved = load(lanes.x, i) - load(lanes.base_x, i)
        miss = maximum(miss, magnitude(moved - h * fused(h, turn, mean)))
        most = maximum(most, magnitude(moved))
    store(lanes.measure_of, 2, miss)
    store(lanes.measure_of, 3, most)
    store(lanes.measure_of, 4, crossed)
    store(lanes.measure_of, 5, turned)
    store(lanes.measure_of, 7, dipped)


@njit
def _lowest(start, start_rate, end, end_rate):
    """Return the lowest value of a cubic on the unit interval that falls at first and rises at its end."""
    a = start_rate + end_rate - 2.0 * (end - start)
    b = 3.0 * (end - start) - 2.0 * start_rate - end_rate
    # Of a t³ + b t² + ċ t the derivative has one root in between, for it changes its sign there.
    square = root(maximum(b * b - 3.0 * a * start_rate, 0.0 * b))
    t = (0.0 - 1.0) * start_rate / (b + square)
    return start + t * (start_rate + t * (b + t * a))


@njit
def first_crossing(topology, lanes, lane, h, member, foreseen):
    """Find the first of the members that change between slack and taut; return how far from the base.

    It is where the prediction of the member vanishes, or its chord where that does not. Which members
    change is known from the end of the step or, where that was not reached, `foreseen`.
    """
    first = np.inf
    for e in range(topology.n_members):
        if number(topology.is_cable, e) == 0.0 or get(lanes.edge, e, lane) > 0.0:
            continue
        before, after = get(lanes.base_stress, e, lane), get(lanes.stress, e, lane)
        if foreseen:
            after = _foreseen(lanes, lane, e, h)
        if (after > 0.0) == (get(lanes.base_taut, e, lane) > 0.0):
            continue
        low, high = 0.0, 1.0
        if (_foreseen(lanes, lane, e, h) > 0.0) != (before > 0.0):
            for _ in range(30):
                middle = 0.5 * (low + high)
                if (_foreseen(lanes, lane, e, middle * h) > 0.0) == (before > 0.0):
                    low = middle
                else:
                    high = middle
        else:
            high = before / (before - after)
        if high * h < first:
            first = high * h
            member[lane] = e
    return first if first < np.inf else 0.0


@njit
def take_base(topology, lanes):
    """Make the points of the active lanes their bases; leave the speed of the bases in `measure_of`, 8.

    The derivatives at both ends of the step that led there, `step`, give the third one too; 0 says that
    there was no such step. Where `shift` is one it is noted which cables carry force, and which are on the
    edge; behind an event (`measure_of`, 6) those go where they tend.
    """
    nothing, one = zero(lanes.x), zero(lanes.x) + 1.0
    active, h, found, past = (
        load(lanes.active, 0), load(lanes.step, 0), load(lanes.shift, 0), load(lanes.measure_of, 6)
    )  # fmt: skip
    inverse = choose(h, 1.0 / choose(h, h, one), nothing)
    largest, speed = nothing, nothing
    for e in range(topology.n_members):
        largest = maximum(largest, magnitude(load(lanes.tension, e)))
    for e in range(topology.n_members):
        stress = load(lanes.stress, e)
        if number(topology.is_cable, e) == 0.0:
            store(lanes.base_taut, e, one)
        else:
            l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
            least = maximum(EDGE * largest, 10.0 * LENGTH_ROUNDING * law.size(length, l0, ea))
            edge = one - less(least, magnitude(stress))
            taut = choose(edge * past, less(nothing, load(lanes.stress_rate, e)), less(nothing, stress))
            store(lanes.edge, e, choose(found, edge, load(lanes.edge, e)))
            store(lanes.base_taut, e, choose(found, taut, load(lanes.base_taut, e)))
        store(lanes.base_stress, e, choose(active, stress, load(lanes.base_stress, e)))
        v, b = load(lanes.stress_rate, e), load(lanes.stress_bend, e)
        v0, b0 = load(lanes.base_stress_rate, e), load(lanes.base_stress_bend, e)
        third = (4.0 * b + 2.0 * b0 - 6.0 * (v - v0) * inverse) * inverse
        store(lanes.base_stress_third, e, choose(active, third, load(lanes.base_stress_third, e)))
        store(lanes.base_stress_rate, e, choose(active, v, v0))
        store(lanes.base_stress_bend, e, choose(active, b, b0))
    for i in range(topology.n_coordinates):
        v, b = load(lanes.velocity, i), load(lanes.bend, i)
        v0, b0 = load(lanes.base_velocity, i), load(lanes.base_bend, i)
        third = (4.0 * b + 2.0 * b0 - 6.0 * (v - v0) * inverse) * inverse
        store(lanes.base_third, i, choose(active, third, load(lanes.base_third, i)))
        store(lanes.base_velocity, i, choose(active, v, v0))
        store(lanes.base_bend, i, choose(active, b, b0))
        store(lanes.base_x, i, choose(active, load(lanes.x, i), load(lanes.base_x, i)))
        speed = maximum(speed, magnitude(load(lanes.base_velocity, i)))
    store(lanes.measure_of, 8, speed)
    store(lanes.shift, 0, nothing)


@njit
def turn_edges(topology, lanes, lane):
    """Take the cables on the edge for what they came to be behind it."""
    for e in range(topology.n_members):
        if get(lanes.edge, e, lane) > 0.0:
            put(lanes.base_taut, e, lane, 1.0 if get(lanes.stress, e, lane) > 0.0 else 0.0)


@njit
def go_back(topology, lanes, lane, base):
    """Put a lane back to its base."""
    for i in range(topology.n_coordinates):
        put(lanes.x, i, lane, get(lanes.base_x, i, lane))
    for e in range(topology.n_members):
        put(lanes.stress, e, lane, get(lanes.base_stress, e, lane))
    put(lanes.parameter, 0, lane, base)


@njit
def carries(topology, lanes, lane, e):
    """Whether a member carries force at the base: a strut does, a cable where it is taut."""
    return number(topology.is_cable, e) == 0.0 or get(lanes.base_taut, e, lane) > 0.0


@njit
def collapses_at(topology, lanes, lane, base, reference):
    """Return λ where all prestress of an unloaded lane is gone, as its base foresees it; infinite where not.

    Towards a collapse all tensions fall to nothing together, and K with them: every step there is cut, the
    shorter the nearer. Once little is left the derivatives tell where nothing is.
    """
    for i in range(topology.n_coordinates):
        load = get(lanes.loads_start, i, lane) + base * get(lanes.loads_rate, i, lane)
        if number(topology.free, i) * load != 0.0:
            return np.inf
    strongest, most = 0, 0.0
    for e in range(topology.n_members):
        carried = abs(get(lanes.base_stress, e, lane)) * number(topology.moving, e)
        if carries(topology, lanes, lane, e) and carried > most:
            strongest, most = e, carried
    if not 0.0 < most < NEARLY_GONE * reference:
        return np.inf
    side = 1.0 if get(lanes.base_stress, strongest, lane) > 0.0 else -1.0
    falls = side * get(lanes.base_stress_rate, strongest, lane)
    square = falls * falls - 2.0 * most * side * get(lanes.base_stress_bend, strongest, lane)
    if not (falls < 0.0 and square >= 0.0):
        return np.inf
    h = 2.0 * most / (np.sqrt(square) - falls)
    for e in range(topology.n_members):
        moves = carries(topology, lanes, lane, e) and number(topology.moving, e) > 0.0
        if moves and abs(_foreseen(lanes, lane, e, h)) > TOGETHER * most:
            return np.inf
    return base + h if base + h < 1.0 else np.inf


@njit
def leave_foreseen(topology, lanes, outcome, lane, r, base, target):
    """Write where a lane will be at λ = `target`, as its base foresees it, for where its branch ends."""
    leave_base(topology, lanes, outcome, lane, r, base)
    predict(topology, lanes, lane, base, target)
    outcome.parameter[r] = target
    for i in range(topology.n_coordinates):
        outcome.nodes[r, i] = get(lanes.x, i, lane)
    for e in range(topology.n_members):
        outcome.tensions[r, e] = get(lanes.stress, e, lane) if carries(topology, lanes, lane, e) else 0.0


@njit
def leave_base(topology, lanes, outcome, lane, r, base):
    """Write where the branch of a lane ends: its base, with its velocity."""
    outcome.parameter[r] = base
    for i in range(topology.n_coordinates):
        outcome.nodes[r, i] = get(lanes.base_x, i, lane)
        outcome.velocity[r, i] = get(lanes.base_velocity, i, lane)
    for e in range(topology.n_members):
        stress = get(lanes.base_stress, e, lane)
        outcome.tensions[r, e] = stress if get(lanes.base_taut, e, lane) > 0.0 else 0.0
