"""Many runs of one structure in lockstep by the plain procedure of the source.

What `tensegra.mechanics.stepped` does with one run, eight lanes at a time: equal increments, each
solved by Newton–Raphson in the positions, with K built from the tensions of the present position.
A lane whose increment has converged goes on to the next within the same tick, so a run costs one
factorisation an iteration, as alone.

Lanes do not exchange numbers, so a result depends neither on its neighbours nor on the order.
"""

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.compiled import njit, njit_once
from tensegra.mechanics.equilibrium import LENGTH_ROUNDING, RESIDUAL_TOLERANCE
from tensegra.mechanics.lanes import WIDTH, choose, less, load, magnitude, maximum, store, zero
from tensegra.mechanics.lockstep import enter, leave
from tensegra.mechanics.lockstep_data import FLAT, LOST, NOT_DEFINITE, STANDS
from tensegra.mechanics.tick import factorise, prescribe, row_of, solve

GOES_ON = 0
"""`Outcome.done` of a run that has not come to its end."""

SMALLEST_SCALE = LENGTH_ROUNDING / RESIDUAL_TOLERANCE
"""Residuals are relative to no less than this share of the largest EA ℓ/l₀: what rounding leaves."""


@njit
def follow_stepped(topology, runs, increments, outcome, lanes, first, last):
    """Take the runs `first` to `last` through their stage in equal increments.

    Parameters
    ----------
    topology, runs, increments, outcome, lanes
        `Topology`, `Runs`, `Increments`, `Outcome` and `Lanes`.
    first, last
        Range of runs.
    """
    place = np.zeros(topology.block_node.size, dtype=np.int64)
    run = np.full(WIDTH, -1)
    end, solves = np.full(WIDTH, GOES_ON), np.zeros(WIDTH, dtype=np.int64)
    queue, n_active = first, 0
    for lane in range(WIDTH):
        # A lane without a run of its own repeats the first: its numbers are numbers, nothing is kept.
        _begin(topology, runs, increments, lanes, lane, min(queue, last - 1))
        if queue < last:
            run[lane] = queue
            queue += 1
            n_active += 1
    while n_active > 0:
        advanced = True
        while advanced:
            prescribe(lanes)
            balance(topology, increments.moving, lanes)
            advanced = False
            for lane in range(WIDTH):
                r = run[lane]
                if r >= 0 and end[lane] == GOES_ON and lanes.residual[0, lane] <= RESIDUAL_TOLERANCE:
                    outcome.steps[r] += 1
                    solves[lane] = 0
                    if outcome.steps[r] == increments.number[r]:
                        end[lane] = STANDS
                    else:
                        _advance(topology, runs, increments, lanes, lane, r, outcome.steps[r] + 1)
                        advanced = True
        for lane in range(WIDTH):
            carried, loaded = lanes.measure_of[0, lane], lanes.measure_of[1, lane] != 0.0
            flat_below = row_of(increments.flat_below, max(run[lane], 0))
            if run[lane] >= 0 and end[lane] == GOES_ON and not loaded and carried <= flat_below:
                end[lane] = FLAT
        factorise(topology, lanes, place)
        for lane in range(WIDTH):
            lanes.active[0, lane] = 1.0 if run[lane] >= 0 and end[lane] == GOES_ON else 0.0
            if end[lane] == STANDS and lanes.n_negative[0, lane] > 0.0:
                end[lane] = NOT_DEFINITE
        _move(topology, lanes)
        for lane in range(WIDTH):
            r = run[lane]
            if r < 0:
                continue
            if end[lane] == GOES_ON:
                outcome.iterations[r] += 1
                solves[lane] += 1
                inside = lanes.measure_of[0, lane] < increments.farthest
                if not inside or solves[lane] == increments.most_iterations:
                    end[lane] = LOST
            if end[lane] != GOES_ON:
                outcome.done[r] = end[lane]
                if end[lane] != LOST:
                    leave(lanes, outcome, lane, r)
                run[lane], end[lane], solves[lane] = -1, GOES_ON, 0
                n_active -= 1
                if queue < last:
                    run[lane] = queue
                    queue += 1
                    n_active += 1
                    _begin(topology, runs, increments, lanes, lane, run[lane])


