"""Many runs of one structure in lockstep: the path follower, eight lanes at a time.

Every tick does the same for all lanes of a pack: measure, assemble, factorise, solve. What a lane
does with the outcome is its own affair: correct again, accept the step and predict the next, cut the
step, or finish and make room for the next run of the queue. A run that leaves the plain course (no
convergence, a negative eigenvalue, a step too small) is given back and is solved from its start by
the follower of `tensegra.mechanics.follow`.

Lanes do not exchange numbers, so a result depends neither on its neighbours nor on the order.
"""

import numpy as np

from tensegra.mechanics.compiled import njit, njit_once
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.lockstep_data import BRANCH_ENDS, STANDS
from tensegra.mechanics.tick import (
    ACCEPT,
    CLOSE,
    CORRECT,
    CUT,
    FINISH,
    IDLE,
    certify,
    correct,
    differentiate,
    row_of,
    tick,
)

ACCEPTED = 1e-5
"""Relative residual at which a step on the way is accepted; one more correction follows unchecked."""

CONVERGED = 1e-9
"""Relative residual of a finished run, measured again at its last position."""

MAX_CORRECTIONS = 8
"""Corrections of one step after which it is cut."""

MOST_SWEEPS, SETTLED = 30, 1e-7
"""Inverse iterations for the lowest eigenvalue, and the relative change below which they end: a run may
come to stand far from the shape that lent its modes."""


@njit
def certify_runs(topology, runs, outcome, lanes, first, last):
    """Find the lowest eigenvalue and the derivatives of the runs `first` to `last` that stand, by packs.

    Parameters
    ----------
    topology, runs, outcome, lanes
        `Topology`, `Runs`, `Outcome` and `Lanes`.
    first, last
        Range of runs.
    """
    place = np.zeros(topology.block_node.size, dtype=np.int64)
    run, action = np.full(WIDTH, -1), np.full(WIDTH, IDLE)
    r, n_lanes = first, 0
    while r < last:
        if outcome.done[r] == STANDS:
            enter(topology, runs, lanes, n_lanes, r)
            for i in range(lanes.x.shape[0]):
                lanes.x[i, n_lanes] = outcome.nodes[r, i]
            for e in range(lanes.stress.shape[0]):
                lanes.stress[e, n_lanes] = outcome.tensions[r, e]
            lanes.parameter[0, n_lanes] = 1.0
            run[n_lanes], action[n_lanes] = r, FINISH
            n_lanes += 1
        r += 1
        if n_lanes == WIDTH or (r == last and n_lanes > 0):
            tick(topology, lanes, place)
            certify(topology, runs, outcome, lanes, run, action, MOST_SWEEPS, SETTLED)
            run[:], action[:], n_lanes = -1, IDLE, 0


