"""Everything printed that a beam can agree with or not: values with their digits, and claims in words."""

from dataclasses import dataclass

__all__ = ["FINDINGS", "Finding"]


@dataclass(frozen=True)
class Finding:
    """Something printed that a beam can agree with or not.

    Attributes
    ----------
    key, chapter, place
        Its name; which part of the reproduction it belongs to; where it is printed.
    words
        What is printed.
    target, tolerance
        A measured value agrees where it is within the tolerance of the target; where `least` (`most`) is
        true, also where it is above (below).
    fitted
        Whether the search may see it; the others are predicted.
    scale
        What the measured value is off by where the search counts one.
    """

    key: str
    chapter: str
    place: str
    words: str
    target: float
    tolerance: float
    fitted: bool
    scale: float
    least: bool = False
    most: bool = False

    def off(self, value: float) -> float:
        """Return by how much a measured value misses the target, zero where one side is enough; NaN stays."""
        miss = value - self.target
        if (self.least and miss > 0.0) or (self.most and miss < 0.0):
            return 0.0
        return miss

    def agrees(self, value: float) -> bool:
        """Return whether a measured value agrees with what is printed."""
        return bool(abs(self.off(value)) <= self.tolerance)


SAMPLES = 10_000
"""Size of the publication's samples of Table 2."""

PRINTED = {
    "uniform": {
        "mean": 50.10,
        "std": 1.34,
        "q25": 49.15,
        "q50": 50.08,
        "q75": 51.06,
        "min": 46.42,
        "max": 53.88,
    },
    "exponential": {
        "mean": 52.60,
        "std": 0.64,
        "q25": 52.20,
        "q50": 52.63,
        "q75": 53.08,
        "min": 48.48,
        "max": 54.03,
    },
}
"""Table 2, FEM, cm, each law's numbers as printed under the heading of the other: the mean actuation of the
uniform law is 9.5 %, that of the exponential one 9.9 %, and w grows with it."""

HALF_DIGIT = 0.005

CHANCE = {"mean": 2.0, "std": 1.5, "q25": 2.8, "q50": 2.6, "q75": 2.8, "min": 30.0, "max": 30.0}
"""Two standard errors of each statistic of 10,000 samples, over std/√10,000, rounded up; of bounded laws the
extremes scatter by less than 0.3 std."""

CHANCE_OF_LONGEST = 125.0
"""The same for the minimum under the exponential law: the largest of 10,000 exponential errors has a standard
deviation of 1.28 means, twice that times the slope of w (3.1 cm a percent) is 0.8 cm, or 1.25 std."""


def _table(law: str, statistic: str) -> Finding:
    value, std = PRINTED[law][statistic], PRINTED[law]["std"]
    chance = CHANCE_OF_LONGEST if (law, statistic) == ("exponential", "min") else CHANCE[statistic]
    return Finding(
        f"{law} {statistic}",
        "uncertainty",
        "Table 2",
        f"{value:.2f} cm",
        value,
        HALF_DIGIT + chance * std / SAMPLES**0.5,
        fitted=statistic in {"mean", "std"},
        scale=0.05,
    )


def _claim(
    key: str, chapter: str, place: str, words: str, bound: float, scale: float, *, least: bool, fitted: bool
) -> Finding:
    return Finding(key, chapter, place, words, bound, 0.0, fitted, scale, least=least, most=not least)


