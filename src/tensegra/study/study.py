"""A study: the question that a campaign answers, frozen."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.structure import Structure
from tensegra.structure.frozen import FrozenMapping
from tensegra.structure.mapping import structure_to_mapping
from tensegra.study.analyses import AnalysisEntry, SurrogateEntry
from tensegra.study.derivatives import DIFFERENTIABLE, derivative_name
from tensegra.study.entry import Entry
from tensegra.study.evaluate import Runs, Solver, evaluate
from tensegra.study.memory import campaign_bytes, require_room
from tensegra.study.outputs import Output
from tensegra.study.sampling import (
    n_design_points,
    sampling_advice,
    unit_points,
)
from tensegra.study.schema import SCHEMA
from tensegra.study.selection import SelectionEntry
from tensegra.study.solver import SolverEntry
from tensegra.study.space import Space
from tensegra.study.variables import Variable

if TYPE_CHECKING:
    from tensegra.study.campaign import Campaign
    from tensegra.study.executors import Executor

__all__ = ["RUN_COLUMNS", "Study", "design_points", "require_room_for"]

RUN_COLUMNS = ("status", "reason", "residual", "lowest_eigenvalue", "steps", "iterations", "seconds")
"""Columns of a campaign beside the variables and the outputs."""

RESULTS_VERSION = 1
"""Raised when the solver's answers change, so that old runs are not taken for new ones."""


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """What is varied, what is wanted, and how it is sampled, learned and questioned.

    Attributes
    ----------
    name, description
        For people.
    structure
        With the study's changes applied.
    space
        The variables and their dependence.
    outputs
        The quantities of interest.
    design
        The entry of the design; `design_points` draws it.
    solver
        How the paths of the runs are followed.
    derivatives
        Whether a campaign stores the derivatives of the outputs, too.
    points
        The points of a design from a file, shape (n_points, n_inputs), else None.
    seed
        Of everything random.
    selection, surrogates, analyses
        Their entries.
    """

    name: str
    structure: Structure
    space: Space
    outputs: tuple[Output, ...]
    design: Entry
    solver: SolverEntry = field(default_factory=SolverEntry)
    derivatives: bool = False
    points: NDArray[np.float64] | None = None
    seed: int = 0
    selection: SelectionEntry = field(default_factory=SelectionEntry)
    surrogates: Mapping[str, SurrogateEntry] = FrozenMapping()
    analyses: tuple[AnalysisEntry, ...] = ()
    description: str = ""

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The variables, in the order of the columns of a design."""
        return self.space.variables

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the variables."""
        return self.space.names

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(output.name for output in self.outputs)

    @property
    def derivative_names(self) -> tuple[str, ...]:
        """Names of the columns of derivatives, output by output; none if they are not asked for."""
        if not self.derivatives:
            return ()
        return tuple(
            derivative_name(output.name, variable)
            for output in self.outputs
            if output.quantity in DIFFERENTIABLE
            for variable in self.input_names
        )

    @property
    def n_points(self) -> int:
        """Number of points of the design."""
        return (
            len(self.points) if self.points is not None else n_design_points(self.design, self.space.n_inputs)
        )

    @property
    def advice(self) -> tuple[str, ...]:
        """What the author of the study should know of its design."""
        return sampling_advice(self.design)

    @cached_property
    def fingerprint(self) -> str:
        """The SHA-256, in hexadecimal, of all that the rows of a campaign depend on.

        Structure, variables with their laws, outputs with or without derivatives, and the solver;
        neither the design, which only says which rows there are, nor what is made of them.
        """
        content = {
            "results_version": RESULTS_VERSION,
            "structure": self.structure.fingerprint,
            "variables": {variable.name: _unlabelled(variable.to_mapping()) for variable in self.variables},
            "correlation": None if self.space.correlation is None else self.space.correlation.tolist(),
            "outputs": {output.name: _unlabelled(output.to_mapping()) for output in self.outputs},
            "solver": self.solver.acting,
            "derivatives": self.derivatives,
        }
        return sha256(json.dumps(content).encode()).hexdigest()

    def evaluate(
        self,
        X: ArrayLike,
        *,
        derivatives: bool = False,
        threads: int | None = None,
        solver: Solver | None = None,
    ) -> Runs:
        """Solve the structure at design points.

        Parameters
        ----------
        X
            Design points, shape (n_points, n_inputs).
        derivatives
            Whether to differentiate the outputs, too.
        threads
            Threads of the solver, one a core if left out; the results do not depend on it.
        solver
            `tensegra.mechanics.solve_batch` with the study's settings if left out.

        Raises
        ------
        StudyError
            As `tensegra.study.evaluate`.
        """
        return evaluate(
            self.structure,
            self.variables,
            self.outputs,
            X,
            derivatives=derivatives,
            solver=solver or self.solver.solver(threads),
        )

    def run(
        self,
        folder: str | PathLike[str],
        workers: int = 1,
        *,
        scheduler: str | None = None,
        progress: "Callable[[int, int, int], object] | None" = None,
        executor: "Executor | None" = None,
        solver: Solver | None = None,
    ) -> "Campaign":
        """Run the study's design, or what of it is still missing in `folder`.

        Parameters
        ----------
        folder
            The campaign's folder; created if there is none, resumed if it holds this study.
        workers
            With 1 this process solves the runs, on all its threads; with more, as many processes of a
            local Dask cluster do.
        scheduler
            Address of a Dask scheduler, such as ``tcp://node7:8786``, whose workers do it instead.
        progress
            Called as ``progress(done, total, failed)`` at the beginning and after each block of runs.
        executor
            What carries out the blocks, instead of `workers` and `scheduler`.
        solver
            `tensegra.mechanics.solve_batch` with the study's settings if left out.

        Returns
        -------
        Campaign
            The finished campaign; its rows are the same whoever solved them.

        Raises
        ------
        StudyError
            If the folder belongs to another study, is being run by another process, or cannot be
            written; if there is no scheduler, or no worker, or no Dask where it is needed.
        """
        from tensegra.study.driver import run_campaign

        return run_campaign(
            self,
            folder,
            workers,
            scheduler=scheduler,
            progress=progress,
            executor=executor,
            solver=solver,
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the resolved study: what its file would hold with everything explicit.

        The structure stands in it as it is after the changes, quantities are plain numbers and
        measurements are read in, so that it needs no other file (but the points of a file design).
        """
        mapping: dict[str, Any] = {
            "schema": SCHEMA,
            "name": self.name,
            "description": self.description,
            "structure": structure_to_mapping(self.structure),
            "seed": self.seed,
            "variables": {variable.name: variable.to_mapping() for variable in self.variables},
            "outputs": {output.name: output.to_mapping() for output in self.outputs},
            "solver": self.solver.acting,
            "derivatives": self.derivatives,
            "design": self.design.written(),
            "selection": self.selection.written(),
            "surrogates": {name: entry.written() for name, entry in self.surrogates.items()},
            "analyses": [entry.written() for entry in self.analyses],
        }
        if self.space.correlation is not None:
            mapping["correlation"] = self.space.correlation.tolist()
        return mapping

    def __repr__(self) -> str:
        return (
            f"Study({self.name!r}: {', '.join(self.input_names)} → {', '.join(self.output_names)}; "
            f"{self.n_points} points)"
        )


def require_room_for(study: Study) -> None:
    """Refuse a design that would not fit into the memory, before a point of it is drawn.

    Raises
    ------
    StudyError
        With the memory that it would need.
    """
    if study.points is None:
        n_bytes = campaign_bytes(
            study.n_points, study.space.n_inputs, len(study.outputs), derivatives=study.derivatives
        )
        require_room("design", f"{study.n_points} points", n_bytes)


def design_points(study: Study) -> NDArray[np.float64]:
    """Return the design points of a study, shape (n_points, n_inputs), in the variables' units.

    A sampled point that a law places beyond its box (with a probability of 1e-6) is moved onto the
    box's face, so that surrogates are never trained outside it.

    Examples
    --------
    >>> from tensegra.study import parse_study
    >>> study = parse_study({
    ...     "structure": "library:paper_beam",
    ...     "variables": {"a": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.1]}}},
    ...     "outputs": {"w": {"displacement": "z", "nodes": [18, 23]}},
    ...     "design": {"sampler": "full_factorial", "levels": 3},
    ... })
    >>> study
    Study('study': a → w; 3 points)
    >>> design_points(study).ravel()
    array([0.  , 0.05, 0.1 ])
    """
    if study.points is not None:
        return study.points
    require_room_for(study)
    U = unit_points(study.design, study.input_names, study.seed)
    # Adding zero turns -0.0 into 0.0: one point has one representation.
    return study.space.clip(study.space.from_unit(U)) + 0.0


def _unlabelled(mapping: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in mapping.items() if key != "label"}
