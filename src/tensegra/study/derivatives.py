"""Derivatives of the outputs by the variables, exact, from the solver's own factorisation."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.structure import Structure
from tensegra.study.outputs import Output
from tensegra.study.variables import Coordinate, Prestress, Variable

if TYPE_CHECKING:
    from tensegra.mechanics import Batch
    from tensegra.mechanics.derivatives import ParameterKind

__all__ = ["DIFFERENTIABLE", "derivative_name", "output_derivatives", "parameters_along"]

Array: TypeAlias = NDArray[np.float64]

DIFFERENTIABLE = ("displacement", "coordinate", "distance", "tension", "reaction")
"""Quantities whose outputs have derivatives; the others have kinks, or jump."""

BEFORE_STAGES = ("youngs_modulus", "area", "rest_length", "rest_length_error", "prestress")
"""Quantities that move the equilibrium from which displacements are measured, too."""


def derivative_name(output: str, variable: str) -> str:
    """Return the name of the column that holds the derivative of an output by a variable.

    Examples
    --------
    >>> derivative_name("w", "A14")
    'dw/dA14'
    """
    return f"d{output}/d{variable}"


@dataclass(frozen=True, eq=False)
class Rates:
    """Rates of solved runs with one variable; batch axis first.

    Attributes
    ----------
    nodes, start, tensions
        Of the positions, of those from which displacements are measured, and of the tensions.
    loads
        Of the nodal forces, weight included; none unless an output is a reaction.
    """

    nodes: Array
    start: Array
    tensions: Array
    loads: Array


def output_derivatives(
    variables: Sequence[Variable],
    outputs: Sequence[Output],
    runs: "Batch",
    X: Array,
    arguments: Mapping[str, Mapping[Any, Array]],
    solve: "Callable[..., Batch]",
) -> Array:
    """Return the derivatives of outputs by variables.

    Parameters
    ----------
    variables, outputs
        What to differentiate by, and what.
    runs
        The solved runs.
    X
        Their design points, shape (n_runs, n_inputs).
    arguments
        The arguments of `solve_batch` that gave the runs.
    solve
        The solver that gave them; it solves the stages once more where a variable acts before them,
        since displacements are measured from their end.

    Returns
    -------
    ndarray
        Shape (n_runs, n_outputs, n_inputs), in units of output per unit of variable. NaN where a run
        has no stable equilibrium, and for outputs that are not `DIFFERENTIABLE`.
    """
    before = {
        name: arguments[name] for name in ("youngs_modulus", "area", "rest_length") if name in arguments
    }
    measured = any(output.quantity == "displacement" for output in outputs)
    starts = None
    if before and measured:
        early = [variable for variable in variables if variable.quantity in BEFORE_STAGES]
        starts = solve(
            runs.structure, **before, derivatives=parameters_along(runs.structure, early, arguments)
        )
    values = np.full((len(X), len(outputs), len(variables)), np.nan)
    loaded = any(output.quantity == "reaction" for output in outputs)
    for j, (variable, column) in enumerate(zip(variables, X.T, strict=True)):
        moves_start = variable.quantity in BEFORE_STAGES
        rates = _rates(variable, column, runs, starts if moves_start else None, arguments, loaded=loaded)
        for i, output in enumerate(outputs):
            if output.quantity in DIFFERENTIABLE:
                values[:, i, j] = _CHAINS[output.quantity](output, runs, rates)
    return values


def parameters_along(
    structure: Structure, variables: Sequence[Variable], arguments: Mapping[str, Mapping[Any, Array]]
) -> "list[tuple[ParameterKind, object]]":
    """Return what `solve_batch` can differentiate by while it solves, of all that variables set.

    The rest is differentiated on demand, at the price of one more certificate for each parameter.
    """
    # Compiled kernels, imported where they are first needed.
    from tensegra.mechanics.block import LOCKSTEP_KINDS

    wanted = {
        (kind, name): None
        for variable in variables
        for kind, name, _ in _parameters(structure, variable, arguments.get("rest_length", {}))
        if kind in LOCKSTEP_KINDS
    }
    return list(wanted)


def _rates(
    variable: Variable,
    column: Array,
    runs: "Batch",
    starts: "Batch | None",
    arguments: Mapping[str, Mapping[Any, Array]],
    *,
    loaded: bool,
) -> Rates:
    """Return the rates with one variable: those with the parameters it sets, weighted by the chain rule."""
    nodes, start, loads = (np.zeros_like(runs.nodes) for _ in range(3))
    total = Rates(nodes, start, np.zeros_like(runs.tensions), loads)
    for kind, name, weight in _parameters(runs.structure, variable, arguments.get("rest_length", {})):
        by = runs.derivative(name, kind)
        weighted = np.broadcast_to(weight(column), runs.n_runs)
        total.nodes[...] += weighted[:, None, None] * by.nodes
        total.tensions[...] += weighted[:, None] * by.tensions
        if loaded:
            total.loads[...] += weighted[:, None, None] * _load_rates(runs, kind, name)
        if starts is not None:
            total.start[...] += weighted[:, None, None] * starts.derivative(name, kind).nodes
    return total


def _load_rates(runs: "Batch", kind: "ParameterKind", name: object) -> Array:
    """Return the rates of the nodal forces with one parameter of the solver, (n_nodes, 3)."""
    from tensegra.mechanics.endloads import end_load_rates

    return end_load_rates(runs.structure, kind, name)


def _parameters(
    structure: Structure, variable: Variable, rest_length: Mapping[Any, Array]
) -> "list[tuple[ParameterKind, object, Callable[[Array], Array | float]]]":
    """Return the solver's parameters that a variable sets: kind, name, and their rate with its values.

    With a prestress c and an error e a rest length starts at l = l₀ (1 + e) (1 + c)/(1 + c₀), so
    ∂l/∂c = l/(1 + c), ∂l/∂e = l/(1 + e) and ∂l/∂l₀ = l/l₀.
    """
    target = variable.target
    if isinstance(target, Prestress):
        return [("rest_length", member, _per(rest_length[member], 1.0)) for member in target.members]
    if variable.quantity == "rest_length_error":
        members = structure.members_named(str(target))
        return [("rest_length", member, _per(rest_length[member], 1.0)) for member in members]
    if variable.quantity == "rest_length":
        return [("rest_length", target, _per(rest_length[target], 0.0))]
    name = (target.node, target.axis) if isinstance(target, Coordinate) else target
    return [(_KINDS[variable.quantity], name, lambda _: 1.0)]


def _per(length: Array, offset: float) -> "Callable[[Array], Array]":
    return lambda values: length / (offset + values)


_KINDS: "dict[str, ParameterKind]" = {
    "actuator": "actuation",
    "temperature": "temperature",
    "youngs_modulus": "youngs_modulus",
    "area": "area",
    "load": "load",
    "position": "position",
}


def _mean(output: Output, runs: "Batch", nodes: Array) -> Array:
    rows = [runs.node_ids.index(node) for node in output.nodes]
    return np.asarray(nodes[:, rows, "xyz".index(output.target)].mean(axis=1))


def _distance(output: Output, runs: "Batch", rates: Rates) -> Array:
    first, second = (runs.node_ids.index(node) for node in output.nodes)
    along = runs.nodes[:, second] - runs.nodes[:, first]
    apart = np.linalg.norm(along, axis=1)
    moved = np.einsum("ni,ni->n", along, rates.nodes[:, second] - rates.nodes[:, first])
    return np.asarray(np.divide(moved, apart, out=np.full(len(apart), np.nan), where=apart > 0.0))


def _reaction(output: Output, runs: "Batch", rates: Rates) -> Array:
    from tensegra.mechanics.arrays import structure_arrays
    from tensegra.mechanics.reactions import reaction_rates

    by_node = reaction_rates(
        structure_arrays(runs.structure),
        runs.nodes,
        runs.tensions,
        node_rates=rates.nodes,
        tension_rates=rates.tensions,
        load_rates=rates.loads,
    )
    rows = [runs.node_ids.index(node) for node in output.nodes]
    return np.asarray(by_node[:, rows, "xyz".index(output.target)].sum(axis=1))


_CHAINS: "dict[str, Callable[[Output, Batch, Rates], Array]]" = {
    "displacement": lambda output, runs, rates: _mean(output, runs, rates.nodes - rates.start),
    "coordinate": lambda output, runs, rates: _mean(output, runs, rates.nodes),
    "distance": _distance,
    "reaction": _reaction,
    "tension": lambda output, runs, rates: rates.tensions[
        :, [runs.member_ids.index(member) for member in output.members]
    ].mean(axis=1),
}
"""How the rate of each quantity follows from those of positions and tensions."""