FINDINGS: tuple[Finding, ...] = (
    _claim(
        "w grows", "shapes", "Fig. 4", "large upward deflection at 10 %", 0.0, 1.0, least=True, fitted=False
    ),
    _claim(
        "v grows",
        "shapes",
        "Sect. 2.2",
        "deflection along y becomes larger and larger",
        0.0,
        1.0,
        least=True,
        fitted=False,
    ),
    Finding("6a upward", "outcomes", "Fig. 6a", "98.4 %", 98.4, 0.15, fitted=True, scale=2.0),
    Finding("6a irregular", "outcomes", "Fig. 6a", "1.4 %", 1.4, 0.15, fitted=False, scale=2.0),
    Finding("6a not converged", "outcomes", "Fig. 6a", "0.2 %", 0.2, 0.1, fitted=False, scale=2.0),
    Finding("6b irregular", "outcomes", "Fig. 6b", "49.4 %", 49.4, 0.5, fitted=True, scale=5.0),
    Finding("6b upward", "outcomes", "Fig. 6b", "about half", 50.0, 5.0, fitted=False, scale=5.0),
    _claim(
        "T on v",
        "designs",
        "Fig. 9a",
        "effect of temperature on y is negligible",
        0.05,
        0.02,
        least=False,
        fitted=True,
    ),
    _claim(
        "T on w above v",
        "designs",
        "Fig. 9",
        "high on z, negligible on y",
        1.0,
        0.2,
        least=True,
        fitted=False,
    ),
    _claim("T_top first on w", "designs", "Fig. 9b", "T_top", 1.0, 0.2, least=True, fitted=False),
    *(_table(law, statistic) for law in PRINTED for statistic in PRINTED[law]),
    _claim(
        "uniform: normal",
        "uncertainty",
        "Fig. 12c",
        "normal distribution",
        0.5,
        0.2,
        least=False,
        fitted=False,
    ),
    _claim(
        "exponential: skew",
        "uncertainty",
        "Fig. 12d",
        "approximately exponential",
        -1.0,
        0.3,
        least=False,
        fitted=False,
    ),
    _claim(
        "top over bottom",
        "indices",
        "Fig. 13b",
        "A1 and A4 much stronger than A2 and A3",
        2.0,
        0.5,
        least=True,
        fitted=True,
    ),
    _claim(
        "actuation over T",
        "indices",
        "Fig. 19",
        "much larger for actuation than for temperature",
        2.0,
        0.5,
        least=True,
        fitted=False,
    ),
    _claim("T_bottom", "indices", "Fig. 19", "negligible", 0.05, 0.02, least=False, fitted=False),
    _claim("A14 on w", "indices", "Fig. 19b", "high sensitivity", 0.4, 0.1, least=True, fitted=False),
    _claim(
        "A14 on v",
        "indices",
        "Fig. 19a",
        "relatively low: at most half of that to z",
        0.5,
        0.1,
        least=False,
        fitted=True,
    ),
    _claim("A23 on v", "indices", "Fig. 19a", "the highest", 1.0, 0.2, least=True, fitted=True),
    _claim(
        "runs kept",
        "selection",
        "App. B",
        "98,365 of 100,000 kept, so at least as many converged",
        98.365,
        2.0,
        least=True,
        fitted=False,
    ),
    Finding("w at v = 1.00", "optimum", "Sect. 4.3", "146.85 cm", 146.85, 0.02, fitted=True, scale=0.5),
    Finding("A4 at v = 1.00", "optimum", "Sect. 4.3", "0.16", 0.16, 0.005, fitted=True, scale=0.005),
    Finding("w at v = 0", "optimum", "Fig. 14", "about 144 cm", 144.0, 0.5, fitted=False, scale=0.5),
    _claim("corner is best", "optimum", "Sect. 4.3", "A1 = A23 = 0.3", 0.0, 0.5, least=True, fitted=False),
    Finding(
        "area before",
        "gripper",
        "Sect. 4.3",
        "2910 cm² where the gap after is 18.22 cm",
        2910.0,
        5.0,
        fitted=True,
        scale=100.0,
    ),
    _claim(
        "v left",
        "gripper",
        "Fig. 15",
        "deflection along y is almost eliminated",
        0.1,
        0.05,
        least=False,
        fitted=False,
    ),
)
"""Of those in words, the bounds are what the words say at the least: much stronger or larger is twice,
negligible a share of 5 %, high a share of 40 %, normal within 0.5 of no skewness and no excess kurtosis,
exponential half the skewness of the law itself, almost eliminated a tenth left."""
