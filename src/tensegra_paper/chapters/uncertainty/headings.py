"""What Table 2 says of itself, by its own numbers and by our samples: shapes, headings, one error or two."""

from collections.abc import Sequence
from math import sqrt
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra_paper.chapter import Agreement, Row
from tensegra_paper.chapters.uncertainty.readings import (
    LAWS,
    STATISTICS,
    Reading,
    lift_by,
    nearest,
    printed_column,
    slope_ratio,
    statistics,
)
from tensegra_paper.claims import finding
from tensegra_paper.five_inputs import TEMPERATURES
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["BOUND", "RANGE", "REACH", "excess_kurtosis", "heading_rows", "shape_rows", "skewness"]

Array: TypeAlias = NDArray[np.float64]

BOUND = sqrt(3.0 * 5.0)
"""Deviations from its mean that a linear response to five independent uniform inputs can reach at most.

One uniform input reaches √3; of k equally strong ones the sum reaches √(3k), of unequal ones less.
"""


def _printed(law: str, *, exchanged: bool = True) -> dict[str, float]:
    values = printed_column(law, "fem", exchanged=exchanged).tolist()
    return dict(zip(STATISTICS, values, strict=True))


_SOBOL = _printed("uniform", exchanged=False)
_OTHER = _printed("exponential", exchanged=False)

REACH = {
    "low": (_SOBOL["mean"] - _SOBOL["min"]) / _SOBOL["std"],
    "high": (_SOBOL["max"] - _SOBOL["mean"]) / _SOBOL["std"],
}
"""Of the column headed 'Sobol', in its own deviations."""

RANGE = (_OTHER["max"] - _OTHER["min"]) / _OTHER["std"]
"""Of the column headed 'Exponential', in its own deviations."""


def skewness(values: Array) -> float:
    """Return the skewness of a sample; 0 for a normal law, −2 for a reflected exponential one."""
    from scipy.stats import skew

    return float(skew(values))


def excess_kurtosis(values: Array) -> float:
    """Return the excess kurtosis of a sample; 0 for a normal law, −1.2 for a uniform one."""
    from scipy.stats import kurtosis

    return float(kurtosis(values))


def shape_rows(setting: Setting, ours: Reading, network: "Surrogate") -> list[Row]:
    """Return what Fig. 12 says of the shapes of the distributions."""
    uniform, exponential = ours.samples["uniform"], ours.samples["exponential"]
    normal = _with_normal_error(setting, network, len(uniform))
    quartiles = {law: _quartile_skewness(_printed(law)) for law in LAWS}
    return [
        finding(
            "normal",
            "skewness and excess kurtosis of w, uniform error",
            f"{skewness(uniform):.2f}, {excess_kurtosis(uniform):.2f}",
            "",
            "a uniform law has 0 and −1.2: the error is shared and outweighs the temperatures, so that w is "
            "a plateau. Normal it would be with an error that is normal itself (of the same mean and "
            f"deviation: {skewness(normal):.2f}, {excess_kurtosis(normal):.2f}), or with many independent "
            "errors of one size",
            skewness=skewness(uniform),
            kurtosis=excess_kurtosis(uniform),
        ),
        finding(
            "exponential",
            "skewness of w, exponential error",
            skewness(exponential),
            "",
            "the temperatures scatter w as much as the error does. The printed quartiles are as symmetric: "
            "the median lies at "
            + " and ".join(f"{100 * share:.0f} %" for share in quartiles.values())
            + " of the way between the others in the two columns; 63 % in an exponential law with its tail "
            "below",
            skewness=skewness(exponential),
        ),
    ]


def _with_normal_error(setting: Setting, network: "Surrogate", n_runs: int) -> Array:
    """Return w for an error that is normal, of the mean and deviation of the uniform one."""
    rng = np.random.default_rng(setting.seed_of("normal error"))
    phi = rng.normal(0.005, 0.01 / sqrt(12.0), n_runs)
    cold, hot = published("doe", "temperature_range")
    temperatures = rng.uniform(cold, hot, (n_runs, len(TEMPERATURES)))
    return lift_by(network, np.column_stack([0.1 - phi, 0.1 - phi, temperatures]))


def _quartile_skewness(column: dict[str, float]) -> float:
    """Return where the median lies between the quartiles, as a share of their distance."""
    return (column["q50"] - column["q25"]) / (column["q75"] - column["q25"])


def heading_rows(options: Sequence[Reading]) -> list[Row]:
    """Return what the numbers say of how Table 2 is to be read."""
    headed, exchanged = (nearest(options, exchanged=swapped) for swapped in (False, True))
    varying = nearest(options, exchanged=True, temperatures=True)
    still = nearest(options, exchanged=True, temperatures=False)
    printed = {law: _printed(law) for law in LAWS}
    ratio = slope_ratio(*({law: column[name] for law, column in printed.items()} for name in ("mean", "std")))
    return [
        finding(
            "headings by the print",
            "heading of each column, by the print alone",
            "the other's",
            "",
            f"the error of 0.5 % on average has the mean {_SOBOL['mean']:.2f} cm, that of 0.1 % "
            f"{_OTHER['mean']:.2f}; the bounded one reaches {REACH['low']:.1f} deviations, where "
            f"{BOUND:.2f} is the most that five uniform inputs can do",
            mean_uniform=_SOBOL["mean"],
            mean_exponential=_OTHER["mean"],
            reach_uniform=max(REACH.values()),
            bound=BOUND,
        ),
        finding(
            "headings by the beam",
            "heading of each column, by this beam",
            "the other's" if exchanged.distance < headed.distance else "its own",
            "",
            f"distance as headed {headed.told}, exchanged {exchanged.told}",
            headed=headed.distances,
            exchanged=exchanged.distances,
        ),
        Row(
            "Table 2",
            "temperatures in these samples",
            "not said",
            "vary" if varying.distance < still.distance else "do not vary",
            "",
            Agreement.VALUE,
            None,
            f"the range of the column of the uniform error is {RANGE:.2f} deviations, above the 4.90 that "
            f"two uniform errors can reach; on this beam {varying.told} varying, {still.told} not",
        ),
        finding(
            "one error",
            "Σ slope² / (Σ slope)² from the printed means and deviations",
            round(ratio, 3),
            "",
            "1 where A14 and A23 share their error, 1/2 where two equally strong ones are independent. The "
            "quartiles agree: "
            f"{(printed['uniform']['q75'] - printed['uniform']['q25']) / printed['uniform']['std']:.2f} "
            "deviations apart, 1.43 for two equal uniform errors, 1.73 for one; ours, shared, "
            f"{_spread(nearest(options, exchanged=True, temperatures=True, shared=True)):.2f}",
            ratio=ratio,
        ),
    ]


def _spread(reading: Reading) -> float:
    """Return the distance of the quartiles of the uniform error over the deviation."""
    found = dict(zip(STATISTICS, statistics(reading.samples["uniform"]).tolist(), strict=True))
    return float((found["q75"] - found["q25"]) / found["std"])
