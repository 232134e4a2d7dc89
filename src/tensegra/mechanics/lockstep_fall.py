"""Falls of many runs in lockstep: descent of the potential energy, eight lanes at a time.

What `tensegra.mechanics.equilibrium.descend` does with one structure: shifted Newton steps, each
downhill and bounded, until the run is in balance or nothing carries force any more. Whether a
balance where K is not definite is a neutral one or a saddle is not for the kernel to tell.

Lanes do not exchange numbers, so a result depends neither on its neighbours nor on the order.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray
from tensegra.mechanics.compiled import njit, njit_once
from tensegra.mechanics.equilibrium import (
    ENERGY_ROUNDING,
    LARGEST_SHIFT,
    LENGTH_ROUNDING,
    RESIDUAL_TOLERANCE,
    SMALLEST_SHIFT,
)
from tensegra.mechanics.lanes import WIDTH, fused, load, magnitude, maximum, store, zero
from tensegra.mechanics.lockstep import enter, leave
from tensegra.mechanics.lockstep_data import FLAT, LOST, NOT_DEFINITE, STANDS
from tensegra.mechanics.lockstep_stepped import balance, hold_supports
from tensegra.mechanics.tick import factorise, prescribe, row_of, solve

MOST_STEPS = 200
"""Steps after which a fall is given back; those into a mechanism take about ten."""

DOWNHILL, SHIFTING, BALANCED, IDLE = range(4)
"""What a lane waits for: the energy of a trial, a shift that makes a step, or the inertia of K."""


class Falls(NamedTuple):
    """What is to fall, beside `Runs`.

    Attributes
    ----------
    run
        Which runs, ``(n_falls,)``.
    start
        Where they fall from, ``(n_falls, 3 n_nodes)``.
    parameter
        λ of what acts meanwhile, ``(n_falls,)``.
    flat_below
        Largest tension that counts as none where nothing is loaded, ``(n_falls,)``.
    moving
        One for a member that touches a node that can move, else zero, ``(n_members,)``.
    largest_move
        Bound on a single move of a coordinate.
    """

    run: IndexArray
    start: FloatArray
    parameter: FloatArray
    flat_below: FloatArray
    moving: FloatArray
    largest_move: float


@njit
def fall_runs(topology, runs, falls, outcome, lanes, first, last):
    """Let the runs `first` to `last` of the falls descend.

    Parameters
    ----------
    topology, runs, falls, outcome, lanes
        `Topology`, `Runs`, `Falls`, `Outcome` with a row for each fall, and `Lanes`.
    first, last
        Range of falls.
    """
    place = np.zeros(topology.block_node.size, dtype=np.int64)
    fall, state, end = np.full(WIDTH, -1), np.full(WIDTH, IDLE), np.zeros(WIDTH, dtype=np.int64)
    energy, residual, slope = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    shift, least = np.zeros(WIDTH), np.zeros(WIDTH)
    queue, n_active = first, 0
    for lane in range(WIDTH):
        _begin(topology, runs, falls, lanes, lane, min(queue, last - 1))
        if queue < last:
            fall[lane], state[lane], energy[lane], shift[lane] = queue, DOWNHILL, np.inf, 0.0
            queue += 1
            n_active += 1
    while n_active > 0:
        measured = False
        while not measured:
            prescribe(lanes)
            balance(topology, falls.moving, lanes)
            _potential(topology, lanes)
            measured = True
            for lane in range(WIDTH):
                if state[lane] != DOWNHILL:
                    continue
                now, small, scale = lanes.measure_of[2, lane], lanes.residual[0, lane], lanes.scale[0, lane]
                downhill = now <= energy[lane] + 1e-4 * slope[lane] or energy[lane] == np.inf
                rounding = ENERGY_ROUNDING * max(abs(energy[lane]), abs(now)) + lanes.measure_of[3, lane]
                level = now <= energy[lane] + rounding
                least[lane] = SMALLEST_SHIFT * scale
                if downhill or (level and small < residual[lane]):
                    energy[lane], residual[lane] = now, small
                    shift[lane] = 0.2 * shift[lane] if shift[lane] > 0.1 * least[lane] else 0.0
                    for i in range(lanes.x.shape[0]):
                        lanes.accepted[i, lane] = lanes.x[i, lane]
                    state[lane] = BALANCED if small <= RESIDUAL_TOLERANCE else SHIFTING
                    flat = lanes.measure_of[0, lane] <= falls.flat_below[fall[lane]]
                    end[lane] = FLAT if flat and lanes.measure_of[1, lane] == 0.0 else 0
                else:
                    shift[lane] = max(5.0 * shift[lane], least[lane])
                    state[lane] = BALANCED if residual[lane] <= RESIDUAL_TOLERANCE else SHIFTING
                    for i in range(lanes.x.shape[0]):
                        lanes.x[i, lane] = lanes.accepted[i, lane]
                    measured = False
        for lane in range(WIDTH):
            lanes.shift[0, lane] = shift[lane] if state[lane] == SHIFTING else 0.0
        factorise(topology, lanes, place)
        _step(topology, lanes)
        for lane in range(WIDTH):
            q = fall[lane]
            if q < 0:
                continue
            definite = lanes.n_negative[0, lane] == 0.0
            outcome.iterations[q] += 1
            if end[lane] == FLAT:
                pass
            elif state[lane] == BALANCED:
                end[lane] = STANDS if definite else NOT_DEFINITE
            elif definite and lanes.measure_of[0, lane] <= falls.largest_move:
                slope[lane] = lanes.measure_of[1, lane]
                for i in range(lanes.x.shape[0]):
                    lanes.x[i, lane] += lanes.motion[i, lane]
                outcome.steps[q] += 1
                state[lane] = DOWNHILL
            else:
                shift[lane] = max(4.0 * shift[lane], least[lane])
                if not shift[lane] <= LARGEST_SHIFT * lanes.scale[0, lane]:
                    end[lane] = LOST
            if outcome.steps[q] >= MOST_STEPS:
                end[lane] = LOST
            if end[lane] > 0:
                outcome.done[q] = end[lane]
                leave(lanes, outcome, lane, q)
                fall[lane], state[lane], end[lane] = -1, IDLE, 0
                n_active -= 1
                if queue < last:
                    _begin(topology, runs, falls, lanes, lane, queue)
                    fall[lane], state[lane], energy[lane], shift[lane] = queue, DOWNHILL, np.inf, 0.0
                    queue += 1
                    n_active += 1
    for lane in range(WIDTH):
        lanes.shift[0, lane] = 0.0


@njit
def _begin(topology, runs, falls, lanes, lane, q):
    """Put a fall into a lane, at its start under what acts meanwhile."""
    r = falls.run[q]
    enter(topology, runs, lanes, lane, r)
    for i in range(falls.start.shape[1]):
        lanes.x[i, lane] = falls.start[q, i]
    lanes.parameter[0, lane] = falls.parameter[q]
    hold_supports(topology, row_of(runs.start, r), lanes, lane)


@njit_once
def _potential(topology, lanes):
    """Leave the potential energy Π = Σ ½ T (ℓ − l₀) − p·x of the last measure, and its rounding."""
    energy, carried = zero(lanes.x), zero(lanes.x)
    for e in range(lanes.tension.shape[0]):
        carried = fused(magnitude(load(lanes.tension, e)), load(lanes.length, e), carried)
        stretch = load(lanes.length, e) - load(lanes.rest_length, e)
        energy = fused(0.5 * load(lanes.tension, e), stretch, energy)
    parameter = load(lanes.parameter, 0)
    for i in range(lanes.x.shape[0]):
        p = load(lanes.loads_start, i) + parameter * load(lanes.loads_rate, i)
        energy = energy - topology.free[i] * p * load(lanes.x, i)
    store(lanes.measure_of, 2, energy)
    store(lanes.measure_of, 3, LENGTH_ROUNDING * carried)


@njit_once
def _step(topology, lanes):
    """Leave the step in `motion`, its largest coordinate and (f − p)·step in `measure_of`."""
    for i in range(lanes.rhs.shape[0]):
        store(lanes.second, i, load(lanes.rhs, i))
    solve(topology, lanes, lanes.second)
    move, slope = zero(lanes.x), zero(lanes.x)
    for i in range(lanes.motion.shape[0]):
        store(lanes.motion, i, zero(lanes.x))
    for b in range(topology.block_node.size):
        for c in range(3):
            u = load(lanes.second, 3 * b + c)
            store(lanes.motion, 3 * topology.block_node[b] + c, u)
            move = maximum(move, magnitude(u))
            slope = slope - u * load(lanes.rhs, 3 * b + c)
    # A NaN is larger than nothing in no comparison: let it through, so that no lane takes such a step.
    store(lanes.measure_of, 0, move + 0.0 * slope)
    store(lanes.measure_of, 1, slope)
