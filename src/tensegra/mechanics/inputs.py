"""What acts on a structure, and how it changes along a stage.

All arrays may have leading axes for many runs at once: where a shape says ``(n_members,)``, an
array of ``(n_runs, n_members)`` serves as well.

`Inputs` holds the state of all that can be prescribed; `StageInputs` is the way from one state to
the next, a function of the path parameter λ in [0, 1]. All inputs of a stage go from their old to
their new values in proportion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import comb
from typing import Any

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import AXES, FloatArray, StructureArrays
from tensegra.structure import Actuator, Stage, Structure


@dataclass(frozen=True, eq=False)
class Inputs:
    """The prescribed quantities of one state.

    Attributes
    ----------
    rest_length
        Mechanical rest lengths (without thermal strain), shape ``(n_members,)``.
    temperature
        Differences from the stress-free state, shape ``(n_members,)``.
    loads
        Nodal forces without the weight, shape ``(n_nodes, 3)``.
    gravity
        Factor on the members' weights, shape ``(3,)``.
    positions
        Coordinates at which supports hold, shape ``(n_nodes, 3)``; free coordinates are not read.
    """

    rest_length: FloatArray
    temperature: FloatArray
    loads: FloatArray
    gravity: FloatArray
    positions: FloatArray


def initial_inputs(arrays: StructureArrays) -> Inputs:
    """Return the inputs before the first stage: nothing but the rest lengths acts."""
    return Inputs(
        rest_length=arrays.rest_length.copy(),
        temperature=np.zeros(arrays.n_members),
        loads=np.zeros((arrays.n_nodes, 3)),
        gravity=np.zeros(3),
        positions=arrays.coordinates.copy(),
    )


def inputs_after_stage(structure: Structure, arrays: StructureArrays, before: Inputs, stage: Stage) -> Inputs:
    """Return the inputs at the end of `stage`; what it does not name stays as it was."""
    rest_length = before.rest_length.copy()
    for member, change in stage.rest_length_changes.items():
        rest_length[..., arrays.member_index[member]] *= 1.0 + change
    for member, value in stage.rest_lengths.items():
        rest_length[..., arrays.member_index[member]] = value
    loads = before.loads.copy()
    for node, force in stage.loads.items():
        loads[arrays.node_index[node]] = force
    positions = before.positions.copy()
    for node, position in stage.positions.items():
        positions[arrays.node_index[node]] = np.asarray(position) - arrays.origin
    return Inputs(
        rest_length=rest_length,
        temperature=_with_temperatures(structure, arrays, before.temperature, stage.temperatures),
        loads=loads,
        gravity=before.gravity if stage.gravity is None else np.array(stage.gravity, dtype=np.float64),
        positions=positions,
    )


def _with_temperatures(
    structure: Structure, arrays: StructureArrays, before: FloatArray, temperatures: Mapping[str, float]
) -> FloatArray:
    temperature = before.copy()
    for name, value in temperatures.items():
        for member in structure.members_named(name):
            temperature[arrays.member_index[member]] = value
    return temperature


def effective_rest_length(arrays: StructureArrays, inputs: Inputs) -> FloatArray:
    """Return the rest lengths with thermal strain, l₀ (1 + α ΔT), shape ``(n_members,)``."""
    return inputs.rest_length * (1.0 + arrays.thermal_expansion * inputs.temperature)


def nodal_forces(arrays: StructureArrays, inputs: Inputs) -> FloatArray:
    """Return loads and weights together, shape ``(n_nodes, 3)``."""
    return inputs.loads + arrays.nodal_weight[..., None] * inputs.gravity


@dataclass(frozen=True, eq=False)
class Load:
    """What holds still while an equilibrium is sought.

    Attributes
    ----------
    rest_length, stiffness
        Effective rest lengths and EA, shape ``(n_members,)``.
    force
        Nodal forces, weight included, shape ``(n_nodes, 3)``.
    tolerance
        Relative residual of an equilibrium.
    """

    rest_length: FloatArray
    stiffness: FloatArray
    force: FloatArray
    tolerance: float = 1e-9


@dataclass(frozen=True, eq=False)
class StageInputs:
    """All inputs along one stage, as functions of the path parameter λ in [0, 1].

    Attributes
    ----------
    rest_length
        Coefficients c of the effective rest length Σ c[:, k] λᵏ, thermal strain included,
        shape ``(n_members, degree + 1)``.
    loads_start, loads_end
        Nodal forces, weight included, at λ = 0 and 1, shape ``(n_nodes, 3)``.
    positions_start, positions_end
        Coordinates of the supports at λ = 0 and 1, shape ``(n_nodes, 3)``.
    """

    rest_length: FloatArray
    loads_start: FloatArray
    loads_end: FloatArray
    positions_start: FloatArray
    positions_end: FloatArray

    def rest_length_at(self, parameter: float) -> FloatArray:
        """Return the effective rest lengths at the path parameter, shape ``(n_members,)``."""
        value = self.rest_length[..., -1]
        for power in range(self.rest_length.shape[-1] - 2, -1, -1):
            value = value * parameter + self.rest_length[..., power]  # Horner, as lockstep does
        return value

    def rest_length_rate(self, parameter: float) -> FloatArray:
        """Return d l₀/dλ at the path parameter, shape ``(n_members,)``."""
        exponents = np.arange(1, self.rest_length.shape[-1])
        return self.rest_length[..., 1:] @ (exponents * parameter ** (exponents - 1))

    def loads_at(self, parameter: float) -> FloatArray:
        """Return the nodal forces at the path parameter, shape ``(n_nodes, 3)``."""
        return self.loads_start + parameter * (self.loads_end - self.loads_start)

    def positions_at(self, parameter: float) -> FloatArray:
        """Return the coordinates of the supports at the path parameter, shape ``(n_nodes, 3)``."""
        return self.positions_start + parameter * (self.positions_end - self.positions_start)

    def between(self, start: float, end: float) -> "StageInputs":
        """Return the part of the stage from one value of λ to another, as a stage of its own."""
        width, powers = end - start, self.rest_length.shape[-1]
        rest_length = np.zeros_like(self.rest_length)
        for k in range(powers):
            for j in range(k + 1):
                share = comb(k, j) * start ** (k - j) * width**j
                rest_length[..., j] += share * self.rest_length[..., k]
        return StageInputs(
            rest_length,
            self.loads_at(start),
            self.loads_at(end),
            self.positions_at(start),
            self.positions_at(end),
        )

    def of_run(self, run: int) -> "StageInputs":
        """Return the stage of one of many runs."""
        rows = []
        for values, n_axes in zip(
            (self.rest_length, self.loads_start, self.loads_end, self.positions_start, self.positions_end),
            (2, 2, 2, 2, 2),
            strict=True,
        ):
            rows.append(values if values.ndim == n_axes else values[run if len(values) > 1 else 0])
        return StageInputs(*rows)

    def balanced_by(self, force: FloatArray) -> "StageInputs":
        """Return the same stage with `force` acting at its beginning and fading to nothing."""
        return replace(self, loads_start=self.loads_start + force)


def stage_inputs(arrays: StructureArrays, before: Inputs, after: Inputs) -> StageInputs:
    """Join two states: rest lengths, temperatures, loads and positions change in proportion to λ."""
    strain = 1.0 + arrays.thermal_expansion * before.temperature
    strain_rate = arrays.thermal_expansion * (after.temperature - before.temperature)
    length, length_rate = before.rest_length, after.rest_length - before.rest_length
    by_power = [length * strain, length * strain_rate + length_rate * strain, length_rate * strain_rate]
    return _stage(arrays, before, after, np.stack(by_power, axis=-1))


def _stage(arrays: StructureArrays, before: Inputs, after: Inputs, rest_length: FloatArray) -> StageInputs:
    return StageInputs(
        rest_length=rest_length,
        loads_start=nodal_forces(arrays, before),
        loads_end=nodal_forces(arrays, after),
        positions_start=before.positions,
        positions_end=after.positions,
    )


Values = float | FloatArray


@dataclass(frozen=True)
class Actuation:
    """What acts after the stages: the inputs of one run, or of many.

    Every value is a number, or an array ``(n_runs,)``.

    Attributes
    ----------
    actuation
        Value of each actuator named, relative change of rest length.
    temperature
        Change of temperature of a member or a group, added to that of the stages; where a group and
        its member are named, the member takes the sum.
    loads
        Forces added to those of the last stage, by (node, axis).
    positions
        Shift of a supported coordinate, by (node, axis).
    """

    actuation: Mapping[str, Values]
    temperature: Mapping[str, Values]
    loads: Mapping[tuple[str, str], Values]
    positions: Mapping[tuple[str, str], Values]

    @property
    def acts(self) -> bool:
        """Whether anything acts after the stages."""
        return any(self.groups())

    def groups(self) -> tuple[Mapping[Any, Values], ...]:
        """Return the four mappings, in the order of the attributes."""
        return self.actuation, self.temperature, self.loads, self.positions


def actuation_inputs(
    structure: Structure, arrays: StructureArrays, before: Inputs, run: Actuation
) -> tuple[StageInputs, Inputs]:
    """Return the way from the last stage's inputs to those of a run, and the inputs at its end.

    Actuators that share a member multiply, so the rest length is a polynomial in λ.

    Raises
    ------
    ModelError
        For an unknown actuator, member, group, node or axis, a value that leaves no rest length,
        or a shift of a coordinate that is not supported.
    """
    polynomials = _scaled(structure, arrays, before, run.actuation)
    after = _after(structure, arrays, before, run, polynomials)
    strain = 1.0 + arrays.thermal_expansion * before.temperature
    rate = arrays.thermal_expansion * (after.temperature - before.temperature)
    still = polynomials * strain[..., None]
    growing = polynomials * rate[..., None]
    rest_length = np.zeros((*growing.shape[:-1], growing.shape[-1] + 1))
    rest_length[..., :-1] += still
    rest_length[..., 1:] += growing
    return _stage(arrays, before, after, rest_length), after


def inputs_under(structure: Structure, arrays: StructureArrays, before: Inputs, run: Actuation) -> Inputs:
    """Return the inputs at the end of the way that `actuation_inputs` describes."""
    return _after(structure, arrays, before, run, _scaled(structure, arrays, before, run.actuation))


def _after(
    structure: Structure, arrays: StructureArrays, before: Inputs, run: Actuation, polynomials: FloatArray
) -> Inputs:
    temperature = before.temperature
    if run.temperature:
        temperature = temperature + np.zeros((*_runs(run), arrays.n_members))
        for name, value in run.temperature.items():
            for member in structure.members_named(name):
                at = arrays.member_index[member]
                temperature[..., at] += np.asarray(_finite(value, f"temperature {name}"))
    if not np.all(1.0 + arrays.thermal_expansion * temperature > 0.0):
        raise ModelError.at("temperature", dict(run.temperature), "temperatures that leave a rest length")
    loads, positions = before.loads, before.positions
    if run.loads:
        loads = loads + _by_coordinate(structure, arrays, run.loads, "load")
    if run.positions:
        positions = positions + _support_shift(structure, arrays, run.positions)
    return Inputs(
        rest_length=polynomials.sum(axis=-1),
        temperature=temperature,
        loads=loads,
        gravity=before.gravity,
        positions=positions,
    )


def _runs(run: Actuation) -> tuple[int, ...]:
    """Return the leading shape of a run's values: nothing, or the number of runs."""
    return np.broadcast_shapes(*(np.shape(value) for group in run.groups() for value in group.values()))


