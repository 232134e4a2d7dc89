"""Many runs of one structure: arrays in, arrays out."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import AXES, BoolArray, FloatArray, structure_arrays
from tensegra.mechanics.block import (
    LOCKSTEP_KINDS,
    Parameter,
    RunResults,
    differentiate_block,
    n_runs_of,
    part,
    run_end,
    solve_block,
)
from tensegra.mechanics.derivatives import Derivative, ParameterKind
from tensegra.mechanics.endloads import end_loads
from tensegra.mechanics.inputs import Actuation
from tensegra.mechanics.path import prepare, softest_modes
from tensegra.mechanics.reactions import reactions
from tensegra.mechanics.settings import PathSettings, Policy, Procedure, path_settings
from tensegra.mechanics.stability import free_mechanisms
from tensegra.mechanics.stages import Ground
from tensegra.mechanics.status import Status, axis_index, index_of, names_in
from tensegra.mechanics.strains import strain_limits
from tensegra.mechanics.variants import Variants, varied_arrays
from tensegra.presented import Presented
from tensegra.savable import Savable
from tensegra.structure import Structure
from tensegra.viewable import Viewable

if TYPE_CHECKING:
    import pandas as pd

Coordinate = tuple[str, str]

BLOCK = 4096
"""Runs that are prepared, solved and gathered together: what bounds the memory beside the results."""


@dataclass(frozen=True, eq=False, repr=False)
class Batch(RunResults, Presented, Savable, Viewable):
    """Results of many runs, with the runs themselves.

    Attributes
    ----------
    structure
        The structure.
    inputs, variants
        What the runs prescribe after and before the stages.
    parameters
        What was differentiated by along with the solution, as pairs of kind and name.
    ground
        What all their histories share, for what is still computed on demand.
    """

    structure: Structure
    inputs: Actuation
    variants: Variants
    ground: Ground
    parameters: tuple[Parameter, ...] = ()

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

    @property
    def strains(self) -> FloatArray:
        """Strain T/EA of every member, ``(n_runs, n_members)``, tension positive; NaN where failed."""
        arrays = varied_arrays(self.structure, structure_arrays(self.structure), self.variants)
        strains: FloatArray = self.tensions / arrays.stiffness
        return strains

    @property
    def largest_strain(self) -> FloatArray:
        """Largest strain of a member in magnitude, shape ``(n_runs,)``; NaN where failed."""
        largest: FloatArray = np.abs(self.strains).max(axis=1)
        return largest

    @property
    def beyond_law(self) -> BoolArray:
        """Whether a member is strained beyond the limit of its linear law, shape ``(n_runs,)``."""
        return np.asarray((np.abs(self.strains) > strain_limits(self.structure)).any(axis=1))

    @cached_property
    def reactions(self) -> FloatArray:
        """Forces of the supports on the structure, ``(n_runs, n_nodes, 3)``, computed when asked for."""
        arrays = structure_arrays(self.structure)
        loads = end_loads(self.structure, self.inputs, self.variants, self.parameter)
        blocks = (
            reactions(arrays, self.nodes[runs], self.tensions[runs], loads[runs])
            for runs in _blocks(self.n_runs)
        )
        return np.concatenate(list(blocks))

    def reaction(self, axis: str, nodes: str | int | Sequence[str | int]) -> FloatArray:
        """Sum of the reactions at the named nodes along an axis, shape ``(n_runs,)``."""
        total: FloatArray = self.reactions[:, self._rows(nodes), axis_index(axis)].sum(axis=1)
        return total

    def to_dataframe(self) -> "pd.DataFrame":
        """Return a row for each run.

        Columns are ``status``, ``reason``, ``residual``, ``lowest_eigenvalue``, ``steps`` and ``iterations``,
        then ``<node>.x|y|z`` in the unit of length and ``T.<member>`` in the unit of force; NaN where failed.
        """
        import pandas as pd

        columns: dict[str, Any] = {
            "status": self.status.astype(str),
            "reason": self.reason.astype(str),
            "residual": self.residual,
            "lowest_eigenvalue": self.lowest_eigenvalue,
            "steps": self.steps,
            "iterations": self.iterations,
        }
        names = [f"{node}.{axis}" for node in self.node_ids for axis in AXES]
        columns |= dict(zip(names, self.nodes.reshape(self.n_runs, -1).T, strict=True))
        columns |= dict(zip((f"T.{member}" for member in self.member_ids), self.tensions.T, strict=True))
        return pd.DataFrame(columns)

    def derivative(self, name: object, of: ParameterKind = "actuation") -> Derivative:
        """Differentiate positions and tensions of all runs by one parameter, exactly.

        At next to no cost for what `solve_batch` was asked to differentiate by; otherwise the runs
        are certified once more.

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
        if (of, name) in self.parameters:
            q = self.parameters.index((of, name))
            return Derivative(self.nodes_by[:, q], self.tensions_by[:, q])
        blocks = [
            differentiate_block(
                self.structure,
                part(self.inputs, runs),
                self.variants.part(runs),
                self.ground,
                self.nodes[runs],
                self.start[runs] if len(self.start) > 1 else self.start,
                np.isin(self.status[runs], (Status.STABLE, Status.SNAPPED)),
                of,
                name,
            )
            for runs in _blocks(self.n_runs)
        ]
        return Derivative(
            np.concatenate([block.nodes for block in blocks]),
            np.concatenate([block.tensions for block in blocks]),
        )

    def mechanisms(self, run: int) -> tuple[tuple[str, ...], ...]:
        """Name the nodes that each free mechanism moves most where a run has collapsed; none elsewhere.

        Parameters
        ----------
        run
            Its place.
        """
        if self.status[run] != Status.COLLAPSED:
            return ()
        end = run_end(self.structure, self.ground, self.inputs, self.variants, run, self.parameter[run])
        nodes = self.nodes[run] - self.ground.arrays.origin
        return free_mechanisms(end.arrays, end.motions, nodes, end.load)

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
    derivatives: Sequence[object] = (),
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
    derivatives
        What to differentiate by along with the solution: names of actuators, of members or groups
        (temperature), or pairs such as ``("load", ("9", "z"))`` of one of `LOCKSTEP_KINDS` and a
        name. `Batch.derivative` gives them.
    path
        ``adaptive``, the default, or ``stepped``: all runs by the plain procedure of the source.
    policy
        What to do where a stable path ends: ``settle``, the default, ``stop`` or ``trace``.
    settings
        How the runs are followed.

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
    n_runs = n_runs_of(inputs, variants)
    variants.check(structure)
    parameters = tuple(_parameter(structure, asked) for asked in derivatives)
    base = prepare(structure, settings=settings)
    ground = base.ground.on_threads(threads)
    base, modes = replace(base, ground=ground), softest_modes(base)
    blocks = [
        solve_block(structure, part(inputs, runs), variants.part(runs), parameters, base, modes)
        for runs in _blocks(n_runs)
    ]
    columns = {
        column.name: np.concatenate([getattr(block, column.name) for block in blocks])
        for column in fields(RunResults)
    }
    if not variants.vary:
        columns["start"] = blocks[0].start
    return Batch(
        structure=structure,
        inputs=inputs,
        variants=variants,
        ground=ground,
        parameters=parameters,
        **columns,
    )


def _parameter(structure: Structure, asked: object) -> Parameter:
    """Return the kind and the name of a parameter: an actuator, else a temperature, or what is said."""
    if isinstance(asked, tuple) and len(asked) == 2:
        if asked[0] not in LOCKSTEP_KINDS:
            raise ModelError.at("derivatives", asked[0], "a kind of parameter", candidates=LOCKSTEP_KINDS)
        return asked
    if asked in structure.actuators:
        return "actuation", asked
    known = (*structure.actuators, *structure.groups, *structure.members)
    if asked not in known:
        raise ModelError.at("derivatives", asked, "an actuator, a group or a member", candidates=known)
    return "temperature", asked


def _blocks(n_runs: int) -> list[slice]:
    """Return the blocks of the runs; one, empty, where there are none."""
    return [slice(first, min(first + BLOCK, n_runs)) for first in range(0, max(n_runs, 1), BLOCK)]


def _columns(group: Mapping[Any, ArrayLike] | None) -> dict[Any, FloatArray]:
    return {name: np.atleast_1d(np.asarray(v, dtype=np.float64)) for name, v in (group or {}).items()}
