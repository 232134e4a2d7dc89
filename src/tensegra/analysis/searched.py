"""What a search may choose, and what becomes of the rest.

Search variables and uncertain inputs are two declared things. A search chooses the inputs named in `search`;
by default the actuators of the study, and whatever has bounds or an error of its own, less what `inputs`
speaks of. A model without actuators is searched in all of its inputs. The rest keep their laws where the
question is one of scatter, and are held at their means where it is not.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.inputs import Draws, RandomInputs, SameAs, random_inputs
from tensegra.analysis.model import Model, column_index
from tensegra.errors import StudyError

Array = NDArray[np.float64]

ACTUATOR = "actuator"


def searched_inputs(
    model: Model,
    search: Sequence[str] | None,
    inputs: Mapping[str, object],
    also: Mapping[str, Collection[str]],
) -> tuple[str, ...]:
    """Return the names of the inputs that a search chooses, in the model's order.

    Parameters
    ----------
    model
        Its space tells which inputs are actuators.
    search
        The names, or None for the default.
    inputs
        Inputs that have a law or a number of their own, so that they are not searched.
    also
        Names that only make sense for what is searched, such as those of ``bounds``, by where they stand.

    Raises
    ------
    StudyError
        For a name that is no input, or is told to be searched and not to be, and where nothing is searched.
    """
    names = model.input_names
    for place, asked in (("search", search or ()), ("inputs", inputs), *also.items()):
        column_index(names, tuple(asked), place)
    wanted = set(search) if search is not None else _by_default(model, inputs) | set().union(*also.values())
    for place, asked in (("inputs", inputs), *((place, ()) for place in also)):
        for name in asked:
            if name in wanted:
                raise StudyError.at(
                    place, name, "an input that is not searched, or leave it out of the search"
                )
    for place, asked in also.items():
        for name in asked:
            if name not in wanted:
                expected = f"an input that is searched ({', '.join(n for n in names if n in wanted)})"
                raise StudyError.at(place, name, expected)
    found = tuple(name for name in names if name in wanted)
    if not found:
        raise StudyError("search: nothing is searched, every input has a law or a number of its own")
    return found


def held_values(model: Model, searched: Collection[str], inputs: Mapping[str, object]) -> dict[str, float]:
    """Return the number at which each input that is not searched is held: its own, or the mean of its law.

    Of a discrete law it is the value nearest to the mean, for between the values there is nothing.
    """
    if set(searched) >= set(model.input_names):
        return {}
    laws = rest_laws(model, searched, inputs)
    means = mean_of_each(laws)
    return {name: means[name] for name in model.input_names if name not in searched}


def rest_laws(
    model: Model,
    searched: Collection[str],
    inputs: Mapping[str, object],
    errors: Mapping[str, object] | None = None,
) -> RandomInputs:
    """Return the laws of all inputs: of a searched one that of its error, 0 where it has none.

    Raises
    ------
    StudyError
        As `random_inputs`, and for an input tied to one that is searched.
    """
    given = {name: (errors or {}).get(name, 0.0) for name in model.input_names if name in searched}
    laws = random_inputs(model, given | dict(inputs), may_be_fixed=True)
    for name, law in zip(laws.names, laws.laws, strict=True):
        if isinstance(law, SameAs) and name not in searched and law.variable in searched:
            raise StudyError.at(f"inputs.{name}.same_as", law.variable, "an input that is not searched")
    return laws


def mean_of_each(laws: RandomInputs) -> dict[str, float]:
    """Return the mean of each input by name; of a discrete law the value nearest to it."""
    by_name = dict(zip(laws.names, laws.laws, strict=True))
    return {
        name: _mean(by_name[law.variable] if isinstance(law, SameAs) else law)
        for name, law in by_name.items()
    }


def levels_of(model: Model) -> dict[str, Array]:
    """Return the values (n,), in order, of each input of the model that has a discrete law."""
    told = getattr(model, "levels", None)
    if told is not None:
        return dict(told)
    if model.space is None:
        return {}
    pairs = zip(model.space.names, model.space.distributions, strict=True)
    found = {name: discrete_values(law) for name, law in pairs}
    return {name: values for name, values in found.items() if values is not None}


def discrete_values(law: Any) -> Array | None:  # noqa: ANN401 - a study's law, or SciPy's
    """Return the values that a law can take, where they are finitely many; else None."""
    if getattr(law, "kind", "") == "discrete":
        return np.sort(np.asarray(law.parameters.values, dtype=float))
    if hasattr(getattr(law, "dist", None), "pmf"):
        low, high = law.support()
        if np.isfinite([low, high]).all():
            values = np.arange(low, high + 1.0)
            return np.asarray(values[law.pmf(values) > 0.0], dtype=float)
    return None


def _by_default(model: Model, inputs: Mapping[str, object]) -> set[str]:
    every = set(model.input_names)
    if model.space is not None:
        variables = zip(model.space.names, model.space.variables, strict=True)
        every = {name for name, variable in variables if variable.quantity == ACTUATOR} or every
    return every - set(inputs)


def _mean(law: Any) -> float:  # noqa: ANN401 - a number or anything with quantiles
    if isinstance(law, float):
        return law
    if isinstance(law, Draws):
        return float(law.values.mean())
    mean = getattr(law, "mean", None)
    found = float(law.ppf(np.array([0.5]))[0]) if mean is None else float(mean() if callable(mean) else mean)
    values = discrete_values(law)
    return found if values is None else float(values[np.argmin(np.abs(values - found))])
