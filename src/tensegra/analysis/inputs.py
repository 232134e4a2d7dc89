"""Random inputs: what each variable of a model is drawn from.

A variable has a law of its own (a `tensegra.study` distribution, the mapping that a study file would hold for
one, or anything with a quantile function `ppf` such as a frozen `scipy.stats` law), is fixed at a number, or
is `SameAs` another variable. The paper's A14 = A23 = 0.1 − φ is a law for A14 and ``SameAs("A14")`` for A23:
one random dimension, two columns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.model import Model
from tensegra.errors import StudyError

if TYPE_CHECKING:
    from tensegra.study.space import Space

Array = NDArray[np.float64]


class QuantileFunction(Protocol):
    """All that sampling needs of a distribution."""

    def ppf(self, q: Array, /) -> ArrayLike:
        """Return the quantiles at the probabilities `q`."""
        ...


@dataclass(frozen=True)
class SameAs:
    """A variable that equals another one in every sample."""

    variable: str


@dataclass(frozen=True, eq=False)
class Draws:
    """A variable known by draws of it, such as those of a posterior.

    Attributes
    ----------
    values
        Shape (n,).
    source
        What the draws come from. Variables of one source are drawn by rows together, so that what ties them
        to each other stays.
    """

    values: Array
    source: object

    def at(self, u: Array) -> Array:
        """Return the values of the rows that probabilities (n,) fall on."""
        row = (u * len(self.values)).astype(np.intp)
        return np.asarray(self.values[np.minimum(row, len(self.values) - 1)])

    def __repr__(self) -> str:
        return f"{len(self.values)} draws of mean {self.values.mean():.6g}, std {self.values.std():.3g}"


Law = QuantileFunction | SameAs | Draws | float


@dataclass(frozen=True)
class RandomInputs:
    """The joint law of a model's inputs, built by `random_inputs`.

    Attributes
    ----------
    names
        All inputs, in the model's order.
    laws
        The law of each.
    independent
        The inputs with a law of their own: the random dimensions, in the order of the unit cube's
        coordinates.
    copula
        The correlated ones among them, which come first; None where all are independent.
    """

    names: tuple[str, ...]
    laws: tuple[Law, ...]
    independent: tuple[str, ...]
    copula: "Space | None" = None

    @property
    def n_dimensions(self) -> int:
        """Number of random dimensions."""
        return len(self.independent)

    def from_unit(self, U: ArrayLike) -> Array:
        """Map points (n, n_dimensions) of the unit cube to inputs (n, n_inputs)."""
        U = np.asarray(U, dtype=float)
        columns: dict[str, Array] = {}
        if self.copula is not None:
            joint = self.copula.from_unit(U[:, : self.copula.n_inputs])
            columns |= dict(zip(self.copula.names, joint.T, strict=True))
        by_name = dict(zip(self.names, self.laws, strict=True))
        rows: dict[int, str] = {}
        for name, law in by_name.items():
            if isinstance(law, float):
                columns[name] = np.full(len(U), law)
            elif isinstance(law, Draws):
                first = rows.setdefault(id(law.source), name)
                columns[name] = law.at(U[:, self.independent.index(first)])
            elif not isinstance(law, SameAs) and name not in columns:
                columns[name] = np.asarray(law.ppf(U[:, self.independent.index(name)]), dtype=float)
        for name, law in by_name.items():
            if isinstance(law, SameAs):
                columns[name] = columns[law.variable]
        return np.stack([columns[name] for name in self.names], axis=1)

    def describe(self) -> dict[str, str]:
        """Return each input's law in words."""
        return {name: _words(law) for name, law in zip(self.names, self.laws, strict=True)}


