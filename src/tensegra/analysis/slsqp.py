"""Sequential quadratic programming: SLSQP (Kraft 1988) from many starts, with exact Jacobians."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.multistart import Finish, View
from tensegra.analysis.problem import Problem

Array = NDArray[np.float64]

# In units of the objective's spread over the starts: far below the 1e-6 that optima are compared at.
TOLERANCE = 1e-13
MAX_ITERATIONS = 200


def descend(view: View, z: Array, problem: Problem) -> Finish:
    """Run SLSQP from `z` on the scaled problem."""
    from scipy.optimize import minimize

    equality = np.array([constraint.equality for constraint in problem.constraints], dtype=bool)
    conditions: Any = [
        {
            "type": kind,
            "fun": lambda z, mask=mask: view.at(z).c[mask],
            "jac": lambda z, mask=mask: view.at(z).dc[mask],
        }
        for kind, mask in (("eq", equality), ("ineq", ~equality))
        if mask.any()
    ]

    def value(z: Array) -> tuple[float, Array]:
        local = view.at(z)
        return local.f, local.df

    result = minimize(
        value,
        z,
        jac=True,
        method="SLSQP",
        bounds=[(0.0, 1.0)] * z.size,
        constraints=conditions,
        options={"ftol": TOLERANCE, "maxiter": MAX_ITERATIONS},
    )
    return Finish(np.clip(result.x, 0.0, 1.0), converged=bool(result.success), reason=str(result.message))
