"""Let runs fall: descent of the potential energy to a stable equilibrium, or to where nothing carries force.

Each step solves (K + μI) u = p − f with μ ≥ 0 such that the matrix is positive definite, the energy falls and
no coordinate moves by more than a bound: a discrete gradient flow, as of a structure that is loaded slowly,
which turns into Newton's method where K is positive definite. The bound does not depend on the settings of a
path, so neither does where a structure falls to. In balance, K shifted to either side of zero by what
rounding cannot tell from it says whether the structure stands, is neutral, or sits on a saddle.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels, law
from tensegra.mechanics.arrays import FloatArray
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import (
    count_lanes,
    fused,
    get,
    load,
    magnitude,
    maximum,
    number,
    put,
    store,
    zero,
)
from tensegra.mechanics.step import (
    LENGTH_ROUNDING,
    balance,
    enter,
    factorise,
    leave,
    measure_by_length,
    prescribe,
    spread,
)

STANDS, NEUTRAL, SADDLE, FLAT, LOST = range(11, 16)
"""How a fall ended (`Outcome.end`): in balance where K is positive definite, is singular, or has a negative
eigenvalue; where nothing carries force, nothing is loaded and K is not definite; nowhere."""

MOST_STEPS = 2000
"""Steps after which a fall is given up; those into a mechanism take about ten."""

BOUND = 0.03
"""Largest move of a coordinate in one step of a fall, as a share of the size."""

POLISHED = 1e-14
"""Steps go on to this residual as long as they improve it: what rounding leaves."""

ENERGY_ROUNDING = 1e-13
"""Relative differences of the energy below this are rounding, as is what lengths leave: then the residual
decides."""

DOWNHILL_SHARE = 1e-4
"""Share of the fall that the slope promises which a step has to bring (Armijo)."""

SMALLEST_SHIFT, LARGEST_SHIFT = 1e-9, 1e6
"""Range of the shift μ, as shares of the largest EA/l₀."""

_DOWNHILL, _SHIFTING, _BALANCED, _ABOVE, _BELOW, _IDLE = range(6)  # what a lane waits for


class Falls(NamedTuple):
    """What falls, beside `Runs` and `Outcome`: rows of the outcome are falls, `run` are theirs of the runs.

    `flat_below` ``(n_falls,)`` is the largest tension that counts as none.
    """

    run: np.ndarray
    flat_below: FloatArray
    tolerance: float


@njit
def fall_runs(topology, runs, falls, outcome, lanes, first, last):
    """Let the falls `first` to `last` descend under what acts at their λ.

    Parameters
    ----------
    topology, runs, falls, outcome, lanes
        `Topology`, `Runs`, `Falls`, `Outcome` and `Lanes`.
    first, last
        Range of falls.
    """
    n, bound = count_lanes(lanes.x), BOUND * number(topology.numbers, 0)
    smallest_scale = LENGTH_ROUNDING / falls.tolerance
    fall, state, end = np.full(n, -1), np.full(n, _IDLE), np.zeros(n, np.int64)
    flat = np.zeros(n, np.bool_)
    energy, residual, slope, shift = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    queue, n_active = first, 0
    for lane in range(n):
        row = min(queue, last - 1)
        enter(topology, runs, outcome, lanes, lane, falls.run[row], row)
        if queue < last:
            fall[lane], state[lane], energy[lane], shift[lane] = queue, _DOWNHILL, np.inf, 0.0
            queue += 1
            n_active += 1
    while n_active > 0:
        measured = False
        while not measured:
            prescribe(topology, lanes)
            measure_by_length(topology, lanes)
            balance(topology, lanes, smallest_scale)
            _potential(topology, lanes)
            measured = True
            for lane in range(n):
                if state[lane] != _DOWNHILL:
                    continue
                now, small = get(lanes.measure_of, 2, lane), get(lanes.residual, 0, lane)
                least = SMALLEST_SHIFT * get(lanes.scale, 0, lane)
                rounding = ENERGY_ROUNDING * max(abs(energy[lane]), abs(now)) + get(lanes.measure_of, 3, lane)
                told = 0.0 - slope[lane] > rounding  # else the energies differ by rounding alone
                downhill = told and now <= energy[lane] + DOWNHILL_SHARE * slope[lane]
                better = now <= energy[lane] + rounding and small < residual[lane]
                if downhill or better or energy[lane] == np.inf:
                    # In balance, and the last step brought little: the digits that are left are rounding.
                    polished = small <= falls.tolerance and (
                        small <= POLISHED or not small < 0.5 * residual[lane]
                    )
                    energy[lane], residual[lane] = now, small
                    shift[lane] = 0.2 * shift[lane] if shift[lane] > 0.1 * least else 0.0
                    for i in range(topology.n_coordinates):
                        put(lanes.base_x, i, lane, get(lanes.x, i, lane))
                    carries = get(lanes.measure_of, 0, lane) > falls.flat_below[fall[lane]]
                    flat[lane] = not carries and get(lanes.measure_of, 1, lane) == 0.0
                    state[lane] = _BALANCED if polished or flat[lane] else _SHIFTING
                else:
                    shift[lane] = max(5.0 * shift[lane], least)
                    state[lane] = _BALANCED if residual[lane] <= falls.tolerance else _SHIFTING
                    for i in range(topology.n_coordinates):
                        put(lanes.x, i, lane, get(lanes.base_x, i, lane))
                    measured = False
        for lane in range(n):
            zero_shift = kernels.ZERO_EIGENVALUE * get(lanes.scale, 0, lane)
            sought = shift[lane] if state[lane] == _SHIFTING else 0.0
            sought = (
                0.0 - zero_shift if state[lane] == _ABOVE else zero_shift if state[lane] == _BELOW else sought
            )
            put(lanes.shift, 0, lane, sought)
        factorise(topology, lanes)
        _step(topology, lanes)
        for lane in range(n):
            q = fall[lane]
            if q < 0:
                continue
            definite = get(lanes.n_negative, 0, lane) == 0.0
            outcome.iterations[q] += 1
            if state[lane] == _ABOVE:
                end[lane] = STANDS if definite else NEUTRAL
            elif state[lane] == _BELOW:
                end[lane] = NEUTRAL if definite else SADDLE
            elif state[lane] == _BALANCED and not definite and flat[lane]:
                end[lane] = FLAT
            elif state[lane] == _BALANCED and definite and residual[lane] > falls.tolerance:
                state[lane] = _SHIFTING  # flat, but not in balance yet
            elif state[lane] == _BALANCED or (
                residual[lane] <= falls.tolerance and not definite and shift[lane] == 0.0
            ):
                state[lane] = _ABOVE if definite else _BELOW
            elif definite and get(lanes.measure_of, 0, lane) <= bound:
                slope[lane] = get(lanes.measure_of, 1, lane)
                for i in range(topology.n_coordinates):
                    put(lanes.x, i, lane, get(lanes.x, i, lane) + get(lanes.motion, i, lane))
                outcome.steps[q] += 1
                state[lane] = _DOWNHILL
            else:
                shift[lane] = max(4.0 * shift[lane], SMALLEST_SHIFT * get(lanes.scale, 0, lane))
                if not shift[lane] <= LARGEST_SHIFT * get(lanes.scale, 0, lane):
                    # No shift makes a step: two nodes of a segment have met, and K is no number.
                    end[lane] = LOST
            if end[lane] == 0 and outcome.steps[q] >= MOST_STEPS:
                end[lane] = LOST
            if end[lane] > 0:
                outcome.end[q] = end[lane]
                leave(topology, lanes, outcome, lane, q)
                fall[lane], state[lane], end[lane] = -1, _IDLE, 0
                n_active -= 1
                if queue < last:
                    enter(topology, runs, outcome, lanes, lane, falls.run[queue], queue)
                    fall[lane], state[lane], energy[lane], shift[lane] = queue, _DOWNHILL, np.inf, 0.0
                    queue += 1
                    n_active += 1


@njit
def _potential(topology, lanes):
    """Leave the potential energy Π = Σ ∫ T dℓ − p·x of the last measure, and its rounding."""
    energy, carried = zero(lanes.x), zero(lanes.x)
    for e in range(topology.n_members):
        l0, ea, length = load(lanes.rest_length, e), load(lanes.stiffness, e), load(lanes.length, e)
        carried = fused(magnitude(load(lanes.tension, e)), length, carried)
        energy = fused(load(lanes.taut, e), law.energy(length, l0, ea), energy)
    parameter = load(lanes.parameter, 0)
    for i in range(topology.n_coordinates):
        p = load(lanes.loads_start, i) + parameter * load(lanes.loads_rate, i)
        energy = energy - number(topology.free, i) * p * load(lanes.x, i)
    store(lanes.measure_of, 2, energy)
    store(lanes.measure_of, 3, LENGTH_ROUNDING * carried)


@njit
def _step(topology, lanes):
    """Leave the step in `motion`, its largest coordinate and (f − p)·step in `measure_of`."""
    for i in range(3 * topology.n_blocks):
        store(lanes.second, i, load(lanes.rhs, i))
    kernels.solve(topology, lanes, lanes.second)
    spread(topology, lanes.second, lanes.motion)
    move, slope = zero(lanes.x), zero(lanes.x)
    for i in range(3 * topology.n_blocks):
        slope = slope - load(lanes.second, i) * load(lanes.rhs, i)
    for i in range(topology.n_coordinates):
        move = maximum(move, magnitude(load(lanes.motion, i)))
    # A NaN is larger than nothing in no comparison: let it through, so that no lane takes such a step.
    store(lanes.measure_of, 0, move + 0.0 * slope)
    store(lanes.measure_of, 1, slope)
