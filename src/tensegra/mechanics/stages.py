"""A loading history of one run or of many: the stages in order, then what acts after them.

For each stage it is found out which rigid motions nothing holds and no load turns, the solver holds
coordinates for these, and the supervisor takes the runs through.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays, structure_arrays
from tensegra.mechanics.conclude import concluded
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.falls import FLAT_TENSION
from tensegra.mechanics.follow import ARRIVED, UNSTABLE_START
from tensegra.mechanics.pattern import Pattern, build_pattern
from tensegra.mechanics.reactions import internal_forces
from tensegra.mechanics.rigid import Freedom, RigidMotions, align, freedom_under, in_frame, rigid_motions
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.status import Status
from tensegra.mechanics.supervise import Supervisor, Task
from tensegra.structure import Structure

NEAR_EQUILIBRIUM = 1e-2
"""A start within this share of the structure's size of an equilibrium is taken to mean it."""

SAME_END = 1e-6
"""Share of the size within which the plain procedure ends where the path does."""

_KEPT = "_flat_for_mechanics"  # where a structure keeps its `_Flat`, beside its cached properties

MOST_GROUNDS = 4
"""Settings with which a structure was solved whose solvers are kept."""

UNLOADED_AT = 1.0 - 1e-6
"""λ from which on a motion that loads turn is held at the end of a stage that takes these loads away."""


@dataclass(eq=False)
class Ground:
    """What all histories of a structure share.

    Attributes
    ----------
    arrays
        The structure, flattened, with its own supports.
    settings
        How paths are followed.
    motions
        Rigid motions that the supports leave.
    pattern
        Of the structure with its own supports.
    plain_arrays
        The structure as it is given, where `arrays` vary it run by run.
    threads
        Threads to share many runs.
    kept
        What later floors have found of the structure with these settings, by a key of their own.
    """

    arrays: StructureArrays
    settings: PathSettings
    motions: RigidMotions
    pattern: Pattern
    plain_arrays: StructureArrays
    threads: int = 1
    kept: dict[object, Any] = field(default_factory=dict)
    _solvers: dict[bytes, Solver] = field(default_factory=dict)

    def solver(self, freedom: Freedom, nodes: FloatArray) -> Solver:
        """Return a solver that holds coordinates for the neutral motions, good at some positions.

        Coordinates that are good where the structure is drawn serve as long as they can: what is found does
        not depend on what was solved before.
        """
        if freedom.key not in self._solvers:
            self._solvers[freedom.key] = self._solver(freedom, self.plain_arrays.coordinates)
        drawn = self._solvers[freedom.key]
        return self._solver(freedom, nodes) if drawn.grip.is_worn(nodes[None])[0] else drawn

    def _solver(self, freedom: Freedom, nodes: FloatArray) -> Solver:
        if not len(freedom.neutral):
            return Solver(
                self.plain_arrays, self.settings, self.threads, pattern=self.pattern, turning=self.motions
            )
        return Solver(
            self.plain_arrays, self.settings, self.threads, freedom.neutral, nodes, turning=self.motions
        )

    def on_threads(self, threads: int) -> "Ground":
        """Return the same with solvers of its own on so many threads."""
        return replace(self, threads=threads, _solvers={})

    def freedom(self, loads: FloatArray) -> Freedom:
        """Return what loads ``(…, n_nodes, 3)`` make of the rigid motions."""
        return freedom_under(self.plain_arrays, self.motions, loads)


@dataclass(frozen=True, eq=False)
class _Flat:
    """What the geometry of a structure alone decides."""

    arrays: StructureArrays
    motions: RigidMotions
    pattern: Pattern
    grounds: dict[PathSettings, Ground]


def ground_of(structure: Structure, settings: PathSettings, threads: int = 1) -> Ground:
    """Find what all histories of a structure share.

    A structure does not change, so what was found of it is kept as long as it lives: to be asked again is
    the rule where one structure is solved for one actuation after the other.
    """
    kept = vars(structure)
    if _KEPT not in kept:
        arrays = structure_arrays(structure)
        kept[_KEPT] = _Flat(arrays, rigid_motions(arrays), build_pattern(arrays), {})
    flat: _Flat = kept[_KEPT]
    if settings not in flat.grounds:
        while len(flat.grounds) >= MOST_GROUNDS:
            flat.grounds.pop(next(iter(flat.grounds)))
        flat.grounds[settings] = Ground(flat.arrays, settings, flat.motions, flat.pattern, flat.arrays)
    ground = flat.grounds[settings]
    return ground if threads == 1 else ground.on_threads(threads)


