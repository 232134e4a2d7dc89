"""Training data: what a campaign hands to a surrogate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError

if TYPE_CHECKING:
    from tensegra.study.space import Space

__all__ = ["Distribution", "TrainingData"]

Array: TypeAlias = NDArray[np.float64]


class Distribution(Protocol):
    """The law of one input: a density and a quantile function, as `scipy.stats` freezes them."""

    def pdf(self, x: Array, /) -> Array:
        """Return the density at `x`."""
        ...

    def ppf(self, q: Array, /) -> Array:
        """Return the quantiles at the probabilities `q`."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class TrainingData:
    """Design points, the outputs there and, where they are known, the outputs' derivatives.

    Parameters
    ----------
    X
        Inputs, shape (n_points, n_inputs), in the units of `input_units`.
    Y
        Outputs, shape (n_points, n_outputs); a vector counts as one output.
    dY
        Derivatives of the outputs by the inputs, shape (n_points, n_outputs, n_inputs), or None.
    input_names, output_names
        Names of the columns of `X` and `Y`; ``x1, x2, …`` and ``y1, y2, …`` where left out.
    input_units, output_units
        Unit of each column, ``""`` where it has none or none is known.
    bounds
        The box that the inputs were drawn from, shape (n_inputs, 2); the extremes of `X` where left out.
    distributions
        The law of each input, or None for the uniform law on `bounds`.
    space
        The joint law of the inputs, which travels with every surrogate of these data; its laws are the
        `distributions`. None where there is nothing to know beyond these.
    study_fingerprint
        Hash of the study that the data come from, ``""`` for data from elsewhere.

    Raises
    ------
    StudyError
        If the shapes do not fit together, a number is not finite, or a name occurs twice.

    Examples
    --------
    >>> data = TrainingData(X=[[0.0, 1.0], [2.0, 3.0], [1.0, 0.0]], Y=[1.0, 5.0, 1.0])
    >>> data
    TrainingData(3 points: x1, x2 → y1)
    >>> data.bounds
    array([[0., 2.],
           [0., 3.]])
    """

    X: Array
    Y: Array
    dY: Array | None = None  # noqa: N815 - the derivative of Y, as in mathematics
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    bounds: Array | None = None
    distributions: tuple[Distribution, ...] | None = None
    space: "Space | None" = None
    study_fingerprint: str = ""

    def __post_init__(self) -> None:
        X, Y = _matrix("X", self.X), _matrix("Y", self.Y, column=True)
        if len(X) != len(Y) or len(X) == 0:
            raise StudyError.at("training data", (len(X), len(Y)), "as many rows in Y as in X, at least one")
        (_, d), (_, k) = X.shape, Y.shape
        dY = None if self.dY is None else _numbers("dY", self.dY)
        if dY is not None and k == 1 and dY.shape == X.shape:
            dY = dY[:, None, :]
        if dY is not None and dY.shape != (len(X), k, d):
            raise StudyError.at("training data: dY", dY.shape, f"the shape {(len(X), k, d)}")
        bounds = np.stack([X.min(axis=0), X.max(axis=0)], axis=1) if self.bounds is None else self.bounds
        bounds = _numbers("bounds", bounds)
        if bounds.shape != (d, 2) or np.any(bounds[:, 0] > bounds[:, 1]):
            raise StudyError.at("training data: bounds", bounds.tolist(), f"{d} rows (lower, upper)")
        if self.distributions is not None and len(self.distributions) != d:
            raise StudyError.at("training data: distributions", len(self.distributions), f"{d} of them")
        if self.space is not None and self.space.n_inputs != d:
            raise StudyError.at("training data: space", self.space.names, f"{d} variables, one per column")
        settled = {
            "X": X,
            "Y": Y,
            "dY": dY,
            "bounds": bounds,
            "input_names": _labels("input_names", self.input_names, [f"x{i + 1}" for i in range(d)]),
            "output_names": _labels("output_names", self.output_names, [f"y{i + 1}" for i in range(k)]),
            "input_units": _labels("input_units", self.input_units, [""] * d, unique=False),
            "output_units": _labels("output_units", self.output_units, [""] * k, unique=False),
            "distributions": self.distributions if self.space is None else self.space.distributions,
        }
        for name, value in settled.items():
            object.__setattr__(self, name, value)

    @property
    def n_points(self) -> int:
        """Number of design points."""
        return len(self.X)

    @property
    def n_inputs(self) -> int:
        """Number of inputs."""
        return int(self.X.shape[1])

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return int(self.Y.shape[1])

    @property
    def box(self) -> Array:
        """The bounds, shape (n_inputs, 2), which are never None once the data exist."""
        assert self.bounds is not None  # noqa: S101 - settled in __post_init__
        return self.bounds

    def rows(self, index: ArrayLike) -> "TrainingData":
        """Return the data at the rows of an index array, a slice of indices or a mask."""
        index = np.asarray(index)
        dY = None if self.dY is None else self.dY[index]
        return replace(self, X=self.X[index], Y=self.Y[index], dY=dY)

    def select_outputs(self, names: Sequence[str]) -> "TrainingData":
        """Return the data of some outputs, in the order named.

        Raises
        ------
        StudyError
            If there is no such output.
        """
        for name in names:
            if name not in self.output_names:
                raise StudyError.at("outputs", name, "an output", candidates=self.output_names)
        column = [self.output_names.index(name) for name in names]
        return replace(
            self,
            Y=self.Y[:, column],
            dY=None if self.dY is None else self.dY[:, column],
            output_names=tuple(names),
            output_units=tuple(self.output_units[i] for i in column),
        )

    def __repr__(self) -> str:
        derivatives = ", with derivatives" if self.dY is not None else ""
        return (
            f"TrainingData({self.n_points} points: {', '.join(self.input_names)} → "
            f"{', '.join(self.output_names)}{derivatives})"
        )


def _numbers(name: str, values: ArrayLike) -> Array:
    """Return `values` as a contiguous array of finite floats."""
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StudyError(f"training data: {name} is not an array of numbers ({error})") from None
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        place = f"training data: {name}[{', '.join(map(str, bad[0]))}]"
        raise StudyError.at(place, float(array[tuple(bad[0])]), "a finite number (leave failed runs out)")
    return array


def _matrix(name: str, values: ArrayLike, *, column: bool = False) -> Array:
    """Return `values` as a matrix with a row per point; a vector becomes a column where that is meant."""
    array = _numbers(name, values)
    if array.ndim == 1 and column:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] == 0:
        raise StudyError.at(f"training data: shape of {name}", array.shape, "a row per point, a column each")
    return array


def _labels(
    name: str, given: Sequence[str], default: Sequence[str], *, unique: bool = True
) -> tuple[str, ...]:
    """Return the given names, or the default ones where none are given, checked for number and identity."""
    labels = tuple(given) or tuple(default)
    if len(labels) != len(default):
        raise StudyError.at(f"training data: {name}", labels, f"{len(default)} of them, one per column")
    if unique and len(set(labels)) != len(labels):
        raise StudyError.at(f"training data: {name}", labels, "different names")
    return labels
