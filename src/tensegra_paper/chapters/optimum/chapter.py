"""Figs. 14, 17 and 18 and Eq. 12: which actuation lifts the tip straightest, and which highest."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import Optimum, SurrogateModel, optimise
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Chapter, Figure
from tensegra_paper.chapters.optimum.figures import (
    convergence_figure,
    range_figure,
    solutions_figure,
    surface_figure,
)
from tensegra_paper.chapters.optimum.refinement import Question, Searches, confirmed_searches
from tensegra_paper.chapters.optimum.rows import (
    EVALUATIONS,
    HIGHEST,
    METHODS,
    PROBLEMS,
    STRAIGHT,
    XI,
    Found,
    optimum_table,
    place,
    posed_rows,
    printed_rows,
    range_rows,
    spread,
    visit_rows,
    visited,
)
from tensegra_paper.chapters.optimum.searching import FEWEST_STARTS, N_STARTS, searched
from tensegra_paper.chapters.optimum.straight import Surface, slices, straight_surface
from tensegra_paper.models import LIFT_INPUTS, cable_model, lift_runs
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

__all__ = ["Lift", "optimum", "well_posed_optimum"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Lift:
    """The highest straight lift, found on the structure itself.

    Attributes
    ----------
    A1, A23, A4
        Its actuation.
    v, w
        Displacements of the tip, cm.
    """

    A1: float
    A23: float
    A4: float
    v: float
    w: float


def well_posed_optimum(setting: Setting) -> Lift:
    """Return the greatest w subject to |v| ≤ 1 cm, from direct optimisation by FEM, now or before."""
    kept = setting.kept(
        "well-posed", [HIGHEST, STRAIGHT], lambda: _kept(_direct(setting, HIGHEST, (STRAIGHT,)))
    )
    return Lift(**{name: float(value) for name, value in kept.items()})


def _kept(best: Optimum) -> dict[str, Array]:
    return {name: np.array(value) for name, value in (*best.inputs.items(), *best.outputs.items())}


def _direct(setting: Setting, objective: str, constraints: tuple[str, ...]) -> Optimum:
    """Search on the structure itself, with its exact derivatives."""
    truth = cable_model(setting, LIFT_INPUTS)
    return optimise(
        truth,
        objective,
        constraints=constraints,
        method="direct",
        starts=setting.count(N_STARTS["direct"], least=FEWEST_STARTS["direct"]),
        seed=setting.seed_of("direct"),
        true_model=truth,
    )


def optimum(setting: Setting) -> Chapter:
    """Search by all methods on a surrogate and on the structure itself, for both statements."""
    runs, truth = lift_runs(setting), cable_model(setting, LIFT_INPUTS)
    searches = confirmed_searches(
        setting,
        [
            Question(name, method, problem[2])
            for name, problem in PROBLEMS.items()
            for method in list(METHODS)[:-1]
        ],
        lambda model, asked: searched(
            setting,
            model,
            truth,
            asked.problem,
            asked.method,
            seed=asked.method,
            told_as=asked.problem,
        ),
    )
    found = {
        name: {
            **{question.method: one for question, one in searches.found.items() if question.problem == name},
            "direct": _direct(setting, *problem[:2]),
        }
        for name, problem in PROBLEMS.items()
    }
    model = SurrogateModel(searches.surrogate, "surrogate", truth.space)
    best = found["well posed"]["direct"]
    setting.kept("well-posed", [HIGHEST, STRAIGHT], lambda: _kept(best))
    other = _direct(setting, HIGHEST, (f"v == {published('optimisation', 'optimum', 'v')}",))
    exact = _direct(setting, HIGHEST, ("v == 0",))
    surface = straight_surface(setting, model)
    shown = slices(setting, model)
    printed, posed = found["Eq. 12 as printed"], found["well posed"]
    return Chapter(
        name="optimum",
        title="Optimisation of the actuation (Figs. 14, 17 and 18, Eq. 12)",
        figures=(
            Figure(
                "fig-14-range",
                "Displacement w over the actuations, by our surrogate. Three slices of the box; the lines "
                "are v = −1, 0 and 1 cm, and white is where the structure collapses",
                lambda: range_figure(shown),
            ),
            Figure(
                "eq-12-surface",
                "The surface v = 0, on which Eq. 12 is 1. Left the actuation A4 that makes the lift "
                "straight, right the lift, which runs over more than a hundred centimetres; marks show "
                "where each method ends",
                lambda: surface_figure(surface, printed, METHODS),
            ),
            Figure(
                "fig-17-convergence",
                "Convergence on Eq. 12 as printed: SQP (printed as a), BFGS (b), Bayesian (c), and our "
                "search on the structure itself. Evaluations in their order, of many one in so many that "
                "3,000 remain, and the best so far",
                lambda: convergence_figure(printed, METHODS),
            ),
            Figure(
                "posed-convergence",
                "The same for the greatest w with |v| ≤ 1 cm. The best is the best that satisfies the "
                "constraint",
                lambda: convergence_figure(posed, METHODS),
            ),
            Figure(
                "fig-18-solutions",
                "w at the intermediate solutions, for Eq. 12 as printed above and for the greatest w with "
                "|v| ≤ 1 cm below. (a) SQP and (b) BFGS, where each start ends, (c) Bayesian, all that was "
                "asked",
                lambda: solutions_figure(
                    {
                        name: {
                            METHODS[method]: visited(each[method], 1, ends=method != "bayesian")
                            for method in list(METHODS)[:-1]
                        }
                        for name, each in found.items()
                    }
                ),
            ),
        ),
        rows=(
            *range_rows(runs, exact),
            *printed_rows(printed, runs, surface),
            *visit_rows(printed, *_range(runs), setting.scale),
            *posed_rows(posed, other, setting.scale),
        ),
        text=_text(searches, printed, posed, other, surface),
        findings=(
            (
                f"Eq. 12 is 1 on a whole surface, on which w runs from {surface.w.min():.0f} to "
                f"{surface.w.max():.0f} cm, so its maximiser is not unique. The greatest w with |v| ≤ 1 cm "
                f"is {best.outputs['w']:.2f} cm (printed: 146.85); all methods find it within "
                f"{100 * spread(posed):.1g} %."
            ),
        ),
        tables=tuple(optimum_table(name, each) for name, each in found.items()),
        seconds={
            f"{METHODS[m]}, {name}": one.seconds for name, each in found.items() for m, one in each.items()
        },
        seeds={name: setting.seed_of(name) for name in ("lift", *METHODS)},
    )


def _range(runs: BeamRuns) -> tuple[float, float]:
    """Return the least and the greatest w of the runs that stand, cm."""
    w = runs.w[runs.stands]
    return float(w.min()), float(w.max())


def _text(
    searches: Searches, printed: Found, posed: Found, other: Optimum, surface: Surface
) -> tuple[str, ...]:
    taken = {method: posed[method].seconds + printed[method].seconds for method in METHODS}
    direct = posed["direct"]
    repeated = "FEM confirmed all of them."
    if searches.repeated:
        again = ", ".join(
            f"{METHODS[question.method]} on {question.problem}" for question, _ in searches.repeated
        )
        repeated = (
            "Where few runs have slack cables a surrogate invents optima that the structure does not have. "
            f"FEM did not confirm {again}; there {searches.n_runs - searches.n_first} runs were added, and "
            "the search was repeated."
        )
    return (
        (
            "The search is over (A1, A23, A4) in [0, 30] %, without gravity, on a surrogate of "
            f"{searches.n_first} runs with a piece for each regime (taut, slack), which gives no answer "
            f"where it expects a collapse. Every optimum is solved again by FEM. {repeated} SQP and BFGS "
            f"start from {posed['slsqp'].agreement.n_starts} and {posed['bfgs'].agreement.n_starts} points "
            f"of a Latin hypercube; Bayesian optimisation has {EVALUATIONS} evaluations with UCB, ξ = {XI}. "
            "'Direct FEM' is SQP on the structure itself, in all of the box and with its exact derivatives: "
            f"{len(np.unique(direct.trace.start))} starts, of which the best {direct.agreement.n_starts} are "
            "followed to the end."
        ),
        (
            "Eq. 12 as printed is 1 wherever v = 0. That surface was traced by the surrogate and solved by "
            f"FEM at {len(surface.w)} points: |v| stays below {surface.largest_v:.1g} cm, and w runs from "
            f"{surface.w.min():.1f} to {surface.w.max():.1f} cm. Each method ends somewhere on it (figure). "
            "The text asks for something else: the greatest w with a minimal v. That is well posed as the "
            "greatest w subject to |v| ≤ 1 cm, the printed v."
        ),
        (
            f"There all methods agree within {100 * spread(posed):.1g} %: {place(direct)}, w = "
            f"{direct.outputs['w']:.3f} cm, v = {direct.outputs['v']:.2f} cm. With v = "
            f"{other.outputs['v']:.2f} cm, as printed, it is {other.outputs['w']:.2f} cm at {place(other)}."
        ),
        "Times for both statements together: "
        + ", ".join(f"{METHODS[method]} {seconds:.1f} s" for method, seconds in taken.items())
        + " (printed: SQP and BFGS less than 30 s, Bayesian about 120 s, each for one).",
    )
