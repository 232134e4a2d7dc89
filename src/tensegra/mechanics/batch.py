"""Many runs of one structure: arrays in, arrays out.

The runs go through `tensegra.mechanics.lockstep`, in blocks, on several threads; what that gives
back is followed one by one with the whole care of `tensegra.mechanics.path`. No run is lost.
"""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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
from tensegra.mechanics.equilibrium import Load
from tensegra.mechanics.follow import PathSettings, Policy, Procedure, path_settings
from tensegra.mechanics.inputs import (
    Actuation,
    Inputs,
    StageInputs,
    actuation_inputs,
    effective_rest_length,
    initial_inputs,
    nodal_forces,
    stage_inputs,
)
from tensegra.mechanics.lockstep_solver import SOFT_MODES, LockstepSolver
from tensegra.mechanics.path import Prepared, actuate, prepare, stage_targets
from tensegra.mechanics.results import EquilibriumPath
from tensegra.mechanics.status import Status, axis_index, index_of, names_in
from tensegra.mechanics.tangent import Tangent
from tensegra.mechanics.variants import Variants, varied_arrays, varied_structure
from tensegra.structure import Structure

Coordinate = tuple[str, str]

LOCKSTEP_KINDS = ("actuation", "temperature", "rest_length", "stiffness", "load")
"""Parameters whose derivative is taken for many runs at once."""

BLOCK = 4096
"""Runs that are prepared, solved and gathered together: what bounds the memory beside the results."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Results of many runs; the first axis of every array is the run.

    Attributes
    ----------
    structure
        The structure.
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
    steps, iterations
        Increments and Newton solves after the stages, ``(n_runs,)``.
    seconds
        Time spent on each run, ``(n_runs,)``; an equal share of it for runs in lockstep.
    """

    structure: Structure = field(repr=False)
    status: np.ndarray[Any, np.dtype[np.object_]]
    reason: np.ndarray[Any, np.dtype[np.object_]]
    nodes: FloatArray
    start: FloatArray
    tensions: FloatArray
    slack: BoolArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    steps: IndexArray
    iterations: IndexArray
    seconds: FloatArray
    inputs: Actuation = field(repr=False)
    variants: Variants = field(repr=False)
    threads: int = field(repr=False, default=1)

    def __repr__(self) -> str:
        names, counts = np.unique(self.status, return_counts=True)
        outcome = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))
        return f"Batch({self.structure.name!r}: {self.n_runs} runs; {outcome})"

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.status)

    @property
    def node_ids(self) -> tuple[str, ...]:
        """Names along the node axis."""
        return tuple(self.structure.nodes)

    @property
    def member_ids(self) -> tuple[str, ...]:
        """Names along the member axis."""
        return tuple(self.structure.members)

    @property
    def displacements(self) -> FloatArray:
        """Displacements from the last stage's equilibrium, ``(n_runs, n_nodes, 3)``."""
        return self.nodes - self.start

    def displacement(self, axis: str, nodes: str | int | Sequence[str | int]) -> FloatArray:
        """Mean displacement of the named nodes along an axis, shape ``(n_runs,)``."""
        start = self.start[:, self._rows(nodes), axis_index(axis)].mean(axis=1)
        displacement: FloatArray = self.coordinate(axis, nodes) - start
        return displacement

    def coordinate(self, axis: str, nodes: str | int | Sequence[str | int]) -> FloatArray:
        """Mean coordinate of the named nodes along an axis, shape ``(n_runs,)``."""
        mean: FloatArray = self.nodes[:, self._rows(nodes), axis_index(axis)].mean(axis=1)
        return mean

    def tension(self, member: str | int) -> FloatArray:
        """Tension of a member, shape ``(n_runs,)``."""
        return self.tensions[:, index_of(self.structure.members, member, "member")]

    def derivative(self, name: object, of: ParameterKind = "actuation") -> Derivative:
        """Differentiate positions and tensions of all runs by one parameter, exactly.

        Parameters
        ----------
        name, of
            As in `EquilibriumPath.derivative`.

        Returns
        -------
        Derivative
            ``nodes`` of shape ``(n_runs, n_nodes, 3)`` and ``tensions`` of shape
            ``(n_runs, n_members)``; NaN where a run has no stable equilibrium.

        Raises
        ------
        ModelError
            For a name that the structure does not have.

        Examples
        --------
        >>> from tensegra.structure import library
        >>> runs = solve_batch(library.paper_beam(), actuation={"A14": [0.05, 0.1], "A23": [0.05, 0.1]})
        >>> runs.derivative("A14").nodes.shape
        (2, 24, 3)
        """
        blocks = [
            self._block_derivative(slice(first, first + BLOCK), name, of)
            for first in range(0, self.n_runs, BLOCK)
        ]
        return Derivative(
            np.concatenate([block.nodes for block in blocks]),
            np.concatenate([block.tensions for block in blocks]),
        )

    def _block_derivative(self, runs: slice, name: object, of: ParameterKind) -> Derivative:
        """Differentiate some runs: in lockstep where the factor can be had for all of them at once."""
        inputs, variants = part(self.inputs, runs), self.variants.part(runs)
        nodes, stands = self.nodes[runs], np.isin(self.status[runs], (Status.STABLE, Status.SNAPPED))
        result = Derivative(np.full(nodes.shape, np.nan), np.full(self.tensions[runs].shape, np.nan))
        if of in LOCKSTEP_KINDS and np.any(stands):
            arrays = varied_arrays(self.structure, structure_arrays(self.structure), variants)
            after = _inputs_after(self.structure, arrays, inputs)
            direction = direction_of(Given(self.structure, arrays, after, inputs), of, name)
            solver = _solver(self.structure, arrays, nodes[stands][0], after, self.threads)
            if solver.serves:
                outcome = solver.follow(_at_rest(arrays, after), nodes, len(nodes), direction)
                result.nodes[:] = outcome.nodes_by[:, 0].reshape(nodes.shape)
                result.tensions[:] = outcome.tensions_by[:, 0]
        for run in np.flatnonzero(stands & np.isnan(result.tensions[:, 0])):
            alone = _differentiate_alone(self.structure, inputs, variants, int(run), nodes[run], of, name)
            result.nodes[run], result.tensions[run] = alone.nodes, alone.tensions
        result.nodes[~stands], result.tensions[~stands] = np.nan, np.nan
        return result

    def _rows(self, nodes: str | int | Sequence[str | int]) -> list[int]:
        return [index_of(self.structure.nodes, node, "node") for node in names_in(nodes)]


