"""The prior of a calibration, in the standard normal space of its parameters.

Every parameter is a quantile of its law at Φ(z), z standard normal. In z the prior is the same for all laws,
the support has no ends, and a sampler works on one scale; a correlated prior is correlated in z by its
Gaussian copula.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.inputs import Draws, RandomInputs, SameAs, random_inputs
from tensegra.analysis.model import Model
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# A probability below this is taken for it, on either side: a quantile there may be infinite. It lies 37
# standard deviations off.
LEAST_PROBABILITY = 1e-300
# Step of central differences in z, for a law that has no density.
STEP = 1e-4


@dataclass(frozen=True)
class Prior:
    """The joint prior of the parameters, built by `prior_of`.

    Attributes
    ----------
    laws
        Of all inputs of the model; those that are measured with every state stand fixed at 0.
    """

    laws: RandomInputs

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.laws.independent

    @property
    def n_parameters(self) -> int:
        """Number of parameters."""
        return len(self.names)

    def values(self, Z: Array) -> tuple[Array, Array]:
        """Return the inputs (n, n_inputs) at normal coordinates (n, p), and their derivatives by them."""
        n, laws = len(Z), self.laws
        factor = np.eye(self.n_parameters)
        if laws.copula is not None and laws.copula.correlation is not None:
            k = laws.copula.n_inputs
            normal = 2.0 * np.sin(np.pi * laws.copula.correlation / 6.0)  # Kruskal 1958, as in `Space`
            factor[:k, :k] = np.linalg.cholesky(normal)
        correlated = Z @ factor.T
        X = np.zeros((n, len(laws.names)))
        slopes = np.zeros((n, len(laws.names), self.n_parameters))
        place = {name: column for column, name in enumerate(laws.names)}
        by_name = dict(zip(laws.names, laws.laws, strict=True))
        for column, (name, law) in enumerate(by_name.items()):
            if isinstance(law, float):
                X[:, column] = law
            elif not isinstance(law, SameAs):
                row = laws.independent.index(name)
                z = correlated[:, row]
                X[:, column] = _at_normal(law, z)
                slopes[:, column] = _rate(law, z, X[:, column])[:, None] * factor[row]
        for column, law in enumerate(by_name.values()):
            if isinstance(law, SameAs):
                X[:, column], slopes[:, column] = X[:, place[law.variable]], slopes[:, place[law.variable]]
        return X, slopes


def prior_of(model: Model, known: tuple[str, ...], inputs: Mapping[str, object]) -> Prior:
    """Settle the prior of a model's parameters.

    Parameters
    ----------
    model
        Its space, or its box, gives the laws that `inputs` leaves out.
    known
        Inputs that are known in every measured state.
    inputs
        By input: its prior, a number that it is fixed at, or ``SameAs`` another.

    Raises
    ------
    StudyError
        If an input is both, a law is discrete, or nothing is left to calibrate.
    """
    for name in inputs:
        if name in known:
            raise StudyError.at("inputs", name, "an input that the measurements do not tell already")
    try:
        laws = random_inputs(model, dict(inputs) | dict.fromkeys(known, 0.0))
    except StudyError as error:
        if "nothing random" in str(error):
            raise StudyError("calibration: every input is known, there is nothing to calibrate") from None
        raise
    for name, law in zip(laws.names, laws.laws, strict=True):
        if isinstance(law, Draws) or getattr(law, "kind", "") == "discrete":
            raise StudyError.at(f"inputs.{name}", repr(law), "a prior with a density")
    return Prior(laws)


def _at_normal(law: Any, z: Array) -> Array:  # noqa: ANN401 - anything with a ppf
    """Return the quantiles at Φ(z), in the upper half from the probability above, which stays exact."""
    from scipy.special import ndtr

    tail = np.maximum(ndtr(-np.abs(z)), LEAST_PROBABILITY)
    upper = law.isf(tail) if hasattr(law, "isf") else law.ppf(1.0 - np.maximum(tail, np.finfo(float).epsneg))
    return np.where(z > 0.0, np.asarray(upper, dtype=float), np.asarray(law.ppf(tail), dtype=float))


def _rate(law: Any, z: Array, x: Array) -> Array:  # noqa: ANN401 - anything with a ppf
    """Return dx/dz = φ(z)/f(x)."""
    if hasattr(law, "pdf"):
        density = np.asarray(law.pdf(x), dtype=float)
        if np.all(density > 0.0):
            return np.asarray(np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi) / density)
    ahead, behind = (_at_normal(law, z + step) for step in (STEP, -STEP))
    return (ahead - behind) / (2.0 * STEP)
