"""What is uncertain at a design: errors that add to the designed inputs, and inputs that are random.

An actuator asked for 10 % gives 10 % + e, and the temperature is what it is. `Scatter` knows the laws of
both; at each design it gives the inputs that may come, from one fixed set of draws, so that a statistic of
what follows from them is a smooth function of the design.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.expression import Expression
from tensegra.analysis.inputs import RandomInputs
from tensegra.analysis.model import Evaluation, FunctionModel, Model, SurrogateModel, points
from tensegra.analysis.searched import levels_of, mean_of_each, rest_laws, searched_inputs
from tensegra.errors import StudyError

if TYPE_CHECKING:
    from tensegra.study.space import Space

Array = NDArray[np.float64]


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

        if not self.laws.n_dimensions:
            return self.centre()
        sampler = qmc.Sobol(self.laws.n_dimensions, rng=np.random.default_rng(seed))
        return self.laws.from_unit(
            np.clip(sampler.random(1 << max(n - 1, 1).bit_length())[:n], 2.0**-31, 1.0)
        )

    def centre(self) -> Array:
        """Return the means (1, n_inputs); of a discrete law the value nearest to it."""
        means = mean_of_each(self.laws)
        return np.array([[means[name] for name in self.laws.names]])

    @property
    def scatters(self) -> bool:
        """Whether anything is random."""
        return self.laws.n_dimensions > 0

    @property
    def levels(self) -> dict[str, Array]:
        """The values of the designed inputs that are discrete, by name."""
        return {name: values for name, values in levels_of(self.model).items() if name in self.design_names}

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
        """Return the laws as `tensegra.propagate` takes them for `at`; correlated ones are in its space."""
        joint = () if self.laws.copula is None else self.laws.copula.names
        pairs = zip(self.laws.names, self.laws.laws, strict=True)
        return {name: law for name, law in pairs if name not in joint}


@dataclass(frozen=True)
class Scattered:
    """A model at one design, asked for errors and random inputs (`tensegra.analysis.Model`)."""

    scatter: Scatter
    x: Array
    formulas: Mapping[str, tuple[Expression, ...]] = field(default_factory=dict)

    bounds = None

    @property
    def space(self) -> "Space | None":
        """The joint law of the inputs that are correlated, or None."""
        return self.scatter.laws.copula

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
    search: Sequence[str] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
) -> Scatter:
    """Settle what is designed, and what scatters around the designs of a model.

    Parameters
    ----------
    model
        Its space gives the laws of the inputs that are not designed and that `inputs` leaves out.
    errors
        By designed input: the law of the error that adds to it, or ``SameAs`` another for a shared one.
    inputs
        By input: the law that it has whatever the design, or a number.
    search, bounds
        What is designed, as `tensegra.analysis.searched` settles it.

    Raises
    ------
    StudyError
        For an unknown input, one that is told both to be designed and not to, or where nothing is designed.
    """
    errors, inputs = dict(errors or {}), dict(inputs or {})
    searched = searched_inputs(model, search, inputs, {"errors": errors, "bounds": bounds or {}})
    is_designed = np.array([name in searched for name in model.input_names])
    return Scatter(model, rest_laws(model, searched, inputs, errors), is_designed)
