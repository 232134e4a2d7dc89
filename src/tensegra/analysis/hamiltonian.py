"""Hamiltonian Monte Carlo: chains that follow the gradient of the log density, all of them in step.

Each chain is a particle in the potential −log p, kicked at random and followed by leapfrog steps for a random
time; the end is accepted by its error in energy (Neal 2011, *Handbook of Markov Chain Monte Carlo*, ch. 5).
All chains take each step together, so that the model answers one batch. During the warm-up the step adapts to
an acceptance of 0.8 by dual averaging (Hoffman & Gelman 2014, section 3.2), and the space is whitened anew by
the covariance of the draws. In the whitened space a normal density needs times about π/2.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LogDensity = Callable[[Array], tuple[Array, Array]]

TARGET_ACCEPTANCE = 0.8
# Times of a trajectory: a quarter period of a normal density, give or take a half, lest any mode be met in
# step with its own period.
SHORTEST, LONGEST = 0.25 * np.pi, 0.75 * np.pi
MAX_STEPS = 50
# An error of the energy beyond which a trajectory has left the level set: the step is too long there.
DIVERGENT = 50.0


@dataclass(frozen=True)
class Chains:
    """Draws of several chains.

    Attributes
    ----------
    draws
        Shape (n_chains, n_draws, d).
    log_density
        Shape (n_chains, n_draws).
    acceptance
        Mean probability of acceptance.
    n_divergent
        Trajectories, after the warm-up, whose energy was lost.
    step
        The step in the whitened space.
    n_evaluations
        Points at which the density was asked for, in all.
    """

    draws: Array
    log_density: Array
    acceptance: float
    n_divergent: int
    step: float
    n_evaluations: int


def sample(
    log_density: LogDensity,
    starts: Array,
    factor: Array,
    *,
    n_warmup: int,
    n_draws: int,
    rng: np.random.Generator,
    progress: Callable[[int, int], None] | None = None,
) -> Chains:
    """Draw from a density by Hamiltonian Monte Carlo.

    Parameters
    ----------
    log_density
        Takes points (n_chains, d); returns the log density (n_chains,), −inf where there is none, and its
        gradient (n_chains, d).
    starts
        Shape (n_chains, d).
    factor
        A first guess of the scale: the density is near N(·, F Fᵀ), F of shape (d, d).
    n_warmup, n_draws
        Iterations of each chain that adapt the method and are thrown away, and that are kept.
    rng
        Of all random numbers.
    progress
        Called with (iterations done, in all).

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> normal = lambda z: (-0.5 * (z**2).sum(axis=1), -z)
    >>> chains = sample(normal, rng.standard_normal((4, 2)), np.eye(2), n_warmup=100, n_draws=400, rng=rng)
    >>> bool(abs(chains.draws.mean()) < 0.1), bool(abs(chains.draws.std() - 1) < 0.05)
    (True, True)
    """
    state = _State(log_density, starts, factor, rng)
    window = n_warmup // 3
    seen: list[Array] = []
    total = n_warmup + n_draws
    for i in range(n_warmup):
        if window and i in {window, 2 * window}:
            state.whiten(np.concatenate(seen[len(seen) // 2 :]))
            seen = []
        state.iterate(adapt=True)
        seen.append(state.z)
        if progress is not None:
            progress(i + 1, total)
    state.settle()
    draws, logs = [], []
    for i in range(n_draws):
        state.iterate(adapt=False)
        draws.append(state.z)
        logs.append(state.log_p)
        if progress is not None:
            progress(n_warmup + i + 1, total)
    return Chains(
        np.stack(draws, axis=1),
        np.stack(logs, axis=1),
        state.acceptance / max(n_draws, 1),
        state.n_divergent,
        state.step,
        state.n_evaluations,
    )


class _State:
    """Where the chains stand, and what the warm-up has learned."""

    def __init__(
        self, log_density: LogDensity, starts: Array, factor: Array, rng: np.random.Generator
    ) -> None:
        self._log_density, self.rng, self.factor = log_density, rng, factor
        self.n_evaluations, self.acceptance, self.n_divergent = 0, 0.0, 0
        self.z = np.array(starts, dtype=float)
        self.log_p, self.slope = self._ask(self.z)
        self._begin(1.0 / starts.shape[1] ** 0.25)

    def iterate(self, *, adapt: bool) -> None:
        """Move every chain by one trajectory."""
        n, d = self.z.shape
        p = self.rng.standard_normal((n, d))
        steps = int(np.clip(np.ceil(self.rng.uniform(SHORTEST, LONGEST) / self.step), 1, MAX_STEPS))
        z, log_p, slope = self.z, self.log_p, self.slope
        energy = 0.5 * (p**2).sum(axis=1) - log_p
        with np.errstate(all="ignore"):  # a trajectory that runs away ends as a rejection
            for _ in range(steps):
                p = p + 0.5 * self.step * slope @ self.factor
                z = z + self.step * p @ self.factor.T
                log_p, slope = self._ask(z)
                p = p + 0.5 * self.step * slope @ self.factor
            error = np.nan_to_num(energy - (0.5 * (p**2).sum(axis=1) - log_p), nan=-np.inf)
        chance = np.exp(np.minimum(error, 0.0))
        taken = self.rng.random(n) < chance
        self.z = np.where(taken[:, None], z, self.z)
        self.log_p = np.where(taken, log_p, self.log_p)
        self.slope = np.where(taken[:, None], slope, self.slope)
        if adapt:
            self._adapt(float(chance.mean()))
        else:
            self.acceptance += float(chance.mean())
            self.n_divergent += int((error < -DIVERGENT).sum())

    def whiten(self, draws: Array) -> None:
        """Measure the scale anew from draws (n, d), drawn a little towards a round one."""
        n, d = draws.shape
        covariance = np.atleast_2d(np.cov(draws.T))
        weight = n / (n + 5.0 * d)
        covariance = weight * covariance + (1.0 - weight) * np.diag(np.diag(covariance))
        if np.all(np.linalg.eigvalsh(covariance) > 0.0):
            self.factor = np.linalg.cholesky(covariance)
            self._begin(self.step)

    def settle(self) -> None:
        """End the adaptation with the averaged step."""
        if self._count:
            self.step = float(np.exp(self._log_average))

    def _begin(self, step: float) -> None:
        self.step, self._centre = step, float(np.log(10.0 * step))
        self._count: int = 0
        self._deficit: float = 0.0
        self._log_average: float = 0.0

    def _adapt(self, chance: float) -> None:
        """Update the step by dual averaging, with its authors' constants γ, t₀, κ = 0.05, 10, 0.75."""
        self._count += 1
        rate = 1.0 / (self._count + 10.0)
        self._deficit += rate * (TARGET_ACCEPTANCE - chance - self._deficit)
        log_step = self._centre - np.sqrt(self._count) / 0.05 * self._deficit
        weight = self._count**-0.75
        self._log_average = weight * log_step + (1.0 - weight) * self._log_average
        self.step = float(np.exp(log_step))

    def _ask(self, z: Array) -> tuple[Array, Array]:
        self.n_evaluations += len(z)
        log_p, slope = self._log_density(z)
        lost = ~np.isfinite(log_p)
        return np.where(lost, -np.inf, log_p), np.where(lost[:, None], 0.0, slope)
