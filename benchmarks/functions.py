"""Functions that surrogates are compared on, with the laws of their inputs."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from tensegra.study import TrainingData
from tensegra.study.distributions import Distribution, as_distribution

G_WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])


@dataclass(frozen=True)
class Case:
    """A function, the laws of its inputs, and the number of runs that it is learnt from."""

    function: Callable[[np.ndarray], np.ndarray]
    laws: tuple[Distribution, ...]
    n_runs: int

    def points(self, n: int, seed: int, *, sobol: bool) -> np.ndarray:
        """Draw points from the laws: of a scrambled Sobol sequence, or at random."""
        d = len(self.laws)
        sequence = qmc.Sobol(d, seed=seed).random_base2(int(np.ceil(np.log2(n))))[:n]
        unit = sequence if sobol else np.random.default_rng(seed).uniform(size=(n, d))
        return np.column_stack([law.ppf(u) for law, u in zip(self.laws, unit.T, strict=True)])

    def data(self, n: int, seed: int) -> TrainingData:
        """Run the function on a Sobol design."""
        X = self.points(n, seed, sobol=True)
        bounds = [law.box for law in self.laws]
        return TrainingData(X=X, Y=self.function(X), distributions=self.laws, bounds=bounds)


def ishigami(X: np.ndarray) -> np.ndarray:
    """Return Ishigami and Homma's function (1990), a = 7 and b = 0.1."""
    return np.sin(X[:, 0]) + 7 * np.sin(X[:, 1]) ** 2 + 0.1 * X[:, 2] ** 4 * np.sin(X[:, 0])


def borehole(X: np.ndarray) -> np.ndarray:
    """Return the flow through a borehole (Harper and Gupta 1983)."""
    r_w, r, T_u, H_u, T_l, H_l, L, K_w = X.T
    log = np.log(r / r_w)
    return 2 * np.pi * T_u * (H_u - H_l) / (log * (1 + 2 * L * T_u / (log * r_w**2 * K_w) + T_u / T_l))


def g_function(X: np.ndarray) -> np.ndarray:
    """Return Sobol's G-function (Saltelli and Sobol 1995), which has a kink in each input."""
    return np.prod((np.abs(4 * X - 2) + G_WEIGHTS) / (1 + G_WEIGHTS), axis=1)


def _uniform(*bounds: tuple[float, float]) -> tuple[Distribution, ...]:
    return tuple(as_distribution({"uniform": list(pair)}) for pair in bounds)


# r is lognormal with the parameters 7.71 and 1.0056 of its logarithm, r_w normal (Morris et al. 1993).
_R_MEAN = float(np.exp(7.71 + 1.0056**2 / 2))
_BOREHOLE = (
    as_distribution({"normal": {"mean": 0.1, "std": 0.0161812}}),
    as_distribution({"lognormal": {"mean": _R_MEAN, "std": _R_MEAN * float(np.sqrt(np.expm1(1.0056**2)))}}),
    *_uniform((63070, 115600), (990, 1110), (63.1, 116), (700, 820), (1120, 1680), (9855, 12045)),
)

CASES = {
    "Ishigami": Case(ishigami, _uniform(*[(-np.pi, np.pi)] * 3), 200),
    "Borehole": Case(borehole, _BOREHOLE, 100),
    "G-function": Case(g_function, _uniform(*[(0.0, 1.0)] * 8), 500),
}
