"""The first equilibrium of a structure, from coordinates that are only nearly one.

The given coordinates are an equilibrium under the force that balances them; along the first stage
this force fades while the inputs come in, so that the first equilibrium is reached along a path
like any other. Where the given coordinates do not stand (no prestress yet, or a negative
eigenvalue) there is no path to follow, and Newton's method or a fall finds the equilibrium.
"""

from tensegra.mechanics.equilibrium import ZERO_EIGENVALUE, newton, unbalanced
from tensegra.mechanics.follow import StageFollower, StageRun, reference_tension
from tensegra.mechanics.status import Status

NEAR_EQUILIBRIUM = 1e-2
"""A start within this share of the structure's size of an equilibrium is taken to mean it."""


def first_stage(follower: StageFollower, name: str, *, settle: bool) -> StageRun:
    """Find the equilibrium at the end of the first stage.

    Parameters
    ----------
    follower
        Of the first stage, from the given coordinates without loads to its inputs.
    name
        Of the stage.
    settle
        Let an unstable start fall instead of reporting it as it is.
    """
    tangent, arrays = follower.tangent, follower.arrays
    given = arrays.coordinates
    out, _ = unbalanced(tangent, given, follower.load_at(0.0))
    follower.reference_tension = reference_tension(tangent.tension, arrays.stiffness)
    stands = tangent.factorise() == 0
    if stands:
        follower.inputs = follower.inputs.balanced_by(out)
        return follower.run(name, given)
    run = StageRun(name, given, steps=1)
    if not settle and _stay_unstable(follower, run):
        return run
    return _fall_into_place(follower, run)


def _stay_unstable(follower: StageFollower, run: StageRun) -> bool:
    """Accept an unstable equilibrium that is near the given coordinates; return whether it is one."""
    tangent, arrays = follower.tangent, follower.arrays
    attempt = newton(
        tangent,
        follower.with_supports(arrays.coordinates, 1.0),
        follower.load_at(1.0),
        largest_move=NEAR_EQUILIBRIUM * arrays.size,
    )
    run.iterations += attempt.iterations
    lowest = tangent.lowest_eigenvalue()
    if not attempt.converged or lowest >= -ZERO_EIGENVALUE * tangent.stiffness_scale:
        return False
    run.nodes, run.parameter = attempt.nodes, 1.0
    run.end(
        Status.UNSTABLE,
        f"the start is an equilibrium that does not stand: {tangent.factorise()} negative eigenvalue(s), "
        f"lowest {lowest:.4g}",
    )
    return True


def _fall_into_place(follower: StageFollower, run: StageRun) -> StageRun:
    """Fall from the given coordinates under the stage's final inputs."""
    attempt = follower.fall(run, run.nodes, 1.0)
    follower.reference_tension = max(
        follower.reference_tension, reference_tension(follower.tangent.tension, follower.arrays.stiffness)
    )
    run.nodes, run.parameter = attempt.nodes, 1.0
    if not attempt.converged:
        residual = f"residual {attempt.residual:.3g}"
        run.end(Status.FAILED, f"no equilibrium found from the given coordinates: {residual}")
    elif attempt.flat or attempt.neutral:
        run.end(Status.COLLAPSED, "the structure does not stand: nothing holds it in its position")
    return run
