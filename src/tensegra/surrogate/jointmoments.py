"""Moments of a surrogate under a joint law whose inputs depend on each other, by quasi-Monte Carlo."""

import warnings
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tensegra.surrogate.surrogate import Surrogate

__all__ = ["joint_moments"]

Array: TypeAlias = NDArray[np.float64]

# Points of the scrambled Sobol sequence, and its seed: a smooth output's moments are then known to about 1e-6
# of its spread, far below what any expansion of some hundred runs is worth.
POINTS, SEED = 2**16, 0
CHUNK = 2**13  # points at a time, some megabytes of polynomials


def joint_moments(surrogate: "Surrogate") -> tuple[Array, Array]:
    """Return mean and standard deviation (n_outputs,) of the predictions under the surrogate's joint law."""
    from scipy.stats import qmc

    from tensegra.surrogate.surrogate import OutsideBoxWarning

    space = surrogate.space
    assert space is not None  # noqa: S101 - the caller has looked
    sampler = qmc.Sobol(space.n_inputs, rng=np.random.default_rng(SEED))
    with warnings.catch_warnings():
        # A law without ends passes its box twice in a million points.
        warnings.simplefilter("ignore", OutsideBoxWarning)
        parts = [surrogate.predict(space.from_unit(sampler.random(CHUNK))) for _ in range(POINTS // CHUNK)]
    Y = np.concatenate(parts)
    return Y.mean(axis=0), Y.std(axis=0)
