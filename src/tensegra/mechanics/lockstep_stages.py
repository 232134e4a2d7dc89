"""Varied structures on their way through the stages, in lockstep."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray, StructureArrays, path_lengths
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.equilibrium import FLAT_TENSION
from tensegra.mechanics.inputs import Inputs, StageInputs, initial_inputs, nodal_forces, stage_inputs
from tensegra.mechanics.lockstep_data import STANDS, Outcome
from tensegra.mechanics.lockstep_solver import CAREFUL_STEP, LockstepSolver
from tensegra.mechanics.path import Prepared, stage_targets
from tensegra.mechanics.settings import PathSettings


def follow_stage(
    solver: LockstepSolver,
    stage: StageInputs,
    start: FloatArray,
    n_runs: int,
    settings: PathSettings,
    reference: FloatArray,
    directions: Sequence[Direction] = (),
) -> Outcome:
    """Follow all runs through a stage by the procedure of the settings."""
    if settings.path == "stepped":
        return solver.follow_stepped(stage, start, n_runs, settings.increment, reference, directions)
    smallest_step = settings.smallest_step if settings.policy == "settle" else CAREFUL_STEP
    return solver.follow(stage, start, n_runs, directions, smallest_step)


def through_stages(
    base: Prepared, arrays: StructureArrays, solver: LockstepSolver, n_runs: int
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Take varied structures through their stages.

    Parameters
    ----------
    base
        The structure as it is given, solved through its stages.
    arrays
        The varied structures.
    solver
        Of the varied structures.
    n_runs
        Number of structures.

    Returns
    -------
    tuple
        Positions, ``(n_runs, n_nodes, 3)``, reference tensions and which runs stand there, ``(n_runs,)``.
    """
    done, reference = np.ones(n_runs, dtype=np.bool_), np.zeros(n_runs)
    targets = [after for _, after in stage_targets(base.structure, arrays)]
    if base.settings.path == "stepped":
        stage, nodes = stage_inputs(arrays, initial_inputs(arrays), targets[0]), arrays.coordinates[None]
    else:
        stage, nodes = _first_stage(base, arrays, targets[0]), base.equilibria[0].nodes[None]
    for before, after in zip(targets, [*targets[1:], None], strict=True):
        outcome = follow_stage(solver, stage, nodes, n_runs, base.settings, reference)
        done &= outcome.done == STANDS
        reference = np.maximum(reference, reference_tensions([outcome.tensions], arrays.stiffness))
        nodes = outcome.nodes.reshape(n_runs, -1, 3)
        if after is not None:
            stage = stage_inputs(arrays, before, after)
    return nodes, reference, done


def reference_tensions(tensions: Sequence[FloatArray], stiffness: FloatArray) -> FloatArray:
    """Return what counts as a tension of the structures, as `reference_tension` does, ``(n_runs | 1,)``."""
    least = FLAT_TENSION * stiffness.max(axis=-1, initial=1.0)
    largest = [np.abs(one).max(axis=-1, initial=0.0) for one in tensions]
    return np.atleast_1d(np.maximum.reduce([*largest, np.broadcast_to(least, np.shape(largest[0]))]))


def _first_stage(base: Prepared, arrays: StructureArrays, after: Inputs) -> StageInputs:
    """Lead the varied structures from the first equilibrium of the given one to their own.

    They begin at its positions with its tensions and loads: with the rest lengths that give these, which
    then become their own. There a structure stands as the given one does. At the given coordinates it may
    not, for it is stiffened by its prestress, and a modulus changes the tensions of the cables alone. (Only
    if the path of the stage had a fold for some of the moduli between would its end be another one.)
    """
    (_, given), at = stage_targets(base.structure, base.arrays)[0], base.equilibria[0]
    stage, length = stage_inputs(arrays, after, after), path_lengths(arrays, at.nodes)
    own = stage.rest_length[..., 0]
    lent = np.where(at.slack, np.maximum(own, length), length / (1.0 + at.tensions / arrays.stiffness))
    return replace(
        stage,
        rest_length=np.stack([lent, own - lent, np.zeros_like(own)], axis=-1),
        loads_start=nodal_forces(base.arrays, given),
    )