def _scaled(
    structure: Structure, arrays: StructureArrays, before: Inputs, actuation: Mapping[str, Values]
) -> FloatArray:
    """Return the mechanical rest lengths as polynomials in λ, ``(…, n_members, degree + 1)``."""
    degrees = np.zeros(arrays.n_members, dtype=np.int64)
    for name in actuation:
        degrees[[arrays.member_index[member] for member in _actuator(structure, name).members]] += 1
    runs = np.broadcast_shapes(before.rest_length.shape[:-1], *(np.shape(v) for v in actuation.values()))
    polynomials = np.zeros((*runs, arrays.n_members, int(degrees.max(initial=0)) + 1))
    polynomials[..., 0] = before.rest_length
    for name, value in actuation.items():
        actuator = _actuator(structure, name)
        rate = np.asarray(actuator.factor(np.asarray(value, dtype=np.float64))) - 1.0  # type: ignore[arg-type]
        if not np.all(rate > -1.0) or not np.all(np.isfinite(rate)):
            raise ModelError.at(f"actuation {name}", value, "a value that leaves a rest length")
        rows = [arrays.member_index[member] for member in actuator.members]
        taken = polynomials[..., rows, :]
        taken[..., 1:] += rate[..., None, None] * taken[..., :-1]
        polynomials[..., rows, :] = taken
    return polynomials


