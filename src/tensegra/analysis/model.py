"""Surrogate or truth behind one call.

An analysis asks a `Model` for outputs at design points and for their derivatives; whether a fitted
surrogate, the equilibrium solver or a Python function answers is one argument. Every answer says for each
point whether it is valid: a failed run is NaN with a status, and the analyses count it, drop it and report
it.
"""

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError

if TYPE_CHECKING:
    from tensegra.study.space import Space

Array = NDArray[np.float64]

# Relative step of central differences: the cube root of a residual of 1e-9 (the solver's tolerance) balances
# truncation against noise.
DIFFERENCE_STEP = 1e-3


@dataclass(frozen=True)
class Evaluation:
    """Outputs at design points.

    Attributes
    ----------
    values
        Shape (n, n_outputs); NaN in the rows that are not valid.
    valid
        Shape (n,): whether the row is a result.
    status
        Shape (n,): the run's status (``stable``, ``snapped``, …) or ``evaluated`` and ``failed`` for a
        function.
    """

    values: Array
    valid: NDArray[np.bool_]
    status: NDArray[np.str_]

    @classmethod
    def of_values(cls, values: ArrayLike) -> "Evaluation":
        """Build the evaluation of a plain function: a row is valid where all of it is finite."""
        found = np.array(values, dtype=float)
        valid = np.isfinite(found).all(axis=1)
        found[~valid] = np.nan
        return cls(found, valid, np.where(valid, "evaluated", "failed"))

    @property
    def n_failed(self) -> int:
        """Number of points without a result."""
        return int((~self.valid).sum())

    def tally(self) -> dict[str, int]:
        """Return how many points have each status, the most frequent first."""
        return dict(Counter(self.status.tolist()).most_common())


@runtime_checkable
class Model(Protocol):
    """What an analysis asks of a model; `X` is (n, n_inputs), all arrays have the batch axis first."""

    @property
    def name(self) -> str:
        """The name that results carry."""
        ...

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the columns of `X`."""
        ...

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        ...

    @property
    def bounds(self) -> Array | None:
        """The box (n_inputs, 2) that the model is meant for, or None."""
        ...

    @property
    def space(self) -> "Space | None":
        """The joint law of the inputs unless an analysis says otherwise; None for uniform on `bounds`."""
        ...

    @property
    def units(self) -> Mapping[str, str]:
        """Units by the name of the input or output."""
        ...

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the outputs at the points `X`."""
        ...

    def gradient(self, X: ArrayLike) -> Array:
        """Return the derivatives (n, n_outputs, n_inputs), NaN where the model fails."""
        ...

    def uncertainty(self, X: ArrayLike) -> Array | None:
        """Return the model's own standard deviation (n, n_outputs), or None if it knows none."""
        ...


@dataclass(frozen=True)
class FunctionModel:
    """A Python function of a batch of points.

    Parameters
    ----------
    function
        Takes X (n, n_inputs), returns (n, n_outputs) or, for one output, (n,). A point that fails is NaN.
    input_names, output_names
        Names of the columns.
    bounds
        Box (n_inputs, 2), or None.
    derivative
        Takes X, returns (n, n_outputs, n_inputs); central differences unless given.
    name, units, space
        What results are labelled with; the joint law of the inputs, if there is one.
    counts
        Outputs that count, so that only whole numbers can be equal.
    within
        The box (n_inputs, 2) that differences stay in, where it is narrower than `bounds`: see `confined`.

    Examples
    --------
    >>> import numpy as np
    >>> model = FunctionModel(lambda X: X[:, 0] ** 2 + X[:, 1], ("a", "b"), ("y",))
    >>> model.evaluate([[2.0, 1.0]]).values
    array([[5.]])
    """

    function: Callable[[Array], ArrayLike]
    input_names: tuple[str, ...]
    output_names: tuple[str, ...]
    bounds: Array | None = None
    derivative: Callable[[Array], ArrayLike] | None = None
    name: str = "function"
    units: Mapping[str, str] = field(default_factory=dict)
    space: "Space | None" = None
    counts: tuple[str, ...] = ()
    within: Array | None = None

    def confined(self, box: Array) -> "FunctionModel":
        """Return the model that takes its differences within a box (n_inputs, 2)."""
        return replace(self, within=box)

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the outputs at the points `X`."""
        X = points(X, self.input_names)
        values = np.asarray(self.function(X), dtype=float)
        return Evaluation.of_values(values.reshape(len(X), len(self.output_names)))

    def gradient(self, X: ArrayLike) -> Array:
        """Return the derivatives (n, n_outputs, n_inputs)."""
        X = points(X, self.input_names)
        if self.derivative is None:
            return central_differences(self, X, self.within)
        shape = (len(X), len(self.output_names), len(self.input_names))
        return np.asarray(self.derivative(X), dtype=float).reshape(shape)

    def uncertainty(self, X: ArrayLike) -> None:
        """Return None: a function does not know its error."""


@dataclass(frozen=True)
class SurrogateModel:
    """A fitted surrogate, asked like any model.

    Parameters
    ----------
    surrogate
        As `tensegra.fit` returns it.
    name
        The name that results carry; the surrogate's kind unless given.
    space
        The joint law of the inputs; the one that the surrogate was trained under unless given.
    counts
        Outputs that count, so that only whole numbers can be equal.
    """

    surrogate: Any
    name: str = ""
    space: "Space | None" = None
    counts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", str(getattr(self.surrogate, "kind", "surrogate")))
        if self.space is None:
            object.__setattr__(self, "space", getattr(self.surrogate, "space", None))

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the columns of `X`."""
        return tuple(self.surrogate.input_names)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.surrogate.output_names)

    @property
    def bounds(self) -> Array | None:
        """The box that the surrogate was trained on."""
        return np.asarray(self.surrogate.bounds, dtype=float)

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name, as far as the training data told them."""
        return _surrogate_units(self.surrogate)

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the predictions at the points `X`.

        Where the surrogate knows of regimes, the status of a point is its regime, and a point at which the
        structure more probably than not does not stand has no result.
        """
        X = points(X, self.input_names)
        with self._outside_is_counted(X):
            if not getattr(self.surrogate, "regime_names", ()):
                return Evaluation.of_values(np.asarray(self.surrogate.predict(X)).reshape(len(X), -1))
            values, regimes = self.surrogate.predict(X, return_regime=True)
        return Evaluation(values, np.isfinite(values).all(axis=1), regimes)

    def gradient(self, X: ArrayLike) -> Array:
        """Return the predictions' derivatives (n, n_outputs, n_inputs)."""
        X = points(X, self.input_names)
        with self._outside_is_counted(X):
            return np.asarray(self.surrogate.gradient(X), dtype=float)

    def uncertainty(self, X: ArrayLike) -> Array | None:
        """Return the predictive standard deviation (n, n_outputs), or None for a kind that has none."""
        if not getattr(self.surrogate, "has_std", False):
            return None
        X = points(X, self.input_names)
        with self._outside_is_counted(X):
            _, std = self.surrogate.predict(X, return_std=True)
        return np.asarray(std, dtype=float).reshape(len(X), -1)

    @contextmanager
    def _outside_is_counted(self, X: Array) -> Iterator[None]:
        """Silence the surrogate's warning of points outside its box: the analyses count and report them."""
        if n_outside(X, self.bounds) == 0:
            yield
            return
        from tensegra.surrogate.surrogate import OutsideBoxWarning

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", OutsideBoxWarning)
            yield


