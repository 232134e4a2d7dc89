import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis.expression import parse_constraint, parse_expression
from tensegra.errors import StudyError

NAMES = ("v", "w", "A14")
PAPER = "abs(w) / (abs(v) + abs(w))"

# Central differences with a step of 1e-6 on functions of order one: truncation 1e-12, rounding 1e-10.
DIFFERENCES = 1e-7


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3 - 4 / 2", 5.0),
        ("2 ** 3 ** 2", 512.0),
        ("-v ** 2", -4.0),
        ("+w", 3.0),
        ("min(v, w, A14) + max(v, w)", 3.1),
        ("sqrt(w * 3) + exp(0) + log(1) + sin(0) + cos(0)", 5.0),
        (PAPER, 0.6),
        ("2.5e-1", 0.25),
    ],
)
def test_a_formula_has_the_value_of_its_arithmetic(text, value):
    columns = {"v": 2.0, "w": 3.0, "A14": 0.1}
    assert_allclose(parse_expression(text, NAMES)(columns), value, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("abs(q)", "an output or a variable"),
        ("A15 + v", "did you mean 'A14'"),
        ("sqroot(v)", "did you mean 'sqrt'"),
        ("__import__('os').system('true')", "one of the functions"),
        ("v.real", "numbers, names"),
        ("v[0]", "numbers, names"),
        ("(lambda: v)()", "one of the functions"),
        ("[v for v in w]", "numbers, names"),
        ("v if w else v", "numbers, names"),
        ("v and w", "numbers, names"),
        ("v % w", "numbers, names"),
        ("v // w", "numbers, names"),
        ("~v", "numbers, names"),
        ("'v'", "a number"),
        ("True", "a number"),
        ("1j", "a number"),
        ("1e999", "a finite number"),
        ("9" * 400, "a finite number"),
        ("v <= 1", "not a comparison"),
        ("min(v)", "two or more"),
        ("abs(v, w)", "one argument"),
        ("abs(x=v)", "one argument"),
        ("v +", "a formula"),
        ("", "a formula"),
        ("v\0", "a formula"),
        ("v + " * 6000 + "v", "characters"),
        ("v+" * 9000 + "v", "fewer terms"),
        ("v[0]+" * 1000 + "v", "numbers, names"),
        ("-" * 200 + "v", "nested"),
    ],
)
def test_all_else_is_refused_with_the_place(text, told):
    with pytest.raises(StudyError, match=told) as refusal:
        parse_expression(text, NAMES, place="analyses[0].objective")
    assert str(refusal.value).startswith("analyses[0].objective")


def test_brackets_too_deep_for_the_parser_are_refused():
    with pytest.raises(StudyError, match="a formula"):
        parse_expression("(" * 400 + "v" + ")" * 400, NAMES)


