"""The beam's outputs that the publication speaks of, for many runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.mechanics import PathSettings, Status, solve_batch
from tensegra.structure import Structure

__all__ = ["TIP", "BeamRuns", "solve_beam"]

Array: TypeAlias = NDArray[np.float64]

TIP = ("18", "23")
"""Nodes of the free end whose mean displacement the publication optimises; it also prints 23 alone."""

TEMPERATURE = "T_"
"""What the name of an input begins with that is a temperature of a group; all others are actuators."""


@dataclass(frozen=True, eq=False)
class BeamRuns:
    """Solved runs of the beam.

    Attributes
    ----------
    inputs
        By name, such as ``A14`` or ``T_top``, each of shape (n_runs,).
    status
        Text of `tensegra.mechanics.Status` by run, shape (n_runs,).
    tip
        Displacements of the nodes of `TIP` from the last stage's equilibrium, shape (n_runs, 2, 3), cm;
        NaN where failed.
    n_slack
        Number of slack cables, shape (n_runs,).
    strain
        Largest strain of a member in magnitude, shape (n_runs,); NaN where failed.
    beyond_law
        Whether a member is strained beyond the limit of the linear law, shape (n_runs,).
    seconds
        Time on the clock that solving took, when it was done.
    """

    inputs: Mapping[str, Array]
    status: NDArray[np.str_]
    tip: Array
    n_slack: NDArray[np.int64]
    strain: Array
    beyond_law: NDArray[np.bool_]
    seconds: float

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self.status)

    @cached_property
    def X(self) -> Array:  # noqa: N802 - the matrix of inputs, as everywhere
        """Inputs, shape (n_runs, n_inputs), in the order of `inputs`."""
        return np.column_stack(list(self.inputs.values()))

    @property
    def v(self) -> Array:
        """Mean displacement along y of the tip's nodes, shape (n_runs,), cm."""
        return np.asarray(self.tip[:, :, 1].mean(axis=1))

    @property
    def w(self) -> Array:
        """Mean displacement along z of the tip's nodes, shape (n_runs,), cm."""
        return np.asarray(self.tip[:, :, 2].mean(axis=1))

    def displacement(self, axis: str, node: str) -> Array:
        """Displacement of one of the tip's nodes along an axis, shape (n_runs,), cm."""
        return np.asarray(self.tip[:, TIP.index(node), "xyz".index(axis)])

    @cached_property
    def stands(self) -> NDArray[np.bool_]:
        """Whether the run ends in a stable equilibrium, shape (n_runs,)."""
        return np.isin(self.status, (str(Status.STABLE), str(Status.SNAPPED)))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return plain arrays, as they are kept in a file."""
        kept = {f"input_{name}": column for name, column in self.inputs.items()}
        others = {name: getattr(self, name) for name in ("status", "tip", "n_slack", "strain", "beyond_law")}
        return kept | others | {"seconds": np.array(self.seconds)}

    @classmethod
    def of_arrays(cls, kept: Mapping[str, NDArray[Any]]) -> "BeamRuns":
        """Build the runs from `to_arrays`."""
        inputs = {k.removeprefix("input_"): v for k, v in kept.items() if k.startswith("input_")}
        others = {k: v for k, v in kept.items() if not k.startswith("input_") and k != "seconds"}
        return cls(inputs, seconds=float(kept["seconds"]), **others)

    @classmethod
    def joined(cls, parts: "list[BeamRuns]") -> "BeamRuns":
        """Put blocks of runs one after the other; their times add up."""
        names = [name for name in parts[0].to_arrays() if name != "seconds"]
        arrays = [part.to_arrays() for part in parts]
        joined: dict[str, NDArray[Any]] = {name: np.concatenate([a[name] for a in arrays]) for name in names}
        return cls.of_arrays(joined | {"seconds": np.array(sum(part.seconds for part in parts))})


def solve_beam(
    structure: Structure,
    inputs: Mapping[str, Array],
    settings: PathSettings | None = None,
    *,
    threads: int | None = None,
) -> BeamRuns:
    """Solve runs of the beam.

    Parameters
    ----------
    structure
        One of the beams.
    inputs
        By name: values of an actuator, or of the temperature of a group for ``T_`` and its name; each
        of shape (n_runs,).
    settings
        How the paths are followed.
    threads
        One a core where left out.

    Examples
    --------
    >>> from tensegra.structure import library
    >>> solve_beam(library.paper_beam(), {"A14": np.array([0.1]), "A23": np.array([0.1])}).w.round(2)
    array([53.15])
    """
    began = perf_counter()
    actuation = {name: column for name, column in inputs.items() if not name.startswith(TEMPERATURE)}
    temperature = {
        name.removeprefix(TEMPERATURE): column
        for name, column in inputs.items()
        if name.startswith(TEMPERATURE)
    }
    runs = solve_batch(
        structure, actuation=actuation, temperature=temperature, threads=threads, settings=settings
    )
    rows = [structure.node_ids.index(node) for node in TIP]
    return BeamRuns(
        inputs=dict(inputs),
        status=runs.status.astype(np.str_),
        tip=runs.displacements[:, rows],
        n_slack=runs.slack.sum(axis=1),
        strain=runs.largest_strain,
        beyond_law=runs.beyond_law,
        seconds=perf_counter() - began,
    )
