"""Follow a stage along the branch of stable equilibria: one state machine for one run and for many.

A lane holds one run. It stands at a base, a point of the branch with its derivatives by λ, and goes on by
steps: predict, correct, and accept the point that is found only with evidence that it belongs to the branch
that was left:

- K is positive definite there;
- the same cables carry force as at the base, none of them having dipped through zero on the way: where
  one changed, the step ends at the event instead, which is found with λ as an unknown, and the branch is
  taken up again behind it with the new set;
- the derivatives at both ends tell the way between. With ẋ and ẍ at both, the displacement of a smooth
  branch is h/2 (ẋ₀ + ẋ₁) + h²/12 (ẍ₀ − ẍ₁) but for a term of fifth order; a point on another branch misses
  it by as much as the structure would have leapt.

A step without that evidence is taken back and cut. Where no step is small enough the branch has ended, and
the lane leaves its run at the last base: what happens there is for `tensegra.mechanics.supervise` to say.
Lanes do not exchange numbers, so a result depends neither on its neighbours nor on the order.
"""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray
from tensegra.mechanics.branch import (
    begin,
    carries,
    collapses_at,
    first_crossing,
    go_back,
    hold_taut,
    leave_base,
    leave_foreseen,
    move_along,
    predict,
    reread,
    take_base,
    turn_edges,
    weigh,
)
from tensegra.mechanics.compiled import njit
from tensegra.mechanics.lanes import get, number, put
from tensegra.mechanics.step import (
    LENGTH_ROUNDING,
    balance,
    carried_by,
    correct,
    differentiate,
    enter,
    factorise,
    leave,
    n_lanes,
    prescribe,
    row_of,
    taut_by_stress,
    velocity,
)

ARRIVED, BRANCH_ENDS, EVENT_ENDS, NO_START, UNSTABLE_START, OUT_OF_STEPS, PAUSED = range(1, 8)
"""Why a run was left (`Outcome.end`): at λ = 1; where no step is small enough; where a cable went slack and
took the stiffness away; at once, since it is no equilibrium, or one that does not stand; for good; with its
record full."""

DEFECT = 2e-5
"""Largest miss of the way between two points, as a share of the size: a fifth of the smallest snap told."""

MISSED_SHARE, ROUNDING = 0.1, 1e-10
"""Share of the way that a miss may be, so that no leap is most of a step, be it as short as it may; what
positions are told to, as a share of the size."""

NEAR = 1e-6
"""Correction, as a share of the size, behind which a point on the way is near enough: what is left of it, and
of the derivatives that were taken before it, is little beside the miss that counts."""

MAX_CORRECTIONS = 10
"""Corrections of one point after which its step is cut."""

CUT_TO, GROW_TO = 0.4, 3.0
"""Share of a step that is tried after it; largest growth from one step to the next."""

CORRECTION_AIM = 0.05
"""Share of the size that the first correction of a step should have: the error of the prediction."""

MOST_TURNS = 4
"""Times that the cables on the edge are taken for others, at one base, before its step is cut."""

_START, _STEP, _CLOSING, _EVENT, _REBASE = range(5)
"""What a lane is at: a run that begins; a step; its end, once more, at λ = 1; the event in a step; its base,
taken anew with other cables taut."""

_IDLE, _CORRECT, _ACCEPT, _LAND, _STAND, _CUT, _STOP, _COMMIT, _TURN, _SEEK = range(10)
"""What a lane does: nothing; correct its point; take it as it will be once corrected, or as it is; take it
for a start; cut its step; stop; make its point the base; turn the cables on the edge; seek an event."""


class Control(NamedTuple):
    """The settings of a path, as `PathSettings` gives them, with lengths in the structure's unit."""

    first_step: float
    smallest_step: float
    largest_move: float
    contraction: float
    max_steps: int
    tolerance: float


class Record(NamedTuple):
    """What happened on the way of a single run; without rows where nobody asks.

    Accepted points: λ ``(n,)``, positions, tensions, iterations. Events: λ, member and whether it became
    taut. `counts` ``(2,)`` says how many of either there are.
    """

    parameter: FloatArray
    nodes: FloatArray
    tensions: FloatArray
    iterations: IndexArray
    event_parameter: FloatArray
    event_member: IndexArray
    event_taut: IndexArray
    counts: IndexArray