def as_model(thing: object) -> Model:
    """Return `thing` as a model: a `Model` as it is, a surrogate or a study wrapped.

    Raises
    ------
    StudyError
        If it is none of them.
    """
    if isinstance(thing, Model):
        return thing
    if hasattr(thing, "predict") and hasattr(thing, "gradient"):
        return SurrogateModel(thing)
    from tensegra.analysis.truth import TrueModel
    from tensegra.study.study import Study

    if isinstance(thing, Study):
        return TrueModel(thing)
    raise StudyError.at("model", type(thing).__name__, "a surrogate, a study or a FunctionModel")


def points(X: ArrayLike, names: Sequence[str]) -> Array:
    """Return `X` as (n, n_inputs) floats.

    Raises
    ------
    StudyError
        If the number of columns is not the number of `names`.
    """
    found = np.atleast_2d(np.asarray(X, dtype=float))
    if found.ndim != 2 or found.shape[1] != len(names):
        raise StudyError.at("points", found.shape, f"{len(names)} columns ({', '.join(names)})")
    return found


def central_differences(model: Model, X: Array, within: Array | None = None) -> Array:
    """Return derivatives (n, n_outputs, n_inputs) by central differences, in one batch.

    The step is `DIFFERENCE_STEP` of the model's box, or of max(1, |x|) without one; near a bound it turns
    one-sided, so that the model is never asked outside its box, nor outside the box `within` which is
    searched (but for points that lie outside themselves). Where that box has no width the derivative is 0.
    """
    n, d = X.shape
    box = model.bounds
    span = np.maximum(1.0, np.abs(X)) if box is None else np.broadcast_to(box[:, 1] - box[:, 0], (n, d))
    step = DIFFERENCE_STEP * span
    lower, upper = np.full((n, d), -np.inf), np.full((n, d), np.inf)
    for limits in (box, within):
        if limits is not None:
            lower, upper = np.maximum(lower, limits[:, 0]), np.minimum(upper, limits[:, 1])
    lower, upper = np.minimum(lower, X), np.maximum(upper, X)
    low, high = np.clip(X - step, lower, upper), np.clip(X + step, lower, upper)
    probes = np.repeat(X[:, None, None, :], 2 * d, axis=1).reshape(n, d, 2, d)
    for i in range(d):
        probes[:, i, 0, i], probes[:, i, 1, i] = low[:, i], high[:, i]
    values = model.evaluate(probes.reshape(-1, d)).values.reshape(n, d, 2, -1)
    width = high - low
    slopes = (values[:, :, 1] - values[:, :, 0]) / np.where(width == 0.0, 1.0, width)[:, :, None]
    return np.swapaxes(slopes, 1, 2)


def column_index(names: Sequence[str], wanted: Sequence[str], place: str) -> list[int]:
    """Return where each of `wanted` stands in `names`.

    Raises
    ------
    StudyError
        If one is not there; the nearest name is offered.
    """
    for name in wanted:
        if name not in names:
            raise StudyError.at(place, name, f"one of {', '.join(names)}", candidates=names)
    return [list(names).index(name) for name in wanted]


def n_outside(X: Array, bounds: Array | None) -> int:
    """Count the points outside a box, where a surrogate extrapolates."""
    if bounds is None:
        return 0
    slack = 1e-9 * (bounds[:, 1] - bounds[:, 0])
    return int((np.less(X, bounds[:, 0] - slack) | np.greater(X, bounds[:, 1] + slack)).any(axis=1).sum())


def _surrogate_units(surrogate: object) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for side in ("input", "output"):
        names = getattr(surrogate, f"{side}_names", ())
        pairs |= dict(zip(names, getattr(surrogate, f"{side}_units", ("",) * len(names)), strict=True))
    return pairs
