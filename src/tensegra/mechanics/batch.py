"""Many runs of one structure: arrays in, arrays out."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegra.errors import ModelError
from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray
from tensegra.mechanics.follow import PathSettings
from tensegra.mechanics.inputs import Actuation, members_named
from tensegra.mechanics.path import Prepared, actuate, prepare
from tensegra.mechanics.results import EquilibriumPath, axis_index
from tensegra.structure import Structure

Coordinate = tuple[str, str]


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
    displacements
        From the last stage's equilibrium, ``(n_runs, n_nodes, 3)``.
    tensions
        Tension positive, ``(n_runs, n_members)``, unit of force.
    slack
        True for cables that carry nothing, ``(n_runs, n_members)``.
    residual, lowest_eigenvalue
        Certificate of each run, ``(n_runs,)``.
    steps, iterations
        Increments and Newton solves after the stages, ``(n_runs,)``.
    seconds
        Time spent on each run, ``(n_runs,)``.
    """

    structure: Structure = field(repr=False)
    status: np.ndarray[Any, np.dtype[np.str_]]
    reason: np.ndarray[Any, np.dtype[np.object_]]
    nodes: FloatArray
    displacements: FloatArray
    tensions: FloatArray
    slack: BoolArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    steps: IndexArray
    iterations: IndexArray
    seconds: FloatArray

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

    def displacement(self, axis: str, nodes: Sequence[str | int]) -> FloatArray:
        """Mean displacement of the named nodes along an axis, shape ``(n_runs,)``."""
        mean: FloatArray = self.displacements[:, self._rows(nodes), axis_index(axis)].mean(axis=1)
        return mean

    def coordinate(self, axis: str, nodes: Sequence[str | int]) -> FloatArray:
        """Mean coordinate of the named nodes along an axis, shape ``(n_runs,)``."""
        mean: FloatArray = self.nodes[:, self._rows(nodes), axis_index(axis)].mean(axis=1)
        return mean

    def tension(self, member: str | int) -> FloatArray:
        """Tension of a member, shape ``(n_runs,)``."""
        if str(member) not in self.structure.members:
            raise ModelError.at("tension", member, "the id of a member", candidates=self.structure.members)
        return self.tensions[:, self.member_ids.index(str(member))]

    def _rows(self, nodes: Sequence[str | int]) -> list[int]:
        for node in nodes:
            if str(node) not in self.structure.nodes:
                raise ModelError.at("nodes", node, "the id of a node", candidates=self.structure.nodes)
        return [self.node_ids.index(str(node)) for node in nodes]


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
    settings
        How paths are followed.

    Raises
    ------
    ModelError
        For a name or a value that cannot be; arrays of different lengths.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> runs = solve_batch(library.paper_beam(), actuation={"A14": [0.05, 0.1], "A23": [0.05, 0.1]})
    >>> runs.displacement("z", nodes=[18, 23]).round(2)
    array([27.55, 53.15])
    """
    after: dict[str, Mapping[Any, ArrayLike]] = {
        "actuation": actuation or {},
        "temperature": temperature or {},
        "loads": loads or {},
        "positions": positions or {},
    }
    before: dict[str, Mapping[str, ArrayLike]] = {
        "youngs_modulus": youngs_modulus or {},
        "area": area or {},
        "rest_length": rest_length or {},
    }
    columns = _columns({**after, **before})
    n_runs = len(next(iter(columns.values()))) if columns else 1
    results: list[tuple[EquilibriumPath, float]] = []
    shared = prepare(structure, settings=settings) if not any(before.values()) else None
    for run in range(n_runs):
        started = time.perf_counter()
        prepared = shared or _prepared_variant(structure, before, columns, run, settings)
        inputs = {what: {name: columns[what, name][run] for name in values} for what, values in after.items()}
        results.append((actuate(prepared, Actuation(**inputs)), time.perf_counter() - started))
    return _gather(structure, results)


def _columns(groups: Mapping[str, Mapping[Any, ArrayLike]]) -> dict[tuple[str, Any], FloatArray]:
    columns = {
        (what, name): np.atleast_1d(np.asarray(values, dtype=np.float64))
        for what, mapping in groups.items()
        for name, values in mapping.items()
    }
    n_runs = max((len(values) for values in columns.values()), default=1)
    for (what, name), values in columns.items():
        if values.shape != (n_runs,):
            raise ModelError.at(f"{what} {name}", values.shape, f"one value for each of the {n_runs} runs")
    return columns


def _prepared_variant(
    structure: Structure,
    before: Mapping[str, Mapping[str, ArrayLike]],
    columns: Mapping[tuple[str, Any], FloatArray],
    run: int,
    settings: PathSettings | None,
) -> Prepared:
    """Solve the stages of a structure whose materials, areas or rest lengths this run changes."""
    materials, members = dict(structure.materials), dict(structure.members)
    for name in before["youngs_modulus"]:
        if name not in materials:
            raise ModelError.at("youngs_modulus", name, "a material", candidates=materials)
        value = float(columns["youngs_modulus", name][run])
        materials[name] = replace(materials[name], youngs_modulus=value)
    for name in before["area"]:
        for member in members_named(structure, name, "area"):
            members[member] = replace(members[member], area=float(columns["area", name][run]))
    for name in before["rest_length"]:
        if name not in members:
            raise ModelError.at("rest_length", name, "a member", candidates=members)
        members[name] = replace(members[name], rest_length=float(columns["rest_length", name][run]))
    return prepare(structure.replace(materials=materials, members=members), settings=settings)


def _gather(structure: Structure, results: Sequence[tuple[EquilibriumPath, float]]) -> Batch:
    def column(values: Iterator[Any], dtype: type = np.float64) -> Any:  # noqa: ANN401 - dtype decides
        return np.array(list(values), dtype=dtype)

    paths = [path for path, _ in results]
    return Batch(
        structure=structure,
        status=column((str(path.status) for path in paths), dtype=np.str_),
        reason=column((path.reason for path in paths), dtype=np.object_),
        nodes=column(path.final.nodes for path in paths),
        displacements=column(path.displacements for path in paths),
        tensions=column(path.final.tensions for path in paths),
        slack=column((path.final.slack for path in paths), dtype=np.bool_),
        residual=column(path.final.residual for path in paths),
        lowest_eigenvalue=column(path.final.lowest_eigenvalue for path in paths),
        steps=column((path.final.steps for path in paths), dtype=np.int64),
        iterations=column((path.final.iterations for path in paths), dtype=np.int64),
        seconds=column(seconds for _, seconds in results),
    )
