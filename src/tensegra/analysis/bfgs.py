"""Bounded quasi-Newton: L-BFGS-B (Byrd, Lu, Nocedal & Zhu 1995) from many starts, with exact gradients.

The method knows bounds only; constraints come in by the augmented Lagrangian of Powell, Hestenes and
Rockafellar (Nocedal & Wright, *Numerical Optimization*, ch. 17.4): an inner descent for fixed multipliers,
then their update, until the violation is gone.
"""

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.compiled import minimise
from tensegra.analysis.multistart import Finish, View, room
from tensegra.analysis.problem import Problem

Array = NDArray[np.float64]

# In scaled units, where the objective and the margins have a spread of 1 over the starts.
GRADIENT_TOLERANCE, OBJECTIVE_TOLERANCE = 1e-8, 1e-13
VIOLATION_TOLERANCE = 1e-9
MAX_ITERATIONS = 200
MAX_UPDATES = 25
FIRST_PENALTY, LAST_PENALTY = 10.0, 1e6


def descend(view: View, z: Array, problem: Problem, frozen: NDArray[np.bool_]) -> Finish:
    """Run L-BFGS-B from `z` on the scaled problem, constraints by an augmented Lagrangian.

    `frozen` variables keep their values.
    """
    if not problem.constraints:
        return _inner(view, z, np.zeros(0), 0.0, np.zeros(0, dtype=bool), frozen)
    equality = np.array([constraint.equality for constraint in problem.constraints], dtype=bool)
    multipliers, penalty, worst = np.zeros(equality.size), FIRST_PENALTY, np.inf
    finish = Finish(z, converged=False, reason="")
    for _ in range(MAX_UPDATES):
        finish = _inner(view, finish.z, multipliers, penalty, equality, frozen)
        c = view.at(finish.z).c
        violation = float(np.max(np.where(equality, np.abs(c), np.abs(np.minimum(c, multipliers / penalty)))))
        if violation <= VIOLATION_TOLERANCE:
            return Finish(finish.z, converged=True, reason="converged: stationary and all constraints hold")
        multipliers = multipliers - penalty * c
        multipliers = np.where(equality, multipliers, np.maximum(multipliers, 0.0))
        if violation > 0.25 * worst:
            penalty = min(10.0 * penalty, LAST_PENALTY)
        worst = min(worst, violation)
    reason = f"the constraints still miss by {violation:.1e} of their spread after {MAX_UPDATES} updates"
    return Finish(finish.z, converged=False, reason=reason)


def _inner(
    view: View,
    z: Array,
    multipliers: Array,
    penalty: float,
    equality: NDArray[np.bool_],
    frozen: NDArray[np.bool_],
) -> Finish:
    def value(z: Array) -> tuple[float, Array]:
        local = view.at(z)
        if not equality.size or not np.isfinite(local.f):
            return local.f, local.df
        pull = multipliers - penalty * local.c  # the multipliers' first-order update
        pull = np.where(equality, pull, np.maximum(pull, 0.0))
        return local.f + float(pull @ pull) / (2.0 * penalty), local.df - pull @ local.dc

    result = minimise(
        value,
        z,
        method="L-BFGS-B",
        bounds=room(z, frozen),
        options={
            "ftol": OBJECTIVE_TOLERANCE,
            "gtol": GRADIENT_TOLERANCE,
            "maxiter": MAX_ITERATIONS,
            "maxls": 30,
        },
    )
    return Finish(np.clip(result.x, 0.0, 1.0), converged=bool(result.success), reason=str(result.message))