def solve_batch(
    structure: Structure,
    *,
    actuation: Mapping[str, ArrayLike] | None = None,
    temperature: Mapping[str, ArrayLike] | None = None,
    loads: Mapping[Coordinate, ArrayLike] | None = None,
    positions: Mapping[Coordinate, ArrayLike] | None = None,
    youngs_modulus: Mapping[str, ArrayLike] | None = None,
    area: Mapping[str, ArrayLike] | None = None,
    rest_length: Mapping[str, ArrayLike] | None = None,
    path: Procedure | None = None,
    policy: Policy | None = None,
    threads: int | None = None,
    settings: PathSettings | None = None,
) -> Batch:
    """Solve many runs of a structure.

    Actuation, temperature, loads and positions act after the stages; Young's moduli, areas and
    rest lengths change the structure before its first stage. Every value is an array over the runs.

    Parameters
    ----------
    structure
        The structure that all runs share.
    actuation
        By actuator: relative change of rest length, shape ``(n_runs,)``.
    temperature
        By member or group: change of temperature.
    loads, positions
        By (node, axis): force added to that of the last stage; shift of a supported coordinate.
    youngs_modulus
        By material.
    area
        By member or group.
    rest_length
        By member: rest length before the stages.
    threads
        Threads to share the runs; one a core where left out. Results do not depend on it.
    path
        ``adaptive``, the default, or ``stepped``: all runs by the plain procedure of the source.
    policy
        What to do where a stable path ends: ``settle``, the default, ``stop`` or ``trace``.
    settings
        How the runs are followed that leave the plain course.

    Raises
    ------
    ModelError
        For a name or a value that cannot be; arrays of different lengths.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> runs = solve_batch(library.paper_beam(), actuation={"A14": [0.05, 0.1], "A23": [0.05, 0.1]})
    >>> runs.displacement("z", nodes=[18, 23]).round(2)
    array([26.75, 53.15])
    """
    settings = path_settings(settings, path, policy)
    threads = threads or os.cpu_count() or 1
    inputs = Actuation(*(_columns(group) for group in (actuation, temperature, loads, positions)))
    variants = Variants(*(_columns(group) for group in (youngs_modulus, area, rest_length)))
    n_runs = _n_runs(inputs, variants)
    variants.check(structure)
    shared = None if variants.vary else prepare(structure, settings=settings)
    blocks = [
        _solve_block(structure, part(inputs, runs), variants.part(runs), shared, threads, settings)
        for runs in (slice(first, min(first + BLOCK, n_runs)) for first in range(0, max(n_runs, 1), BLOCK))
    ]
    columns = {
        column.name: np.concatenate([getattr(block, column.name) for block in blocks])
        for column in fields(_Block)
    }
    if shared is not None:
        columns["start"] = blocks[0].start
    return Batch(structure=structure, inputs=inputs, variants=variants, threads=threads, **columns)


