"""The design of the paper's five inputs: every pair of an actuation and a temperature."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.published import published
from tensegra_paper.setting import Setting

__all__ = ["ACTUATIONS", "TEMPERATURES", "product_design"]

Array: TypeAlias = NDArray[np.float64]

ACTUATIONS, TEMPERATURES = ("A14", "A23"), ("T_top", "T_middle", "T_bottom")


def product_design(setting: Setting, n_actuations: int, n_temperatures: int) -> dict[str, Array]:
    """Return every pair of a Sobol point of the actuations and one of the temperatures.

    Parameters
    ----------
    setting
        Gives the seeds of the scrambling.
    n_actuations, n_temperatures
        Points of the two sequences.

    Returns
    -------
    dict
        By input, shape (n_actuations n_temperatures,); the temperatures run fastest.
    """
    actuations = _sobol(setting, "actuations", len(ACTUATIONS), n_actuations)
    temperatures = _sobol(setting, "temperatures", len(TEMPERATURES), n_temperatures)
    low, high = published("doe", "actuation_range")
    cold, hot = published("doe", "temperature_range")
    scaled = {
        name: np.repeat(low + (high - low) * column, n_temperatures)
        for name, column in zip(ACTUATIONS, actuations.T, strict=True)
    }
    return scaled | {
        name: np.tile(cold + (hot - cold) * column, n_actuations)
        for name, column in zip(TEMPERATURES, temperatures.T, strict=True)
    }


def _sobol(setting: Setting, name: str, dimension: int, n_points: int) -> Array:
    from scipy.stats import qmc

    sampler = qmc.Sobol(dimension, scramble=True, rng=setting.seed_of(f"designs {name}"))
    # The printed numbers are no powers of two; the beginning of a longer balanced sequence is taken.
    return np.asarray(sampler.random_base2(int(np.ceil(np.log2(n_points))))[:n_points])
