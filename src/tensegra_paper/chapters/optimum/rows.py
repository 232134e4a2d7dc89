"""What the optimisation found beside what is printed: the problems, the rows and the tables."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import Optimum
from tensegra.report import Table, number
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Row
from tensegra_paper.chapters.optimum.straight import Surface
from tensegra_paper.claims import finding
from tensegra_paper.models import LIFT_INPUTS
from tensegra_paper.published import published

__all__ = [
    "EVALUATIONS",
    "HIGHEST",
    "METHODS",
    "PROBLEMS",
    "STRAIGHT",
    "XI",
    "Found",
    "by_fem",
    "optimum_table",
    "place",
    "posed_rows",
    "printed_rows",
    "range_rows",
    "spread",
    "visit_rows",
    "visited",
]

STRAIGHTEST = "abs(w) / (abs(v) + abs(w))"
"""Eq. 12 as printed."""

HIGHEST, STRAIGHT = "w", "abs(v) <= 1"
"""What the publication describes: the greatest w with a small v, here 1 cm as at its optimum."""

METHODS = {"slsqp": "SQP", "bfgs": "BFGS", "bayesian": "Bayesian", "direct": "direct FEM"}
EVALUATIONS, XI = 60, 0.01
"""More evaluations than the printed 'less than 40', so that this could fail; and the printed ξ."""

FALLEN = "does not stand"

N_VISITED = 200
"""Intermediate solutions that Fig. 18 has."""

SAME_RATIO, SAME_LIFT = 1e-4, 1e-3
"""All methods agree on Eq. 12 to this difference, and on the greatest w to this share of it."""

PROBLEMS: Mapping[str, tuple[str, tuple[str, ...], float]] = {
    "Eq. 12 as printed": (STRAIGHTEST, (), SAME_RATIO),
    "well posed": (HIGHEST, (STRAIGHT,), SAME_LIFT),
}
"""Objective, constraints and the relative tolerance of the objective; Eq. 12 is 1 at its maximum."""

Array: TypeAlias = NDArray[np.float64]
Found: TypeAlias = dict[str, Optimum]


def by_fem(best: Optimum) -> float:
    """Return the objective by FEM; NaN where the structure does not stand there."""
    return np.nan if best.true_objective is None else best.true_objective


def place(best: Optimum) -> str:
    """Return the inputs at an optimum in words."""
    return ", ".join(f"{name} {value:.3f}" for name, value in best.inputs.items())


def spread(posed: Found) -> float:
    """Return the largest share by which a method's w, by itself or by FEM, differs from the direct one's."""
    reference = posed["direct"].objective
    return max(abs(value / reference - 1) for one in posed.values() for value in (one.objective, by_fem(one)))


BAYESIAN = (
    "What it does: a Gaussian process of v and one of w, UCB with ξ of the objective made of them times the "
    "probability that the constraints hold, and expected improvement where UCB repeats itself"
)


def needed(one: Optimum, goal: float | None = None) -> int:
    """Return the number of evaluations after which the search is within 0.1 % of a goal, or of its end.

    All evaluations and one more where it never is.
    """
    near = np.abs(one.trace.best / (one.objective if goal is None else goal) - 1) <= SAME_LIFT
    return int(one.trace.evaluation[np.argmax(near)]) if near.any() else one.n_evaluations + 1


def visited(one: Optimum, output: int, *, ends: bool) -> Array:
    """Return an output at the intermediate solutions of a search, at most 200, evenly taken.

    Parameters
    ----------
    one
        The search.
    output
        Number of the output.
    ends
        Whether to take where each start ended, the local optima of which the publication speaks; all that was
        asked otherwise.
    """
    trace = one.trace
    # Starts may take turns: the last evaluation of each is its first from behind.
    n = len(trace.start)
    last = n - 1 - np.unique(trace.start[::-1], return_index=True)[1] if ends else np.arange(n)
    values = trace.outputs[last, output]
    values = values[np.isfinite(values)]
    return np.asarray(values[np.unique(np.linspace(0, len(values) - 1, N_VISITED).round().astype(int))])


def visit_rows(found: Found, low: float, high: float, scale: float) -> list[Row]:
    """Return what Fig. 18 says of the solutions that Eq. 12 lets each method visit, by their w.

    Parameters
    ----------
    found
        The searches.
    low, high
        Range of w over the runs that stand, cm, in which a distribution would be uniform.
    scale
        Of the reproduction.
    """
    rows = []
    for claim, method in (("SQP uniform", "slsqp"), ("BFGS uniform", "bfgs")):
        w = visited(found[method], 1, ends=True)
        gap = uniform_distance(w, low, high)
        rows.append(
            finding(
                claim,
                f"distance of w where {len(w)} starts end from uniform, {METHODS[method]}",
                gap,
                "",
                f"on {low:.0f} to {high:.0f} cm; half of them lie in {np.quantile(w, 0.25):.0f} to "
                f"{np.quantile(w, 0.75):.0f} cm",
                distance=gap,
                scale=scale,
            )
        )
    w = visited(found["bayesian"], 1, ends=False)
    end = found["bayesian"].outputs["w"]
    share = float(np.mean(np.abs(w / end - 1.0) <= 0.05))
    rows.append(
        finding(
            "Bayesian concentrated",
            f"share of {len(w)} solutions within 5 % of the optimum's w, Bayesian",
            share,
            "",
            f"which is {end:.0f} cm; it makes {EVALUATIONS} evaluations, so that there are no 200",
            share=share,
        )
    )
    return rows


def uniform_distance(values: Array, low: float, high: float) -> float:
    """Return Kolmogorov's distance of a sample from the uniform law on an interval.

    Examples
    --------
    >>> uniform_distance(np.linspace(0.0, 1.0, 101), 0.0, 1.0) < 0.02
    True
    >>> round(uniform_distance(np.full(10, 0.9), 0.0, 1.0), 3)
    0.9
    """
    from scipy.stats import kstest

    return float(kstest(values, "uniform", args=(low, high - low)).statistic)


def range_rows(runs: BeamRuns, exact: Optimum) -> list[Row]:
    """Return the rows of Fig. 14, from the runs and the optimum subject to v = 0."""
    w = runs.w[runs.stands]
    return [
        Row(
            "Fig. 14",
            "range of w over the box, runs that stand",
            None,
            f"{w.min():.1f} to {w.max():.1f}",
            "cm",
            Agreement.VALUE,
            None,
            f"{len(w)} of {runs.n_runs} runs; the figure prints no numbers",
        ),
        finding(
            "lift where straight",
            "greatest w where v vanishes",
            exact.outputs["w"],
            "cm",
            f"direct FEM optimisation subject to v = 0, at {place(exact)}; the printed value is read off a "
            "contour plot of the original beam",
            value=exact.outputs["w"],
        ),
    ]


def printed_rows(printed: Found, runs: BeamRuns, surface: Surface) -> list[Row]:
    """Return the rows of Eq. 12 as printed."""
    at_optimum = published("optimisation", "optimum")
    ratio = at_optimum["w"] / (abs(at_optimum["v"]) + at_optimum["w"])
    reference = printed["direct"].objective
    rows = []
    for method, one in printed.items():
        again = by_fem(one)
        away = max(abs(one.objective - reference), abs(again - reference))
        rows.append(
            Row(
                "Eq. 12",
                f"greatest |w|/(|v| + |w|), {METHODS[method]}",
                ratio,
                again if np.isfinite(again) else FALLEN,
                "",
                Agreement.METHOD,
                bool(away <= SAME_RATIO),
                f"by FEM at {place(one)}, where w = {one.outputs['w']:.1f} cm; {one.objective:.8f} on its "
                f"own model; within {away:.1e} of direct FEM, tolerance {SAME_RATIO:g}. The printed optimum "
                f"has {ratio:.4f}",
            )
        )
    share = 100 * float(np.mean(runs.w[runs.stands] / (np.abs(runs.v) + runs.w)[runs.stands] > ratio))
    rows += [
        Row(
            "Eq. 12",
            "designs that beat the printed optimum on Eq. 12",
            None,
            share,
            "%",
            Agreement.VALUE,
            None,
            "of the runs that stand; Eq. 12 is 1 wherever v = 0, and w there runs from "
            f"{surface.w.min():.1f} to {surface.w.max():.1f} cm by FEM",
        ),
        Row(
            "Eq. 12",
            "maximiser",
            None,
            "not unique" if not any(one.agreement.unique for one in printed.values()) else "unique",
            "",
            Agreement.METHOD,
            not any(one.agreement.unique for one in printed.values()),
            "holds where the starts of no method agree on a place; the methods end at w = "
            + ", ".join(f"{one.outputs['w']:.1f}" for one in printed.values())
            + " cm",
        ),
    ]
    return rows


def posed_rows(posed: Found, other: Optimum, scale: float = 1.0) -> list[Row]:
    """Return the rows of the well-posed problem; `other` has v as printed, `scale` is the reproduction's."""
    at_optimum = published("optimisation", "optimum")
    best = posed["direct"]
    clocks = {method: posed[method].seconds for method in ("slsqp", "bfgs") if method in posed}
    rows = []
    for method, one in posed.items():
        away = max(abs(value / best.objective - 1) for value in (one.objective, by_fem(one)))
        rows.append(
            Row(
                "Sect. 4.3",
                f"greatest w with |v| ≤ 1 cm, {METHODS[method]}",
                float(at_optimum["w"]),
                by_fem(one) if np.isfinite(by_fem(one)) else FALLEN,
                "cm",
                Agreement.METHOD,
                bool(away <= SAME_LIFT),
                f"by FEM; {one.objective:.3f} cm on its own model; within {100 * away:.1g} % of direct FEM, "
                f"tolerance {100 * SAME_LIFT:g} %. The rebuilt beam has its optimum at the limit v = "
                f"{best.outputs['v']:.0f} cm",
            )
        )
    rows += [
        Row(
            "Sect. 4.3",
            f"{name} at the optimum",
            float(at_optimum[name]),
            best.inputs[name],
            "",
            Agreement.VALUE,
            None,
            "direct FEM; " + ("on its bound, as printed" if name != "A4" else "where v reaches its limit"),
        )
        for name in LIFT_INPUTS
    ]
    rows += [
        Row(
            "Sect. 4.3",
            "v at the optimum",
            float(at_optimum["v"]),
            best.outputs["v"],
            "cm",
            Agreement.VALUE,
            None,
            "the limit is active; which side of it gives more lift depends on the beam",
        ),
        Row(
            "Sect. 4.3",
            f"greatest w with v = {at_optimum['v']:g} cm, as at the printed optimum",
            float(at_optimum["w"]),
            other.outputs["w"],
            "cm",
            Agreement.VALUE,
            None,
            f"direct FEM, at {place(other)}; printed at A1 0.3, A23 0.3, A4 0.16",
        ),
        finding(
            "many evaluations",
            "evaluations of SQP, greatest w with |v| ≤ 1 cm",
            float(posed["slsqp"].n_evaluations),
            "",
            f"{posed['slsqp'].agreement.n_starts} Latin-hypercube starts, all followed to 1e-13; best to "
            f"0.1 % after {needed(posed['slsqp'])}",
            evaluations=posed["slsqp"].n_evaluations,
            scale=scale,
        ),
        finding(
            "few evaluations",
            "evaluations of Bayesian optimisation until w is best to 0.1 %",
            float(needed(posed["bayesian"], best.objective)),
            "",
            f"of {EVALUATIONS}, which it counts as if it never got there. {BAYESIAN}",
            evaluations=needed(posed["bayesian"], best.objective),
        ),
        finding(
            "Bayesian slower",
            "time of Bayesian optimisation over the longer of SQP and BFGS",
            posed["bayesian"].seconds / max(clocks.values()),
            "",
            f"{posed['bayesian'].seconds:.1f} s, "
            + ", ".join(f"{METHODS[method]} {seconds:.1f} s" for method, seconds in clocks.items())
            + ", on our surrogate",
            bayesian=posed["bayesian"].seconds,
            others=list(clocks.values()),
        ),
    ]
    return rows


