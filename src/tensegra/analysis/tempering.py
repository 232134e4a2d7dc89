"""Draws of a density with several peaks or a curved one: particles led to it from a density that is known.

Sequential Monte Carlo (Del Moral, Doucet & Jasra 2006, doi:10.1111/j.1467-9868.2006.00553.x). The particles
begin as draws of a reference, a mixture of the prior and of wide laws about the modes. It is turned into the
density by q^(1−β) p^β, β from 0 to 1: in each stage β grows until half of the particles would be lost, these
are replaced by copies of the others, and Hamiltonian trajectories move the copies apart. So peaks get the
weight that they have, which chains that sit on one of them never learn. Where the reference is the density
already, as for a normal posterior, there is one stage.

There are several populations, which share nothing but β and the scale of the moves. Their spread is the error
of what they say, and R̂ compares them as it compares chains.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.hamiltonian import LogDensity, Moves

Array = NDArray[np.float64]

# Share of the particles whose loss ends a stage.
KEPT = 0.5
# Trajectories after each stage and at the end; a stage of which little is accepted has twice as many.
MOVES, LAST_MOVES = 2, 4
POOR_ACCEPTANCE = 0.5
FIRST_STEP = 0.6
# Degrees of freedom of the laws about the modes, whose tails must not be lighter than the density's, and how
# much wider than the normal approximation they are.
FREEDOM, WIDER = 5.0, 1.2
# Weight of the prior in the reference; the least weight of a mode among the modes.
PRIOR_WEIGHT, LEAST_WEIGHT = 0.5, 0.05
# Draws of the reference for each particle: they need no derivatives, and settle what share each peak has.
FIRST_DRAWS = 4


@dataclass(frozen=True)
class Reference:
    """A mixture of the standard normal law and t-laws about modes.

    Attributes
    ----------
    centres, factors
        Of each mode, (m, d), and F of its covariance F Fᵀ, (m, d, d).
    weights
        Of the normal law and of the modes, (m + 1,).
    """

    centres: Array
    factors: Array
    weights: Array

    @classmethod
    def of(cls, centres: Array, factors: Array, costs: Array) -> "Reference":
        """Build the mixture from modes and their costs −log p, each weighted by its normal approximation."""
        volume = np.linalg.slogdet(factors)[1]
        evidence = volume - costs
        share = np.exp(evidence - evidence.max())
        share = np.maximum(share / share.sum(), LEAST_WEIGHT)
        weights = np.append(PRIOR_WEIGHT, (1.0 - PRIOR_WEIGHT) * share / share.sum())
        return cls(centres, WIDER * factors, weights)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Return `n` draws (n, d), the number of each part as near to its weight as can be."""
        d = self.centres.shape[1]
        place = _systematic(self.weights, n, rng)
        normal = rng.standard_normal((n, d))
        scale = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, n))
        mode = np.maximum(place - 1, 0)
        about = self.centres[mode] + scale[:, None] * np.einsum("nij,nj->ni", self.factors[mode], normal)
        return np.where((place == 0)[:, None], normal, about)

    def log_density(self, Z: Array) -> tuple[Array, Array]:
        """Return the log density (n,) and its gradient (n, d)."""
        from scipy.special import gammaln, logsumexp

        d = Z.shape[1]
        parts, slopes = [-0.5 * (Z**2).sum(axis=1) - 0.5 * d * np.log(2.0 * np.pi)], [-Z]
        constant = gammaln((FREEDOM + d) / 2) - gammaln(FREEDOM / 2) - 0.5 * d * np.log(FREEDOM * np.pi)
        for centre, factor in zip(self.centres, self.factors, strict=True):
            white = np.linalg.solve(factor, (Z - centre).T).T
            square = (white**2).sum(axis=1)
            volume = float(np.linalg.slogdet(factor)[1])
            parts.append(constant - volume - 0.5 * (FREEDOM + d) * np.log1p(square / FREEDOM))
            pull = -(FREEDOM + d) / (FREEDOM + square)
            slopes.append(pull[:, None] * np.linalg.solve(factor.T, white.T).T)
        logs = np.array(parts) + np.log(self.weights)[:, None]
        total = logsumexp(logs, axis=0)
        return total, np.einsum("kn,knd->nd", np.exp(logs - total), np.array(slopes))


@dataclass(frozen=True)
class Populations:
    """Draws of several populations.

    Attributes
    ----------
    draws
        Shape (n_populations, n_draws, d).
    acceptance
        Mean probability of acceptance of the last trajectories.
    n_divergent
        Of these, those whose energy was lost.
    n_stages
        Stages from the reference to the density.
    n_evaluations
        Points at which the density was asked for, in all.
    complete
        Whether β came to 1 within the trajectories that were allowed.
    """

    draws: Array
    acceptance: float
    n_divergent: int
    n_stages: int
    n_evaluations: int
    complete: bool


