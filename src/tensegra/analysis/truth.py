"""The true model: the structure itself, solved anew at every point."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.model import Evaluation, central_differences, points

if TYPE_CHECKING:
    from tensegra.study.evaluate import Runs, Solver
    from tensegra.study.outputs import Output
    from tensegra.study.space import Space
    from tensegra.study.study import Study

Array = NDArray[np.float64]

# The statuses whose numbers are those of one equilibrium that stands. `collapsed` has no unique position and
# `unstable` falls; surrogates do not learn from them, and an analysis of the truth does not count them
# either.
CERTIFIED = ("stable", "snapped")

# An extreme tension has the derivative of the member that bears it; a number of cables has none but zero.
EXTREMES = {"max_tension": np.argmax, "min_tension": np.argmin}
COUNT = "slack_cables"


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
    ahead
        Whether `evaluate` differentiates too and remembers, for a method that asks for the derivatives next.
    of
        Outputs to differentiate, all unless given; the derivatives of the others are NaN.
    within
        The box (n_inputs, 2) that differences stay in, where it is narrower than that of the space.
    """

    study: "Study"
    statuses: tuple[str, ...] = CERTIFIED
    name: str = "truth"
    solver: "Solver | None" = None
    ahead: bool = False
    of: tuple[str, ...] | None = None
    within: Array | None = None
    _kept: dict[bytes, Array] = field(default_factory=dict, init=False, repr=False, compare=False)

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

    @property
    def counts(self) -> tuple[str, ...]:
        """Outputs that count, so that only whole numbers can be equal."""
        return tuple(output.name for output in self.study.outputs if output.quantity == COUNT)

    def confined(self, box: Array) -> "TrueModel":
        """Return the model that takes its differences within a box (n_inputs, 2)."""
        return replace(self, within=box)

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Solve the structure at the points `X` (n, n_inputs)."""
        X = points(X, self.input_names)
        study = self._differentiable if self.ahead else self.study
        runs = study.evaluate(X, derivatives=self.ahead, solver=self.solver)
        values = runs.Y[:, : len(self.output_names)]
        valid = np.isfinite(values).all(axis=1) & np.isin(runs.status, self.statuses)
        if self.ahead:
            self._kept.clear()
            self._kept[X.tobytes()] = self._derivatives(X, runs)
        return Evaluation(np.where(valid[:, None], values, np.nan), valid, runs.status)

    def gradient(self, X: ArrayLike) -> Array:
        """Return the derivatives (n, n_outputs, n_inputs), NaN where there is no certified equilibrium.

        They are exact, from the factorised stiffness, but for the lowest eigenvalue: central differences.
        """
        X = points(X, self.input_names)
        kept = self._kept.get(X.tobytes())
        if kept is not None:
            return kept
        return self._derivatives(X, self._differentiable.evaluate(X, derivatives=True, solver=self.solver))

    def uncertainty(self, X: ArrayLike) -> None:
        """Return None: the truth has no error of its own."""

    @cached_property
    def _differentiable(self) -> "Study":
        """The study with the tension of every member that may bear an extreme one as a further output."""
        bearers = {
            member: None
            for output in self.study.outputs
            if output.quantity in EXTREMES and self._is_wanted(output)
            for member in output.members
        }
        return replace(self.study, outputs=(*self.study.outputs, *map(_tension_of, bearers)))

    def _is_wanted(self, output: "Output") -> bool:
        return self.of is None or output.name in self.of

    def _derivatives(self, X: Array, runs: "Runs") -> Array:
        assert runs.dY is not None  # noqa: S101 - asked for
        outputs, n_outputs = self._differentiable.outputs, len(self.output_names)
        dY = np.array(runs.dY[:, :n_outputs])
        column = {output.target: k for k, output in enumerate(outputs) if k >= n_outputs}
        for k, output in enumerate(self.study.outputs):
            if not self._is_wanted(output):
                dY[:, k] = np.nan
            elif output.quantity in EXTREMES:
                borne = [column[member] for member in output.members]
                which = EXTREMES[output.quantity](np.nan_to_num(runs.Y[:, borne]), axis=1)
                dY[:, k] = runs.dY[np.arange(len(X)), np.array(borne)[which]]
            elif output.quantity == COUNT:
                dY[:, k] = 0.0
        rest = [
            k
            for k, output in enumerate(self.study.outputs)
            if output.quantity not in _EXACT and self._is_wanted(output)
        ]
        if rest:
            study = replace(self.study, outputs=tuple(self.study.outputs[k] for k in rest))
            dY[:, rest] = central_differences(
                replace(self, study=study, ahead=False, of=None), X, self.within
            )
        dY[~np.isin(runs.status, self.statuses)] = np.nan
        return dY


_EXACT = ("displacement", "coordinate", "distance", "tension", *EXTREMES, COUNT)


def _tension_of(member: str) -> "Output":
    from tensegra.study.outputs import Output

    return Output(f"tension of {member}", "tension", member, members=(member,))
