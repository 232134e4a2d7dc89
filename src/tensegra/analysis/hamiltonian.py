"""Hamiltonian moves: particles that follow the gradient of a log density, all of them in step.

Each point is a particle in the potential −log p, kicked at random and followed by leapfrog steps for a random
time; the end is accepted by its error in energy (Neal 2011, *Handbook of Markov Chain Monte Carlo*, ch. 5).
All particles take each step together, so that the model answers one batch.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LogDensity = Callable[[Array], tuple[Array, Array]]

# The acceptance at which a trajectory costs least (Beskos et al. 2013, doi:10.3150/12-BEJ414, is 0.65; real
# densities want more).
TARGET_ACCEPTANCE = 0.8
# Times of a trajectory: a quarter period of a normal density, give or take a half, lest any mode be met in
# step with its own period.
SHORTEST, LONGEST = 0.25 * np.pi, 0.75 * np.pi
MAX_STEPS = 150
# How far one trajectory may change the step, as a factor, and the longest step of all.
FASTEST, LONGEST_STEP = 2.0, 1.2
# An error of the energy beyond which a trajectory has left the level set: the step is too long there.
DIVERGENT = 50.0


@dataclass
class Moves:
    """Particles, and how they move.

    Parameters
    ----------
    log_density
        Takes points (n, d); returns the log density (n,), −inf where there is none, and its gradient (n, d).
    z
        Where the particles stand, (n, d).
    factor
        The scale: the density is near N(·, F Fᵀ), F of shape (d, d).
    step
        Of the leapfrog, in the whitened space.
    rng
        Of all random numbers.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> normal = lambda z: (-0.5 * (z**2).sum(axis=1), -z)
    >>> moves = Moves(normal, rng.uniform(-1, 1, (4000, 2)), np.eye(2), 0.5, rng)
    >>> for _ in range(20):
    ...     moves.move()
    >>> bool(abs(moves.z.mean()) < 0.05), bool(abs(moves.z.std() - 1) < 0.03)
    (True, True)
    """

    log_density: LogDensity
    z: Array
    factor: Array
    step: float
    rng: np.random.Generator
    acceptance: float = 0.0
    n_divergent: int = 0
    n_evaluations: int = 0

    def __post_init__(self) -> None:
        self.log_p, self.slope = self._ask(self.z)

    def move(self) -> None:
        """Move every particle by one trajectory, and bring the step nearer to the acceptance wanted."""
        n, d = self.z.shape
        p = self.rng.standard_normal((n, d))
        wanted = np.ceil(self.rng.uniform(SHORTEST, LONGEST) / self.step)
        z, log_p, slope = self.z, self.log_p, self.slope
        energy = 0.5 * (p**2).sum(axis=1) - log_p
        with np.errstate(all="ignore"):  # a trajectory that runs away ends as a rejection
            for _ in range(int(np.clip(wanted, 1, MAX_STEPS))):
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
        self.acceptance = float(chance.mean())
        self.n_divergent = int((error < -DIVERGENT).sum())
        change = np.exp(2.0 * (self.acceptance - TARGET_ACCEPTANCE))
        self.step = float(min(self.step * np.clip(change, 1.0 / FASTEST, FASTEST), LONGEST_STEP))

    def _ask(self, z: Array) -> tuple[Array, Array]:
        self.n_evaluations += len(z)
        known = np.isfinite(z).all(axis=1)
        log_p, slope = np.full(len(z), -np.inf), np.zeros(z.shape)
        if known.any():
            log_p[known], slope[known] = self.log_density(z[known])
        lost = ~(np.isfinite(log_p) & np.isfinite(slope).all(axis=1))
        return np.where(lost, -np.inf, log_p), np.where(lost[:, None], 0.0, slope)