@dataclass(frozen=True, eq=False)
class Leg(Task):
    """A part of a history, and what is asked about its end.

    Attributes
    ----------
    modes
        Guess of the softest modes at its end, ``(3, n_nodes, 3)``.
    directions
        What to differentiate its end by.
    """

    modes: FloatArray | None = None
    directions: Sequence[Direction] = ()

    def concluded(self, supervisor: Supervisor) -> StageEnd:
        """Return what is known at the end, in the frame of least squares from the start of the leg."""
        end = concluded(supervisor, self.modes, self.directions)
        return _aligned(end, self.start, supervisor.gauge.motions)


def follow_leg(ground: Ground, leg: Leg) -> StageEnd:
    """Take all runs of a leg from their equilibria at λ = 0 to its end."""
    freedom, ends = _freedom(ground, leg)
    if freedom.unheld or ends.unheld:
        return _without_equilibrium(ground, leg, ends.unheld or freedom.unheld)
    solver = ground.solver(freedom, leg.start[0])
    if len(ends.neutral) > len(freedom.neutral) and ground.settings.path == "adaptive":
        first = Supervisor(solver, replace(leg, stage=leg.stage.between(0.0, UNLOADED_AT)))
        first.follow()
        nodes = first.outcome.nodes.reshape(leg.n_runs, -1, 3)
        rest = replace(leg, start=nodes, stage=leg.stage.between(UNLOADED_AT, 1.0))
        supervisor = Supervisor(ground.solver(ends, nodes[0]), rest)
        stopped = (first.outcome.end != ARRIVED) & ~first.account.has(Status.COLLAPSED)
        supervisor.go_on_from(first)
        end = leg.concluded(supervisor)
        if np.any(stopped):
            before = leg.concluded(first)
            before.parameter *= UNLOADED_AT
            for run in map(int, np.flatnonzero(stopped)):
                end.put(run, before, run)
        return end
    supervisor = Supervisor(solver, leg)
    supervisor.follow()
    if ground.settings.path == "stepped":
        supervisor = _stepped(solver, leg, supervisor)
    return leg.concluded(supervisor)


def first_leg(ground: Ground, leg: Leg, *, settle: bool) -> StageEnd:
    """Find the equilibria at the end of the first stage, from coordinates that are only nearly in balance.

    The given coordinates are an equilibrium under the force that balances them; along the first stage
    this force fades while the inputs come in, so that the first equilibrium is reached along a path
    like any other. Where the given coordinates do not stand (no prestress yet, or a negative
    eigenvalue) there is no path to follow, and Newton's method or a fall finds the equilibrium.

    Parameters
    ----------
    ground, leg
        The structure, and its first stage from the given coordinates without loads to its inputs.
    settle
        Let an unstable start fall instead of reporting it as it is.
    """
    ends = ground.freedom(leg.stage.loads_end)
    if ends.unheld:
        return _without_equilibrium(ground, leg, ends.unheld)
    solver = ground.solver(ends, leg.start[0])
    start = Supervisor(solver, leg)
    certificate, _ = solver.certify(start.runs, start.outcome, None)
    tensions = start.outcome.tensions
    leg = replace(leg, reference=reference_tensions([tensions], leg.stiffness))
    stands = certificate.n_negative == 0
    force = internal_forces(ground.arrays, leg.start, tensions)
    supervisor = Supervisor(solver, replace(leg, stage=leg.stage.balanced_by(force)))
    if not settle:
        _stay_unstable(solver, leg, np.flatnonzero(~stands), supervisor)
    supervisor.fall_into_place(~stands)
    supervisor.follow()
    if ground.settings.path == "stepped":
        supervisor = _stepped(solver, leg, supervisor)
    return leg.concluded(supervisor)