@dataclass(eq=False)
class _Block:
    """Results of a block of runs: the arrays of `Batch`, filled in."""

    status: np.ndarray[Any, np.dtype[np.object_]]
    reason: np.ndarray[Any, np.dtype[np.object_]]
    nodes: FloatArray
    start: FloatArray
    tensions: FloatArray
    slack: BoolArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    steps: IndexArray
    iterations: IndexArray
    seconds: FloatArray

    def take(self, run: int, path: EquilibriumPath, seconds: float) -> None:
        """Take over one run that was followed alone."""
        final = path.final
        self.status[run], self.reason[run] = str(path.status), path.reason
        self.nodes[run], self.tensions[run], self.slack[run] = final.nodes, final.tensions, final.slack
        self.residual[run], self.lowest_eigenvalue[run] = final.residual, final.lowest_eigenvalue
        self.steps[run], self.iterations[run], self.seconds[run] = final.steps, final.iterations, seconds
        if len(self.start) > 1:
            self.start[run] = path.stages[-1].nodes


def _solve_block(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    shared: Prepared | None,
    threads: int,
    settings: PathSettings,
) -> _Block:
    began = time.perf_counter()
    n_runs = _n_runs(inputs, variants)
    base = shared or prepare(structure, settings=settings)
    block, done = _in_lockstep(structure, base, inputs, variants, n_runs, threads)
    block.seconds[:] = (time.perf_counter() - began) / max(n_runs, 1)
    for run in np.flatnonzero(~done):
        began = time.perf_counter()
        prepared = shared or prepare(varied_structure(structure, variants, int(run)), settings=settings)
        block.take(int(run), actuate(prepared, _scalars(inputs, int(run))), time.perf_counter() - began)
    return block


def _in_lockstep(
    structure: Structure, base: Prepared, inputs: Actuation, variants: Variants, n_runs: int, threads: int
) -> tuple[_Block, BoolArray]:
    """Solve what goes the plain course; return the results and which runs have one."""
    arrays = varied_arrays(structure, base.arrays, variants)
    done = np.zeros(n_runs, dtype=np.bool_)
    block = _empty(base, n_runs, starts=n_runs if variants.vary else 1)
    last = base.equilibria[-1]
    plain = base.settings.path == "adaptive" and last.succeeded
    if not plain or n_runs == 0 or not (inputs.acts or variants.vary):
        return block, done
    solver = _solver(structure, arrays, last.nodes, base.inputs, threads)
    if not solver.serves:
        return block, done
    if variants.vary:
        block.start[:], done = _stages_in_lockstep(structure, arrays, solver, n_runs)
    else:
        done[:] = True
    stage, _ = actuation_inputs(structure, arrays, _inputs_before(structure, arrays), inputs)
    outcome = solver.follow(stage, block.start, n_runs)
    done &= outcome.done > 0
    worst = Status.STABLE if all(e.status is Status.STABLE for e in base.equilibria) else Status.SNAPPED
    block.status[:] = str(worst)
    block.reason[:] = "; ".join(e.reason for e in base.equilibria if e.reason)
    block.nodes[:], block.tensions[:] = outcome.nodes.reshape(block.nodes.shape), outcome.tensions
    block.slack[:] = base.arrays.is_cable & (outcome.tensions == 0.0)
    block.residual[:], block.lowest_eigenvalue[:] = outcome.residual, outcome.lowest_eigenvalue
    block.steps[:], block.iterations[:] = outcome.steps, outcome.iterations
    return block, done


def _stages_in_lockstep(
    structure: Structure, arrays: StructureArrays, solver: LockstepSolver, n_runs: int
) -> tuple[FloatArray, BoolArray]:
    """Take the varied structures through their stages; return the positions and which runs got there."""
    done = np.ones(n_runs, dtype=np.bool_)
    before, nodes = initial_inputs(arrays), arrays.coordinates[None]
    for index, (_, after) in enumerate(stage_targets(structure, arrays)):
        stage = stage_inputs(arrays, before, after)
        if index == 0:
            stage = stage.balanced_by(_internal_forces(arrays, stage.rest_length[..., 0]))
        outcome = solver.follow(stage, nodes, n_runs)
        done &= outcome.done > 0
        before, nodes = after, outcome.nodes.reshape(n_runs, -1, 3)
    return nodes, done


