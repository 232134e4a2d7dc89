"""Solve a structure along its loading history: the stages, then the actuation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tensegra.mechanics.arrays import FloatArray, StructureArrays
from tensegra.mechanics.derivatives import Direction, Given
from tensegra.mechanics.ends import StageEnd
from tensegra.mechanics.inputs import (
    Actuation,
    Inputs,
    Load,
    StageInputs,
    actuation_inputs,
    initial_inputs,
    inputs_after_stage,
    stage_inputs,
)
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.settings import PathSettings, Policy, Procedure, path_settings
from tensegra.mechanics.stability import with_mechanisms
from tensegra.mechanics.stages import (
    Ground,
    Leg,
    first_leg,
    follow_leg,
    given_up,
    ground_of,
    reference_tensions,
)
from tensegra.mechanics.state import LARGEST_IN_LANES, N_VECTORS
from tensegra.mechanics.status import Status
from tensegra.mechanics.tangent import Tangent
from tensegra.mechanics.trace import traced
from tensegra.structure import Structure

UNNAMED_STAGE = "as given"
"""Name of the equilibrium of a structure that declares no stages."""

ACTUATION = "actuation"
"""Name of the way from the last stage to a run."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A structure solved through its stages: where every actuation starts.

    Attributes
    ----------
    structure, ground
        The structure, and what all its histories share.
    ends
        Of the stages, in order, of one run or of many.
    inputs
        The prescribed quantities after the last stage.
    """

    structure: Structure
    ground: Ground
    ends: tuple[StageEnd, ...]
    inputs: Inputs

    @property
    def arrays(self) -> StructureArrays:
        """The structure, flattened."""
        return self.ground.arrays

    @cached_property
    def equilibria(self) -> tuple[Equilibrium, ...]:
        """The ends of the stages of a single run."""
        return tuple(equilibrium_of(self.structure, self.ground, end) for end in self.ends)

    @property
    def nodes(self) -> FloatArray:
        """Positions at the end of the stages, ``(n_runs, n_nodes, 3)``, about the arrays' own origin."""
        return self.ends[-1].nodes

    @property
    def reference(self) -> FloatArray:
        """What counts as a tension of the structure after the stages, ``(n_runs,)``."""
        return reference_tensions([end.tensions for end in self.ends], self.arrays.stiffness)


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
        ``adaptive``, the default, or ``stepped``: the plain procedure of the paper.
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
    """Solve the stages of a structure, once for all actuations that start from them.

    What was found is kept with the structure: nothing of it is ever changed.
    """
    ground = ground_of(structure, settings or PathSettings())
    if settle_start not in ground.kept:
        ground.kept[settle_start] = through_stages(
            structure, ground, ground.arrays, settle_start=settle_start
        )
    prepared: Prepared = ground.kept[settle_start]
    return prepared


def through_stages(
    structure: Structure,
    ground: Ground,
    arrays: StructureArrays,
    n_runs: int = 1,
    *,
    settle_start: bool = False,
) -> Prepared:
    """Take a structure, or many that vary it, through its stages.

    Parameters
    ----------
    structure, ground
        The structure, and what all its histories share.
    arrays
        Those of the structure, or with a leading axis of runs where these vary.
    n_runs
        Number of runs.
    settle_start
        Let a start that is an unstable equilibrium fall before the history goes on.
    """
    inputs, nodes = initial_inputs(arrays), arrays.coordinates[None]
    ends: list[StageEnd] = []
    for name, after in stage_targets(structure, arrays):
        reference = reference_tensions([end.tensions for end in ends] or [np.zeros(1)], arrays.stiffness)
        leg = Leg(
            name,
            stage_inputs(arrays, inputs, after),
            arrays.stiffness,
            nodes,
            reference,
            n_runs,
            recorded=n_runs == 1,
        )
        end = _after(ground, leg, ends[-1]) if ends else first_leg(ground, leg, settle=settle_start)
        ends.append(end)
        inputs, nodes = after, end.nodes
    varied = arrays is not ground.arrays  # of a single run, too
    return Prepared(structure, replace(ground, arrays=arrays) if varied else ground, tuple(ends), inputs)