def random_inputs(
    model: Model, inputs: Mapping[str, object] | None = None, *, may_be_fixed: bool = False
) -> RandomInputs:
    """Settle the law of every input of a model.

    Parameters
    ----------
    model
        Gives the names and, for an input that `inputs` leaves out, the law of its space (with its
        correlations); without a space, the uniform law on its bounds.
    inputs
        By variable: a distribution or its mapping, a number, `Draws`, `SameAs` or the mapping ``{"same_as":
        name}``. A variable named here is independent of all others but of those tied to it.
    may_be_fixed
        Whether all inputs may be numbers, so that nothing is random.

    Raises
    ------
    StudyError
        For an unknown variable, a law that is none, a variable tied to itself or to a tied one, a variable
        for which there is neither a law nor a bound, and where nothing is random.
    """
    given = dict(inputs or {})
    names = model.input_names
    for name in given:
        if name not in names:
            raise StudyError.at("inputs", name, "a variable of the model", candidates=names)
    own = {} if model.space is None else dict(zip(model.space.names, model.space.distributions, strict=True))
    laws: dict[str, Law] = {}
    for column, name in enumerate(names):
        if name in given:
            laws[name] = _law(name, given[name], names)
        elif name in own:
            laws[name] = own[name]
        elif model.bounds is not None:
            low, high = (float(bound) for bound in model.bounds[column])
            laws[name] = _law(name, {"uniform": [low, high]} if low < high else low, names)
        else:
            raise StudyError.at("inputs", sorted(given), f"a law for {name!r} too: the model has no bounds")
    for name, law in laws.items():
        if isinstance(law, SameAs) and (law.variable == name or isinstance(laws[law.variable], SameAs)):
            raise StudyError.at(
                f"inputs.{name}.same_as", law.variable, "a variable that has a law of its own"
            )
    copula = _copula(model.space, [name for name in own if name in laws and name not in given])
    first = () if copula is None else copula.names
    seen: set[int] = set()
    rest = (n for n, law in laws.items() if n not in first and _is_free(law, seen))
    independent = (*first, *rest)
    if not independent and not may_be_fixed:
        raise StudyError("inputs: every variable is fixed, there is nothing random to study")
    return RandomInputs(names, tuple(laws.values()), independent, copula)


def _is_free(law: Law, seen: set[int]) -> bool:
    """Tell whether a law needs a dimension of its own; of the draws of one source only the first does."""
    if isinstance(law, Draws):
        new = id(law.source) not in seen
        seen.add(id(law.source))
        return new
    return not isinstance(law, SameAs | float)


def _copula(space: "Space | None", names: Sequence[str]) -> "Space | None":
    """Return the correlated part of a space: a Gaussian copula's margin has the submatrix of correlations."""
    if space is None or space.correlation is None or not names:
        return None
    kept = [space.names.index(name) for name in names]
    correlation = space.correlation[np.ix_(kept, kept)]
    if np.array_equal(correlation, np.eye(len(kept))):
        return None
    return replace(space, variables=tuple(space.variables[i] for i in kept), correlation=correlation)


def _law(name: str, value: object, names: Sequence[str]) -> Law:
    place = f"inputs.{name}"
    if isinstance(value, Mapping) and set(value) == {"same_as"}:
        value = SameAs(str(value["same_as"]))
    if isinstance(value, Draws):
        return value
    if isinstance(value, SameAs):
        if value.variable not in names:
            raise StudyError.at(f"{place}.same_as", value.variable, "a variable", candidates=names)
        return value
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        if not np.isfinite(float(value)):
            raise StudyError.at(place, value, "a finite number")
        return float(value)
    if isinstance(value, Mapping):
        from tensegra.study.distributions import as_distribution

        return as_distribution(value, place)
    if hasattr(value, "ppf"):
        return value
    raise StudyError.at(place, value, "a distribution, a number or {same_as: variable}")


def _words(law: Law) -> str:
    if isinstance(law, float):
        return f"{law:g}"
    if isinstance(law, SameAs):
        return f"same as {law.variable}"
    frozen: Any = law
    if hasattr(frozen, "dist"):  # a frozen scipy law, whose repr tells nothing
        parts = [*map(str, frozen.args), *(f"{key}={value}" for key, value in frozen.kwds.items())]
        return f"{frozen.dist.name}({', '.join(parts)})"
    return repr(law).removeprefix("Distribution")
