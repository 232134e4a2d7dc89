"""One block of runs: from inputs and variants as columns to results as columns."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray, StructureArrays, structure_arrays
from tensegra.mechanics.derivatives import (
    Derivative,
    Given,
    ParameterKind,
    differentiate,
    direction_of,
    settle_tangent,
)
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import (
    Actuation,
    Inputs,
    Load,
    StageInputs,
    actuation_inputs,
    effective_rest_length,
    nodal_forces,
)
from tensegra.mechanics.path import Prepared, actuated, stage_targets, through_stages
from tensegra.mechanics.rigid import RigidMotions, in_frame
from tensegra.mechanics.stages import Ground, Leg
from tensegra.mechanics.status import Status
from tensegra.mechanics.supervise import Supervisor
from tensegra.mechanics.tangent import Tangent
from tensegra.mechanics.variants import Variants, varied_arrays, varied_structure
from tensegra.structure import Structure

Parameter = tuple[ParameterKind, object]

LOCKSTEP_KINDS = ("actuation", "temperature", "rest_length", "stiffness", "load")
"""Parameters whose derivative is taken for many runs at once."""


@dataclass(frozen=True, eq=False)
class RunResults:
    """What is known of many runs; the first axis of every array is the run.

    Attributes
    ----------
    status, reason
        `Status` and its reason of each run, shape ``(n_runs,)``.
    nodes
        Positions, ``(n_runs, n_nodes, 3)``, unit of length; NaN where failed.
    start
        Positions at the end of the stages, ``(n_runs | 1, n_nodes, 3)``: displacements are
        measured from them.
    tensions
        Tension positive, ``(n_runs, n_members)``, unit of force.
    slack
        True for cables that carry nothing, ``(n_runs, n_members)``.
    residual, lowest_eigenvalue
        Certificate of each run, ``(n_runs,)``.
    parameter
        Path parameter in [0, 1] at which each run ended, 1 unless it stopped on the way, ``(n_runs,)``.
    steps, iterations
        Increments and Newton solves after the stages, ``(n_runs,)``.
    seconds
        Time spent on each run, an equal share of that of its block, ``(n_runs,)``.
    nodes_by, tensions_by
        Derivatives by the parameters asked for, ``(n_runs, n_parameters, n_nodes, 3)`` and
        ``(n_runs, n_parameters, n_members)``; NaN where a run does not stand.
    """

    status: np.ndarray[Any, np.dtype[np.object_]]
    reason: np.ndarray[Any, np.dtype[np.object_]]
    nodes: FloatArray
    start: FloatArray
    tensions: FloatArray
    slack: BoolArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    parameter: FloatArray
    steps: IndexArray
    iterations: IndexArray
    seconds: FloatArray
    nodes_by: FloatArray
    tensions_by: FloatArray


def solve_block(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    parameters: Sequence[Parameter],
    base: Prepared,
    modes: FloatArray,
) -> RunResults:
    """Solve one block of runs.

    Parameters
    ----------
    structure, inputs, variants
        The runs.
    parameters
        What to differentiate by.
    base
        The structure solved through its stages: where all runs start that do not vary it.
    modes
        Softest modes of K where it ended, ``(3, n_nodes, 3)``: a good guess for all runs.
    """
    began = time.perf_counter()
    n_runs = n_runs_of(inputs, variants)
    prepared = base
    if variants.vary:
        arrays = varied_arrays(structure, base.arrays, variants)
        prepared = through_stages(structure, base.ground, arrays, n_runs)
    way, after = actuation_inputs(structure, prepared.arrays, prepared.inputs, inputs)
    given = Given(structure, prepared.arrays, after, inputs)
    directions = [direction_of(given, kind, name) for kind, name in parameters]
    if not inputs.acts and not parameters:
        end = prepared.ends[-1] if variants.vary else _repeated(prepared.ends[-1], n_runs)
        before = prepared.ends[:-1]
    else:
        end, before = actuated(prepared, way, n_runs, modes, directions), prepared.ends
    status, reason = _whole(end, before)
    shape = (n_runs, len(parameters), prepared.arrays.n_nodes, 3)
    origin = base.arrays.origin
    return RunResults(
        status=status,
        reason=reason,
        nodes=end.nodes + origin,
        start=prepared.ends[-1].nodes + origin,
        tensions=end.tensions,
        slack=base.arrays.is_cable & (end.tensions == 0.0),
        residual=end.residual,
        lowest_eigenvalue=end.lowest_eigenvalue,
        parameter=end.parameter,
        steps=end.steps,
        iterations=end.iterations,
        seconds=np.full(n_runs, (time.perf_counter() - began) / max(n_runs, 1)),
        nodes_by=end.nodes_by.reshape(shape),
        tensions_by=end.tensions_by,
    )


def _whole(end: StageEnd, before: Sequence[StageEnd]) -> tuple[np.ndarray, np.ndarray]:
    """Return status and reason of whole histories, ``snapped`` where they left a branch on the way."""
    status, reason = np.array([str(one) for one in end.status], dtype=np.object_), end.reason.copy()
    for one_or_all in reversed(before):
        stage = one_or_all.of_all(len(status))
        left = np.array([one is not Status.STABLE for one in stage.status], dtype=np.bool_)
        status[left & (status == str(Status.STABLE))] = str(Status.SNAPPED)
        for run in map(int, np.flatnonzero(stage.reason != "")):
            reason[run] = "; ".join(text for text in (stage.reason[run], reason[run]) if text)
    return status, reason


def _repeated(end: StageEnd, n_runs: int) -> StageEnd:
    """Return the end of one run as that of many that are the same."""
    columns: dict[str, Any] = {
        name: np.repeat(value, n_runs, axis=0)
        for name, value in vars(end).items()
        if isinstance(value, np.ndarray) and len(value) == 1
    }
    return replace(end, **columns)


def differentiate_block(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    ground: Ground,
    nodes: FloatArray,
    start: FloatArray,
    stands: BoolArray,
    of: ParameterKind,
    name: object,
) -> Derivative:
    """Differentiate solved runs: in lanes where the factor can be had for all of them at once.

    Parameters
    ----------
    structure, inputs, variants
        The runs.
    ground
        What all histories of the structure share.
    nodes, start
        Their positions, and those at the end of their stages, ``(n_runs | 1, n_nodes, 3)``.
    stands
        Which of them are stable.
    of, name
        The parameter, as in `direction_of`.
    """
    result = Derivative(np.full(nodes.shape, np.nan), np.full((len(nodes), structure.n_members), np.nan))
    if not np.any(stands):
        return result
    nodes = np.where(stands[:, None, None], nodes - ground.arrays.origin, ground.arrays.coordinates)
    arrays = varied_arrays(structure, ground.plain_arrays, variants)
    _, after = actuation_inputs(structure, arrays, stage_targets(structure, arrays)[-1][1], inputs)
    rest = _at_rest(arrays, after)
    motions = ground.freedom(rest.loads_end).neutral
    if of in LOCKSTEP_KINDS:
        direction = direction_of(Given(structure, arrays, after, inputs), of, name)
        leg = Leg("", rest, arrays.stiffness, nodes, np.ones(1), len(nodes), directions=(direction,))
        solver = ground.solver(ground.freedom(rest.loads_end), nodes[stands][0])
        supervisor = Supervisor(solver, leg)
        _, by = solver.certify(supervisor.runs, supervisor.outcome, None, (direction,))
        rates, tensions = by.nodes_by, by.tensions_by[:, 0]
        for run in map(int, np.flatnonzero(stands & solver.grip.is_worn(supervisor.outcome.nodes))):
            other = supervisor.hand_on(run)
            _, by = other.solver.certify(other.runs, other.outcome, None, (direction.of_run(run),))
            rates[run], tensions[run] = by.nodes_by[0], by.tensions_by[0, 0]
    else:
        alone = [
            _differentiate_alone(run_end(structure, ground, inputs, variants, int(run)), nodes[run], of, name)
            for run in np.flatnonzero(stands)
        ]
        rates = np.zeros((len(nodes), 1, nodes[0].size))
        tensions = np.zeros((len(nodes), arrays.n_members))
        rates[stands, 0] = [one.nodes.ravel() for one in alone]
        tensions[stands] = [one.tensions for one in alone]
    if len(motions):
        before = np.broadcast_to(start - ground.arrays.origin, nodes.shape)
        rates = in_frame(rates, nodes, before, motions)
    result.nodes[stands], result.tensions[stands] = (
        rates[stands, 0].reshape(-1, *nodes.shape[1:]),
        tensions[stands],
    )
    return result


def _at_rest(arrays: StructureArrays, inputs: Inputs) -> StageInputs:
    """Return a stage along which nothing changes: what is left is to certify and differentiate."""
    force = nodal_forces(arrays, inputs)
    rest_length = effective_rest_length(arrays, inputs)[..., None]
    return StageInputs(rest_length, force, force, inputs.positions, inputs.positions)


@dataclass(frozen=True, eq=False)
class RunEnd:
    """One of many runs where it ended: its structure, its inputs, what acts and what is neutral there."""

    arrays: StructureArrays
    given: Given
    load: Load
    motions: RigidMotions


def run_end(
    structure: Structure,
    ground: Ground,
    inputs: Actuation,
    variants: Variants,
    run: int,
    parameter: float = 1.0,
) -> RunEnd:
    """Return one of many runs where it ended."""
    varied, alone = varied_structure(structure, variants, run), _scalars(inputs, run)
    arrays = structure_arrays(varied)
    way, after = actuation_inputs(varied, arrays, stage_targets(varied, arrays)[-1][1], alone)
    force = way.loads_at(parameter)
    load = Load(way.rest_length_at(parameter), arrays.stiffness, force, ground.settings.residual)
    return RunEnd(arrays, Given(varied, arrays, after, alone), load, ground.freedom(force).neutral)


def _differentiate_alone(end: RunEnd, nodes: FloatArray, of: ParameterKind, name: object) -> Derivative:
    tangent = Tangent(end.arrays, motions=end.motions, nodes=nodes)
    settle_tangent(tangent, nodes, end.load)
    return differentiate(tangent, end.load, direction_of(end.given, of, name))


def part(inputs: Actuation, runs: slice) -> Actuation:
    """Return the inputs of some runs."""
    return Actuation(*({name: np.asarray(v)[runs] for name, v in group.items()} for group in inputs.groups()))


def _scalars(inputs: Actuation, run: int) -> Actuation:
    """Return the inputs of one run, as numbers."""
    return Actuation(*({name: float(np.asarray(v)[run]) for name, v in g.items()} for g in inputs.groups()))


def n_runs_of(inputs: Actuation, variants: Variants) -> int:
    """Return the number of runs, or raise `ModelError` where the columns differ in length."""
    columns = [
        (name, np.asarray(v)) for group in (*inputs.groups(), *variants.groups()) for name, v in group.items()
    ]
    n_runs = len(columns[0][1]) if columns else 1
    for name, values in columns:
        if np.shape(values) != (n_runs,):
            raise ModelError.at(str(name), np.shape(values), f"one value for each of the {n_runs} runs")
    return n_runs