class Course(NamedTuple):
    """What each lane of a pack is at, ``(n_lanes,)`` each.

    `run`, `mode` and `action`, whether K was `definite` at the last tick, and an event
    was `sought` that only the prediction told of; `corrections` of the point, `turns`
    of the edges at the base, the `member` of an event; λ of `base` and `target`, the next `step`; `speed` of
    the base, the `last_move` and the `first_move` of the corrector; `taken`, the step that led to the base.
    """

    run: IndexArray
    mode: IndexArray
    action: IndexArray
    definite: BoolArray
    sought: BoolArray
    corrections: IndexArray
    turns: IndexArray
    member: IndexArray
    base: FloatArray
    target: FloatArray
    step: FloatArray
    speed: FloatArray
    last_move: FloatArray
    first_move: FloatArray
    taken: FloatArray


@njit
def follow_runs(topology, runs, control, outcome, record, lanes, first, last):
    """Follow the runs `first` to `last` from where they stand to λ = 1.

    Parameters
    ----------
    topology, runs, control, outcome, record, lanes
        `Topology`, `Runs`, `Control`, `Outcome`, `Record` and `Lanes`.
    first, last
        Range of runs.
    """
    n = n_lanes(lanes)
    smallest_scale = LENGTH_ROUNDING / control.tolerance
    course = Course(
        np.full(n, -1), np.full(n, _START), np.full(n, _IDLE), np.zeros(n, np.bool_), np.zeros(n, np.bool_),
        np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros(n, np.int64),
        np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n),
    )  # fmt: skip
    queue = first
    for lane in range(n):
        # A lane without a run of its own repeats one: its numbers stay finite, nothing is kept.
        _take_run(topology, runs, control, outcome, lanes, course, lane, min(queue, last - 1))
        if queue < last:
            queue += 1
        else:
            course.run[lane] = -1
    n_active = queue - first
    while n_active > 0:
        prescribe(topology, lanes)
        taut_by_stress(topology, lanes)
        for lane in range(n):
            if course.mode[lane] == _REBASE or course.mode[lane] == _EVENT:
                hold_taut(topology, lanes, lane, course.mode[lane] == _REBASE, course.member[lane])
        carried_by(topology, lanes)
        kernels.measure(topology, lanes)
        balance(topology, lanes, smallest_scale)
        factorise(topology, lanes)
        _look(control, lanes, course)
        if np.any((course.action == _CORRECT) & (course.mode == _EVENT)):
            velocity(topology, lanes)
        for lane in range(n):
            # One more correction with the factor at hand is free: it takes off what the tolerance left.
            moves = course.action[lane] == _CORRECT or course.action[lane] == _LAND
            put(lanes.active, 0, lane, 1.0 if moves else 0.0)
        correct(topology, lanes)
        _judge(topology, control, lanes, course)
        points = (course.action == _ACCEPT) | (course.action == _LAND) | (course.action == _STAND)
        if np.any(points):
            differentiate(topology, lanes)
            for lane in range(n):
                put(lanes.step, 0, lane, get(lanes.parameter, 0, lane) - course.base[lane])
            weigh(topology, lanes)
            for lane in range(n):
                _decide(topology, lanes, course, lane)
                stands = course.action[lane] == _STAND or course.action[lane] == _COMMIT
                put(lanes.active, 0, lane, 1.0 if stands else 0.0)
                found = course.action[lane] == _COMMIT or (stands and course.mode[lane] == _START)
                put(lanes.shift, 0, lane, 1.0 if found else 0.0)
                past_event = course.action[lane] == _COMMIT and course.mode[lane] == _EVENT
                put(lanes.measure_of, 6, lane, 1.0 if past_event else 0.0)
                put(lanes.step, 0, lane, course.taken[lane])
            take_base(topology, lanes)
        for lane in range(n):
            if course.run[lane] < 0 or course.action[lane] == _IDLE or course.action[lane] == _CORRECT:
                continue
            end = _go_on(topology, control, runs.reference, outcome, record, lanes, course, lane)
            if end > 0:
                n_active -= 1
                outcome.end[course.run[lane]] = end
                course.run[lane] = -1
                if queue < last:
                    _take_run(topology, runs, control, outcome, lanes, course, lane, queue)
                    queue += 1
                    n_active += 1


@njit
def _take_run(topology, runs, control, outcome, lanes, course, lane, r):
    """Put a run into a lane, at its start."""
    enter(topology, runs, outcome, lanes, lane, r, r)
    begin(topology, lanes, lane)
    course.run[lane], course.mode[lane] = r, _START
    course.corrections[lane], course.last_move[lane] = 0, np.inf
    course.base[lane], course.target[lane], course.step[lane] = 0.0, 0.0, control.first_step