@njit
def follow_runs(
    topology, runs, outcome, lanes, first, last, first_step, careful_below, smallest_step, largest_move
):
    """Follow the runs `first` to `last` through their stage.

    Parameters
    ----------
    topology, runs, outcome, lanes
        `Topology`, `Runs`, `Outcome` and `Lanes`.
    first, last
        Range of runs.
    first_step, careful_below, smallest_step
        First increment of λ; the increment below which a step has to converge before it is accepted;
        the increment below which the stable branch is held to end.
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
        enter(topology, runs, lanes, lane, min(queue, last - 1))
        if queue < last:
            run[lane] = queue
            queue += 1
            n_active += 1
        step[lane], target[lane], base[lane], closing[lane], corrections[lane] = (
            first_step,
            0.0,
            0.0,
            False,
            0,
        )
    while n_active > 0:
        tick(topology, lanes, place)
        for lane in range(WIDTH):
            action[lane] = IDLE
            if run[lane] < 0:
                continue
            small, stands = lanes.residual[0, lane], lanes.n_negative[0, lane] == 0.0
            if closing[lane]:
                action[lane] = FINISH if small <= CONVERGED and stands else CUT
            elif small <= (CONVERGED if target[lane] >= 1.0 or step[lane] < careful_below else ACCEPTED):
                action[lane] = CUT if not stands else CLOSE if target[lane] >= 1.0 else ACCEPT
            else:
                corrections[lane] += 1
                good = small < np.inf and corrections[lane] <= MAX_CORRECTIONS
                action[lane] = CORRECT if good else CUT
        any_accept = np.any(action == ACCEPT)
        correct(topology, lanes, action)
        for lane in range(WIDTH):
            if action[lane] == CORRECT or action[lane] == CLOSE:
                move, away = lanes.measure_of[0, lane], lanes.measure_of[1, lane]
                reach = 0.5 * (target[lane] - base[lane]) * speed[lane] + 0.1 * largest_move
                slow = corrections[lane] > 2 and move > 0.5 * last_move[lane]
                last_move[lane] = move
                if (not away <= reach and target[lane] > 0.0) or (slow and action[lane] == CORRECT):
                    action[lane] = CUT
                elif action[lane] == CLOSE:
                    closing[lane] = True
        if any_accept:
            differentiate(topology, lanes, action)
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
                    outcome.done[r], outcome.parameter[r] = STANDS, 1.0
                    outcome.steps[r] += 1
                    outcome.iterations[r] += corrections[lane] + 2
                    leave(lanes, outcome, lane, r)
                elif target[lane] > 0.0:
                    outcome.done[r], outcome.parameter[r] = BRANCH_ENDS, base[lane]
                    _leave_accepted(lanes, outcome, lane, r)
                run[lane] = -1
                n_active -= 1
                if queue < last:
                    run[lane] = queue
                    queue += 1
                    n_active += 1
                    enter(topology, runs, lanes, lane, run[lane])
                    step[lane], target[lane], base[lane] = first_step, 0.0, 0.0
                    closing[lane], corrections[lane] = False, 0


@njit_once
def enter(topology, runs, lanes, lane, r):
    """Put a run at its start into a lane."""
    start, stiffness = row_of(runs.start, r), row_of(runs.stiffness, r)
    loads_start, loads_rate = row_of(runs.loads_start, r), row_of(runs.loads_rate, r)
    support_rate = row_of(runs.support_rate, r)
    for i in range(start.size):
        lanes.x[i, lane] = lanes.guess[i, lane] = start[i]
        lanes.loads_start[i, lane] = loads_start[i]
        lanes.loads_rate[i, lane] = loads_rate[i]
        lanes.support_rate[i, lane] = support_rate[i]
    coefficients = runs.rest_length[r]
    lanes.scale[0, lane] = np.max(stiffness / coefficients[:, 0])
    n_powers = coefficients.shape[1]
    for e in range(stiffness.size):
        lanes.stiffness[e, lane] = stiffness[e]
        for d in range(n_powers):
            lanes.coefficients[e * n_powers + d, lane] = coefficients[e, d]
        total = 0.0
        for s in range(topology.segment_start[e], topology.segment_start[e + 1]):
            i, j = 3 * topology.segment_nodes[s, 0], 3 * topology.segment_nodes[s, 1]
            total += np.sqrt(
                (start[j] - start[i]) ** 2
                + (start[j + 1] - start[i + 1]) ** 2
                + (start[j + 2] - start[i + 2]) ** 2
            )
        tension = stiffness[e] * (total / coefficients[e, 0] - 1.0)
        lanes.stress[e, lane] = max(tension, 0.0) if topology.is_cable[e] > 0.0 else tension
    lanes.parameter[0, lane] = 0.0


@njit_once
def leave(lanes, outcome, lane, r):
    """Take a finished run out of its lane."""
    for i in range(lanes.x.shape[0]):
        outcome.nodes[r, i] = lanes.x[i, lane]
    for e in range(lanes.tension.shape[0]):
        outcome.tensions[r, e] = lanes.tension[e, lane] + 0.0  # a slack cable carries 0, not -0
    outcome.residual[r] = lanes.residual[0, lane]


@njit_once
def _leave_accepted(lanes, outcome, lane, r):
    """Take a run out of its lane as it was at its last accepted point."""
    for i in range(lanes.x.shape[0]):
        outcome.nodes[r, i] = lanes.accepted[i, lane]
    for e in range(lanes.tension.shape[0]):
        outcome.tensions[r, e] = lanes.accepted_tension[e, lane]


@njit_once
def _keep(lanes, lane):
    """Keep the accepted point of a lane to predict from; return the largest speed of a coordinate."""
    speed = 0.0
    for i in range(lanes.x.shape[0]):
        lanes.accepted[i, lane] = lanes.x[i, lane]
        speed = max(speed, abs(lanes.velocity[i, lane]))
    for e in range(lanes.stress.shape[0]):
        lanes.accepted_tension[e, lane] = lanes.stress[e, lane]
    return speed


@njit_once
def _predict(lanes, lane, base, target):
    """Put a lane at its prediction for λ = `target`, to second order from the point kept at `base`."""
    h = target - base
    for i in range(lanes.x.shape[0]):
        x = lanes.accepted[i, lane] + h * (lanes.velocity[i, lane] + 0.5 * h * lanes.bend[i, lane])
        lanes.x[i, lane] = lanes.guess[i, lane] = x
    lanes.parameter[0, lane] = target
    for e in range(lanes.stress.shape[0]):
        rate = lanes.tension_rate[e, lane] + 0.5 * h * lanes.tension_bend[e, lane]
        lanes.stress[e, lane] = lanes.accepted_tension[e, lane] + h * rate
