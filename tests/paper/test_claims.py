"""No criterion holds whatever comes out: each has a made-up case in which it holds, and one where not."""

import pytest

from tensegra_paper.chapter import Agreement
from tensegra_paper.claims import CLAIMS, finding

TOP, BOTTOM = {"A1": 0.5, "A4": 0.4}, {"A2": 0.1, "A3": 0.2}

# By claim: numbers for which it holds, and numbers of the same kind for which it does not.
CASES = {
    "y grows": ({"v": [1.0, -2.0, 3.0]}, {"v": [1.0, 3.0, 2.0]}),
    "two shapes": ({"largest_strain": 0.04, "limit": 0.05}, {"largest_strain": 0.89, "limit": 0.05}),
    "upward with gravity": ({"share": 98.0}, {"share": 83.2}),
    "irregular with gravity": ({"share": 1.0}, {"share": 8.0}),
    "not converged with gravity": ({"share": 0.0}, {"share": 9.0}),
    "upward without gravity": ({"share": 51.0}, {"share": 67.0}),
    "irregular without gravity": ({"share": 50.0}, {"share": 12.0}),
    "temperature high on z": ({"z": 0.3, "y": 0.1}, {"z": 0.09, "y": 0.18}),
    "temperature negligible on y": ({"y": 0.04}, {"y": 0.18}),
    "T_top matters most": (
        {"shares": {"T_top": 0.7, "T_middle": 0.1, "T_bottom": 0.2}},
        {"shares": {"T_top": 0.4, "T_middle": 0.3, "T_bottom": 0.3}},
    ),
    "process error": ({"error": 1e-6}, {"error": 1e-4}),
    "network error": ({"error": 1e-2}, {"error": 0.1}),
    "process more accurate": (
        {"process": [1e-6, 1e-6], "network": [1e-3, 1e-3]},
        {"process": [1e-6, 1e-2], "network": [1e-3, 1e-3]},
    ),
    "process slower": ({"process": 630.3, "network": 147.3}, {"process": 1.1, "network": 4.2}),
    "three orders": ({"ratio": 900.0}, {"ratio": 33.0}),
    "normal": ({"skewness": 0.1, "kurtosis": -0.2}, {"skewness": 0.1, "kurtosis": -1.06}),
    "exponential": ({"skewness": -1.9}, {"skewness": -0.7}),
    "FEM and network": ({"difference": 0.01}, {"difference": 0.3}),
    "headings by the print": (
        {"mean_uniform": 50.1, "mean_exponential": 52.6, "reach_uniform": 2.2, "bound": 2.45},
        {"mean_uniform": 52.6, "mean_exponential": 50.1, "reach_uniform": 6.4, "bound": 2.45},
    ),
    "headings by the beam": (
        {"headed": [0.3, 0.2], "exchanged": [1.8]},
        {"headed": [1.9], "exchanged": [0.26, 0.3]},
    ),
    "uniform statistics": ({"mean": 50.2, "std": 1.4}, {"mean": 50.4, "std": 1.55}),
    "exponential statistics": ({"mean": 52.4, "std": 0.64}, {"mean": 52.4, "std": 0.8}),
    "one error": ({"ratio": 0.97}, {"ratio": 0.484}),
    "top much stronger": ({"top": TOP, "bottom": BOTTOM}, {"top": TOP | {"A4": 0.02}, "bottom": BOTTOM}),
    "bind the bottom": ({"kept": TOP, "bound": BOTTOM}, {"kept": TOP | {"A4": 0.02}, "bound": BOTTOM}),
    "actuation much larger": (
        {"actuation": [{"A14": 0.5, "A23": 0.4}] * 2, "temperature": [{"T_top": 0.1}] * 2},
        {"actuation": [{"A14": 0.8, "A23": 0.04}] * 2, "temperature": [{"T_top": 0.1}] * 2},
    ),
    "T_bottom negligible": ({"total": [0.01, 0.02]}, {"total": [0.055, 0.02]}),
    "A14 high on z": ({"total": 0.88}, {"total": 0.3}),
    "A14 low on y": ({"total": 0.2, "other": 0.7}, {"total": 0.79, "other": 0.04}),
    "A23 highest on y": ({"totals": {"A14": 0.2, "A23": 0.7}}, {"totals": {"A14": 0.8, "A23": 0.04}}),
    "four groups": ({"groups": 4}, {"groups": 3}),
    "largest group": ({"share": 98.0}, {"share": 75.6}),
    "all viable": ({"left_out": 0.02}, {"left_out": 23.6}),
    "upward alone": ({"fallen": 0.1}, {"fallen": 9.6}),
    "lift where straight": ({"value": 148.1}, {"value": 110.0}),
    "one optimum": (
        {"places": [[0.3, 0.3, 0.16], [0.3, 0.3, 0.161], [0.3, 0.299, 0.16]]},
        {"places": [[0.3, 0.3, 0.16], [0.1, 0.2, 0.05], [0.3, 0.3, 0.16]]},
    ),
    "optimum confirmed": ({"network": 146.85, "fem": 147.0}, {"network": 263.0, "fem": 140.0}),
    "many evaluations": ({"evaluations": 7323}, {"evaluations": 900}),
    "few evaluations": ({"evaluations": 34}, {"evaluations": 60}),
    "Bayesian slower": (
        {"bayesian": 120.0, "others": [30.0, 29.0]},
        {"bayesian": 3.0, "others": [20.0, 2.0]},
    ),
    "SQP uniform": ({"distance": 0.05}, {"distance": 0.6}),
    "BFGS uniform": ({"distance": 0.05}, {"distance": 0.6}),
    "Bayesian concentrated": ({"share": 0.7}, {"share": 0.2}),
    "y eliminated": ({"before": 25.5, "after": 0.92}, {"before": 25.5, "after": 5.0}),
    "area before": ({"value": 2800.0}, {"value": 3600.0}),
    "greatly reduced": ({"before": 3600.0, "after": 332.0}, {"before": 900.0, "after": 332.0}),
}


def test_every_criterion_has_its_cases():
    assert set(CASES) == set(CLAIMS)


@pytest.mark.parametrize("key", CASES)
def test_a_criterion_can_hold_and_can_fail(key):
    good, bad = CASES[key]
    claim = CLAIMS[key]
    # A number is measured by the only name that the criterion has.
    assert claim.holds(*good.values()) if len(good) == 1 else claim.holds(**good)
    assert not (claim.holds(*bad.values()) if len(bad) == 1 else claim.holds(**bad))


def test_what_needs_all_runs_is_not_judged_with_fewer():
    judged = {
        scale: finding("four groups", "groups", 4.0, "", "", scale=scale, groups=4) for scale in (0.1, 1.0)
    }
    assert judged[1.0].holds is True
    assert judged[0.1].holds is None
    assert judged[0.1].agreement is Agreement.VALUE
    assert "judged with the printed number of runs alone" in judged[0.1].why


def test_a_row_is_judged_by_its_claim():
    row = finding("area before", "area before", 3600.0, "cm²", "the tips are not printed", value=3600.0)
    assert row.holds is False
    assert row.place == "Fig. 16"
    assert row.published == 2910.0
    assert row.why.startswith("holds where it is the printed value within a tenth; ")