@njit
def _look(control, lanes, course):
    """Say from residual and inertia what each lane does with a tick."""
    for lane in range(course.run.size):
        mode, residual = course.mode[lane], get(lanes.residual, 0, lane)
        course.definite[lane] = get(lanes.n_negative, 0, lane) == 0.0
        small = residual <= control.tolerance
        if course.run[lane] < 0:
            course.action[lane] = _IDLE
        elif mode == _REBASE or (mode == _START and small):
            course.action[lane] = _STAND if course.definite[lane] else _STOP
        elif mode == _CLOSING and small:
            course.action[lane] = _LAND
        elif course.corrections[lane] >= MAX_CORRECTIONS or not residual < np.inf:
            course.action[lane] = _STOP if mode == _START else _CUT
        else:
            course.action[lane] = _CORRECT


@njit
def _judge(topology, control, lanes, course):
    """Say from the corrections whether each lane converges, and has come near enough to its point."""
    size = number(topology.numbers, 0)
    for lane in range(course.run.size):
        action, mode = course.action[lane], course.mode[lane]
        if action == _STAND:
            reread(topology, lanes, lane)
        if action != _CORRECT:
            continue
        move, away = get(lanes.measure_of, 0, lane), get(lanes.measure_of, 1, lane)
        strays = False
        if mode == _EVENT:
            move += abs(move_along(topology, lanes, lane, course.member[lane])) * course.speed[lane]
            there = get(lanes.parameter, 0, lane)
            strays = not (there > course.base[lane] and there <= course.target[lane])
        if course.corrections[lane] == 0:
            course.first_move[lane] = move
        reach = (
            0.5 * (course.target[lane] - course.base[lane]) * course.speed[lane] + 0.1 * control.largest_move
        )
        slow = course.corrections[lane] > 1 and move > control.contraction * course.last_move[lane]
        near = move <= NEAR * size
        course.corrections[lane] += 1
        course.last_move[lane] = move
        if mode == _START:
            continue
        if strays or not away <= reach or (slow and not near):
            course.action[lane] = _CUT
        elif near and mode == _STEP and course.target[lane] >= 1.0:
            course.mode[lane] = _CLOSING
        elif near and mode != _CLOSING:
            course.action[lane] = _ACCEPT


@njit
def _decide(topology, lanes, course, lane):
    """Say what becomes of a point: whether it is on the branch of its base, and if not what is done."""
    action, mode, size = course.action[lane], course.mode[lane], number(topology.numbers, 0)
    course.taken[lane] = 0.0
    if action != _ACCEPT and action != _LAND:  # noqa: PLR1714 - compiled: no set
        return
    miss, most = get(lanes.measure_of, 2, lane), get(lanes.measure_of, 3, lane)
    crossed, turned = get(lanes.measure_of, 4, lane) > 0.0, get(lanes.measure_of, 5, lane) > 0.0
    dipped = get(lanes.measure_of, 7, lane) > 0.0
    sound = miss <= min(DEFECT * size, MISSED_SHARE * most + ROUNDING * size) and not dipped
    if crossed:
        course.action[lane] = _CUT if mode == _EVENT else _SEEK
    elif not course.definite[lane]:
        course.action[lane] = _CUT
    elif sound:
        course.action[lane] = _COMMIT
        course.taken[lane] = 0.0 if mode == _EVENT else get(lanes.parameter, 0, lane) - course.base[lane]
    elif turned and mode != _EVENT and course.turns[lane] < MOST_TURNS:
        course.action[lane] = _TURN
    else:
        course.action[lane] = _CUT


@njit
def _go_on(topology, control, reference, outcome, record, lanes, course, lane):
    """Do with a lane what was decided, and set out for its next point; return why its run ends, or 0."""
    r, action, mode = course.run[lane], course.action[lane], course.mode[lane]
    there, size = get(lanes.parameter, 0, lane), number(topology.numbers, 0)
    outcome.iterations[r] += course.corrections[lane]
    if action == _STOP:
        return _stop(topology, control, outcome, lanes, course, lane)
    if action == _STAND or action == _COMMIT:  # noqa: PLR1714, SIM109 - compiled: no set
        past_event = action == _COMMIT and mode == _EVENT
        if action == _COMMIT:
            outcome.steps[r] += 1
            growth = _growth(size, course.first_move[lane], get(lanes.measure_of, 2, lane))
            h = there - course.base[lane]
            course.step[lane] = growth * (max(h, course.step[lane]) if past_event else h)
        if action == _COMMIT or mode == _START:
            _note(topology, record, lanes, lane, course.corrections[lane], past_event)
        course.base[lane], course.speed[lane] = there, get(lanes.measure_of, 8, lane)
        course.sought[lane] = False
        if mode != _REBASE:
            course.turns[lane] = 0
        end = 0
        if there >= 1.0:
            end = ARRIVED
            outcome.iterations[r] += 1
        elif outcome.steps[r] >= control.max_steps:
            end = OUT_OF_STEPS
        elif action == _COMMIT and _is_full(record):
            end = PAUSED
        if end > 0:
            leave(topology, lanes, outcome, lane, r)
            return end
        if past_event:
            course.mode[lane], course.corrections[lane] = _REBASE, 0
            return 0
    elif action == _TURN:
        # The cables on the edge are not those that the base was differentiated with.
        course.turns[lane] += 1
        turn_edges(topology, lanes, lane)
        go_back(topology, lanes, lane, course.base[lane])
        course.mode[lane], course.corrections[lane] = _REBASE, 0
        return 0
    else:
        # Also a cut: what is beyond an event may not be reached at all; the event itself is.
        foreseen = action == _CUT
        once = not foreseen or not course.sought[lane]
        if mode != _EVENT and once and _seek_event(topology, lanes, course, lane, foreseen):
            course.sought[lane] = foreseen
            return 0
        gone = collapses_at(topology, lanes, lane, course.base[lane], row_of(reference, r))
        if gone < 1.0:
            leave_foreseen(topology, lanes, outcome, lane, r, course.base[lane], gone)
            return BRANCH_ENDS
        course.step[lane] = CUT_TO * min(course.step[lane], course.target[lane] - course.base[lane])
        if course.step[lane] < control.smallest_step:
            leave_base(topology, lanes, outcome, lane, r, course.base[lane])
            return BRANCH_ENDS
    _set_out(topology, control, lanes, course, lane)
    return 0


