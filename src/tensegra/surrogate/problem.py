"""What a kind of surrogate is trained on and what it has to be, in standardised inputs and outputs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tensegra.study.data import Distribution, TrainingData
from tensegra.surrogate.regimes import RegimeData

__all__ = ["FastModel", "Model", "OutcomeModel", "Outcomes", "Problem", "Scaling"]

Array: TypeAlias = NDArray[np.float64]
Json: TypeAlias = Any  # what the json module reads and writes


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
        return cls.over(data.X, data.Y)

    @classmethod
    def over(cls, X: Array, Y: Array) -> Self:
        """Return the map that standardises inputs and outputs; a constant column is only shifted."""
        spread = [np.where(np.ptp(A, axis=0) > 0, A.std(axis=0), 1.0) for A in (X, Y)]
        return cls(X.mean(axis=0), spread[0], Y.mean(axis=0), spread[1])

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
class Outcomes:
    """What became of the runs: the regime of each that stands, and standardised inputs of the others.

    `regimes` has the shape (n_standing,), `fallen_Z` (n_fallen, n_inputs), `fallen` (n_fallen,).
    """

    regimes: NDArray[np.str_]
    fallen_Z: Array  # noqa: N815 - Z as in Problem
    fallen: NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class Problem:
    """What a kind is trained on: standardised points, and the laws of the inputs in original units.

    `Z` has the shape (n_points, n_inputs), `T` (n_points, n_outputs), `dT` (n_points, n_outputs, n_inputs)
    or None, `bounds` (n_inputs, 2). `outcomes` is None where the regimes of the runs are not known.
    """

    Z: Array
    T: Array
    dT: Array | None  # noqa: N815 - the derivative of T, as in mathematics
    scaling: Scaling
    bounds: Array
    distributions: tuple[Distribution, ...] | None
    output_units: tuple[str, ...] = ()
    outcomes: Outcomes | None = None

    @classmethod
    def of(cls, data: TrainingData | RegimeData) -> Self:
        """Standardise `data`."""
        runs = data.runs if isinstance(data, RegimeData) else data
        scaling = Scaling.of(runs)
        outcomes = None
        if isinstance(data, RegimeData):
            outcomes = Outcomes(data.regimes, scaling.inputs(data.fallen_X), data.fallen)
        return cls(
            Z=scaling.inputs(runs.X),
            T=scaling.outputs(runs.Y),
            dT=None if runs.dY is None else scaling.derivatives(runs.dY),
            scaling=scaling,
            bounds=runs.box,
            distributions=runs.distributions,
            output_units=runs.output_units,
            outcomes=outcomes,
        )

    def rows(self, index: NDArray[np.intp]) -> Self:
        """Return the problem of some of the runs that stand; what became of the others is left out."""
        dT = None if self.dT is None else self.dT[index]
        return replace(self, Z=self.Z[index], T=self.T[index], dT=dT, outcomes=None)


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


@runtime_checkable
class OutcomeModel(Protocol):
    """What a model offers beside `Model` that knows where not to answer."""

    @property
    def regime_names(self) -> tuple[str, ...]:
        """The regimes."""
        ...

    def probabilities(self, Z: Array, /) -> Array:
        """Return the probability of each regime, shape (n_points, n_regimes)."""
        ...

    def chosen(self, Z: Array, /, *, standing: bool = False) -> NDArray[np.intp]:
        """Return the number of the regime that is spoken for; with `standing`, one that stands."""
        ...

    def predict_standing(self, Z: Array, /) -> Array:
        """Return the outputs on the condition that the structure stands."""
        ...

    def std_standing(self, Z: Array, /) -> Array:
        """Return the standard deviations on that condition."""
        ...


@runtime_checkable
class FastModel(Protocol):
    """What a model offers beside `Model` that can answer in single precision."""

    def predict_fast(self, X: Array, scaling: Scaling, /) -> Array:
        """Return the outputs in their own units, at points in theirs, by single-precision arithmetic."""
        ...