def _after(ground: Ground, leg: Leg, before: StageEnd) -> StageEnd:
    """Follow a leg from where the one before it ended, as far as it came to its end."""
    missing = [missing_start(before, run) for run in range(leg.n_runs)]
    there = np.where(np.isfinite(leg.start), leg.start, ground.arrays.coordinates)
    there_on = replace(leg, start=there)
    end = follow_leg(ground, there_on) if None in missing else given_up(ground, there_on, "")
    for run, reason in enumerate(missing):
        if reason is not None:
            end.give_up(run, reason)
    return end if ground.settings.policy != "trace" else traced(ground, leg, end)


def missing_start(before: StageEnd, run: int) -> str | None:
    """Return why no path can start where a run ended; None where one can."""
    if before.status[run] is Status.FAILED:
        return f"stage '{before.name}' failed"
    if before.parameter[run] < 1.0:
        return f"stage '{before.name}' stopped at {100 * before.parameter[run]:.4g} %"
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


def actuated(
    prepared: Prepared,
    way: StageInputs,
    n_runs: int,
    modes: FloatArray | None = None,
    directions: Sequence[Direction] = (),
) -> StageEnd:
    """Follow an actuation of one run or of many from the ends of the stages."""
    ground = prepared.ground
    leg = Leg(
        ACTUATION,
        way,
        prepared.arrays.stiffness,
        prepared.nodes,
        prepared.reference,
        n_runs,
        recorded=n_runs == 1,
        modes=modes,
        directions=directions,
    )
    return _after(ground, leg, prepared.ends[-1].of_all(n_runs))


def actuate(prepared: Prepared, run: Actuation) -> EquilibriumPath:
    """Follow an actuation from the last stage's equilibrium."""
    structure, arrays, ground = prepared.structure, prepared.arrays, prepared.ground
    way, inputs = actuation_inputs(structure, arrays, prepared.inputs, run)
    ends = list(prepared.ends)
    if run.acts:
        ends.append(actuated(prepared, way, 1))
    parameter = float(ends[-1].parameter[0]) if run.acts else 0.0
    force = way.loads_at(parameter)
    load = Load(way.rest_length_at(parameter), arrays.stiffness, force, ground.settings.residual)
    return EquilibriumPath(
        structure=structure,
        stages=prepared.equilibria,
        actuation=equilibrium_of(structure, ground, ends[-1]) if run.acts else None,
        given=Given(structure, arrays, inputs, run),
        load=load,
        freedom=ground.freedom(force),
        critical_points=tuple(point for end in ends for point in end.critical_points[0]),
        slack_events=tuple(event for end in ends for event in end.slack_events),
        history=tuple(
            replace(point, nodes=point.nodes + arrays.origin) for end in ends for point in end.history
        ),
    )


def equilibrium_of(structure: Structure, ground: Ground, end: StageEnd) -> Equilibrium:
    """Return the end of a single run as an equilibrium, with the names of what is free there."""
    arrays, load = ground.arrays, end.load
    result = Equilibrium(
        structure=structure,
        stage=end.name,
        status=end.status[0],
        reason=end.reason[0],
        nodes=end.nodes[0] + arrays.origin,
        tensions=end.tensions[0],
        slack=arrays.is_cable & (end.tensions[0] == 0.0),
        residual=float(end.residual[0]),
        lowest_eigenvalue=float(end.lowest_eigenvalue[0]),
        n_negative=int(end.n_negative[0]),
        strain_energy=float(end.strain_energy[0]),
        steps=int(end.steps[0]),
        iterations=int(end.iterations[0]),
        parameter=float(end.parameter[0]),
        forces=load.force,
        arrays=arrays,
        rigid_motions=end.free_motions,
    )
    if result.status is Status.COLLAPSED:
        motions = ground.freedom(load.force).neutral
        return with_mechanisms(result, motions, end.nodes[0], load)
    return result


def softest_modes(prepared: Prepared) -> FloatArray:
    """Return the softest modes of K at the end of the stages, ``(n, n_nodes, 3)``, if any."""
    end, ground = prepared.ends[-1], prepared.ground
    nowhere = np.zeros((0, ground.arrays.n_nodes, 3))
    if end.status[0] not in (Status.STABLE, Status.SNAPPED) or ground.pattern.n_blocks > LARGEST_IN_LANES:
        return nowhere
    load = end.load
    tangent = Tangent(ground.arrays, motions=ground.freedom(load.force).neutral, nodes=end.nodes[0])
    tangent.measure(end.nodes[0], load)
    return tangent.spectrum(N_VECTORS).vectors