@njit
def _stop(topology, control, outcome, lanes, course, lane):
    """Leave a run that cannot go on from where it is; return why."""
    r = course.run[lane]
    if course.mode[lane] == _REBASE:
        leave_base(topology, lanes, outcome, lane, r, course.base[lane])
        return EVENT_ENDS
    if not get(lanes.residual, 0, lane) <= control.tolerance:
        return NO_START
    leave(topology, lanes, outcome, lane, r)
    return UNSTABLE_START


@njit
def _seek_event(topology, lanes, course, lane, foreseen):
    """Set out for the first event within the step; return whether there is one."""
    h = course.target[lane] - course.base[lane]
    at = first_crossing(topology, lanes, lane, h, course.member, foreseen)
    if not 0.0 < at < h:
        return False
    course.mode[lane], course.corrections[lane], course.last_move[lane] = _EVENT, 0, np.inf
    predict(topology, lanes, lane, course.base[lane], course.base[lane] + at)
    return True


@njit
def _set_out(topology, control, lanes, course, lane):
    """Predict the next point from the base."""
    left = 1.0 - course.base[lane]
    if course.speed[lane] > 0.0:
        course.step[lane] = min(course.step[lane], control.largest_move / course.speed[lane])
    # Equal steps rather than a last one that is nearly nothing.
    taken = left / np.ceil(left / course.step[lane] - 1e-9)
    course.target[lane] = 1.0 if taken >= left else course.base[lane] + taken
    course.mode[lane], course.corrections[lane], course.last_move[lane] = _STEP, 0, np.inf
    if not course.sought[lane] and _seek_event(topology, lanes, course, lane, foreseen=True):
        course.sought[lane] = True
        return
    predict(topology, lanes, lane, course.base[lane], course.target[lane])


@njit
def _growth(size, correction, miss):
    """Return by how much the next step may be longer: both errors of the last one say so."""
    by_correction = (CORRECTION_AIM * size / max(correction, 1e-12 * size)) ** 0.25
    by_miss = (0.5 * DEFECT * size / max(miss, 1e-14 * size)) ** 0.2
    return min(GROW_TO, max(CUT_TO, min(by_correction, by_miss)))


@njit
def _is_full(record):
    """Whether the record has room for no further step."""
    points, events = record.parameter.size, record.event_parameter.size
    return points > 0 and (record.counts[0] >= points or record.counts[1] + record.tensions.shape[1] > events)


@njit
def _note(topology, record, lanes, lane, iterations, past_event):
    """Write an accepted point, and the cables that an event changed, into the record."""
    if record.parameter.size == 0:
        return
    at = record.counts[0]
    record.counts[0] += 1
    record.parameter[at] = get(lanes.parameter, 0, lane)
    record.iterations[at] = iterations
    for i in range(topology.n_coordinates):
        record.nodes[at, i] = get(lanes.x, i, lane)
    for e in range(topology.n_members):
        taut = carries(topology, lanes, lane, e)
        record.tensions[at, e] = get(lanes.stress, e, lane) if taut else 0.0
        if past_event and get(lanes.edge, e, lane) > 0.0 and taut != (get(lanes.taut, e, lane) > 0.0):
            record.event_parameter[record.counts[1]] = record.parameter[at]
            record.event_member[record.counts[1]] = e
            record.event_taut[record.counts[1]] = 1 if taut else 0
            record.counts[1] += 1
