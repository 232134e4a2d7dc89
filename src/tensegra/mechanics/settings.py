"""How a path is followed: by which procedure, in what steps, and what happens where the branch ends."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

from tensegra.errors import ModelError

Policy = Literal["settle", "stop", "trace"]
Procedure = Literal["adaptive", "stepped"]
POLICIES: tuple[str, ...] = get_args(Policy)
PROCEDURES: tuple[str, ...] = get_args(Procedure)


@dataclass(frozen=True)
class PathSettings:
    """How a path is followed.

    Attributes
    ----------
    policy
        What to do where the stable branch ends: ``settle`` into the stable equilibrium that a
        slowly loaded structure falls into, ``stop``, or ``trace`` the unstable branch by arc length.
    first_step
        First increment of the path parameter.
    smallest_step
        Increment below which the branch is held to end; critical points are located to it.
    largest_move
        Largest move of a coordinate in one step, as a share of the structure's size.
    contraction
        Ratio of successive Newton corrections above which a step is cut.
    max_steps
        Steps of one stage after which it fails.
    residual
        ‖f − p‖∞ relative to the largest tension or load at which an equilibrium is accepted.
    path
        ``adaptive``, or ``stepped``: the plain procedure of the source, in fixed increments.
    increment
        Largest relative change of a rest length in one increment of the stepped procedure.
    """

    policy: Policy = "settle"
    first_step: float = 0.5
    smallest_step: float = 2e-7
    largest_move: float = 0.15
    contraction: float = 0.5
    max_steps: int = 20_000
    residual: float = 1e-9
    path: Procedure = "adaptive"
    increment: float = 0.01


def path_settings(
    settings: PathSettings | None, path: Procedure | None, policy: Policy | None
) -> PathSettings:
    """Return the settings with the procedure and the policy that a caller names apart from them.

    Raises
    ------
    ModelError
        For a procedure or a policy that there is not.
    """
    result = settings or PathSettings()
    for what, value, known in (("path", path, PROCEDURES), ("policy", policy, POLICIES)):
        if value is not None and value not in known:
            raise ModelError.at(what, value, f"one of {', '.join(known)}", candidates=known)
    return replace(result, path=path or result.path, policy=policy or result.policy)
