"""The surrogate: one interface for every kind, in the units and names of the study it was trained on."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol, Self, TypeAlias, overload, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.data import Distribution, TrainingData
from tensegra.surrogate.validation import Validation

__all__ = ["Model", "OutsideBoxWarning", "Problem", "Scaling", "Surrogate"]

Array: TypeAlias = NDArray[np.float64]
Json: TypeAlias = Any  # what the json module reads and writes

BOX_TOLERANCE = 1e-9  # of a side: rounding in the map from the unit cube is not extrapolation


class OutsideBoxWarning(UserWarning):
    """A surrogate was asked about points outside the box that it was trained in."""


@dataclass(frozen=True, eq=False)
class Scaling:
    """The affine map z = (x − shift)/scale of the inputs, and the like for the outputs.

    Every model sees inputs and outputs of zero mean and unit standard deviation over its training points;
    `Surrogate` brings its answers back to the original units.
    """

    input_shift: Array
    input_scale: Array
    output_shift: Array
    output_scale: Array

    @classmethod
    def of(cls, data: TrainingData) -> Self:
        """Return the map that standardises `data`; a constant column is only shifted."""
        spread = [np.where(np.ptp(A, axis=0) > 0, A.std(axis=0), 1.0) for A in (data.X, data.Y)]
        return cls(data.X.mean(axis=0), spread[0], data.Y.mean(axis=0), spread[1])

    def inputs(self, X: Array) -> Array:
        """Return standardised inputs."""
        return (X - self.input_shift) / self.input_scale

    def outputs(self, Y: Array) -> Array:
        """Return standardised outputs."""
        return (Y - self.output_shift) / self.output_scale

    def derivatives(self, dY: Array) -> Array:
        """Return the derivatives of standardised outputs by standardised inputs."""
        return dY * self.input_scale / self.output_scale[:, None]


@dataclass(frozen=True, eq=False)
class Problem:
    """What a kind is trained on: standardised points, and the laws of the inputs in original units.

    `Z` has the shape (n_points, n_inputs), `T` (n_points, n_outputs), `dT` (n_points, n_outputs, n_inputs)
    or None, `bounds` (n_inputs, 2).
    """

    Z: Array
    T: Array
    dT: Array | None  # noqa: N815 - the derivative of T, as in mathematics
    scaling: Scaling
    bounds: Array
    distributions: tuple[Distribution, ...] | None

    @classmethod
    def of(cls, data: TrainingData) -> Self:
        """Standardise `data`."""
        scaling = Scaling.of(data)
        dT = None if data.dY is None else scaling.derivatives(data.dY)
        return cls(scaling.inputs(data.X), scaling.outputs(data.Y), dT, scaling, data.box, data.distributions)


@runtime_checkable
class Model(Protocol):
    """The mathematics of a surrogate, in standardised inputs and outputs.

    A new kind implements this, and a function ``train(problem, rng, **options) -> Model`` beside it, and is
    entered in `tensegra.surrogate.kinds.KINDS`; the suite in ``tests/contracts/test_surrogates.py`` then
    checks it.
    """

    @property
    def has_std(self) -> bool:
        """Whether the model knows how far it can be trusted."""
        ...

    def predict(self, Z: Array, /) -> Array:
        """Return the outputs, shape (n_points, n_outputs)."""
        ...

    def std(self, Z: Array, /) -> Array:
        """Return calibrated standard deviations, shape (n_points, n_outputs)."""
        ...

    def gradient(self, Z: Array, /) -> Array:
        """Return the exact derivatives of `predict`, shape (n_points, n_outputs, n_inputs)."""
        ...

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Json]]:
        """Return the arrays and the settings from which `from_state` builds an equal model."""
        ...

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Json], /) -> Self:
        """Build the model that `state` was taken from."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Surrogate:
    """A function fitted to runs, that stands for the mechanics where thousands of evaluations are wanted.

    Made by `tensegra.surrogate.fit`. Inputs and outputs are in the study's own units, columns in the order
    of `input_names` and `output_names`.

    Parameters
    ----------
    kind
        ``"gpr"``, ``"nn"`` or ``"pce"``.
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

    @property
    def has_std(self) -> bool:
        """Whether ``predict(X, return_std=True)`` can be answered."""
        return self.model.has_std

    @overload
    def predict(
        self, X: ArrayLike | Mapping[str, ArrayLike], *, return_std: Literal[False] = False
    ) -> Array: ...

    @overload
    def predict(
        self, X: ArrayLike | Mapping[str, ArrayLike], *, return_std: Literal[True]
    ) -> tuple[Array, Array]: ...

    def predict(
        self, X: ArrayLike | Mapping[str, ArrayLike], *, return_std: bool = False
    ) -> Array | tuple[Array, Array]:
        """Return the outputs at some points.

        Parameters
        ----------
        X
            Inputs, shape (n_points, n_inputs); or a table (mapping, data frame) with a column of each name.
        return_std
            Also return calibrated standard deviations: the true output lies within ±1.645 of them at about
            90 % of the points.

        Returns
        -------
        ndarray or tuple of ndarray
            Y, shape (n_points, n_outputs); or ``(Y, std)``.

        Raises
        ------
        StudyError
            If the columns are not those of `input_names`, a number is not finite, or a standard deviation
            is asked of a surrogate that has none.

        Warns
        -----
        OutsideBoxWarning
            If a point lies outside `bounds`.
        """
        Z = self._standardised(X)
        Y = self.scaling.output_shift + self.scaling.output_scale * self.model.predict(Z)
        if not return_std:
            return Y
        if not self.has_std:
            raise StudyError(
                f"a surrogate of kind {self.kind!r} as trained here has no standard deviation; "
                "a network has one with `ensemble` of 2 or more"
            )
        return Y, self.scaling.output_scale * self.model.std(Z)

    def gradient(self, X: ArrayLike | Mapping[str, ArrayLike]) -> Array:
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
        slope = self.model.gradient(self._standardised(X))
        return slope * self.scaling.output_scale[:, None] / self.scaling.input_scale

    def inside(self, X: ArrayLike | Mapping[str, ArrayLike]) -> NDArray[np.bool_]:
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

    def __repr__(self) -> str:
        error = "" if self.validation is None else f"; {self.validation.summary()}"
        return (
            f"Surrogate({self.kind!r}: {', '.join(self.input_names)} → {', '.join(self.output_names)}; "
            f"{self.n_train} runs{error})"
        )

    def _matrix(self, X: ArrayLike | Mapping[str, ArrayLike]) -> Array:
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

    def _standardised(self, X: ArrayLike | Mapping[str, ArrayLike]) -> Array:
        """Return the standardised points, and warn of those outside the box."""
        points = self._matrix(X)
        outside = ~self._inside(points)
        if outside.any():
            names = [self.input_names[j] for j in np.flatnonzero(outside.any(axis=0))]
            warnings.warn(
                f"{np.count_nonzero(outside.any(axis=1))} of {len(points)} points lie outside the box that "
                f"the surrogate was trained in ({', '.join(names)}); its error is not known there",
                OutsideBoxWarning,
                stacklevel=3,
            )
        return self.scaling.inputs(points)
