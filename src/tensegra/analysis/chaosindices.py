"""Sobol' indices in closed form, from the coefficients of a chaos expansion.

The polynomials are orthonormal under the inputs' laws, so the squares of the coefficients are shares of the
variance, (I3) (Sudret 2008, doi:10.1016/j.ress.2007.04.002): no sampling, no sampling error. What remains is
the error of the expansion. Its coefficients are least-squares estimates with the covariance s² (RᵀR)⁻¹, R the
triangular factor of the regression and s its calibrated residual; the intervals follow from draws of them.
They hold what scatters in the fit, not what every polynomial of this degree would miss.

Where the inputs are correlated the variance has no shares that belong to one input alone. The result then has
the variance under the joint law, and says why it has no indices.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.inputs import RandomInputs, random_inputs
from tensegra.analysis.model import SurrogateModel, as_model, column_index
from tensegra.analysis.sensitivity import RESAMPLES, Indices, Sensitivity
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Laws are compared at these probabilities, and are one where their quantiles agree to this share of the
# range.
LEVELS = np.linspace(0.01, 0.99, 15)
SAME_LAW = 1e-6
CORRELATED = "the inputs are correlated: no share of the variance belongs to one of them alone"


def chaos_indices(
    model: object,
    *,
    outputs: Sequence[str] | None = None,
    second_order: bool = True,
    seed: int = 0,
    confidence: float = 0.95,
    name: str = "sensitivity",
) -> Sensitivity:
    """Return first, total and second order Sobol' indices of a surrogate of kind ``pce``, in closed form.

    Parameters
    ----------
    model
        A fitted surrogate of kind ``pce``, or a `SurrogateModel` of one.
    outputs
        Which outputs; all unless given.
    second_order
        Whether to give the second order too.
    seed, confidence, name
        Of the draws behind the intervals; of the intervals; of the result.

    Returns
    -------
    Sensitivity
        Under the laws that the expansion was trained with; it has no runs, no blocks and no convergence.

    Raises
    ------
    StudyError
        If the surrogate is of another kind, or the model's space has other laws than it was trained with.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegra.analysis import chaos_indices
    >>> from tensegra.surrogate import fit
    >>> X = np.random.default_rng(1).uniform(size=(60, 2))
    >>> chaos_indices(fit((X, 2 * X[:, 0] + X[:, 1]), "pce")).indices["y1"].first.round(1)
    array([0.8, 0.2])
    """
    asked = as_model(model)
    if not isinstance(asked, SurrogateModel) or getattr(asked.surrogate, "kind", "") != "pce":
        raise StudyError.at("sensitivity.model", asked.name, "a surrogate of kind 'pce' for the method chaos")
    laws = _laws(asked)
    from tensegra.surrogate.chaos import moments
    from tensegra.surrogate.jointlaw import is_correlated

    wanted = tuple(outputs or asked.output_names)
    columns = column_index(asked.output_names, wanted, "sensitivity.outputs")
    correlated = is_correlated(asked.surrogate.space)
    if correlated:
        point = halves = _no_shares(len(asked.output_names), len(asked.input_names))
    else:
        point = _shares(asked.surrogate)
        drawn = [_shares(copy) for copy in _redrawn(asked.surrogate, seed)]
        halves = tuple(_half_width(np.array([each[i] for each in drawn]), confidence) for i in range(3))
    _, std = moments(asked.surrogate)
    indices = {}
    for output, k in zip(wanted, columns, strict=True):
        varies = std[k] > 0.0
        indices[output] = Indices(
            output=output,
            unit=asked.units.get(output, ""),
            variance=float(std[k] ** 2),
            first=point[0][k],
            first_half=halves[0][k],
            total=point[1][k],
            total_half=halves[1][k],
            second=point[2][k] if second_order else None,
            second_half=halves[2][k] if second_order else None,
            reason=(CORRELATED if correlated else "") if varies else "the output does not vary",
        )
    return Sensitivity(
        name=name,
        model=asked.name,
        method="chaos",
        seed=seed,
        confidence=confidence,
        n_base=0,
        n_blocks=0,
        n_runs=0,
        n_failed=0,
        statuses={},
        input_names=asked.input_names,
        laws=laws,
        indices=indices,
        sizes=(),
        convergence={},
    )


def _no_shares(n_outputs: int, d: int) -> tuple[Array, ...]:
    """Return what `_shares` does, without a number in it."""
    return (
        np.full((n_outputs, d), np.nan),
        np.full((n_outputs, d), np.nan),
        np.full((n_outputs, d, d), np.nan),
    )


def _shares(surrogate: Any) -> tuple[Array, ...]:  # noqa: ANN401 - a Surrogate of kind pce
    """Return first-order and total indices (n_outputs, d), and those of pairs (n_outputs, d, d)."""
    from tensegra.surrogate.chaos import sobol_indices

    first, total = sobol_indices(surrogate)
    square = surrogate.model.coefficients[1:] ** 2
    active = surrogate.model.indices[1:] > 0
    d = active.shape[1]
    pairs = np.full((square.shape[1], d, d), np.nan)
    variance = square.sum(axis=0)
    together = active.sum(axis=1) == 2
    for i, j in zip(*np.triu_indices(d, 1), strict=True):
        share = square[together & active[:, i] & active[:, j]].sum(axis=0)
        pairs[:, i, j] = np.divide(share, variance, out=np.full_like(share, np.nan), where=variance > 0.0)
    return first, total, pairs


def _redrawn(surrogate: Any, seed: int) -> list[Any]:  # noqa: ANN401 - a Surrogate of kind pce
    """Return copies of the expansion with coefficients drawn from their distribution."""
    from scipy.linalg import solve_triangular

    model, rng = surrogate.model, np.random.default_rng(seed)
    copies = []
    for _ in range(RESAMPLES):
        noise = rng.standard_normal(model.coefficients.shape) * model.deviation
        shift = solve_triangular(model.factor, noise)
        copies.append(replace(surrogate, model=replace(model, coefficients=model.coefficients + shift)))
    return copies


def _half_width(draws: Array, confidence: float) -> Array:
    from scipy.special import ndtri

    return np.asarray(ndtri(0.5 + confidence / 2) * draws.std(axis=0, ddof=1))


def _laws(model: SurrogateModel) -> dict[str, str]:
    """Return the laws in words, after a check that they are those of the training."""
    laws, own = random_inputs(model), random_inputs(SurrogateModel(model.surrogate))
    for name, law, trained in zip(laws.names, laws.laws, own.laws, strict=True):
        given, known = (_quantiles(each) for each in (law, trained))
        if not np.allclose(given, known, rtol=0.0, atol=SAME_LAW * max(float(np.ptp(known)), SAME_LAW)):
            raise StudyError.at(
                f"sensitivity.inputs.{name}", repr(law), "the law that the expansion was trained with"
            )
    if not np.allclose(_ranks(laws), _ranks(own)):
        raise StudyError.at("sensitivity.inputs", "a correlation", "the one that it was trained with")
    return laws.describe()


def _quantiles(law: Any) -> Array:  # noqa: ANN401 - a number or anything with quantiles
    return np.full(LEVELS.size, law) if isinstance(law, float) else np.asarray(law.ppf(LEVELS), dtype=float)


def _ranks(laws: RandomInputs) -> Array:
    """Return the rank correlations (d, d) of all inputs."""
    ranks = np.eye(len(laws.names))
    if laws.copula is not None and laws.copula.correlation is not None:
        place = [laws.names.index(name) for name in laws.copula.names]
        ranks[np.ix_(place, place)] = laws.copula.correlation
    return ranks
