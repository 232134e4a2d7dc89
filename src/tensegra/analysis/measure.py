"""What a design under uncertainty is judged by: a statistic of the outcomes at it, with its derivative."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError

Array = NDArray[np.float64]

KAPPA, QUANTILE = 2.0, 0.05


@dataclass(frozen=True)
class Measure:
    """A statistic of outcomes of which more is better.

    Attributes
    ----------
    kappa
        mean − κ · std, where given.
    quantile
        Otherwise the outcome that this share of all outcomes falls short of.
    """

    kappa: float | None
    quantile: float | None

    @classmethod
    def of(cls, kappa: float | None, quantile: float | None) -> "Measure":
        """Build the measure from the two options, of which at most one is given.

        Raises
        ------
        StudyError
            If both are given, or the value makes no sense.
        """
        if kappa is not None and quantile is not None:
            raise StudyError.at("robust", "kappa and quantile", "one of them")
        if quantile is not None and not 0.0 < quantile < 1.0:
            raise StudyError.at("robust.quantile", quantile, "a share between 0 and 1")
        if kappa is not None and not kappa >= 0.0:
            raise StudyError.at("robust.kappa", kappa, "a number not below 0")
        return cls(KAPPA if kappa is None and quantile is None else kappa, quantile)

    def words(self, formula: str, *, maximise: bool) -> str:
        """Return the statistic of a formula as one writes it by hand."""
        if self.quantile is not None:
            level = self.quantile if maximise else 1.0 - self.quantile
            return f"{100 * level:g} % quantile of {formula}"
        return f"mean {'−' if maximise else '+'} {self.kappa:g} std of {formula}"

    def value(self, outcomes: Array) -> Array:
        """Return the statistic (n,) of outcomes (n, n_draws)."""
        if self.quantile is not None:
            return np.asarray(np.quantile(outcomes, self.quantile, axis=1))
        return np.asarray(outcomes.mean(axis=1) - (self.kappa or 0.0) * outcomes.std(axis=1))

    def slope(self, outcomes: Array, slopes: Array) -> Array:
        """Return its derivatives (n, d) from those of the outcomes, (n, n_draws, d)."""
        return np.asarray(np.einsum("nm,nmd->nd", self._weights(outcomes), slopes))

    def _weights(self, outcomes: Array) -> Array:
        """Return the derivative of the statistic by each outcome, (n, n_draws)."""
        n, n_draws = outcomes.shape
        if self.quantile is None:
            spread = outcomes.std(axis=1, keepdims=True)
            safe = np.where(spread > 0.0, spread, 1.0)
            centred = np.where(spread > 0.0, (outcomes - outcomes.mean(axis=1, keepdims=True)) / safe, 0.0)
            return np.asarray((1.0 - (self.kappa or 0.0) * centred) / n_draws)
        place = self.quantile * (n_draws - 1)
        below = int(place)
        above, share = min(below + 1, n_draws - 1), place - below
        order, rows = np.argsort(outcomes, axis=1), np.arange(n)
        weights = np.zeros_like(outcomes)
        weights[rows, order[:, below]] += 1.0 - share
        weights[rows, order[:, above]] += share
        return weights
