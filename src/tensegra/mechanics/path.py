"""Solve a structure along its loading history: the stages, then the actuation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tensegra.mechanics.arrays import FloatArray, StructureArrays, structure_arrays
from tensegra.mechanics.derivatives import Given
from tensegra.mechanics.equilibrium import Load, unbalanced
from tensegra.mechanics.follow import StageFollower, StageRun, reference_tension
from tensegra.mechanics.inputs import (
    Actuation,
    Inputs,
    StageInputs,
    actuation_inputs,
    initial_inputs,
    inputs_after_stage,
    stage_inputs,
)
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.settings import PathSettings, Policy, Procedure, path_settings
from tensegra.mechanics.stability import LARGEST_LISTED, free_mechanisms
from tensegra.mechanics.start import first_stage
from tensegra.mechanics.status import Status
from tensegra.mechanics.stepped import run_stepped
from tensegra.mechanics.tangent import Tangent, lowest_of
from tensegra.mechanics.trace import trace_branch
from tensegra.structure import Structure

UNNAMED_STAGE = "as given"
"""Name of the equilibrium of a structure that declares no stages."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A structure solved through its stages: where every actuation starts.

    Attributes
    ----------
    structure, arrays, tangent
        The structure, flattened, and the workspace of its kernels.
    runs
        One followed stage each.
    equilibria
        Their results.
    inputs
        The prescribed quantities after the last stage.
    settings
        How paths are followed.
    """

    structure: Structure
    arrays: StructureArrays
    tangent: Tangent
    runs: tuple[StageRun, ...]
    equilibria: tuple[Equilibrium, ...]
    inputs: Inputs
    settings: PathSettings


def solve_path(
    structure: Structure,
    actuation: Mapping[str, float] | None = None,
    temperature: Mapping[str, float] | None = None,
    *,
    loads: Mapping[tuple[str, str], float] | None = None,
    positions: Mapping[tuple[str, str], float] | None = None,
    path: Procedure | None = None,
    policy: Policy | None = None,
    settle_start: bool = False,
    settings: PathSettings | None = None,
) -> EquilibriumPath:
    """Follow a structure through its stages and then along an actuation.

    Parameters
    ----------
    structure
        The structure.
    actuation
        Value of each actuator, the relative change of its members' rest lengths.
    temperature
        Change of temperature of a member or a group.
    loads
        Forces added to those of the last stage, by (node, axis).
    positions
        Shift of a supported coordinate, by (node, axis).
    path
        ``adaptive``, the default, or ``stepped``: the plain procedure of the source.
    policy
        What to do where the stable path ends: ``settle``, the default, ``stop`` or ``trace``.
    settle_start
        Let a start that is an unstable equilibrium fall before the history goes on.
    settings
        How the path is followed in detail.

    Returns
    -------
    EquilibriumPath
        Equilibria with status; nothing is raised for a numerical failure.

    Raises
    ------
    ModelError
        For an input that names nothing in the structure or cannot be.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> path = solve_path(library.paper_beam(), {"A14": 0.10, "A23": 0.10})
    >>> str(path.status), round(path.displacement("z", nodes=[18, 23]), 2)
    ('stable', 53.15)
    """
    chosen = path_settings(settings, path, policy)
    prepared = prepare(structure, settle_start=settle_start, settings=chosen)
    run = Actuation(actuation or {}, temperature or {}, loads or {}, positions or {})
    return actuate(prepared, run)


def prepare(
    structure: Structure, *, settle_start: bool = False, settings: PathSettings | None = None
) -> Prepared:
    """Solve the stages of a structure, once for all actuations that start from them."""
    settings = settings or PathSettings()
    arrays = structure_arrays(structure)
    tangent = Tangent(arrays)
    inputs = initial_inputs(arrays)
    runs: list[StageRun] = []
    equilibria: list[Equilibrium] = []
    nodes = arrays.coordinates
    for index, (name, after) in enumerate(stage_targets(structure, arrays)):
        follower = _follower(tangent, stage_inputs(arrays, inputs, after), equilibria, settings)
        if index == 0:
            run = _first_stage(follower, name, settle=settle_start)
        elif (missing := _missing_start(runs[-1])) is not None:
            run = StageRun(name, nodes, outcome=Status.FAILED, reason=missing)
        else:
            run = _run(follower, name, nodes)
        runs.append(run)
        equilibria.append(certify_end(structure, tangent, run, follower.load_at(run.parameter)))
        inputs, nodes = after, run.nodes
    return Prepared(structure, arrays, tangent, tuple(runs), tuple(equilibria), inputs, settings)


def _missing_start(before: StageRun) -> str | None:
    """Return why no path can start where `before` ended; None where one can."""
    if before.outcome is Status.FAILED:
        return f"stage '{before.name}' failed"
    if before.parameter < 1.0:
        return f"stage '{before.name}' stopped at {100 * before.parameter:.4g} %"
    return None


def stage_targets(structure: Structure, arrays: StructureArrays) -> list[tuple[str, Inputs]]:
    """Return name and final inputs of each stage; the structure's own gravity acts from the first on."""
    gravity = np.array(structure.gravity, dtype=np.float64)
    inputs = replace(initial_inputs(arrays), gravity=gravity)
    if not structure.stages:
        return [(UNNAMED_STAGE, inputs)]
    targets = []
    for stage in structure.stages:
        inputs = inputs_after_stage(structure, arrays, inputs, stage)
        targets.append((stage.name, inputs))
    return targets