def optimum_table(title: str, found: Found) -> Table:
    """List the optima of the methods and what FEM says of each, a column per method."""
    columns = list(found.values())
    rows: list[tuple[object, ...]] = [
        (name, *(f"{one.inputs[name]:.5f}" for one in columns)) for name in LIFT_INPUTS
    ]
    rows.append(("objective", *(number(one.objective, 8) for one in columns)))
    rows.append(("objective, FEM", *(number(by_fem(one), 8) for one in columns)))
    for name in ("v", "w"):
        rows.append((f"{name} [cm]", *(number(one.outputs[name], 8) for one in columns)))
        again = [(one.true_outputs or {}).get(name) for one in columns]
        rows.append((f"{name} [cm], FEM", *(number(value, 8) for value in again)))
    rows += [
        ("status, FEM", *(one.true_status or "" for one in columns)),
        ("place unique", *("yes" if one.agreement.unique else "no" for one in columns)),
        (
            "starts that reach it",
            *(f"{one.agreement.n_best} of {one.agreement.n_starts}" for one in columns),
        ),
        ("evaluations", *(one.n_evaluations for one in columns)),
        ("evaluations until 0.1 %", *(needed(one) for one in columns)),
        ("time [s]", *(f"{one.seconds:.1f}" for one in columns)),
    ]
    objective, constraints, _ = PROBLEMS[title]
    note = f"Greatest {objective}" + (f" subject to {', '.join(constraints)}" if constraints else "")
    return Table.of(title, ("", *(METHODS[method] for method in found)), rows, "s" + "r" * len(found), note)
