"""Polynomial chaos: expansions in products of polynomials that are orthonormal under the inputs' laws.

The coefficients are the answer to several questions at once: the first is the mean, the sum of the squares
of the others the variance, and their shares the Sobol indices (Sudret, *Reliability Engineering and System
Safety* 93, 2008). The set of products is chosen by the leave-one-out error, which least squares yields
without a second fit; where that leaves an error, terms are sought among more candidates than there are runs
(`tensegra.surrogate.sparse`).
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.expansion import Chaos
from tensegra.surrogate.jointlaw import is_correlated
from tensegra.surrogate.jointmoments import joint_moments
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.search import Search, score
from tensegra.surrogate.surrogate import Surrogate

__all__ = ["Chaos", "moments", "sobol_indices", "train"]

Array: TypeAlias = NDArray[np.float64]

# Of the error in a tame coordinate: what polynomials of the input itself have to come down to, for their
# moments hang on a tail in which there are no runs.
RAW_BETTER = 0.1


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    degree: int | None = None,
    max_degree: int | None = None,
    max_terms: int = 1500,
    sparse: bool = True,
    derivatives: bool = True,
) -> Chaos:
    """Fit an expansion shared by all outputs.

    Parameters
    ----------
    problem
        The standardised runs. The polynomials are orthonormal under `problem.distributions`, or under the
        uniform law on `problem.bounds`; in the logarithm of an input with a heavy tail, unless polynomials of
        the input itself have a tenth of the error.
    rng
        Source of the runs on which the terms are chosen.
    degree
        Total degree; chosen by the leave-one-out error where left out.
    max_degree, max_terms
        Limits to that choice; left out, the degree is at most 12, and 30 of terms that are sought one by one.
    sparse
        Also try sets of terms that grow, round by round, where the coefficients are large, and, of 20 to
        2,000 runs without derivatives, terms sought among more candidates than there are runs. Not tried with
        a given `degree`.
    derivatives
        Use the runs' derivatives if they have any.

    Returns
    -------
    Chaos
        The expansion.

    Raises
    ------
    StudyError
        If there are too few runs for the degree asked for.
    """
    for asked in (degree, max_degree):
        if asked is not None and asked < 0:
            raise StudyError.at("pce: degree", asked, "0 or more")
    search = Search(degree, max_degree, max_terms, sparse, derivatives)
    raw = Coordinates.raw(problem.Z.shape[1])
    tame = raw if problem.distributions is None else Coordinates.of(problem)  # the uniform law is tame
    best = search.expansion(problem, tame, rng)
    if not tame.all_raw:
        other = search.expansion(problem, raw, rng)
        if score(other.loo_error) < score(best.loo_error) + np.log(RAW_BETTER):
            best = other
    return best


def moments(surrogate: Surrogate) -> tuple[Array, Array]:
    """Return the mean and the standard deviation of each output.

    They are in closed form where the inputs are independent. Where they are not, the expansion is integrated
    over their joint law by quasi-Monte Carlo, for its polynomials are orthonormal under the marginals alone.

    Parameters
    ----------
    surrogate
        Of kind ``pce``.

    Returns
    -------
    tuple of ndarray
        Mean and standard deviation under the inputs' laws, shape (n_outputs,) each.
    """
    c = _expansion(surrogate).coefficients
    if is_correlated(surrogate.space):
        return joint_moments(surrogate)
    scale = surrogate.scaling.output_scale
    return surrogate.scaling.output_shift + scale * c[0], scale * np.sqrt(np.sum(c[1:] ** 2, axis=0))


def sobol_indices(surrogate: Surrogate) -> tuple[Array, Array]:
    """Return the first-order and total Sobol indices in closed form.

    Parameters
    ----------
    surrogate
        Of kind ``pce``.

    Returns
    -------
    tuple of ndarray
        Shares of each output's variance, shape (n_outputs, n_inputs) each; not a number for an output that
        does not vary.

    Raises
    ------
    StudyError
        If the inputs depend on each other: the variance then has no shares that belong to one input alone.
    """
    model = _expansion(surrogate)
    if is_correlated(surrogate.space):
        raise StudyError("Sobol indices: found inputs that are correlated, expected independent ones")
    square = model.coefficients[1:] ** 2
    active = model.indices[1:] > 0
    alone = active & (active.sum(axis=1) == 1)[:, None]
    with np.errstate(invalid="ignore"):  # 0/0 for an output that does not vary
        share = square / square.sum(axis=0)
    return share.T @ alone, share.T @ active


def _expansion(surrogate: Surrogate) -> Chaos:
    """Return the expansion inside a surrogate of kind `pce`."""
    if not isinstance(surrogate.model, Chaos):
        raise StudyError.at("closed-form moments and indices", surrogate.kind, "a surrogate of kind 'pce'")
    return surrogate.model
