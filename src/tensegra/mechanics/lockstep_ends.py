"""How runs in lockstep ended, in words: what the kernels leave to be said.

The kernels know that a run has stopped, and where; what holds there, from the eigenvalue to the names
of the mechanisms, is found for each such run alone, at its last position.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray
from tensegra.mechanics.equilibrium import FLAT_TENSION, ZERO_EIGENVALUE, Load, unbalanced
from tensegra.mechanics.follow import FARTHEST_FALL, PRESTRESS_GONE, StageRun
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.lockstep_data import BRANCH_ENDS, FLAT, LOST, NOT_DEFINITE, STANDS, Outcome
from tensegra.mechanics.lockstep_solver import LockstepSolver
from tensegra.mechanics.path import certify_end
from tensegra.mechanics.results import Equilibrium
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.status import CriticalPoint, Status
from tensegra.mechanics.stepped import end_where_not_definite, n_increments, not_converged, prestress_lost
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Structure

STAGE = "actuation"
"""Name of the way from the last stage to a run."""


@dataclass(frozen=True, eq=False)
class Ending:
    """Runs of one block on their way from the last stage.

    Attributes
    ----------
    structure, tangent
        The structure, and a workspace.
    stage
        What the runs go through.
    stiffness
        EA, ``(n_runs | 1, n_members)`` or ``(n_members,)``.
    settings
        How they are followed.
    """

    structure: Structure
    tangent: Tangent
    stage: StageInputs
    stiffness: FloatArray
    settings: PathSettings

    def load(self, run: int, parameter: float = 1.0) -> Load:
        """Return what acts on a run at a point of its way."""
        way = self.stage
        alone = replace(
            way,
            rest_length=_row(way.rest_length, run, 2),
            loads_start=_row(way.loads_start, run, 2),
            loads_end=_row(way.loads_end, run, 2),
        )
        rest_length = np.ascontiguousarray(alone.rest_length_at(parameter))
        return Load(rest_length, _row(self.stiffness, run, 1), alone.loads_at(parameter))

    def is_neutral(self, run: int, nodes: FloatArray, parameter: float) -> bool:
        """Whether an equilibrium of a run cannot be told from a neutral one."""
        unbalanced(self.tangent, nodes.reshape(-1, 3), self.load(run, parameter))
        zero = ZERO_EIGENVALUE * self.tangent.stiffness_scale
        exceed = self.tangent.all_eigenvalues_exceed
        return exceed(-zero) and not exceed(zero)


def _row(values: FloatArray, run: int, n_axes: int) -> FloatArray:
    """Return the values of one run; an axis of runs stands before the last `n_axes`, or none."""
    if values.ndim == n_axes:
        return values
    row: FloatArray = values[run if len(values) > 1 else 0]
    return row


def stepped_ends(ending: Ending, outcome: Outcome) -> Iterator[tuple[int, Equilibrium]]:
    """Yield the runs of the plain procedure that do not stand where they ended, with what is found there.

    Parameters
    ----------
    ending
        The runs.
    outcome
        What `LockstepSolver.follow_stepped` came to.
    """
    number = np.broadcast_to(n_increments(ending.stage, ending.settings.increment), outcome.done.shape)
    for run in map(int, np.flatnonzero(np.isin(outcome.done, (NOT_DEFINITE, FLAT, LOST)))):
        steps, n = int(outcome.steps[run]), int(number[run])
        if outcome.done[run] == LOST:
            how = Status.FAILED, not_converged(steps + 1, n)
        elif outcome.done[run] == FLAT:
            how = Status.COLLAPSED, prestress_lost(steps + 1, n)
        else:
            unbalanced(ending.tangent, outcome.nodes[run].reshape(-1, 3), ending.load(run))
            how = end_where_not_definite(ending.tangent)
        yield run, _certified(ending, outcome, run, *how)


def collapses(
    ending: Ending, solver: LockstepSolver, start: FloatArray, outcome: Outcome, reference: FloatArray
) -> Iterator[tuple[int, Equilibrium]]:
    """Yield the runs whose stable branch ends because their prestress is gone, where they come to rest.

    It is the way of `StageFollower` with such a point: a fall just beyond it, farther on as long as K
    cannot be told from a singular one there, and then a fall under the inputs at the end of the stage.
    Only what is neutral or carries nothing in both is a collapse; all else is left to be followed alone.

    Parameters
    ----------
    ending, solver
        The runs, and what solves them.
    start
        Positions at λ = 0, ``(n_runs | 1, n_nodes, 3)``.
    outcome
        What `LockstepSolver.follow` came to; takes up where the collapsed runs come to rest.
    reference
        What counts as a tension of the structure, ``(n_runs | 1,)``.
    """
    largest_move = 0.4 * ending.settings.largest_move * solver.arrays.size
    reference = np.broadcast_to(reference, outcome.done.shape)

    def fall(runs: IndexArray, parameter: FloatArray) -> tuple[IndexArray, IndexArray]:
        """Let runs fall from where they are; return which become neutral, and which carry nothing."""
        fallen = solver.fall(
            ending.stage,
            start,
            len(outcome.done),
            runs,
            outcome.nodes[runs],
            parameter,
            FLAT_TENSION * reference[runs],
            largest_move,
        )
        outcome.nodes[runs] = fallen.nodes
        outcome.iterations[runs] += fallen.iterations
        neutral = [
            done in (STANDS, NOT_DEFINITE) and ending.is_neutral(run, nodes, at)
            for done, run, nodes, at in zip(fallen.done, runs, fallen.nodes, parameter, strict=True)
        ]
        return runs[np.array(neutral, dtype=np.bool_)], runs[fallen.done == FLAT]

    falling = _without_prestress(ending, solver, outcome, reference)
    before, ahead = outcome.nodes.copy(), 2.0 * ending.settings.smallest_step
    fallen: list[IndexArray] = []
    while len(falling):
        outcome.nodes[falling] = before[falling]
        falling, flat = fall(falling, np.minimum(1.0, outcome.parameter[falling] + ahead))
        fallen.append(flat)
        if ahead >= FARTHEST_FALL:
            fallen.append(falling)
            break
        ahead *= 10.0
    collapsed = np.sort(np.concatenate(fallen)) if fallen else falling
    if len(collapsed):
        collapsed = np.concatenate(fall(collapsed, np.ones(len(collapsed))))
    for run in map(int, collapsed):
        point = CriticalPoint(STAGE, float(outcome.parameter[run]), "collapse", np.nan, ())
        yield run, _certified(ending, outcome, run, Status.COLLAPSED, f"prestress lost: {point}")


def _without_prestress(
    ending: Ending, solver: LockstepSolver, outcome: Outcome, reference: FloatArray
) -> IndexArray:
    """Return the runs without any load that carry next to nothing where their stable branch ends."""
    free = solver.arrays.free
    loaded = np.any((ending.stage.loads_start != 0.0) & free, axis=(-2, -1))
    loaded = loaded | np.any((ending.stage.loads_end != 0.0) & free, axis=(-2, -1))
    carried = np.abs(outcome.tensions[:, solver.arrays.moving]).max(axis=1, initial=0.0)
    gone = carried < PRESTRESS_GONE * reference
    return np.flatnonzero((outcome.done == BRANCH_ENDS) & gone & ~loaded)


def _certified(ending: Ending, outcome: Outcome, run: int, status: Status, reason: str) -> Equilibrium:
    end = StageRun(
        STAGE,
        outcome.nodes[run].reshape(-1, 3),
        parameter=1.0,
        steps=int(outcome.steps[run]),
        iterations=int(outcome.iterations[run]),
        outcome=status,
        reason=reason,
    )
    return certify_end(ending.structure, ending.tangent, end, ending.load(run))
