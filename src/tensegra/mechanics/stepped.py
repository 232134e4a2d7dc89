"""The plain procedure of the paper: fixed increments, Newton–Raphson in the positions.

It neither predicts nor watches stability, so it can jump between branches or not converge at all. It is kept
to reproduce the outcome statistics of Zhang et al. beside those of the path follower. A lane whose increment
has converged goes on to the next within the same tick, so a run costs one factorisation an iteration.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.lanes import (
    choose,
    count_lanes,
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
    row_of,
    spread,
)

ARRIVED, NOT_DEFINITE, FLAT, DIVERGED = 21, 22, 23, 24
"""How a run ended (`Outcome.end`): at λ = 1 where K is positive definite, or is not; at an increment under
whose inputs nothing carries force and K is singular; without convergence of an increment."""

MAX_ITERATIONS = 100
"""Newton solves of one increment after which the plain procedure has not converged."""

_GOES_ON = 0


class Increments(NamedTuple):
    """What the plain procedure needs beside `Runs`.

    Attributes
    ----------
    number
        Of the increments of each run, ``(n_runs,)``.
    flat_below
        Largest tension that counts as none where nothing is loaded, ``(n_runs | 1,)``.
    farthest
        Coordinate at which a run is given up.
    tolerance
        Relative residual of an increment that has converged.
    """

    number: IndexArray
    flat_below: FloatArray
    farthest: float
    tolerance: float


def n_increments(inputs: StageInputs, increment: float) -> IndexArray:
    """Return the number of equal increments of each run, of the shape of its leading axes.

    Parameters
    ----------
    inputs
        Of the stage.
    increment
        Largest relative change of a rest length in one of them.
    """
    change = np.abs(inputs.rest_length_at(1.0) / inputs.rest_length_at(0.0) - 1.0).max(axis=-1, initial=0.0)
    number: IndexArray = np.maximum(1, np.ceil(change / increment - 1e-9)).astype(np.int64)
    return number


def farthest_coordinate(arrays: StructureArrays) -> float:
    """Return the coordinate at which Newton's method is held to run away."""
    return 1e3 * float(np.abs(arrays.coordinates).max() + arrays.size)


@njit
def step_runs(topology, runs, increments, outcome, record, lanes, first, last):
    """Take the runs `first` to `last` through their stage in equal increments.

    Parameters
    ----------
    topology, runs, increments, outcome, record, lanes
        `Topology`, `Runs`, `Increments`, `Outcome`, `Record` and `Lanes`.
    first, last
        Range of runs.
    """
    n, smallest_scale = count_lanes(lanes.x), LENGTH_ROUNDING / increments.tolerance
    run, end, solves = np.full(n, -1), np.full(n, _GOES_ON), np.zeros(n, np.int64)
    queue, n_active = first, 0
    for lane in range(n):
        _begin(topology, runs, increments, outcome, lanes, lane, min(queue, last - 1))
        if queue < last:
            run[lane] = queue
            queue += 1
            n_active += 1
    while n_active > 0:
        advanced = True
        while advanced:
            prescribe(topology, lanes)
            measure_by_length(topology, lanes)
            balance(topology, lanes, smallest_scale)
            advanced = False
            for lane in range(n):
                r = run[lane]
                if r >= 0 and end[lane] == _GOES_ON and get(lanes.residual, 0, lane) <= increments.tolerance:
                    outcome.steps[r] += 1
                    _note(topology, record, lanes, lane, solves[lane])
                    solves[lane] = 0
                    if outcome.steps[r] == increments.number[r]:
                        end[lane] = ARRIVED
                    else:
                        _advance(topology, runs, increments, lanes, lane, r, outcome.steps[r] + 1)
                        advanced = True
        factorise(topology, lanes)
        for lane in range(n):
            carried, loaded = get(lanes.measure_of, 0, lane), get(lanes.measure_of, 1, lane) != 0.0
            flat_below = row_of(increments.flat_below, max(run[lane], 0))
            definite = get(lanes.n_negative, 0, lane) == 0.0
            if (
                run[lane] >= 0
                and end[lane] == _GOES_ON
                and not loaded
                and carried <= flat_below
                and not definite
            ):
                end[lane] = FLAT
            put(lanes.active, 0, lane, 1.0 if run[lane] >= 0 and end[lane] == _GOES_ON else 0.0)
            if end[lane] == ARRIVED and not definite:
                end[lane] = NOT_DEFINITE
        _move(topology, lanes)
        for lane in range(n):
            r = run[lane]
            if r < 0:
                continue
            if end[lane] == _GOES_ON:
                outcome.iterations[r] += 1
                solves[lane] += 1
                inside = get(lanes.measure_of, 0, lane) < increments.farthest
                if not inside or solves[lane] == MAX_ITERATIONS:
                    end[lane] = DIVERGED
            if end[lane] != _GOES_ON:
                outcome.end[r] = end[lane]
                if end[lane] != DIVERGED:
                    leave(topology, lanes, outcome, lane, r)
                run[lane], end[lane], solves[lane] = -1, _GOES_ON, 0
                n_active -= 1
                if queue < last:
                    run[lane] = queue
                    queue += 1
                    n_active += 1
                    _begin(topology, runs, increments, outcome, lanes, lane, run[lane])


@njit
def _begin(topology, runs, increments, outcome, lanes, lane, r):
    """Put a run into a lane, at its start under the inputs of the first increment."""
    enter(topology, runs, outcome, lanes, lane, r, r)
    _advance(topology, runs, increments, lanes, lane, r, 1)


@njit
def _advance(topology, runs, increments, lanes, lane, r, increment):
    """Put a lane under the inputs of an increment, its supports where they are then."""
    parameter, start = increment / increments.number[r], row_of(runs.start, r)
    put(lanes.parameter, 0, lane, parameter)
    for i in range(topology.n_coordinates):
        if number(topology.free, i) == 0.0:
            put(lanes.x, i, lane, start[i] + parameter * get(lanes.support_rate, i, lane))


@njit
def _move(topology, lanes):
    """Correct the active lanes; leave the largest coordinate, or NaN, in `measure_of`."""
    active = load(lanes.active, 0)
    kernels.solve(topology, lanes, lanes.rhs)
    spread(topology, lanes.rhs, lanes.motion)
    farthest, no_number = zero(lanes.x), zero(lanes.x)
    for i in range(topology.n_coordinates):
        x = load(lanes.x, i)
        x = choose(active, x + load(lanes.motion, i), x)
        store(lanes.x, i, x)
        farthest = maximum(farthest, magnitude(x))
        no_number = no_number + 0.0 * x
    store(lanes.measure_of, 0, farthest + no_number)


@njit
def _note(topology, record, lanes, lane, iterations):
    """Write the end of an increment into the record."""
    at = record.counts[0]
    if at < record.parameter.size:
        record.counts[0] += 1
        record.parameter[at], record.iterations[at] = get(lanes.parameter, 0, lane), iterations
        for i in range(topology.n_coordinates):
            record.nodes[at, i] = get(lanes.x, i, lane)
        for e in range(topology.n_members):
            record.tensions[at, e] = get(lanes.tension, e, lane)
