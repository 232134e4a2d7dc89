"""One block of runs: in lockstep as far as they go the plain course, then one by one.

What lockstep gives back is followed alone with the whole care of `tensegra.mechanics.path`; no run
is lost.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import (
    BoolArray,
    FloatArray,
    IndexArray,
    StructureArrays,
    structure_arrays,
)
from tensegra.mechanics.derivatives import (
    Derivative,
    Given,
    ParameterKind,
    differentiate,
    direction_of,
    settle_tangent,
)
from tensegra.mechanics.equilibrium import Load
from tensegra.mechanics.inputs import (
    Actuation,
    Inputs,
    StageInputs,
    actuation_inputs,
    effective_rest_length,
    nodal_forces,
)
from tensegra.mechanics.lockstep_data import STANDS
from tensegra.mechanics.lockstep_ends import Ending, collapses, stepped_ends
from tensegra.mechanics.lockstep_solver import SOFT_MODES, LockstepSolver
from tensegra.mechanics.lockstep_stages import follow_stage, reference_tensions, through_stages
from tensegra.mechanics.path import Prepared, actuate, prepare, stage_targets
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.status import Status
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
    steps, iterations
        Increments and Newton solves after the stages, ``(n_runs,)``.
    seconds
        Time spent on each run, ``(n_runs,)``; an equal share of it for runs in lockstep.
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
    steps: IndexArray
    iterations: IndexArray
    seconds: FloatArray
    nodes_by: FloatArray
    tensions_by: FloatArray

    def take(
        self, run: int, path: EquilibriumPath, parameters: Sequence[Parameter], *, own_start: bool
    ) -> None:
        """Take over one run that was followed alone, from the start of all runs or from its own."""
        final = path.final
        self.take_end(run, final, str(path.status), path.reason)
        for q, (kind, name) in enumerate(parameters):
            if final.succeeded:
                by = path.derivative(name, kind)
                self.nodes_by[run, q], self.tensions_by[run, q] = by.nodes, by.tensions
        if own_start:
            self.start[run] = path.stages[-1].nodes

    def take_end(self, run: int, final: Equilibrium, status: str, reason: str) -> None:
        """Take over the equilibrium where one run ended."""
        self.status[run], self.reason[run] = status, reason
        self.nodes[run], self.tensions[run], self.slack[run] = final.nodes, final.tensions, final.slack
        self.residual[run], self.lowest_eigenvalue[run] = final.residual, final.lowest_eigenvalue
        self.steps[run], self.iterations[run] = final.steps, final.iterations


def solve_block(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    parameters: Sequence[Parameter],
    base: Prepared,
    threads: int,
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
    threads
        Threads to share the runs in lockstep.
    """
    began = time.perf_counter()
    n_runs = n_runs_of(inputs, variants)
    block, done = _in_lockstep(structure, base, inputs, variants, parameters, threads)
    block.seconds[:] = (time.perf_counter() - began) / max(n_runs, 1)
    for run in np.flatnonzero(~done):
        began = time.perf_counter()
        prepared = base
        if variants.vary:
            prepared = prepare(varied_structure(structure, variants, int(run)), settings=base.settings)
        path = actuate(prepared, _scalars(inputs, int(run)))
        block.take(int(run), path, parameters, own_start=variants.vary)
        block.seconds[run] = time.perf_counter() - began
    return block