def lead(
    log_density: LogDensity,
    log_value: Callable[[Array], Array],
    reference: Reference,
    *,
    n_populations: int,
    n_draws: int,
    most_moves: int,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> Populations:
    """Lead populations of particles from a reference to a density.

    Parameters
    ----------
    log_density
        Takes points (n, d); returns the log density (n,), −inf where there is none, and its gradient (n, d).
    log_value
        Returns the log density alone.
    reference
        Where the particles begin.
    n_populations, n_draws
        Populations, and particles in each.
    most_moves
        Most trajectories of each particle on the way.
    rng
        Of all random numbers.
    progress
        Called with (hundredths of the way done, 100).

    Examples
    --------
    Two peaks of equal weight, of which the reference knows one:

    >>> def peaks(z):
    ...     near, far = np.exp(-50 * (z[:, 0] - 1) ** 2), np.exp(-50 * (z[:, 0] + 1) ** 2)
    ...     slope = -100 * ((z[:, 0] - 1) * near + (z[:, 0] + 1) * far) / (near + far)
    ...     return np.log(near + far), slope[:, None]
    >>> one = Reference.of(np.ones((1, 1)), np.full((1, 1, 1), 0.1), np.zeros(1))
    >>> rng = np.random.default_rng(1)
    >>> value = lambda z: peaks(z)[0]
    >>> found = lead(peaks, value, one, n_populations=8, n_draws=500, most_moves=50, rng=rng)
    >>> bool(abs(found.draws.mean()) < 0.1), found.complete
    (True, True)
    """
    Z = np.concatenate([reference.draw(FIRST_DRAWS * n_draws, rng) for _ in range(n_populations)])
    log_p, log_q = _finite(log_value(Z)), reference.log_density(Z)[0]
    beta, step, n_stages, spent, n_evaluations = 0.0, FIRST_STEP, 0, 0, len(Z)
    while True:
        gain = log_p - log_q
        rise = _rise(gain, 1.0 - beta)
        beta = min(beta + rise, 1.0)
        n_stages += 1
        groups = np.arange(len(Z)).reshape(n_populations, -1)
        Z = np.concatenate([Z[group[_resampled(rise * gain[group], n_draws, rng)]] for group in groups])
        last = beta >= 1.0
        moves = Moves(_between(log_density, reference, beta), Z, _factor(Z), step, rng)
        wanted = LAST_MOVES if last else MOVES
        moved = 0
        while moved < wanted:
            moves.move()
            moved += 1
            if moved == wanted and moved <= MOVES + LAST_MOVES and moves.acceptance < POOR_ACCEPTANCE:
                wanted += 1
        spent, step = spent + moved, moves.step
        Z, n_evaluations = moves.z, n_evaluations + moves.n_evaluations
        if progress is not None:
            progress(round(100 * beta), 100)
        if last or spent >= most_moves:
            break
        log_p, log_q = _finite(log_value(Z)), reference.log_density(Z)[0]
        n_evaluations += len(Z)
    draws = Z.reshape(n_populations, n_draws, -1)
    # Copies stand beside each other; in disorder they pass for what they are, draws of one population.
    order = rng.permuted(np.arange(n_draws)[None].repeat(n_populations, axis=0), axis=1)
    draws = np.take_along_axis(draws, order[:, :, None], axis=1)
    return Populations(draws, moves.acceptance, moves.n_divergent, n_stages, n_evaluations, beta >= 1.0)


def _between(log_density: LogDensity, reference: Reference, beta: float) -> LogDensity:
    """Return q^(1−β) p^β."""
    if beta >= 1.0:
        return log_density

    def both(Z: Array) -> tuple[Array, Array]:
        (log_p, slope_p), (log_q, slope_q) = log_density(Z), reference.log_density(Z)
        return beta * log_p + (1.0 - beta) * log_q, beta * slope_p + (1.0 - beta) * slope_q

    return both


def _rise(gain: Array, most: float) -> float:
    """Return how far β can grow until the effective share of the particles falls to `KEPT`."""

    def effective(rise: float) -> float:
        weight = _weights(rise * gain)
        return float(1.0 / (weight @ weight)) / weight.size

    if effective(most) >= KEPT:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= KEPT else (low, middle)
    return max(low, 1e-12)


def _weights(logs: Array) -> Array:
    weight = np.exp(logs - logs.max())
    return np.asarray(weight / weight.sum())


def _resampled(logs: Array, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return the `n` particles that stay, each as often as its weight says."""
    if not np.isfinite(logs).any():
        return np.arange(n)
    return _systematic(_weights(logs), n, rng)


def _systematic(weights: Array, n: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return `n` places with these probabilities, their numbers within one of what is expected."""
    ends = np.cumsum(weights) / weights.sum()
    points = (rng.random() + np.arange(n)) / n
    return np.minimum(np.searchsorted(ends, points), weights.size - 1)


def _factor(Z: Array) -> Array:
    """Return F of the particles' covariance F Fᵀ, a little rounded."""
    d = Z.shape[1]
    covariance = np.atleast_2d(np.cov(Z.T))
    floor = 1e-12 * max(float(np.trace(covariance)) / d, np.finfo(float).tiny)
    return np.asarray(np.linalg.cholesky(covariance + floor * np.eye(d)))


def _finite(logs: Array) -> Array:
    """Return log densities with −inf where there is none."""
    return np.where(np.isfinite(logs), logs, -np.inf)
