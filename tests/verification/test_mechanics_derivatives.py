"""Exact derivatives by the slope of their Taylor remainder, and forward against adjoint mode.

‖x(θ + h) − x(θ) − h x′(θ)‖ falls with h²: on a double logarithmic scale its slope is two. One that
is off by a factor or a term gives a slope of one.
"""

import numpy as np
import pytest

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics import PathSettings, Status, solve_path
from tensegra.mechanics.derivatives import direction_of, pull_back, settle_tangent
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import apply_changes, library

SLOPE = 0.05
"""Around two: what the third order adds over the decade of steps taken."""

STEPS = np.geomspace(1.0, 0.1, 5)
"""Of the largest step of each parameter: small against what bends, large against a residual of 1e-12."""

SAME = 1e-9
"""Relative: forward and adjoint mode solve with one matrix, of condition 1e6, refined once."""

ACTUATION = {"A14": 0.05, "A23": 0.03}
WARMTH = {"top": 40.0}


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


@pytest.fixture(scope="module")
def path(beam):
    return solve_path(beam, ACTUATION, WARMTH)


def solve(structure, actuation=None, temperature=None, **inputs):
    return solve_path(structure, ACTUATION | (actuation or {}), WARMTH | (temperature or {}), **inputs).final


def changed(beam, member, **changes):
    return apply_changes(beam, {"members": {member: changes}})


def by_rest_length(beam, h):
    return solve(changed(beam, "K2", rest_length=beam.members["K2"].rest_length + h))


PARAMETERS = {
    "an actuator": ("actuation", "A14", 0.01, lambda beam, h: solve(beam, {"A14": ACTUATION["A14"] + h})),
    "an actuator at rest": ("actuation", "A1", 0.01, lambda beam, h: solve(beam, {"A1": h})),
    "a warm group": ("temperature", "top", 100.0, lambda beam, h: solve(beam, None, {"top": 40.0 + h})),
    "a cold member": ("temperature", "c5", 200.0, lambda beam, h: solve(beam, None, {"c5": h})),
    "a load": ("load", ("23", "z"), 0.5, lambda beam, h: solve(beam, loads={("23", "z"): h})),
    "a support": ("position", ("4", "z"), 0.1, lambda beam, h: solve(beam, positions={("4", "z"): h})),
    "a rest length": ("rest_length", "K2", 1.0, by_rest_length),
    "a modulus": (
        "youngs_modulus",
        "steel",
        300.0,
        lambda beam, h: solve(apply_changes(beam, {"materials": {"steel": {"youngs_modulus": 11500.0 + h}}})),
    ),
    "an area with its weight": (
        "area",
        "s1",
        10.0,
        lambda beam, h: solve(changed(beam, "s1", area=beam.members["s1"].area + h)),
    ),
}


@pytest.mark.parametrize("name", PARAMETERS)
def test_taylor_remainders_fall_with_the_square(beam, path, name):
    kind, parameter, largest, solve_at = PARAMETERS[name]
    derivative = path.derivative(parameter, of=kind)
    remainders = []
    for h in largest * STEPS:
        found = solve_at(beam, h)
        assert found.status is Status.STABLE
        remainders.append(
            [
                np.abs(found.nodes - path.final.nodes - h * derivative.nodes).max(),
                np.abs(found.tensions - path.final.tensions - h * derivative.tensions).max(),
            ]
        )
    assert np.abs(derivative.nodes).max() > 0.0
    for of_nodes_or_tensions in np.array(remainders).T:
        slope = np.polyfit(np.log(STEPS), np.log(of_nodes_or_tensions), 1)[0]
        assert slope == pytest.approx(2.0, abs=SLOPE)


def test_derivative_by_stiffness_equals_that_by_area_and_modulus(beam):
    # A cable's own weight is small: without gravity area and modulus act through EA alone.
    weightless = solve_path(beam.replace(gravity=(0, 0, 0)), ACTUATION, WARMTH)
    modulus = beam.materials[beam.members["c1"].material].youngs_modulus
    by_area = weightless.derivative("c1", of="area")
    by_stiffness = weightless.derivative("c1", of="stiffness")
    np.testing.assert_allclose(by_area.nodes, modulus * by_stiffness.nodes, rtol=1e-12, atol=0.0)


def test_supports_stay_where_they_are(beam, path):
    held = [list(beam.nodes).index(node) for node in beam.supports]
    assert not path.derivative("A14").nodes[held].any()
    moved = path.derivative((4, "z"), of="position").nodes
    expected = np.zeros((24, 3))
    expected[list(beam.nodes).index("4"), 2] = 1.0
    np.testing.assert_array_equal(moved[held], expected[held])


@pytest.mark.parametrize("name", PARAMETERS)
def test_adjoint_equals_forward(path, name):
    kind, parameter, _, _ = PARAMETERS[name]
    rng = np.random.default_rng(0)
    by_nodes, by_tensions = rng.standard_normal(path.final.nodes.shape), rng.standard_normal(48)
    forward = path.derivative(parameter, of=kind)
    expected = np.sum(by_nodes * forward.nodes) + np.sum(by_tensions * forward.tensions)

    tangent = Tangent(path.given.arrays)
    settle_tangent(tangent, path.final.nodes, path.load)
    gradient = pull_back(tangent, path.load, by_nodes, by_tensions)
    direction = direction_of(path.given, kind, parameter)
    found = sum(
        np.sum(getattr(gradient, what) * getattr(direction, what))
        for what in ("rest_length", "stiffness", "force", "positions")
    )
    assert found == pytest.approx(expected, rel=SAME)


def test_reciprocity_of_loads(path):
    # A symmetric K: the motion at a by a unit load at b is that at b by one at a (Maxwell, Betti).
    there = path.derivative(("23", "z"), of="load").nodes[list(path.structure.nodes).index("10"), 0]
    back = path.derivative(("10", "x"), of="load").nodes[list(path.structure.nodes).index("23"), 2]
    assert there == pytest.approx(back, rel=1e-8)


@pytest.mark.parametrize(
    ("name", "kind", "message"),
    [
        ("A41", "actuation", "did you mean 'A"),
        ("topp", "temperature", "did you mean 'top'"),
        (("23", "w"), "load", "axis"),
        (("23", "xy"), "load", "axis"),
        ("23", "load", "pair"),
        ("K1", "strength", "kind"),
    ],
)
def test_an_unknown_parameter_is_refused(path, name, kind, message):
    with pytest.raises(ModelError, match=message):
        path.derivative(name, of=kind)


def test_what_did_not_end_in_a_stable_equilibrium_has_no_derivative(beam):
    failed = solve_path(library.prism(), {"top": 0.3}, settings=PathSettings(largest_move=1e-3, max_steps=8))
    with pytest.raises(SolverError, match="failed"):
        failed.derivative("top")
    collapsed = solve_path(beam.replace(gravity=(0, 0, 0)), {"A23": 0.25})
    assert collapsed.status is Status.COLLAPSED
    with pytest.raises(SolverError):  # K is singular: there is no derivative
        collapsed.derivative("A23")
