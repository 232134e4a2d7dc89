"""Exact derivatives of an equilibrium by whatever acts on it.

An equilibrium solves r(x, θ) = f − p = 0, so dx/dθ = −K⁻¹ ∂r/∂θ, (D1), with the tangent stiffness K that
the solver has at hand. Forward mode costs one solve a parameter, adjoint mode (D3) one solve an output.
The derivative is that of the branch: it ends where the branch ends, and where a cable is just going
slack it holds on one side.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics.arrays import AXES, FloatArray, StructureArrays, lumped_weight
from tensegra.mechanics.inputs import Actuation, Inputs, Load, effective_rest_length
from tensegra.mechanics.law import plain
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Structure

ParameterKind = Literal[
    "actuation", "temperature", "rest_length", "stiffness", "youngs_modulus", "area", "load", "position"
]


@dataclass(frozen=True, eq=False)
class Direction:
    """How what acts on the structure changes with one parameter.

    Attributes
    ----------
    rest_length, stiffness
        Rates of the effective rest lengths and of EA, shape ``(n_members,)``.
    force, positions
        Rates of the nodal forces and of the supports' coordinates, shape ``(n_nodes, 3)``.
    """

    rest_length: FloatArray
    stiffness: FloatArray
    force: FloatArray
    positions: FloatArray

    def of_run(self, run: int) -> "Direction":
        """Return the direction of one of many runs, whose arrays may have a leading axis."""
        columns = {}
        for name, n_axes in (("rest_length", 1), ("stiffness", 1), ("force", 2), ("positions", 2)):
            values = getattr(self, name)
            columns[name] = values if values.ndim == n_axes else values[run if len(values) > 1 else 0]
        return Direction(**columns)


@dataclass(frozen=True, eq=False)
class Derivative:
    """Rates of an equilibrium with one parameter.

    Attributes
    ----------
    nodes
        Of the positions, shape ``(n_nodes, 3)``.
    tensions
        Of the tensions, shape ``(n_members,)``.
    """

    nodes: FloatArray
    tensions: FloatArray


def settle_tangent(tangent: Tangent, nodes: FloatArray, load: Load) -> None:
    """Measure and factorise at an equilibrium, as `differentiate` and `pull_back` need it.

    Raises
    ------
    SolverError
        Where there is no equilibrium to differentiate.
    """
    if not np.all(np.isfinite(nodes)):
        raise SolverError("a failed run has no derivative")
    tangent.measure(nodes, load)
    tangent.factorise()


def differentiate(tangent: Tangent, load: Load, direction: Direction) -> Derivative:
    """Differentiate the equilibrium last measured and factorised along a direction (forward mode)."""
    free = tangent.arrays.free
    held = np.where(free, 0.0, direction.positions)
    tension_rate = _tension_rate(tangent, load, direction)
    out_rate = tangent.force_rate(held, tension_rate) - direction.force
    nodes = tangent.solve(-out_rate) + held
    # One correction with the same factor removes what rounding left in a stiff solve.
    nodes = nodes - tangent.solve(tangent.force_rate(nodes, tension_rate) - direction.force)
    return Derivative(nodes, tangent.axial * tangent.length_rate(nodes) + tension_rate)


def pull_back(tangent: Tangent, load: Load, by_nodes: FloatArray, by_tensions: FloatArray) -> Direction:
    """Return the gradient of an output by everything that acts (adjoint mode).

    Parameters
    ----------
    tangent
        Measured and factorised at the equilibrium.
    load
        What acts there.
    by_nodes, by_tensions
        Derivatives of the output by positions, ``(n_nodes, 3)``, and tensions, ``(n_members,)``.

    Returns
    -------
    Direction
        Derivatives of the output by each effective rest length, stiffness, force and support
        coordinate.
    """
    free = tangent.arrays.free
    at_rest = np.zeros_like(by_nodes)
    by_motion = by_nodes + tangent.force_rate(at_rest, tangent.axial * by_tensions)
    adjoint = tangent.solve(by_motion)
    adjoint = adjoint + tangent.solve(by_motion - tangent.force_rate(adjoint))
    by_tension_rate = np.where(tangent.taut, by_tensions - tangent.length_rate(adjoint), 0.0)
    return Direction(
        rest_length=plain.by_rest_length(tangent.length, load.rest_length, load.stiffness) * by_tension_rate,
        stiffness=plain.by_stiffness(tangent.length, load.rest_length) * by_tension_rate,
        force=np.where(free, adjoint, 0.0),
        positions=np.where(free, 0.0, by_motion - tangent.force_rate(adjoint)),
    )


def _tension_rate(tangent: Tangent, load: Load, direction: Direction) -> FloatArray:
    """Rate of the tensions where the nodes stay; zero for slack cables."""
    rate: FloatArray = tangent.taut * (
        plain.by_stiffness(tangent.length, load.rest_length) * direction.stiffness
        + plain.by_rest_length(tangent.length, load.rest_length, load.stiffness) * direction.rest_length
    )
    return rate


@dataclass(frozen=True, eq=False)
class Given:
    """An equilibrium's side of the derivative: the structure, its inputs and the run's own values."""

    structure: Structure
    arrays: StructureArrays
    inputs: Inputs
    run: Actuation

    def nothing(self) -> Direction:
        """Return the direction in which nothing changes, the same for all runs."""
        members, nodes = self.arrays.n_members, (self.arrays.n_nodes, 3)
        return Direction(np.zeros(members), np.zeros(members), np.zeros(nodes), np.zeros(nodes))

    def along_rest_length(self, rows: Sequence[int], rates: FloatArray) -> Direction:
        """Return the direction in which the rest lengths of some members change, run by run.

        Parameters
        ----------
        rows
            Places of the members.
        rates
            Of their effective rest lengths, shape ``(…, len(rows))``.
        """
        rest_length = np.zeros((*rates.shape[:-1], self.arrays.n_members))
        rest_length[..., rows] = rates
        return replace(self.nothing(), rest_length=rest_length)

    def known(self, name: object, names: Mapping[str, object], what: str) -> str:
        """Return `name` as text, or raise `ModelError` where it is not among `names`."""
        if str(name) not in names:
            raise ModelError.at("derivative", name, what, candidates=names)
        return str(name)


def direction_of(given: Given, kind: ParameterKind, name: object) -> Direction:
    """Return how the inputs at an equilibrium change with one parameter.

    Parameters
    ----------
    given
        The structure and its inputs at the equilibrium.
    kind, name
        Which parameter: an actuator (actuation); a member or group (temperature, area); a member
        (rest_length before the stages, stiffness); a material (youngs_modulus); a (node, axis)
        (load, position).

    Raises
    ------
    ModelError
        For a kind or a name that there is not.
    """
    if kind not in _DIRECTIONS:
        raise ModelError.at("derivative", kind, "a kind of parameter", candidates=_DIRECTIONS)
    return _DIRECTIONS[kind](given, name)


def _by_actuation(given: Given, name: object) -> Direction:
    actuator = given.structure.actuators[given.known(name, given.structure.actuators, "an actuator")]
    factor = np.asarray(actuator.factor(given.run.actuation.get(str(name), 0.0)))  # type: ignore[arg-type]
    slope = actuator.factor(1.0) - actuator.factor(0.0)
    rows = [given.arrays.member_index[member] for member in actuator.members]
    rest_length = effective_rest_length(given.arrays, given.inputs)[..., rows]
    return given.along_rest_length(rows, rest_length * slope / factor[..., None])


def _by_temperature(given: Given, name: object) -> Direction:
    rows = [given.arrays.member_index[member] for member in given.structure.members_named(str(name))]
    alpha = given.arrays.thermal_expansion[rows]
    return given.along_rest_length(rows, given.inputs.rest_length[..., rows] * alpha)


def _by_rest_length(given: Given, name: object) -> Direction:
    member = given.known(name, given.structure.members, "a member")
    if any(member in stage.rest_lengths for stage in given.structure.stages):
        return given.nothing()
    rows = [given.arrays.member_index[member]]
    rest_length = effective_rest_length(given.arrays, given.inputs)
    return given.along_rest_length(rows, rest_length[..., rows] / given.arrays.rest_length[..., rows])


def _by_stiffness(given: Given, name: object) -> Direction:
    direction = given.nothing()
    direction.stiffness[given.arrays.member_index[given.known(name, given.structure.members, "a member")]] = (
        1.0
    )
    return direction


def _by_youngs_modulus(given: Given, name: object) -> Direction:
    material = given.known(name, given.structure.materials, "a material")
    modulus = given.structure.materials[material].youngs_modulus
    direction = given.nothing()
    for row, member in enumerate(given.structure.members.values()):
        if member.material == material and member.area is not None:
            direction.stiffness[..., row] = given.arrays.stiffness[..., row] / modulus
    return direction


def _by_area(given: Given, name: object) -> Direction:
    direction = given.nothing()
    for member in given.structure.members_named(str(name)):
        area = given.structure.members[member].area
        if area is None:
            raise ModelError.at("derivative", name, "members with an area")
        row = given.arrays.member_index[member]
        direction.stiffness[..., row] = given.arrays.stiffness[..., row] / area
        weight = np.zeros(given.arrays.n_members)
        weight[row] = given.structure.weight_per_length(member)
        nodal = lumped_weight(given.arrays, weight)
        direction.force[...] += nodal[:, None] * given.inputs.gravity / area
    return direction


def _by_load(given: Given, name: object) -> Direction:
    direction = given.nothing()
    direction.force[..., *_coordinate(given, name)] = 1.0
    return direction


def _by_position(given: Given, name: object) -> Direction:
    direction = given.nothing()
    direction.positions[..., *_coordinate(given, name)] = 1.0
    return direction


_DIRECTIONS: dict[str, Callable[[Given, object], Direction]] = {
    "actuation": _by_actuation,
    "temperature": _by_temperature,
    "rest_length": _by_rest_length,
    "stiffness": _by_stiffness,
    "youngs_modulus": _by_youngs_modulus,
    "area": _by_area,
    "load": _by_load,
    "position": _by_position,
}


def _coordinate(given: Given, name: object) -> tuple[int, int]:
    if not (isinstance(name, tuple) and len(name) == 2 and str(name[1]) in tuple(AXES)):
        raise ModelError.at("derivative", name, "a pair of a node and an axis, such as ('9', 'z')")
    node = given.known(name[0], given.structure.nodes, "a node")
    return given.arrays.node_index[node], AXES.index(str(name[1]))
