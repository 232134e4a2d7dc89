"""The surrogate: one interface for every kind, in the units and names of the study it was trained on."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.presented import Presented
from tensegra.surrogate.problem import FastModel, Model, OutcomeModel, Scaling
from tensegra.surrogate.validation import Validation

if TYPE_CHECKING:
    import pandas as pd

    from tensegra.study.space import Space

__all__ = ["OutsideBoxWarning", "Surrogate"]

Array: TypeAlias = NDArray[np.float64]
Labels: TypeAlias = NDArray[np.str_]
Points: TypeAlias = ArrayLike | Mapping[str, ArrayLike]
Json: TypeAlias = Any  # what the json module reads and writes

ROWS = 128  # points in a row, where only their extremes matter
LISTED = 8  # names that a line holds
BOX_TOLERANCE = 1e-9  # of a side: rounding in the map from the unit cube is not extrapolation


class OutsideBoxWarning(UserWarning):
    """A surrogate was asked about points outside the box that it was trained in."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Surrogate(Presented):
    """A function fitted to runs, that stands for the mechanics where thousands of evaluations are wanted.

    Made by `tensegra.surrogate.fit`. Inputs and outputs are in the study's own units, columns in the order
    of `input_names` and `output_names`.

    Parameters
    ----------
    kind
        ``"gpr"``, ``"nn"``, ``"pce"``, ``"field"`` or ``"piecewise"``.
    input_names, output_names, input_units, output_units
        Names and units of the columns.
    bounds
        The box it was trained in, shape (n_inputs, 2); an evaluation outside warns.
    validation
        How far it is from runs that it has not seen, or None if that was not asked for.
    n_train
        Number of runs it was trained on.
    seconds
        Time of the training.
    seed
        Seed of all that was random in the training.
    options
        Options of the kind, as given.
    study_fingerprint
        Hash of the study that the runs belong to.
    space
        The joint law of the inputs that it was trained under: every marginal, the copula, what each variable
        acts on. Analyses draw from it unless told otherwise. None for the uniform law on `bounds`.
    """

    kind: str
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    bounds: Array
    scaling: Scaling
    model: Model
    validation: Validation | None = None
    n_train: int
    seconds: float
    seed: int
    options: Mapping[str, Json] = field(default_factory=dict)
    study_fingerprint: str = ""
    space: "Space | None" = None

    @property
    def has_std(self) -> bool:
        """Whether ``predict(X, return_std=True)`` can be answered."""
        return self.model.has_std

    @property
    def regime_names(self) -> tuple[str, ...]:
        """The regimes that the surrogate tells apart; none for a kind that knows of none."""
        return self.model.regime_names if isinstance(self.model, OutcomeModel) else ()

    @overload
    def predict(
        self,
        X: Points,
        *,
        return_std: Literal[False] = False,
        return_regime: Literal[False] = False,
        fast: bool = False,
    ) -> Array: ...

    @overload
    def predict(
        self,
        X: Points,
        *,
        return_std: Literal[True],
        return_regime: Literal[False] = False,
        fast: bool = False,
    ) -> tuple[Array, Array]: ...

    @overload
    def predict(
        self,
        X: Points,
        *,
        return_std: Literal[False] = False,
        return_regime: Literal[True],
        fast: bool = False,
    ) -> tuple[Array, Labels]: ...

    @overload
    def predict(
        self, X: Points, *, return_std: Literal[True], return_regime: Literal[True], fast: bool = False
    ) -> tuple[Array, Array, Labels]: ...

    def predict(
        self,
        X: Points,
        *,
        return_std: bool = False,
        return_regime: bool = False,
        fast: bool = False,
    ) -> Array | tuple[Array, Array] | tuple[Array, Labels] | tuple[Array, Array, Labels]:
        """Return the outputs at some points.

        Parameters
        ----------
        X
            Inputs, shape (n_points, n_inputs); or a table (mapping, data frame) with a column of each name.
        return_std
            Also return calibrated standard deviations: the true output lies within ±1.645 of them at about
            90 % of the points.
        return_regime
            Also return the regime that the answer speaks for, shape (n_points,), after the standard
            deviations. Where it is one in which nothing stands, the outputs are NaN.
        fast
            Answer in single precision where the kind can (networks): three times as quick, and exact to about
            1e-6 of the outputs' spread, which is less than a network's own error. Other kinds take no notice.

        Returns
        -------
        ndarray or tuple of ndarray
            Y, shape (n_points, n_outputs); or ``(Y, std)``, ``(Y, regime)``, ``(Y, std, regime)``.

        Raises
        ------
        StudyError
            If the columns are not those of `input_names`, a number is not finite, or a standard deviation
            or a regime is asked of a surrogate that has none.

        Warns
        -----
        OutsideBoxWarning
            If a point lies outside `bounds`.
        """
        points = self._points(X)
        if return_std and not self.has_std:
            raise StudyError(
                f"a surrogate of kind {self.kind!r} as trained here has no standard deviation; "
                "a network has one with `ensemble` of 2 or more"
            )
        if fast and not return_std and not return_regime and isinstance(self.model, FastModel):
            return self.model.predict_fast(points, self.scaling)
        Z = self.scaling.inputs(points)
        Y = self.scaling.output_shift + self.scaling.output_scale * self.model.predict(Z)
        if not return_std:
            return (Y, self._spoken_for(Z)) if return_regime else Y
        std = self.scaling.output_scale * self.model.std(Z)
        return (Y, std, self._spoken_for(Z)) if return_regime else (Y, std)

    def outcome(self, X: Points) -> Array:
        """Return the probability of each regime of `regime_names`.

        Parameters
        ----------
        X
            Inputs, as for `predict`.

        Returns
        -------
        ndarray
            Shape (n_points, n_regimes); the rows sum to one.

        Raises
        ------
        StudyError
            As for `predict`, or if the surrogate knows of no regimes.

        Warns
        -----
        OutsideBoxWarning
            If a point lies outside `bounds`.
        """
        return self._outcome_model().probabilities(self.scaling.inputs(self._points(X)))

    def gradient(self, X: Points) -> Array:
        """Return the exact derivatives of the outputs by the inputs.

        Parameters
        ----------
        X
            Inputs, as for `predict`.

        Returns
        -------
        ndarray
            Shape (n_points, n_outputs, n_inputs), in units of output per unit of input.

        Raises
        ------
        StudyError
            As for `predict`.

        Warns
        -----
        OutsideBoxWarning
            If a point lies outside `bounds`.
        """
        slope = self.model.gradient(self.scaling.inputs(self._points(X)))
        return slope * self.scaling.output_scale[:, None] / self.scaling.input_scale

    def inside(self, X: Points) -> NDArray[np.bool_]:
        """Tell which points lie in the box that the surrogate was trained in; a mask, shape (n_points,)."""
        return np.asarray(self._inside(self._matrix(X)).all(axis=1))

    def save(self, path: str | Path) -> Path:
        """Write the surrogate to one file (see `tensegra.surrogate.storage`) and return its path."""
        from tensegra.surrogate.storage import save

        return save(self, path)

    @classmethod
    def load(cls, path: str | Path) -> "Surrogate":
        """Read a surrogate that `save` wrote; its predictions are the same to the last bit."""
        from tensegra.surrogate.storage import load

        return load(path)

    def describe(self) -> str:
        """Return the surrogate's inputs, box, training and error as a text of several lines."""
        lines = [
            repr(self),
            f"  trained on {self.n_train} runs in {self.seconds:.2f} s, seed {self.seed}"
            + "".join(f", {name} {value}" for name, value in self.options.items()),
            "  inputs",
        ]
        for name, unit, (lower, upper) in zip(self.input_names, self.input_units, self.bounds, strict=True):
            lines.append(f"    {name:<16} {lower:.6g} … {upper:.6g} {unit}".rstrip())
        if self.validation is None:
            lines.append("  not validated")
        else:
            lines.append(f"  error ({self.validation.method})")
            lines += [f"    {line}" for line in self.validation.lines(self.output_units)]
        return "\n".join(lines)

    def to_dataframe(self) -> "pd.DataFrame":
        """Return the errors that were measured, a row for each output; no row where none was."""
        import pandas as pd

        found = self.validation
        measures = ("normalised_error", "r2", "mean_abs_error", "rms_error", "max_abs_error", "coverage_90")
        columns: dict[str, object] = {"output": self.output_names, "unit": self.output_units}
        columns |= {name: getattr(found, name, None) for name in measures}
        frame = pd.DataFrame(columns)
        return frame.iloc[: 0 if found is None else None]

    def __repr__(self) -> str:
        error = "" if self.validation is None else f"; {self.validation.summary()}"
        return (
            f"Surrogate({self.kind!r}: {_listed(self.input_names)} → {_listed(self.output_names)}; "
            f"{self.n_train} runs{error})"
        )

    def _matrix(self, X: Points) -> Array:
        """Return the points as a matrix with the columns of `input_names`, all finite."""
        names = self.input_names
        if isinstance(X, Mapping) or hasattr(X, "columns"):
            table: Any = X
            missing = [name for name in names if name not in table]
            if missing:
                raise StudyError.at("predict: columns", list(table), f"the columns {', '.join(names)}")
            points = np.column_stack([np.asarray(table[name], dtype=np.float64) for name in names])
        else:
            points = np.asarray(X, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != len(names):
            raise StudyError.at(
                "predict: shape of X",
                points.shape,
                f"(n_points, {len(names)}), the columns {', '.join(names)} in this order",
            )
        if not np.all(np.isfinite(points)):
            row, column = np.argwhere(~np.isfinite(points))[0]
            raise StudyError.at(
                f"predict: {names[column]} of point {row}", float(points[row, column]), "a finite number"
            )
        return points

    def _inside(self, points: Array) -> NDArray[np.bool_]:
        """Tell for every number whether it lies within its bounds, but for rounding."""
        lower, upper = self.bounds.T
        slack = BOX_TOLERANCE * np.maximum(upper - lower, np.abs(self.bounds).max(axis=1))
        inside: NDArray[np.bool_] = (points >= lower - slack) & (points <= upper + slack)
        return inside

    def _all_inside(self, points: Array) -> bool:
        """Tell whether all points lie in the box: by the extremes of long rows, ten times as quick."""
        head = len(points) - len(points) % ROWS
        if head == 0:
            return bool(self._inside(points).all())
        long = points[:head].reshape(-1, ROWS * points.shape[1])
        extremes = np.stack([long.min(axis=0), long.max(axis=0)]).reshape(-1, points.shape[1])
        return bool(self._inside(extremes).all() and self._inside(points[head:]).all())

    def _points(self, X: Points) -> Array:
        """Return the points as a matrix, and warn of those outside the box."""
        points = self._matrix(X)
        if not self._all_inside(points):
            outside = ~self._inside(points)
            names = [self.input_names[j] for j in np.flatnonzero(outside.any(axis=0))]
            warnings.warn(
                f"{np.count_nonzero(outside.any(axis=1))} of {len(points)} points lie outside the box that "
                f"the surrogate was trained in ({', '.join(names)}); its error is not known there",
                OutsideBoxWarning,
                stacklevel=3,
            )
        return points

    def _outcome_model(self) -> OutcomeModel:
        """Return the model, which has to know of regimes."""
        if not isinstance(self.model, OutcomeModel):
            raise StudyError(
                f"a surrogate of kind {self.kind!r} knows of no regimes; one of kind 'piecewise' does"
            )
        return self.model

    def _spoken_for(self, Z: Array) -> Labels:
        """Return the regime that the answers at some standardised points speak for."""
        model = self._outcome_model()
        return np.array(model.regime_names)[model.chosen(Z)]


def _listed(names: tuple[str, ...]) -> str:
    """Return the names, of many the first ones and how many there are."""
    if len(names) <= LISTED:
        return ", ".join(names)
    return f"{', '.join(names[: LISTED // 2])}, … ({len(names)} in all)"
