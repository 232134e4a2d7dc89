"""What is uncertain at a design: errors that add to the designed inputs, and inputs that are random.

An actuator asked for 10 % gives 10 % + e, and the temperature is what it is. `Scatter` knows the laws of
both; at each design it gives the inputs that may come, from one fixed set of draws, so that a statistic of
what follows from them is a smooth function of the design.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.expression import Expression
from tensegra.analysis.inputs import RandomInputs, random_inputs
from tensegra.analysis.model import Evaluation, FunctionModel, Model, SurrogateModel, points
from tensegra.errors import StudyError

Array = NDArray[np.float64]

MEDIAN = 0.5


@dataclass(frozen=True)
class Scatter:
    """The uncertainty around a design; built by `scatter`.

    Attributes
    ----------
    model
        Answers for the outputs.
    laws
        Of all inputs of the model: of a designed one the law of its error, 0 where it has none.
    is_designed
        Shape (n_inputs,).
    """

    model: Model
    laws: RandomInputs
    is_designed: NDArray[np.bool_]

    @property
    def design_names(self) -> tuple[str, ...]:
        """Names of the designed inputs."""
        return tuple(
            n for n, designed in zip(self.model.input_names, self.is_designed, strict=True) if designed
        )

    def draw(self, n: int, seed: int) -> Array:
        """Return `n` draws (n, n_inputs) of errors and random inputs, evenly spread (scrambled Sobol)."""
        from scipy.stats import qmc

        sampler = qmc.Sobol(self.laws.n_dimensions, rng=np.random.default_rng(seed))
        return self.laws.from_unit(
            np.clip(sampler.random(1 << max(n - 1, 1).bit_length())[:n], 2.0**-31, 1.0)
        )

    def median(self) -> Array:
        """Return the medians (1, n_inputs)."""
        return self.laws.from_unit(np.full((1, self.laws.n_dimensions), MEDIAN))

    def around(self, x: ArrayLike, draws: Array) -> Array:
        """Return the inputs (n, n_draws, n_inputs) that designs (n, n_designed) may come to."""
        nominal = np.zeros((len(np.atleast_2d(x)), 1, len(self.is_designed)))
        nominal[:, 0, self.is_designed] = x
        return nominal + draws

    def bounds(self, wanted: Mapping[str, ArrayLike], draws: Array) -> dict[str, list[float]]:
        """Return the box of the designed inputs.

        A surrogate's is narrowed by the largest error drawn, for it must not be asked outside its own.

        Raises
        ------
        StudyError
            For an input that is not designed, or one for which there is neither a bound nor a box.
        """
        box: dict[str, list[float]] = {}
        for name in wanted:
            if name not in self.design_names:
                expected = f"a designed input ({', '.join(self.design_names)})"
                raise StudyError.at("bounds", name, expected, candidates=self.design_names)
        for column, name in enumerate(self.model.input_names):
            if not self.is_designed[column]:
                continue
            own = None if self.model.bounds is None else self.model.bounds[column]
            asked = wanted.get(name, own)
            if asked is None:
                raise StudyError.at("bounds", sorted(wanted), f"bounds of {name!r} too: the model has none")
            low, high = (float(value) for value in np.asarray(asked, dtype=float))
            if own is not None and isinstance(self.model, SurrogateModel):
                low = max(low, float(own[0] - draws[:, column].min()))
                high = min(high, float(own[1] - draws[:, column].max()))
            if not low < high:
                raise StudyError.at(
                    f"bounds.{name}", [low, high], "room between the bounds that the errors leave"
                )
            box[name] = [low, high]
        return box

    def at(self, x: ArrayLike, formulas: Mapping[str, tuple[Expression, ...]] | None = None) -> "Scattered":
        """Return the model of what scatters, at one design (n_designed,).

        Parameters
        ----------
        x
            The design.
        formulas
            Further outputs by name: formulas over inputs and outputs, of several the least.
        """
        return Scattered(self, np.asarray(x, dtype=float), dict(formulas or {}))

    def given(self) -> dict[str, object]:
        """Return the laws as `tensegra.propagate` takes them for `at`."""
        return dict(zip(self.laws.names, self.laws.laws, strict=True))


@dataclass(frozen=True)
class Scattered:
    """A model at one design, asked for errors and random inputs (`tensegra.analysis.Model`)."""

    scatter: Scatter
    x: Array
    formulas: Mapping[str, tuple[Expression, ...]] = field(default_factory=dict)

    bounds = None
    space = None

    @property
    def name(self) -> str:
        """The model's name."""
        return self.scatter.model.name

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the model's inputs; of a designed one the value is its error."""
        return self.scatter.model.input_names

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the model's outputs and of the formulas."""
        return (*self.scatter.model.output_names, *self.formulas)

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name."""
        return self.scatter.model.units

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the outputs and the formulas for errors and random inputs (n, n_inputs)."""
        model = self.scatter.model
        inputs = self.scatter.around(self.x[None], points(X, self.input_names))[0]
        found = model.evaluate(inputs)
        columns = dict(zip(model.input_names, inputs.T, strict=True))
        columns |= dict(zip(model.output_names, found.values.T, strict=True))
        more = [
            np.min([np.broadcast_to(part(columns), (len(inputs),)) for part in parts], axis=0)
            for parts in self.formulas.values()
        ]
        values = np.concatenate([found.values, np.array(more).reshape(-1, len(inputs)).T], axis=1)
        valid = found.valid & np.isfinite(values).all(axis=1)
        return Evaluation(np.where(valid[:, None], values, np.nan), valid, found.status)

    def gradient(self, X: ArrayLike) -> Array:
        """Return the derivatives (n, n_outputs, n_inputs) by central differences."""
        return FunctionModel(lambda Z: self.evaluate(Z).values, self.input_names, self.output_names).gradient(
            X
        )

    def uncertainty(self, X: ArrayLike) -> None:
        """Return None: it is not asked for it."""


def scatter(
    model: Model,
    errors: Mapping[str, object] | None = None,
    inputs: Mapping[str, object] | None = None,
) -> Scatter:
    """Settle what scatters around the designs of a model.

    Parameters
    ----------
    model
        All of its inputs are designed but those in `inputs`.
    errors
        By designed input: the law of the error that adds to it, or ``SameAs`` another for a shared one.
    inputs
        By input: the law that it has whatever the design, or a number.

    Raises
    ------
    StudyError
        For an unknown input, one in both mappings, or where nothing is designed or nothing scatters.
    """
    errors, inputs = dict(errors or {}), dict(inputs or {})
    for name in errors:
        if name not in model.input_names:
            raise StudyError.at("errors", name, "an input of the model", candidates=model.input_names)
        if name in inputs:
            raise StudyError.at(
                "errors", name, "an input that is designed, not one that has a law of its own"
            )
    is_designed = np.array([name not in inputs for name in model.input_names])
    if not is_designed.any():
        raise StudyError("inputs: every input has a law, there is nothing to design")
    given = {name: errors.get(name, 0.0) for name in model.input_names if name not in inputs}
    return Scatter(model, random_inputs(model, given | inputs), is_designed)