def _actuator(structure: Structure, name: str) -> Actuator:
    try:
        return structure.actuators[name]
    except KeyError:
        raise ModelError.at("actuation", name, "an actuator", candidates=structure.actuators) from None


def _finite(value: Values, place: str) -> Values:
    if not np.all(np.isfinite(value)):
        raise ModelError.at(place, value, "finite numbers")
    return value


def _by_coordinate(
    structure: Structure, arrays: StructureArrays, values: Mapping[tuple[str, str], Values], place: str
) -> FloatArray:
    runs = np.broadcast_shapes(*(np.shape(value) for value in values.values()))
    field = np.zeros((*runs, arrays.n_nodes, 3))
    for (name, axis), value in values.items():
        node = str(name)
        if node not in arrays.node_index:
            raise ModelError.at(place, node, "a node", candidates=structure.nodes)
        if axis not in tuple(AXES):
            raise ModelError.at(f"{place} on {node}", axis, "an axis: x, y or z")
        at = arrays.node_index[node], AXES.index(axis)
        field[..., *at] += np.asarray(_finite(value, f"{place} on {node}"))
    return field


def _support_shift(
    structure: Structure, arrays: StructureArrays, values: Mapping[tuple[str, str], Values]
) -> FloatArray:
    shift = _by_coordinate(structure, arrays, values, "position")
    for node, axis in values:
        if arrays.free[arrays.node_index[str(node)], AXES.index(axis)]:
            raise ModelError.at("position", f"{node}.{axis}", "a coordinate that is supported")
    return shift
