import numpy as np
import pytest

from tensegra.analysis import FunctionModel, optimise
from tensegra.surrogate.regimes import RegimeData
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement
from tensegra_paper.chapters.optimum import rows as optimum_rows
from tensegra_paper.chapters.optimum import straight
from tensegra_paper.chapters.optimum.chapter import well_posed_optimum
from tensegra_paper.chapters.optimum.figures import (
    convergence_figure,
    range_figure,
    solutions_figure,
    surface_figure,
)
from tensegra_paper.chapters.optimum.refinement import confirmed, joined
from tensegra_paper.models import LIFT_INPUTS
from tensegra_paper.setting import Setting

BOX = np.array([[0.0, 0.3]] * 3)

# Of the paper's beam as it was found by direct optimisation, by SQP on a surrogate of 100,000 runs and by
# Bayesian optimisation; w to a tenth of a millimetre.
LIFT, ACTUATION = 149.856, (0.3, 0.3, 0.1417)


def line(shift=0.0):
    """Return a lift that is straight where A1 = A4 + shift, and highest at A1 = A23 = 0.3."""

    def outputs(X):
        A1, A23, A4 = X.T
        return np.column_stack([100 * (A1 - A4 - shift), 200 * A1 + 300 * A23 - 100 * A4])

    return FunctionModel(outputs, LIFT_INPUTS, ("v", "w"), BOX)


@pytest.fixture(scope="module")
def found():
    """Optima of both problems, all of them by SQP, whatever they stand for."""
    problems = {}
    for name, (objective, constraints, _) in optimum_rows.PROBLEMS.items():
        problems[name] = {
            method: optimise(
                line(),
                objective,
                constraints=constraints,
                starts=8,
                true_model=line(),
            )
            for method in ("slsqp", "bayesian", "direct")
        }
    return problems


@pytest.fixture(scope="module")
def surface():
    A1 = np.linspace(0.0, 0.3, 7)
    X = np.column_stack([A1, np.full(7, 0.2), A1])
    return straight.Surface(X, line().evaluate(X).values[:, 1], 0.0)


def test_the_highest_straight_lift_of_the_beam(tmp_path):
    setting = Setting(tmp_path, scale=0.001)
    lift = well_posed_optimum(setting)
    assert lift.w == pytest.approx(LIFT, rel=1e-5)
    assert lift.v == pytest.approx(-1.0, abs=1e-5)
    np.testing.assert_allclose([lift.A1, lift.A23, lift.A4], ACTUATION, atol=1e-4)
    assert well_posed_optimum(setting) == lift


def test_methods_are_held_to_the_direct_one(found):
    posed = dict(found["well posed"])
    other = posed["direct"]
    rows = optimum_rows.posed_rows(posed, other)
    lifts = [row for row in rows if row.quantity.startswith("greatest w with |v|")]
    assert len(lifts) == 3
    assert all(row.agreement is Agreement.METHOD for row in lifts)
    assert lifts[0].holds
    posed["slsqp"] = optimise(line(0.05), "w", constraints=("abs(v) <= 1",), starts=8, true_model=line())
    moved = optimum_rows.posed_rows(posed, other)[0]
    assert not moved.holds
    assert optimum_rows.spread(posed) > optimum_rows.SAME_LIFT


def test_eq_12_has_no_unique_maximiser(found, surface):
    runs = BeamRuns(
        inputs=dict(zip(LIFT_INPUTS, surface.X.T, strict=True)),
        status=np.full(7, "stable"),
        tip=np.repeat(np.column_stack([0 * surface.w, 0 * surface.w, surface.w])[:, None], 2, axis=1),
        n_slack=np.zeros(7, dtype=int),
        strain=np.full(7, 0.03),
        beyond_law=np.zeros(7, dtype=bool),
        seconds=0.0,
    )
    rows = optimum_rows.printed_rows(found["Eq. 12 as printed"], runs, surface)
    verdict = next(row for row in rows if row.quantity == "maximiser")
    assert verdict.ours == "not unique"
    assert verdict.holds
    assert next(row for row in rows if row.quantity.startswith("designs that beat")).ours == pytest.approx(
        100.0
    )


def test_an_optimum_that_fem_contradicts_is_not_confirmed():
    right = optimise(line(), "w", constraints=("abs(v) <= 1",), starts=8, true_model=line())
    wrong = optimise(line(0.05), "w", constraints=("abs(v) <= 1",), starts=8, true_model=line())
    assert confirmed(right, 1e-3)
    assert not confirmed(wrong, 1e-3)  # the objective is the same, but |v| ≤ 1 does not hold
    assert not confirmed(optimise(line(), "w", starts=2), 1e-3)  # nobody solved it again


def test_joined_runs_keep_their_labels():
    one = RegimeData.of([[0.0], [1.0]], [1.0, np.nan], ["taut", "collapsed"])
    other = RegimeData.of([[2.0], [3.0]], [4.0, 5.0], ["slack", "taut"])
    both = joined(one, other)
    assert both.labels.tolist() == ["taut", "slack", "taut", "collapsed"]
    np.testing.assert_array_equal(both.X.ravel(), [0.0, 2.0, 3.0, 1.0])
    np.testing.assert_array_equal(both.runs.Y.ravel(), [1.0, 4.0, 5.0])


def test_crossings_skip_what_is_not_known():
    grid = np.linspace(0.0, 1.0, 5)
    values = np.stack([np.sin(6 * grid - 1), np.where(grid < 0.5, np.nan, np.sin(6 * grid - 1))])
    rows, places = straight.crossings(values, grid, lambda _, x: np.sin(6 * x - 1))
    assert rows.tolist() == [0, 0, 1]
    np.testing.assert_allclose(places, [1 / 6, (1 + np.pi) / 6, (1 + np.pi) / 6], atol=1e-3)


def test_table_and_figures_show_every_method(found, surface):
    posed = found["well posed"]
    table = optimum_rows.optimum_table("well posed", posed)
    assert table.header == ("", "SQP", "Bayesian", "direct FEM")
    grid = np.linspace(0.0, 0.3, 5)
    X = np.stack(np.meshgrid(grid, [0.2], grid, indexing="ij"), axis=-1).reshape(-1, 3)
    v, w = line().evaluate(X).values.T.reshape(2, 5, 5)
    shown = [straight.Slice(0.2, grid, v, w)]
    names = optimum_rows.METHODS
    assert len(range_figure(shown).axes) == 2
    assert len(surface_figure(surface, posed, names).axes) == 4
    assert [axes.get_title() for axes in convergence_figure(posed, names).axes] == list(table.header[1:])
    w = {method: optimum_rows.visited(one, 1, ends=True) for method, one in posed.items()}
    assert len(solutions_figure({"well posed": w}).axes) == 3


def test_the_solutions_are_where_the_starts_end(found):
    one = found["well posed"]["slsqp"]
    ends = optimum_rows.visited(one, 1, ends=True)
    assert len(ends) == one.agreement.n_starts == 8
    assert len(optimum_rows.visited(one, 1, ends=False)) > 8
    # The greatest lift of the line, where all starts arrive.
    np.testing.assert_allclose(ends, one.outputs["w"], rtol=1e-6)


def test_a_search_that_never_arrives_needs_more_than_it_made(found):
    one = found["well posed"]["bayesian"]
    assert optimum_rows.needed(one, 2 * one.objective) == one.n_evaluations + 1
    assert optimum_rows.needed(one) <= one.n_evaluations
