"""Expectations under a law: points with probabilities that stand for it.

They are found in probability, never by the density: E[f(X)] = ∫ f(x(u)) du over the quantile function x(u),
which every law has, whether it has a density, atoms, ties or all of these. The integral is taken over the
normal score s with u = Φ(s), so that both tails are reached as far as numbers go, by Gauss panels that are
halved until the quantile function is a polynomial on each. A jump of the quantile function (a gap in the law)
ends in panels of no width, a level stretch (an atom) in equal points, which become one.
"""

import warnings
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.study.data import Distribution

__all__ = ["law_quadrature", "merged"]

Array: TypeAlias = NDArray[np.float64]

FARTHEST = 37.5  # normal scores: Φ(−37.5) = 5e-308 is the smallest probability that is not denormal
# Without the survival function probabilities near one are all that tells the upper tail: Φ(8.2) is the last.
FARTHEST_WITHOUT_SURVIVAL = 8.2
PANEL_WIDTH, PANEL_ORDER = 0.5, 16  # exact to 1e-13 for e^{ks} with k up to 24, a lognormal's high moments
SMOOTH = 1e-12  # last two Legendre coefficients of the quantile function over the largest of the others
ROUNDING = 1e-13  # of the quantile: steps this small are noise of its computation, not of the law
EXACT = 1e-15  # such coefficients times the panel's probability, over the law's spread
MOST_HALVINGS = 50  # a jump is then located to 1e-15 of a panel
MOST_PANELS = 2_000  # halved at a time: each jump needs one, and more than these are noise
NOTHING = 1e-16  # probability that may be lost where quantiles in the far tails pass the largest number


def law_quadrature(law: Distribution, order: int = PANEL_ORDER) -> tuple[Array, Array]:
    """Return points and probabilities whose sums are expectations under the law.

    Parameters
    ----------
    law
        A law with a quantile function. One that has a method ``quadrature(order)`` gives its own points.
    order
        Half the degree to which a law's own points are exact for polynomials, and one more.

    Returns
    -------
    tuple of ndarray
        Points, rising and all different, and their probabilities, which sum to one. A law of finitely many
        values has just these.

    Raises
    ------
    StudyError
        If the law's quantiles are not finite.

    Examples
    --------
    >>> from tensegra.study.distributions import as_distribution
    >>> points, weights = law_quadrature(as_distribution({"discrete": {"values": [0, 1, 4]}}))
    >>> points.tolist(), weights.round(3).tolist()
    ([0.0, 1.0, 4.0], [0.333, 0.333, 0.333])
    """
    own = getattr(law, "quadrature", None)
    answer: tuple[Array, Array] | None = None if own is None else own(order)
    return _in_probability(law) if answer is None else answer


def merged(points: Array, weights: Array) -> tuple[Array, Array]:
    """Return the points in order, equal ones as one with the sum of their weights, which sum to one."""
    values, place = np.unique(points, return_inverse=True)
    total = np.bincount(place, weights=weights, minlength=len(values))
    kept = total > 0
    return values[kept], total[kept] / total.sum()


def _in_probability(law: Distribution) -> tuple[Array, Array]:
    """Integrate the quantile function over the normal score."""
    node, weight = np.polynomial.legendre.leggauss(PANEL_ORDER)
    to_coefficients = np.polynomial.legendre.legvander(node, PANEL_ORDER - 1).T * weight
    to_coefficients *= np.arange(PANEL_ORDER)[:, None] + 0.5
    far = FARTHEST if hasattr(law, "isf") else FARTHEST_WITHOUT_SURVIVAL
    edges = np.linspace(-far, far, 2 * round(far / PANEL_WIDTH) + 1)
    left, half = edges[:-1], 0.5 * np.diff(edges)
    middle = np.nan_to_num(_quantile(law, np.array([-1.0, -0.1, 0.1, 1.0])), posinf=0.0, neginf=0.0)
    spread = float(np.ptp(middle))
    points, weights, lost = [], [], 0.0
    for halvings in range(MOST_HALVINGS + 1):
        s = (left + half)[:, None] + half[:, None] * node
        share = np.exp(-0.5 * s**2) / np.sqrt(2 * np.pi) * (half[:, None] * weight)
        x = _quantile(law, s)
        finite = np.isfinite(x).all(axis=1)
        lost += float(share[~finite].sum())
        s, share, x, left, half = (each[finite] for each in (s, share, x, left, half))
        probability = share.sum(axis=1)
        size = np.abs(x @ to_coefficients.T)
        noise = np.maximum(ROUNDING * np.abs(x).max(axis=1), EXACT * spread / probability)
        done = size[:, -2:].max(axis=1) <= np.maximum(SMOOTH * size[:, 1:].max(axis=1), noise)
        if halvings == MOST_HALVINGS:
            done[:] = True
        done[np.lexsort((-probability, done))[MOST_PANELS:]] = True
        points.append(x[done].ravel())
        weights.append(share[done].ravel())
        left = np.concatenate([left[~done], (left + half)[~done]])
        half = np.tile(0.5 * half[~done], 2)
        if len(left) == 0:
            break
    if lost > NOTHING:
        raise StudyError.at(f"quantiles of {law!r}", f"no finite ones with probability {lost:.1e}", "numbers")
    return merged(np.concatenate(points), np.concatenate(weights))


def _quantile(law: Distribution, s: Array) -> Array:
    """Return the quantiles at normal scores, those above the median by the survival function."""
    from scipy.special import ndtr

    upper = getattr(law, "isf", None)
    # A tail that underflows is what its value says; some of SciPy's laws warn of it.
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if upper is None:
            return np.asarray(law.ppf(ndtr(s)), dtype=np.float64)
        x = np.empty_like(s)
        below = s <= 0
        x[below] = law.ppf(ndtr(s[below]))
        x[~below] = upper(ndtr(-s[~below]))
    return x