def _internal_forces(arrays: StructureArrays, rest_length: FloatArray) -> FloatArray:
    """Return the forces of all members at the given coordinates, ``(n_runs, n_nodes, 3)``."""
    first, second = arrays.segment_nodes.T
    along = arrays.coordinates[second] - arrays.coordinates[first]
    lengths = np.linalg.norm(along, axis=1)
    total = np.add.reduceat(lengths, arrays.segment_start[:-1])
    tension = arrays.stiffness * (total / rest_length - 1.0)
    tension = np.where(arrays.is_cable, np.maximum(tension, 0.0), tension)
    pull = np.repeat(tension, arrays.n_segments, axis=-1)[..., None] * (along / lengths[:, None])
    force = np.zeros((arrays.n_nodes, *tension.shape[:-1], 3))
    np.add.at(force, second, np.moveaxis(pull, -2, 0))
    np.subtract.at(force, first, np.moveaxis(pull, -2, 0))
    return np.where(arrays.free, np.moveaxis(force, 0, -2), 0.0)


def _solver(
    structure: Structure, arrays: StructureArrays, nodes: FloatArray, inputs: Inputs, threads: int
) -> LockstepSolver:
    """Build the solver with the softest modes at one position, a good guess for all runs."""
    plain = structure_arrays(structure)
    tangent = Tangent(plain)
    rest_length = effective_rest_length(plain, inputs)
    tangent.measure(nodes, rest_length.reshape(-1, plain.n_members)[0], plain.stiffness)
    modes = tangent.spectrum(SOFT_MODES).vectors
    return LockstepSolver(arrays, tangent.pattern, modes, threads)


def _inputs_before(structure: Structure, arrays: StructureArrays) -> Inputs:
    """Return the inputs at the end of the stages."""
    return stage_targets(structure, arrays)[-1][1]


def _inputs_after(structure: Structure, arrays: StructureArrays, inputs: Actuation) -> Inputs:
    """Return the inputs at the end of the actuation."""
    return actuation_inputs(structure, arrays, _inputs_before(structure, arrays), inputs)[1]


def _at_rest(arrays: StructureArrays, inputs: Inputs) -> StageInputs:
    """Return a stage along which nothing changes: what is left is to certify and differentiate."""
    force = nodal_forces(arrays, inputs)
    rest_length = effective_rest_length(arrays, inputs)[..., None]
    return StageInputs(rest_length, force, force, inputs.positions, inputs.positions)


def _differentiate_alone(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    run: int,
    nodes: FloatArray,
    of: ParameterKind,
    name: object,
) -> Derivative:
    varied, alone = varied_structure(structure, variants, run), _scalars(inputs, run)
    arrays = structure_arrays(varied)
    after = _inputs_after(varied, arrays, alone)
    load = Load(effective_rest_length(arrays, after), arrays.stiffness, nodal_forces(arrays, after))
    tangent = Tangent(arrays)
    settle_tangent(tangent, nodes, load)
    return differentiate(tangent, load, direction_of(Given(varied, arrays, after, alone), of, name))


def _empty(base: Prepared, n_runs: int, starts: int) -> _Block:
    arrays = base.arrays
    return _Block(
        status=np.full(n_runs, str(Status.FAILED), dtype=np.object_),
        reason=np.full(n_runs, "", dtype=np.object_),
        nodes=np.full((n_runs, arrays.n_nodes, 3), np.nan),
        start=np.tile(base.equilibria[-1].nodes, (starts, 1, 1)),
        tensions=np.full((n_runs, arrays.n_members), np.nan),
        slack=np.zeros((n_runs, arrays.n_members), dtype=np.bool_),
        residual=np.full(n_runs, np.nan),
        lowest_eigenvalue=np.full(n_runs, np.nan),
        steps=np.zeros(n_runs, dtype=np.int64),
        iterations=np.zeros(n_runs, dtype=np.int64),
        seconds=np.zeros(n_runs),
    )


def part(inputs: Actuation, runs: slice) -> Actuation:
    """Return the inputs of some runs."""
    return Actuation(*({name: np.asarray(v)[runs] for name, v in group.items()} for group in inputs.groups()))


def _scalars(inputs: Actuation, run: int) -> Actuation:
    """Return the inputs of one run, as numbers."""
    return Actuation(*({name: float(np.asarray(v)[run]) for name, v in g.items()} for g in inputs.groups()))


def _columns(group: Mapping[Any, ArrayLike] | None) -> dict[Any, FloatArray]:
    return {name: np.atleast_1d(np.asarray(v, dtype=np.float64)) for name, v in (group or {}).items()}


def _n_runs(inputs: Actuation, variants: Variants) -> int:
    """Return the number of runs, or raise `ModelError` where the columns differ in length."""
    columns = [
        (name, np.asarray(v)) for group in (*inputs.groups(), *variants.groups()) for name, v in group.items()
    ]
    n_runs = len(columns[0][1]) if columns else 1
    for name, values in columns:
        if np.shape(values) != (n_runs,):
            raise ModelError.at(str(name), np.shape(values), f"one value for each of the {n_runs} runs")
    return n_runs
