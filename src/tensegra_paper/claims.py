"""What the paper claims in print, each claim with the criterion that its words set.

A criterion takes numbers that were measured here and says whether they are what is printed. The tests show
for each a made-up case in which it holds and one in which it fails, so that none holds whatever comes out.

Where the words set no number, these thresholds stand for them, one for all claims:

- a printed share holds within one percentage point, "about half" between 45 and 55 %;
- a printed number holds within a tenth of it;
- "much stronger" and "much larger" are twice as much, for each of those named;
- "negligible" is below 5 % of the variance, the usual rule of thumb; "high" and "low" are above and below a
  half.
"""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import log10
from typing import Any

from tensegra_paper.chapter import Agreement, Row

__all__ = ["CLAIMS", "HIGH", "MUCH", "NEGLIGIBLE", "Claim", "finding"]

POINT, HALF = 1.0, (45.0, 55.0)
NEAR = 0.1
MUCH, NEGLIGIBLE, HIGH = 2.0, 0.05, 0.5


@dataclass(frozen=True)
class Claim:
    """One claim.

    Attributes
    ----------
    place
        Where it is printed.
    printed
        What is printed, in words, or the number.
    criterion
        When it holds, in words.
    holds
        The same of numbers; its parameters are named.
    whole
        Whether it is about what many runs or starts do, so that it is judged with the printed number alone.
    """

    place: str
    printed: float | str
    criterion: str
    holds: Callable[..., bool]
    whole: bool = False


def finding(
    key: str,
    quantity: str,
    ours: float | str,
    unit: str,
    why: str,
    *,
    scale: float = 1.0,
    **measured: Any,  # noqa: ANN401
) -> Row:
    """Return the row of a claim, judged by its criterion.

    Parameters
    ----------
    key
        Of `CLAIMS`.
    quantity, ours, unit, why
        As of `Row`; the criterion is put before the reason.
    scale
        Share of the printed numbers of runs. Below 1 a claim that needs them all is compared, not judged.
    **measured
        What the criterion takes.
    """
    claim = CLAIMS[key]
    if claim.whole and scale < 1.0:
        less = f"judged with the printed number of runs alone: {claim.criterion}"
        told = f"{less}; {why}" if why else less
        return Row(claim.place, quantity, claim.printed, ours, unit, Agreement.VALUE, None, told)
    return Row(
        claim.place,
        quantity,
        claim.printed,
        ours,
        unit,
        Agreement.FINDING,
        bool(claim.holds(**measured)),
        f"holds where {claim.criterion}; {why}" if why else f"holds where {claim.criterion}",
        claim=key,
    )


def _share(printed: float) -> Callable[[float], bool]:
    return lambda share: abs(share - printed) <= POINT


def _number(printed: float) -> Callable[[float], bool]:
    return lambda value: abs(value / printed - 1.0) <= NEAR


def _each_much(top: Mapping[str, float], bottom: Mapping[str, float]) -> bool:
    return min(top.values()) >= MUCH * max(bottom.values())


def _largest(of: Mapping[str, float]) -> str:
    return max(of, key=lambda name: of[name])


