"""The true model: the structure itself, solved anew at every point."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.model import Evaluation, central_differences, points

if TYPE_CHECKING:
    from tensegra.study.evaluate import Solver
    from tensegra.study.space import Space
    from tensegra.study.study import Study

Array = NDArray[np.float64]

# The statuses whose numbers are those of one equilibrium that stands. `collapsed` has no unique position and
# `unstable` falls; surrogates do not learn from them, and an analysis of the truth does not count them
# either.
CERTIFIED = ("stable", "snapped")


@dataclass(frozen=True)
class TrueModel:
    """A study's structure, variables and outputs as a model.

    Parameters
    ----------
    study
        Its structure is solved (`Study.evaluate`); its space is the law of the inputs.
    statuses
        Statuses of a run that count as a result.
    name
        The name that results carry.
    solver
        `tensegra.mechanics.solve_batch` unless given.
    """

    study: "Study"
    statuses: tuple[str, ...] = CERTIFIED
    name: str = "truth"
    solver: "Solver | None" = None

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the study's variables."""
        return self.study.input_names

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the study's outputs."""
        return self.study.output_names

    @property
    def bounds(self) -> Array:
        """The finite box of the study's space."""
        return self.study.space.bounds

    @property
    def space(self) -> "Space":
        """The study's space."""
        return self.study.space

    @property
    def units(self) -> Mapping[str, str]:
        """Units of variables and outputs."""
        inputs = {variable.name: variable.unit for variable in self.study.variables}
        return inputs | {output.name: output.unit for output in self.study.outputs}

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Solve the structure at the points `X` (n, n_inputs)."""
        runs = self.study.evaluate(points(X, self.input_names), solver=self.solver)
        valid = runs.valid & np.isin(runs.status, self.statuses)
        return Evaluation(np.where(valid[:, None], runs.Y, np.nan), valid, runs.status)

    def gradient(self, X: ArrayLike) -> Array:
        """Return derivatives (n, n_outputs, n_inputs) by central differences inside the box."""
        return central_differences(self, points(X, self.input_names))

    def uncertainty(self, X: ArrayLike) -> None:
        """Return None: the truth has no error of its own."""