def _in_lockstep(
    structure: Structure,
    base: Prepared,
    inputs: Actuation,
    variants: Variants,
    parameters: Sequence[Parameter],
    threads: int,
) -> tuple[RunResults, BoolArray]:
    """Solve what goes the plain course; return the results and which runs have one."""
    n_runs = n_runs_of(inputs, variants)
    arrays = varied_arrays(structure, base.arrays, variants)
    done = np.zeros(n_runs, dtype=np.bool_)
    block = _empty(base, n_runs, n_runs if variants.vary else 1, len(parameters))
    last = base.equilibria[-1]
    if not last.succeeded or n_runs == 0 or not (inputs.acts or variants.vary):
        return block, done
    solver = _solver(base.tangent, arrays, last.nodes, base.inputs, threads)
    if not solver.serves:
        return block, done
    reference = reference_tensions([e.tensions for e in base.equilibria], base.arrays.stiffness)
    if variants.vary:
        if base.settings.path == "adaptive" and base.equilibria[0].status is not Status.STABLE:
            return block, done  # the others may well not fall
        block.start[:], reference, done = through_stages(base, arrays, solver, n_runs)
    else:
        done[:] = True
    stage, after = actuation_inputs(structure, arrays, _inputs_before(structure, arrays), inputs)
    given = Given(structure, arrays, after, inputs)
    directions = [direction_of(given, kind, name) for kind, name in parameters]
    outcome = follow_stage(solver, stage, block.start, n_runs, base.settings, reference, directions)
    # Runs that vary the structure have come through its stages themselves, on a stable path.
    shared_stages = () if variants.vary else base.equilibria
    stable = all(equilibrium.status is Status.STABLE for equilibrium in shared_stages)
    reasons = [equilibrium.reason for equilibrium in shared_stages if equilibrium.reason]
    block.status[:] = str(Status.STABLE if stable else Status.SNAPPED)
    block.reason[:] = "; ".join(reasons)
    block.nodes[:], block.tensions[:] = outcome.nodes.reshape(block.nodes.shape), outcome.tensions
    block.slack[:] = base.arrays.is_cable & (outcome.tensions == 0.0)
    block.residual[:], block.lowest_eigenvalue[:] = outcome.residual, outcome.lowest_eigenvalue
    block.steps[:], block.iterations[:] = outcome.steps, outcome.iterations
    block.nodes_by[:] = outcome.nodes_by.reshape(block.nodes_by.shape)
    block.tensions_by[:] = outcome.tensions_by
    ended = outcome.done == STANDS
    ending = Ending(structure, base.tangent, stage, arrays.stiffness, base.settings)
    if base.settings.path == "stepped":
        ends = stepped_ends(ending, outcome)
    else:
        ends = collapses(ending, solver, block.start, outcome, reference)
    for run, end in ends:
        ended[run] = True
        block.take_end(run, end, str(end.status), "; ".join([*reasons, end.reason]))
    return block, done & ended


def _solver(
    tangent: Tangent, arrays: StructureArrays, nodes: FloatArray, inputs: Inputs, threads: int
) -> LockstepSolver:
    """Build the solver with the softest modes at one position, a good guess for all runs.

    `tangent` is that of the structure as it is given; `arrays` may vary it.
    """
    plain = tangent.arrays
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


def differentiate_block(
    structure: Structure,
    inputs: Actuation,
    variants: Variants,
    nodes: FloatArray,
    stands: BoolArray,
    threads: int,
    of: ParameterKind,
    name: object,
) -> Derivative:
    """Differentiate solved runs: in lockstep where the factor can be had for all of them at once.

    Parameters
    ----------
    structure, inputs, variants
        The runs.
    nodes, stands
        Their positions, ``(n_runs, n_nodes, 3)``, and which of them are stable.
    threads
        Threads to share the runs.
    of, name
        The parameter, as in `direction_of`.
    """
    result = Derivative(np.full(nodes.shape, np.nan), np.full((len(nodes), structure.n_members), np.nan))
    if of in LOCKSTEP_KINDS and np.any(stands):
        arrays = varied_arrays(structure, structure_arrays(structure), variants)
        after = _inputs_after(structure, arrays, inputs)
        direction = direction_of(Given(structure, arrays, after, inputs), of, name)
        tangent = Tangent(structure_arrays(structure))
        solver = _solver(tangent, arrays, nodes[stands][0], after, threads)
        if solver.serves:
            outcome = solver.follow(_at_rest(arrays, after), nodes, len(nodes), [direction])
            result.nodes[:] = outcome.nodes_by[:, 0].reshape(nodes.shape)
            result.tensions[:] = outcome.tensions_by[:, 0]
    for run in np.flatnonzero(stands & np.isnan(result.tensions[:, 0])):
        alone = _differentiate_alone(structure, inputs, variants, int(run), nodes[run], of, name)
        result.nodes[run], result.tensions[run] = alone.nodes, alone.tensions
    result.nodes[~stands], result.tensions[~stands] = np.nan, np.nan
    return result


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


def _empty(base: Prepared, n_runs: int, n_starts: int, n_parameters: int) -> RunResults:
    arrays = base.arrays
    return RunResults(
        status=np.full(n_runs, str(Status.FAILED), dtype=np.object_),
        reason=np.full(n_runs, "", dtype=np.object_),
        nodes=np.full((n_runs, arrays.n_nodes, 3), np.nan),
        start=np.tile(base.equilibria[-1].nodes, (n_starts, 1, 1)),
        tensions=np.full((n_runs, arrays.n_members), np.nan),
        slack=np.zeros((n_runs, arrays.n_members), dtype=np.bool_),
        residual=np.full(n_runs, np.nan),
        lowest_eigenvalue=np.full(n_runs, np.nan),
        steps=np.zeros(n_runs, dtype=np.int64),
        iterations=np.zeros(n_runs, dtype=np.int64),
        seconds=np.zeros(n_runs),
        nodes_by=np.full((n_runs, n_parameters, arrays.n_nodes, 3), np.nan),
        tensions_by=np.full((n_runs, n_parameters, arrays.n_members), np.nan),
    )


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