CLAIMS: Mapping[str, Claim] = {
    # Sect. 2.2
    "y grows": Claim(
        "Fig. 4",
        "becomes larger and larger",
        "its magnitude grows from each actuation to the next",
        lambda v: all(abs(a) < abs(b) for a, b in itertools.pairwise(v)),
    ),
    "two shapes": Claim(
        "Fig. 5",
        "one regular, one irregular",
        "other lengths of the loading steps end in another equilibrium than the upward one, within small "
        "strain",
        lambda largest_strain, limit: largest_strain is not None and largest_strain <= limit,
    ),
    "upward with gravity": Claim("Fig. 6a", 98.4, "it is the printed share within a point", _share(98.4)),
    "irregular with gravity": Claim("Fig. 6a", 1.4, "it is the printed share within a point", _share(1.4)),
    "not converged with gravity": Claim(
        "Fig. 6a", 0.2, "it is the printed share within a point", _share(0.2)
    ),
    "upward without gravity": Claim(
        "Fig. 6b",
        "about half",
        "it is between 45 and 55 %",
        lambda share: HALF[0] <= share <= HALF[1],
    ),
    "irregular without gravity": Claim(
        "Fig. 6b", 49.4, "it is the printed share within a point", _share(49.4)
    ),
    # Sect. 3.1
    "temperature high on z": Claim(
        "Fig. 9b",
        "high",
        "temperature makes more of the variance of z than of y, and no negligible part",
        lambda z, y: z > y and z >= NEGLIGIBLE,
    ),
    "temperature negligible on y": Claim(
        "Fig. 9a", "negligible", "it is below 5 % of the variance", lambda y: y < NEGLIGIBLE
    ),
    "T_top matters most": Claim(
        "Fig. 9b",
        "T_top",
        "T_top makes more than half of the part by temperatures",
        lambda shares: _largest(shares) == "T_top" and shares["T_top"] > HIGH,
    ),
    # Sect. 3.2
    "process error": Claim(
        "Fig. 10", 1e-5, "neither output is off by more than twice that", lambda error: error <= 2e-5
    ),
    "network error": Claim(
        "Fig. 10", 1e-2, "neither output is off by more than twice that", lambda error: error <= 2e-2
    ),
    "process more accurate": Claim(
        "Sect. 3.2",
        "Gaussian process",
        "its error is the smaller one for both outputs",
        lambda process, network: all(p < n for p, n in zip(process, network, strict=True)),
    ),
    "process slower": Claim(
        "Sect. 3.2",
        "4.3 (630.3 s against 147.3 s)",
        "the Gaussian process takes at least twice as long as the network",
        lambda process, network: process >= MUCH * network,
    ),
    "three orders": Claim(
        "Sect. 3.2",
        "three orders of magnitude",
        "the ratio is nearer to 1,000 than to 100 or 10,000",
        lambda ratio: 2.5 <= log10(ratio) <= 3.5,
    ),
    # Sect. 3.3
    "normal": Claim(
        "Fig. 12c",
        "a normal distribution",
        "skewness and excess kurtosis are within ±0.5",
        lambda skewness, kurtosis: abs(skewness) <= 0.5 and abs(kurtosis) <= 0.5,
    ),
    "exponential": Claim(
        "Fig. 12d",
        "approximately exponential",
        "the skewness is within a quarter of an exponential law's, 2 in magnitude",
        lambda skewness: 1.5 <= abs(skewness) <= 2.5,
    ),
    "FEM and network": Claim(
        "Table 2",
        "in good agreement",
        "no statistic differs by more than 0.02 cm, as in print",
        lambda difference: difference <= 0.02,
    ),
    "headings by the print": Claim(
        "Table 2",
        "its own",
        "the smaller error has the larger mean, and the bounded one no value farther from its mean than it "
        "can reach",
        lambda mean_uniform, mean_exponential, reach_uniform, bound: (
            mean_uniform < mean_exponential and reach_uniform <= bound
        ),
    ),
    "headings by the beam": Claim(
        "Table 2",
        "its own",
        "the numbers are nearer to ours as headed than exchanged, for every seed",
        lambda headed, exchanged: min(headed) < min(exchanged),
    ),
    "uniform statistics": Claim(
        "Table 2",
        "mean 50.10, std 1.34",
        "the mean is within 1 %, the deviation within 10 % of those under the other heading",
        lambda mean, std: abs(mean / 50.10 - 1) <= 0.01 and abs(std / 1.34 - 1) <= NEAR,
    ),
    "exponential statistics": Claim(
        "Table 2",
        "mean 52.60, std 0.64",
        "the mean is within 1 %, the deviation within 10 % of those under the other heading",
        lambda mean, std: abs(mean / 52.60 - 1) <= 0.01 and abs(std / 0.64 - 1) <= NEAR,
    ),
    "one error": Claim(
        "Eq. 9",
        "A14 = A23 = 0.1 − φ",
        "the printed moments are nearer to a shared error (1) than to independent ones (1/2)",
        lambda ratio: ratio > 0.75,
    ),
    # Sect. 4.1 and Appendix A
    "top much stronger": Claim(
        "Fig. 13b",
        "A1, A4 much stronger than A2, A3",
        "A1 and A4 each have twice the index of A2 and of A3",
        _each_much,
    ),
    "bind the bottom": Claim(
        "Sect. 4.1",
        "A2 and A3 are bound together",
        "both have smaller indices than each that is kept apart",
        lambda kept, bound: min(kept.values()) > max(bound.values()),
    ),
    "actuation much larger": Claim(
        "Fig. 19",
        "actuation much larger than temperature",
        "each actuation has twice the index of each temperature, on y and on z",
        lambda actuation, temperature: all(
            min(a.values()) >= MUCH * max(t.values()) for a, t in zip(actuation, temperature, strict=True)
        ),
    ),
    "T_bottom negligible": Claim(
        "Fig. 19",
        "negligible",
        "its index is below 0.05 on y and on z",
        lambda total: max(total) < NEGLIGIBLE,
    ),
    "A14 high on z": Claim("Fig. 19b", "high", "its index is above a half", lambda total: total > HIGH),
    "A14 low on y": Claim(
        "Fig. 19a",
        "relatively low",
        "its index is below a half and below that of A23",
        lambda total, other: total < HIGH and total < other,
    ),
    "A23 highest on y": Claim(
        "Fig. 19a", "A23", "no input has a larger index", lambda totals: _largest(totals) == "A23"
    ),
    # Appendix B
    "four groups": Claim(
        "Fig. 20",
        4.0,
        "there are four",
        lambda groups: groups == 4,
        whole=True,
    ),
    "largest group": Claim(
        "Fig. 20",
        98.365,
        "it is the printed share within a point",
        _share(98.365),
        whole=True,
    ),
    "all viable": Claim(
        "Fig. 20",
        "all the viable solutions",
        "at most 0.1 % of the runs that stand are left out",
        lambda left_out: left_out <= 0.1,
        whole=True,
    ),
    "upward alone": Claim(
        "Sect. 4.1",
        "the data with an upward deflection",
        "at most 1 % of the runs kept do not stand",
        lambda fallen: fallen <= 1.0,
        whole=True,
    ),
    # Sect. 4.3
    "lift where straight": Claim("Fig. 14", 144.0, "it is the printed value within a tenth", _number(144.0)),
    "one optimum": Claim(
        "Eq. 12",
        "the same by all methods",
        "SQP, BFGS and Bayesian optimisation end within 0.01 of each other in every actuation",
        lambda places: all(max(column) - min(column) <= 0.01 for column in zip(*places, strict=True)),
        whole=True,
    ),
    "optimum confirmed": Claim(
        "Sect. 4.3",
        "146.85 by the network",
        "FEM at the network's optimum has its w within a tenth",
        lambda network, fem: abs(fem / network - 1.0) <= NEAR,
        whole=True,
    ),
    "many evaluations": Claim(
        "Fig. 17",
        "over 2,000",
        "SQP asks more than 2,000 times",
        lambda evaluations: evaluations > 2000,
        whole=True,
    ),
    "few evaluations": Claim(
        "Fig. 17",
        "less than 40",
        "Bayesian optimisation is within 0.1 % of the direct optimum before its 40th evaluation",
        lambda evaluations: evaluations < 40,
    ),
    "Bayesian slower": Claim(
        "Sect. 4.3",
        "4 (2 min against 30 s)",
        "Bayesian optimisation takes longer than SQP and than BFGS",
        lambda bayesian, others: bayesian > max(others),
    ),
    "SQP uniform": Claim(
        "Fig. 18a",
        "almost uniform",
        "the distribution of w at 200 solutions is within 0.1 of a uniform one (Kolmogorov's distance)",
        lambda distance: distance <= 0.1,
        whole=True,
    ),
    "BFGS uniform": Claim(
        "Fig. 18b",
        "similar to SQP",
        "the distribution of w at 200 solutions is within 0.1 of a uniform one (Kolmogorov's distance)",
        lambda distance: distance <= 0.1,
        whole=True,
    ),
    "Bayesian concentrated": Claim(
        "Fig. 18c",
        "a clear concentration at the optimum",
        "more than half of its solutions are within 5 % of its optimum",
        lambda share: share > HIGH,
    ),
    "y eliminated": Claim(
        "Fig. 15",
        "almost eliminated",
        "nine tenths are gone",
        lambda before, after: abs(after) <= NEAR * abs(before),
    ),
    "area before": Claim("Fig. 16", 2910.0, "it is the printed value within a tenth", _number(2910.0)),
    "greatly reduced": Claim(
        "Fig. 16",
        "greatly reduced",
        "the area after is a fifth or less of the area before",
        lambda before, after: after <= 0.2 * before,
    ),
}