def _stepped(solver: Solver, leg: Leg, followed: Supervisor) -> Supervisor:
    """Take the runs of a leg through it by the plain procedure, whose words are those of the path beside it.

    The procedure has no evidence of its own that two increments lie on one branch. So what arrives is
    ``stable`` where the path followed from the same start is, and ends in the same place.
    """
    stepped = Supervisor(solver, leg)
    stepped.step()
    for run in map(int, np.flatnonzero(stepped.account.has(Status.STABLE))):
        nodes, there = stepped.outcome.nodes[[run]], followed.outcome.nodes[[run]]
        size, account = solver.arrays.size, followed.account
        away = np.abs(nodes - there).max(initial=0.0)
        if account.status[run] is Status.STABLE and away <= SAME_END * size:
            continue
        passed = account.reason[run] or "; ".join(map(str, account.critical_points[run]))
        stepped.account.set(
            run,
            Status.SNAPPED,
            f"an increment left the path, {f'which tells: {passed}' if passed else 'which ends elsewhere'}",
        )
    return stepped


def _freedom(ground: Ground, leg: Leg) -> tuple[Freedom, Freedom]:
    """Return what the loads of a leg, and those at its end alone, make of the rigid motions."""
    if not len(ground.motions):
        free = Freedom(ground.motions, ())
        return free, free
    shape = (-1, *leg.start.shape[-2:])
    at_start, at_end = leg.stage.loads_start.reshape(shape), leg.stage.loads_end.reshape(shape)
    return ground.freedom(np.concatenate([at_start, at_end])), ground.freedom(at_end)


def _stay_unstable(solver: Solver, leg: Leg, candidates: IndexArray, supervisor: Supervisor) -> None:
    """Leave runs at unstable equilibria that are near the given coordinates, where there are any."""
    if not len(candidates):
        return
    near = Supervisor(solver, leg)
    near.outcome.parameter[:] = 1.0
    part = near.outcome.take(candidates)
    solver.follow(near.runs.take(candidates), part)
    away = np.abs(part.nodes.reshape(len(candidates), -1, 3) - leg.start).max(axis=(1, 2), initial=0.0)
    for row, run in enumerate(candidates.tolist()):
        if part.end[row] != UNSTABLE_START or away[row] > NEAR_EQUILIBRIUM * solver.arrays.size:
            continue
        tangent = near.gauge.measured(run, part.nodes[row], 1.0)
        lowest = tangent.lowest_eigenvalue()
        if lowest < -tangent.zero_eigenvalue:
            negative = f"{tangent.factorise()} negative eigenvalue(s), lowest {lowest:.4g}"
            reason = f"the start is an equilibrium that does not stand: {negative}"
            supervisor.stay(run, part.nodes[row], int(part.iterations[row]), reason)


def _without_equilibrium(ground: Ground, leg: Leg, unheld: tuple[str, ...]) -> StageEnd:
    """Return the end of runs that a net force pulls away."""
    along = ", ".join(unheld)
    return given_up(
        ground, leg, f"no equilibrium: nothing holds the structure against the net force along its {along}"
    )


def given_up(ground: Ground, leg: Leg, reason: str) -> StageEnd:
    """Return the end of a leg that no run can be taken through."""
    unloaded = ground.freedom(np.zeros(leg.start.shape[-2:]))
    supervisor = Supervisor(ground.solver(unloaded, leg.start[0]), leg)
    supervisor.fail_all(reason)
    return concluded(supervisor)


def _aligned(end: StageEnd, start: FloatArray, motions: RigidMotions) -> StageEnd:
    """Move ends, histories and derivatives along the neutral motions to where the start is nearest."""
    if not len(motions):
        return end
    found = np.isfinite(end.nodes).all(axis=(1, 2))
    start = np.broadcast_to(start, end.nodes.shape)
    end.nodes[found] = align(end.nodes[found], start[found], motions)
    end.history = [replace(point, nodes=align(point.nodes, start[0], motions)) for point in end.history]
    end.nodes_by[found] = in_frame(end.nodes_by[found], end.nodes[found], start[found], motions)
    end.free_motions = motions.names
    return end


def reference_tensions(tensions: Sequence[FloatArray], stiffness: FloatArray) -> FloatArray:
    """Return what counts as a tension of the structures, the largest they have had, ``(n_runs | 1,)``.

    It is never nothing: a share of the stiffness stands for it.
    """
    least = FLAT_TENSION * stiffness.max(axis=-1, initial=1.0)
    # A run that failed has no tensions: NaN is passed over.
    largest = [np.fmax.reduce(np.abs(one), axis=-1, initial=0.0) for one in tensions]
    return np.atleast_1d(reduce(np.maximum, largest, least))
