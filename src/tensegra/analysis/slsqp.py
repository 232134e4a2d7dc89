"""Sequential quadratic programming: SLSQP (Kraft 1988) from many starts, with exact Jacobians."""

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.compiled import Condition, minimise
from tensegra.analysis.multistart import Finish, View, room
from tensegra.analysis.problem import Problem

Array = NDArray[np.float64]

# In units of the objective's spread over the starts: far below the 1e-6 that optima are compared at.
TOLERANCE = 1e-13
MAX_ITERATIONS = 200


def descend(view: View, z: Array, problem: Problem, frozen: NDArray[np.bool_]) -> Finish:
    """Run SLSQP from `z` on the scaled problem; `frozen` variables keep their values."""
    equality = np.array([constraint.equality for constraint in problem.constraints], dtype=bool)

    def value(z: Array) -> tuple[float, Array]:
        local = view.at(z)
        return local.f, local.df

    def margins(kind: str, mask: NDArray[np.bool_]) -> Condition:
        return kind, lambda z: view.at(z).c[mask], lambda z: view.at(z).dc[mask]

    pairs = (("eq", equality), ("ineq", ~equality))
    result = minimise(
        value,
        z,
        method="SLSQP",
        bounds=room(z, frozen),
        constraints=[margins(kind, mask) for kind, mask in pairs if mask.any()],
        options={"ftol": TOLERANCE, "maxiter": MAX_ITERATIONS},
    )
    return Finish(np.clip(result.x, 0.0, 1.0), converged=bool(result.success), reason=str(result.message))