def actuate(prepared: Prepared, run: Actuation) -> EquilibriumPath:
    """Follow an actuation from the last stage's equilibrium."""
    structure, arrays, tangent = prepared.structure, prepared.arrays, prepared.tangent
    way, inputs = actuation_inputs(structure, arrays, prepared.inputs, run)
    follower = _follower(tangent, way, prepared.equilibria, prepared.settings)
    runs = list(prepared.runs)
    actuated: Equilibrium | None = None
    load = follower.load_at(0.0)
    if run.acts:
        if (missing := _missing_start(runs[-1])) is not None:
            followed = StageRun("actuation", runs[-1].nodes, outcome=Status.FAILED, reason=missing)
        else:
            followed = _run(follower, "actuation", runs[-1].nodes)
        load = follower.load_at(followed.parameter)
        runs.append(followed)
        actuated = certify_end(structure, tangent, followed, load)
    return EquilibriumPath(
        structure=structure,
        stages=prepared.equilibria,
        actuation=actuated,
        given=Given(structure, arrays, inputs, run),
        load=load,
        critical_points=tuple(point for run in runs for point in run.critical_points),
        slack_events=tuple(event for run in runs for event in run.slack_events),
        history=tuple(point for run in runs for point in run.history),
    )


def _follower(
    tangent: Tangent,
    inputs: StageInputs,
    equilibria: list[Equilibrium] | tuple[Equilibrium, ...],
    settings: PathSettings,
) -> StageFollower:
    stiffness = tangent.arrays.stiffness
    reference = max((reference_tension(e.tensions, stiffness) for e in equilibria), default=0.0)
    return StageFollower(tangent, inputs, stiffness, reference, settings)


def _first_stage(follower: StageFollower, name: str, *, settle: bool) -> StageRun:
    if follower.settings.path == "stepped":
        return run_stepped(follower, name, follower.arrays.coordinates)
    run = first_stage(follower, name, settle=settle)
    return _traced(follower, run)


def _run(follower: StageFollower, name: str, nodes: FloatArray) -> StageRun:
    if follower.settings.path == "stepped":
        return run_stepped(follower, name, nodes)
    return _traced(follower, follower.run(name, nodes))


def _traced(follower: StageFollower, run: StageRun) -> StageRun:
    """Go on along the branch where the stable path ended and the policy says so."""
    if follower.settings.policy == "trace" and run.outcome is Status.UNSTABLE and run.parameter < 1.0:
        trace_branch(follower, run)
    return run


def certify_end(structure: Structure, tangent: Tangent, run: StageRun, load: Load) -> Equilibrium:
    """Certify the end of a stage: measure again, count eigenvalues, name what is free.

    Parameters
    ----------
    structure, tangent
        The structure, and the workspace of its kernels.
    run
        A stage that has come to its end.
    load
        What acts there.
    """
    arrays = tangent.arrays
    nowhere = Equilibrium(
        structure=structure,
        stage=run.name,
        status=Status.FAILED,
        reason=run.reason,
        nodes=np.full((arrays.n_nodes, 3), np.nan),
        tensions=np.full(arrays.n_members, np.nan),
        slack=np.zeros(arrays.n_members, dtype=np.bool_),
        residual=np.nan,
        lowest_eigenvalue=np.nan,
        n_negative=0,
        strain_energy=np.nan,
        steps=run.steps,
        iterations=run.iterations,
    )
    if run.outcome is Status.FAILED:
        return nowhere
    _, residual = unbalanced(tangent, run.nodes, load)
    collapsed = run.outcome is Status.COLLAPSED
    spectrum = tangent.spectrum(LARGEST_LISTED if collapsed else 1)
    n_negative = tangent.factorise()
    result = replace(
        nowhere,
        status=run.outcome,
        nodes=run.nodes,
        tensions=tangent.tension.copy(),
        slack=arrays.is_cable & ~tangent.taut,
        residual=residual,
        lowest_eigenvalue=lowest_of(spectrum),
        n_negative=n_negative,
        strain_energy=tangent.energy(load.rest_length),
    )
    if collapsed:
        free = free_mechanisms(tangent, spectrum)
        names = sorted({node for nodes in free for node in nodes}, key=arrays.node_ids.index)
        reason = f"{run.reason}; {len(free)} free mechanisms, which move nodes {', '.join(names)}"
        return replace(result, mechanisms=free, reason=reason)
    return result
