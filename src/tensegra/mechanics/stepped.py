"""The plain procedure of the source: fixed increments, Newton–Raphson in the positions.

It neither predicts nor watches stability, so it can jump between branches or not converge at all.
It is kept to reproduce the outcome statistics of Zhang et al. beside those of the path follower.
"""

import numpy as np

from tensegra.mechanics.arrays import IndexArray, StructureArrays
from tensegra.mechanics.equilibrium import (
    FLAT_TENSION,
    RESIDUAL_TOLERANCE,
    ZERO_EIGENVALUE,
    Load,
    carried_tension,
    unbalanced,
)
from tensegra.mechanics.follow import StageFollower, StageRun
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.status import Status
from tensegra.mechanics.tangent import Tangent

MAX_ITERATIONS = 100
"""Newton solves of one increment after which the plain procedure has not converged."""


def run_stepped(follower: StageFollower, name: str, nodes: np.ndarray) -> StageRun:
    """Go through a stage in equal increments, each solved by plain Newton–Raphson.

    Parameters
    ----------
    follower
        Of the stage; `PathSettings.increment` bounds the relative change of a rest length in one
        increment.
    name
        Of the stage.
    nodes
        Where it starts, shape ``(n_nodes, 3)``.
    """
    run = StageRun(name, nodes)
    tangent = follower.tangent
    n = int(n_increments(follower.inputs, follower.settings.increment))
    for i in range(1, n + 1):
        parameter = i / n
        load = follower.load_at(parameter)
        x, converged = follower.with_supports(run.nodes, parameter), False
        before = run.iterations
        for _ in range(MAX_ITERATIONS):
            out, residual = unbalanced(tangent, x, load)
            if converged := residual <= RESIDUAL_TOLERANCE:
                break
            if _is_flat(follower, load):
                run.nodes, run.parameter = x, 1.0
                run.end(Status.COLLAPSED, prestress_lost(i, n))
                return run
            tangent.factorise()
            x = x - tangent.solve(out)
            run.iterations += 1
            if not np.abs(x).max() < farthest_coordinate(follower.arrays):
                break
        if not converged:
            run.end(Status.FAILED, not_converged(i, n))
            return run
        run.nodes, run.parameter = x, parameter
        run.steps += 1
        follower.record(run, run.iterations - before)
    if tangent.factorise() > 0:
        run.end(*end_where_not_definite(tangent))
    return run


def end_where_not_definite(tangent: Tangent) -> tuple[Status, str]:
    """Tell an equilibrium that does not stand from one where K is singular, at the last measure."""
    lowest = tangent.lowest_eigenvalue()
    if lowest > -ZERO_EIGENVALUE * tangent.stiffness_scale:
        return Status.COLLAPSED, "ends where K is singular"
    return Status.UNSTABLE, f"ends where K has the negative eigenvalue {lowest:.4g}"


def prestress_lost(increment: int, n: int) -> str:
    """Return the reason of a run that lost its prestress."""
    return f"prestress lost at increment {increment} of {n}"


def not_converged(increment: int, n: int) -> str:
    """Return the reason of a run that found no equilibrium."""
    return f"increment {increment} of {n} did not converge"


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


def _is_flat(follower: StageFollower, load: Load) -> bool:
    carried, loaded = carried_tension(follower.tangent, load)
    return not loaded and carried <= FLAT_TENSION * follower.reference_tension
