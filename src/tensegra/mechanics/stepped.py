"""The plain procedure of the source: fixed increments, Newton–Raphson in the positions.

It neither predicts nor watches stability, so it can jump between branches or not converge at all.
It is kept to reproduce the outcome statistics of Zhang et al. beside those of the path follower.
"""

import numpy as np

from tensegra.mechanics.equilibrium import (
    FLAT_TENSION,
    RESIDUAL_TOLERANCE,
    ZERO_EIGENVALUE,
    Load,
    carried_tension,
    unbalanced,
)
from tensegra.mechanics.follow import StageFollower, StageRun
from tensegra.mechanics.status import Status

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
    n_increments = _n_increments(follower)
    for i in range(1, n_increments + 1):
        parameter = i / n_increments
        load = follower.load_at(parameter)
        x, converged = follower.with_supports(run.nodes, parameter), False
        before = run.iterations
        for _ in range(MAX_ITERATIONS):
            out, residual = unbalanced(tangent, x, load)
            if converged := residual <= RESIDUAL_TOLERANCE:
                break
            if _is_flat(follower, load):
                run.nodes, run.parameter = x, 1.0
                run.end(Status.COLLAPSED, f"prestress lost at increment {i} of {n_increments}")
                return run
            tangent.factorise()
            x = x - tangent.solve(out)
            run.iterations += 1
            if not np.abs(x).max() < 1e3 * (np.abs(follower.arrays.coordinates).max() + follower.arrays.size):
                break
        if not converged:
            run.end(Status.FAILED, f"increment {i} of {n_increments} did not converge")
            return run
        run.nodes, run.parameter = x, parameter
        run.steps += 1
        follower.record(run, run.iterations - before)
    if tangent.factorise() > 0:
        lowest = tangent.lowest_eigenvalue()
        if lowest > -ZERO_EIGENVALUE * tangent.stiffness_scale:
            run.end(Status.COLLAPSED, "ends where K is singular")
        else:
            run.end(Status.UNSTABLE, f"ends where K has the negative eigenvalue {lowest:.4g}")
    return run


def _n_increments(follower: StageFollower) -> int:
    start, end = follower.inputs.rest_length_at(0.0), follower.inputs.rest_length_at(1.0)
    change = float(np.abs(end / start - 1.0).max(initial=0.0))
    return max(1, int(np.ceil(change / follower.settings.increment - 1e-9)))


def _is_flat(follower: StageFollower, load: Load) -> bool:
    carried, loaded = carried_tension(follower.tangent, load)
    return not loaded and carried <= FLAT_TENSION * follower.reference_tension