@pytest.mark.parametrize("n_terms", [62, 500, 1500])
def test_a_long_sum_is_not_deep(n_terms):
    v, w = np.array([0.5, 2.0]), np.array([0.25, 4.0])
    e = parse_expression("+".join(["v", "w"] * (n_terms // 2)) + "-v*w*w*2/w", NAMES)
    value, partials = e.value_and_partials({"v": v, "w": w})
    assert_array_equal(value, n_terms // 2 * (v + w) - v * w * 2)
    assert_allclose(partials, np.stack([n_terms // 2 - 2 * w, n_terms // 2 - 2 * v], axis=1))


def test_a_long_sum_may_stand_in_a_constraint():
    (condition,) = parse_constraint("v" + " + w" * 500 + " <= abs(v) + 1", NAMES)
    assert condition.margin({"v": 1.0, "w": 0.5})[0] == 2.0 - 251.0


def test_depth_counts_brackets_and_not_terms():
    assert parse_expression("(" * 50 + "v" + "+w)" * 50, NAMES)({"v": 1.0, "w": 1.0})[0] == 51.0
    with pytest.raises(StudyError, match="nested"):
        parse_expression("v" + "-(w" * 61 + ")" * 61, NAMES)


def test_undefined_values_are_nan_and_do_not_warn():
    e = parse_expression(PAPER, NAMES)
    assert_array_equal(e({"v": [0.0, 1.0], "w": [0.0, 1.0]}), [np.nan, 0.5])
    assert np.isnan(parse_expression("sqrt(v) + log(v) + v ** 0.5", NAMES)({"v": -1.0})[0])
    assert np.isnan(parse_expression("max(v, w)", NAMES)({"v": np.nan, "w": 1.0})[0])


SMOOTH = [
    "v * w - v / w + A14",
    "v ** 3 + w ** -1.5",
    "v ** w",
    "2 ** v",
    "sqrt(v + w) * exp(-v) + log(w) * sin(v) - cos(A14 * w)",
    "abs(v - 2 * w) + min(v, w, A14) * max(v, 2 * w)",
    PAPER,
]


@given(
    text=st.sampled_from(SMOOTH),
    point=st.tuples(*[st.floats(0.3, 2.0)] * 3),
    smoothing=st.sampled_from([None, 0.05]),
)
def test_derivatives_are_those_of_central_differences(text, point, smoothing):
    e = parse_expression(text, NAMES)
    here = dict(zip(NAMES, point, strict=True))
    gaps = e.kink_arguments(here)
    if smoothing is None and gaps.size and np.abs(gaps).min() < 1e-4:
        return  # a difference across a kink is no derivative
    _, partials = e.value_and_partials(here, seeds=NAMES, smoothing=smoothing)
    step = 1e-6
    for i, name in enumerate(NAMES):
        up, down = ({**here, name: here[name] + sign * step} for sign in (1, -1))
        rise = (
            e.value_and_partials(up, smoothing=smoothing)[0]
            - e.value_and_partials(down, smoothing=smoothing)[0]
        )
        assert_allclose(partials[0, i], rise[0] / (2 * step), rtol=DIFFERENCES, atol=DIFFERENCES)


def test_a_constant_power_of_zero_or_less_has_its_derivative():
    for text, slope in (("v ** 2", 0.0), ("v ** 1", 1.0), ("v ** 0", 0.0), ("(v - 1) ** (4 / 2)", -2.0)):
        value, partials = parse_expression(text, NAMES).value_and_partials({"v": 0.0})
        assert np.isfinite(value).all()
        assert partials[0, 0] == slope


def test_kinks_take_a_subgradient():
    assert parse_expression("abs(v)", NAMES).value_and_partials({"v": 0.0})[1] == 0.0
    _, partials = parse_expression("max(v, w)", NAMES).value_and_partials({"v": 1.0, "w": 1.0})
    assert_array_equal(partials, [[1.0, 0.0]])
    _, partials = parse_expression("min(v, w)", NAMES).value_and_partials({"v": 1.0, "w": 1.0})
    assert_array_equal(partials, [[1.0, 0.0]])


@given(v=st.floats(-5, 5), w=st.floats(-5, 5), width=st.floats(1e-6, 1.0))
def test_smoothing_stays_within_its_width(v, w, width):
    for text in ("abs(v)", "max(v, w)", "min(v, w)"):
        e = parse_expression(text, NAMES)
        smooth, partials = e.value_and_partials({"v": v, "w": w}, smoothing=width)
        assert abs(smooth[0] - e({"v": v, "w": w})[0]) <= width * (1 + 1e-9)
        assert np.isfinite(partials).all()


def test_each_row_and_kink_has_its_own_smoothing():
    e = parse_expression("abs(v) + max(v, w)", NAMES)
    assert e.n_kinks == 2
    value, _ = e.value_and_partials({"v": np.zeros(2), "w": np.zeros(2)}, smoothing=[[0.0, 0.1], [0.0, 0.4]])
    assert_allclose(value, [0.0, 0.1 + 0.2])


def test_kinks_are_numbered_in_the_order_of_evaluation():
    e = parse_expression("max(abs(v), w, A14) - abs(w)", NAMES)
    # abs(v), then |v| against w, the larger of them against A14, and abs(w)
    assert_allclose(
        e.kink_arguments({"v": -2.0, "w": 5.0, "A14": 1.0})[:, 0], [-2.0, 2.0 - 5.0, 5.0 - 1.0, 5.0]
    )


@pytest.mark.parametrize(
    ("text", "holds", "fails"),
    [
        ("abs(v) <= 1", [-1.0, 0.0, 1.0], [-1.01, 1.01]),
        ("-1 <= v < 2", [-1.0, 0.0, 2.0], [-1.01, 2.01]),
        ("1 >= abs(v)", [0.5], [1.5, -1.5]),
        ("max(v, 2 * v) <= 1", [0.5, -3.0], [0.6]),
        ("min(v, 2 * v) >= 1", [1.0], [0.9]),
        ("abs(v) >= 1", [1.0, -1.0], [0.5]),
    ],
)
def test_a_comparison_is_the_sign_of_its_margins(text, holds, fails):
    margins = [c.margin for c in parse_constraint(text, NAMES)]
    assert all(min(m({"v": v})[0] for m in margins) >= 0 for v in holds)
    assert all(min(m({"v": v})[0] for m in margins) < 0 for v in fails)


def test_splitting_leaves_no_kink_where_it_can():
    assert [c.margin.n_kinks for c in parse_constraint("max(abs(v), w) <= 1", NAMES)] == [0, 0, 0]
    assert [c.margin.n_kinks for c in parse_constraint("abs(v) >= 1", NAMES)] == [1]


def test_an_equality_is_marked():
    (condition,) = parse_constraint("v == w", NAMES)
    assert condition.equality
    assert condition.margin({"v": 2.0, "w": 2.0})[0] == 0.0


@pytest.mark.parametrize("text", ["v", "v != 1", "v in w", "v is w"])
def test_what_is_no_comparison_is_refused(text):
    with pytest.raises(StudyError, match=r"constraints\[1\]"):
        parse_constraint(text, NAMES, place="constraints[1]")


def test_a_missing_column_is_named():
    with pytest.raises(StudyError, match="'w'"):
        parse_expression("v + w", NAMES)({"v": 1.0})