@njit
def _begin(topology, runs, increments, lanes, lane, r):
    """Put a run into a lane, at its start under the inputs of the first increment."""
    enter(topology, runs, lanes, lane, r)
    _advance(topology, runs, increments, lanes, lane, r, 1)


@njit
def _advance(topology, runs, increments, lanes, lane, r, increment):
    """Put a lane under the inputs of an increment, its supports where they are then."""
    lanes.parameter[0, lane] = increment / increments.number[r]
    hold_supports(topology, row_of(runs.start, r), lanes, lane)


@njit
def hold_supports(topology, start, lanes, lane):
    """Put the supports of a lane where they are at its λ; `start` are the positions at λ = 0."""
    for i in range(start.size):
        if topology.free[i] == 0.0:
            lanes.x[i, lane] = start[i] + lanes.parameter[0, lane] * lanes.support_rate[i, lane]


@njit_once
def balance(topology, moving, lanes):
    """Measure all lanes; leave p − f in `rhs`, its relative size, what is carried and the largest load."""
    nothing = zero(lanes.x)
    for e in range(lanes.taut.shape[0]):
        store(lanes.taut, e, nothing + 1.0)
    kernels.measure(
        lanes.x, lanes.rest_length, lanes.stiffness, lanes.taut, topology.segment_nodes,
        topology.segment_start, lanes.unit, lanes.inverse_length, lanes.length, lanes.tension, lanes.axial,
    )  # fmt: skip
    largest, scale, carried, pushed, stiffest, no_number = (
        nothing,
        nothing,
        nothing,
        nothing,
        nothing,
        nothing,
    )
    for e in range(lanes.tension.shape[0]):
        k, tension = load(lanes.axial, e), load(lanes.tension, e)
        stiffest = maximum(stiffest, k)
        scale = maximum(scale, SMALLEST_SCALE * k * load(lanes.length, e))
        if topology.is_cable[e] > 0.0:
            taut = less(nothing, tension)
            tension = choose(taut, tension, nothing)
            store(lanes.tension, e, tension)
            store(lanes.axial, e, choose(taut, k, nothing))
            store(lanes.taut, e, taut)
        store(lanes.stress, e, tension)
        scale = maximum(scale, magnitude(tension))
        carried = maximum(carried, moving[e] * magnitude(tension))
    store(lanes.scale, 0, stiffest)
    kernels.internal_force(
        lanes.unit, lanes.tension, topology.segment_nodes, topology.segment_start, lanes.force
    )
    parameter = load(lanes.parameter, 0)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            p = load(lanes.loads_start, i) + parameter * load(lanes.loads_rate, i)
            missing = topology.free[i] * (p - load(lanes.force, i))
            pushed = maximum(pushed, topology.free[i] * magnitude(p))
            largest = maximum(largest, magnitude(missing))
            # A NaN is larger than nothing in no comparison: let it through to the residual.
            no_number = no_number + 0.0 * missing
            store(lanes.rhs, 3 * b + c, missing)
    store(lanes.residual, 0, largest / maximum(scale, pushed) + no_number)
    store(lanes.measure_of, 0, carried)
    store(lanes.measure_of, 1, pushed)


@njit_once
def _move(topology, lanes):
    """Correct the active lanes; leave the largest coordinate, or NaN, in `measure_of`."""
    active = load(lanes.active, 0)
    solve(topology, lanes, lanes.rhs)
    for b in range(topology.block_node.size):
        for c in range(3):
            i = 3 * topology.block_node[b] + c
            x = load(lanes.x, i)
            store(lanes.x, i, choose(active, x + load(lanes.rhs, 3 * b + c), x))
    farthest, no_number = zero(lanes.x), zero(lanes.x)
    for i in range(lanes.x.shape[0]):
        farthest = maximum(farthest, magnitude(load(lanes.x, i)))
        no_number = no_number + 0.0 * load(lanes.x, i)
    store(lanes.measure_of, 0, farthest + no_number)
