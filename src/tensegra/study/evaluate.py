"""From design points to outputs: one call of the batch solver, its answers as flat arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.structure import Structure
from tensegra.study.derivatives import output_derivatives, parameters_along
from tensegra.study.outputs import Output
from tensegra.study.solver import Solver, SolverEntry
from tensegra.study.variables import Coordinate, Prestress, Variable

__all__ = ["Runs", "Solver", "batch_inputs", "evaluate"]

Array: TypeAlias = NDArray[np.float64]

_ARGUMENTS = {"actuator": "actuation", "load": "loads", "position": "positions"}
"""Arguments of `solve_batch` that are not called like the quantity they take."""


@dataclass(frozen=True, eq=False)
class Runs:
    """Solved design points.

    Attributes
    ----------
    X
        Inputs, shape (n_runs, n_inputs).
    Y
        Outputs, shape (n_runs, n_outputs), NaN where a run has none.
    status, reason
        What the solver says of each run, shape (n_runs,); the reason is ``""`` if there is none.
    residual, lowest_eigenvalue
        Of each equilibrium, shape (n_runs,), NaN where there is none.
    steps, iterations
        What each path took, shape (n_runs,).
    seconds
        Solver time of each run, shape (n_runs,).
    dY
        Derivatives of the outputs by the inputs, shape (n_runs, n_outputs, n_inputs), NaN where there
        is none; None if they were not asked for.
    """

    X: Array
    Y: Array
    status: NDArray[np.str_]
    reason: NDArray[np.str_]
    residual: Array
    lowest_eigenvalue: Array
    steps: NDArray[np.int32]
    iterations: NDArray[np.int32]
    seconds: Array
    dY: Array | None = None  # noqa: N815 - the derivative of Y, as in mathematics

    def __len__(self) -> int:
        return len(self.X)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Whether a run found no equilibrium, shape (n_runs,)."""
        return np.asarray(self.status == "failed", dtype=np.bool_)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether a run has all its outputs, shape (n_runs,)."""
        return np.asarray(np.isfinite(self.Y).all(axis=1), dtype=np.bool_)


def evaluate(
    structure: Structure,
    variables: Sequence[Variable],
    outputs: Sequence[Output],
    X: ArrayLike,
    *,
    derivatives: bool = False,
    solver: Solver | None = None,
) -> Runs:
    """Solve the structure at design points.

    Parameters
    ----------
    structure
        The structure, changes applied.
    variables
        What the columns of `X` act on.
    outputs
        What is wanted of each run.
    X
        Design points, shape (n_points, len(variables)), in the variables' units.
    derivatives
        Whether to differentiate the outputs by the variables, exactly.
    solver
        `tensegra.mechanics.solve_batch` with its own settings if left out.

    Returns
    -------
    Runs
        In the order of the points. A numerical failure is a status, not an exception.

    Raises
    ------
    StudyError
        If `X` has the wrong shape or a number that is not finite.
    """
    X = np.ascontiguousarray(X, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != len(variables):
        raise StudyError.at("design points: shape", X.shape, f"a row per point, {len(variables)} columns")
    if not np.isfinite(X).all():
        row, column = np.argwhere(~np.isfinite(X))[0]
        place = f"design points: row {row}, {variables[column].name}"
        raise StudyError.at(place, float(X[row, column]), "a finite number")
    solve = solver or SolverEntry().solver()
    arguments = batch_inputs(structure, variables, X)
    along = {"derivatives": parameters_along(structure, variables, arguments)} if derivatives else {}
    runs = solve(structure, **arguments, **along)
    status = np.asarray(runs.status, dtype=np.str_)
    failed = status == "failed"
    return Runs(
        X=X,
        Y=np.stack([np.where(failed, np.nan, output.of(runs)) for output in outputs], axis=1),
        status=status,
        reason=np.where(runs.beyond_law, _beyond(runs.reason), np.asarray(runs.reason, dtype=np.str_)),
        residual=np.where(failed, np.nan, runs.residual),
        lowest_eigenvalue=np.where(failed, np.nan, runs.lowest_eigenvalue),
        steps=np.asarray(runs.steps, dtype=np.int32),
        iterations=np.asarray(runs.iterations, dtype=np.int32),
        seconds=np.asarray(runs.seconds, dtype=np.float64),
        dY=output_derivatives(variables, outputs, runs, X, arguments, solve) if derivatives else None,
    )


BEYOND_LAW = "strained beyond what the linear law holds for"


def _beyond(reasons: NDArray[Any]) -> NDArray[np.str_]:
    """Return the reasons with what is said of runs beyond the law, in front, where reasons are counted."""
    return np.array([f"{BEYOND_LAW}; {reason}" if reason else BEYOND_LAW for reason in reasons], np.str_)


def batch_inputs(
    structure: Structure, variables: Sequence[Variable], X: Array
) -> dict[str, dict[Any, Array]]:
    """Return the arguments of `solve_batch` that set the variables to the columns of `X`.

    A prestress is set through the rest lengths from which the history starts: where a stage changes a
    member by c₀, the value c has the same effect after it as a rest length of l₀ (1 + c)/(1 + c₀)
    before it. A relative error multiplies the rest length by 1 + e there, too.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> from tensegra.study.distributions import as_distribution
    >>> a14 = Variable("a", "actuator", "A14", as_distribution({"uniform": [0.0, 0.1]}))
    >>> batch_inputs(library.paper_beam(), [a14], np.array([[0.05], [0.1]]))
    {'actuation': {'A14': array([0.05, 0.1 ])}}
    """
    arguments: dict[str, dict[Any, Array]] = {}
    factors: list[tuple[str, Array]] = []
    changes: Mapping[str, Mapping[str, float]] = {
        stage.name: stage.rest_length_changes for stage in structure.stages
    }
    for variable, column in zip(variables, X.T, strict=True):
        values = np.ascontiguousarray(column)
        target = variable.target
        if isinstance(target, Prestress):
            own = changes[target.stage]
            factors += [(member, (1.0 + values) / (1.0 + own[member])) for member in target.members]
            continue
        if variable.quantity == "rest_length_error":
            factors += [(member, 1.0 + values) for member in structure.members_named(str(target))]
            continue
        key = (target.node, target.axis) if isinstance(target, Coordinate) else target
        arguments.setdefault(_ARGUMENTS.get(variable.quantity, variable.quantity), {})[key] = values
    if factors:
        lengths = arguments.setdefault("rest_length", {})
        for member, factor in factors:
            lengths[member] = factor * lengths.get(member, structure.members[member].rest_length)
    return arguments
