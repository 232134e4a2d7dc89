"""The one door to SciPy's compiled optimisers.

They read the memory that a callback returns as it lies there: SciPy's SLSQP takes the entries of a gradient
one after the other whatever its strides, and a search then follows numbers that are not its gradient. So
whatever goes through here is a contiguous array of float64. No other module of this folder imports the
optimisers (a test sees to it).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.surrogate.threads import one_thread

Array = NDArray[np.float64]
Bounds = Sequence[tuple[float, float]]
# "eq" or "ineq", the margins at a point, and their Jacobian.
Condition = tuple[str, Callable[[Array], ArrayLike], Callable[[Array], ArrayLike]]


def contiguous(values: ArrayLike) -> Array:
    """Return values as a contiguous array of float64, a copy only where it is needed."""
    return np.ascontiguousarray(values, dtype=np.float64)


def minimise(
    value: Callable[[Array], tuple[float, ArrayLike]],
    z: ArrayLike,
    *,
    method: str,
    bounds: Bounds,
    constraints: Sequence[Condition] = (),
    options: Mapping[str, Any],
) -> Any:  # noqa: ANN401 - SciPy's OptimizeResult
    """Run `scipy.optimize.minimize` on a function that returns its value and its gradient.

    Parameters
    ----------
    value
        Takes z, returns the value and the gradient.
    z, method, bounds, options
        As SciPy takes them.
    constraints
        Each ``"eq"`` or ``"ineq"``, the margins of z and their Jacobian.
    """
    from scipy.optimize import minimize

    def both(z: Array) -> tuple[float, Array]:
        f, slope = value(z)
        return float(f), contiguous(slope)

    conditions: Any = [
        {"type": kind, "fun": _contiguous_of(margin), "jac": _contiguous_of(slope)}
        for kind, margin, slope in constraints
    ]
    told: Any = {"method": method, "options": dict(options), "bounds": list(bounds)}
    if conditions:
        told["constraints"] = conditions
    with one_thread():  # of a few numbers at a time; several would wait for each other
        return minimize(both, contiguous(z), jac=True, **told)


def least_squares(
    residual: Callable[[Array], ArrayLike],
    z: ArrayLike,
    slope: Callable[[Array], ArrayLike],
    **options: Any,  # noqa: ANN401 - SciPy's own
) -> Any:  # noqa: ANN401 - SciPy's OptimizeResult
    """Run `scipy.optimize.least_squares` on residuals and their Jacobian."""
    from scipy import optimize

    with one_thread():
        return optimize.least_squares(
            _contiguous_of(residual), contiguous(z), _contiguous_of(slope), **options
        )


def _contiguous_of(function: Callable[[Array], ArrayLike]) -> Callable[[Array], Array]:
    return lambda z: contiguous(function(z))
