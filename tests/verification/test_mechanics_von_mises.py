"""The von Mises truss: two struts of half span a and height h under a load on their common node.

With L₀ = √(a² + h²) at rest, ℓ = √(a² + z²) and T = EA (ℓ − L₀)/L₀, vertical balance of the node at
height z asks for the downward load

    P(z) = 2 EA z (1/ℓ − 1/L₀),

which has its limit points where ℓ³ = a² L₀ (von Mises, "Über die Stabilitätsprobleme der
Elastizitätstheorie", ZAMM 3, 1923). A node free to move sideways loses its stability before, at the
bifurcation where the lateral stiffness EA a²/(L₀ ℓ²) + T z²/ℓ³ vanishes.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from tensegra.mechanics import PathSettings, Status, solve_path
from tensegra.structure import Member, Stage, Structure

HALF_SPAN, HEIGHT, EA = 1.0, 0.2, 1000.0
REST_LENGTH = np.hypot(HALF_SPAN, HEIGHT)

LIMIT_HEIGHT = np.sqrt((HALF_SPAN**2 * REST_LENGTH) ** (2 / 3) - HALF_SPAN**2)

POSITION = 1e-10
"""Of the size, away from limit points: the residual of 1e-9 over a stiffness of about one hundred."""

LOCATION = 1e-6
"""Of the path: what is promised of the location of a critical point."""

NEAR_LIMIT = 2e-3
"""Of the height. Within δ of its limit load the height is within √δ of the limit's: √1e-6 = 1e-3."""


def load(z, height=HEIGHT):
    rest_length = np.hypot(HALF_SPAN, height)
    return 2 * EA * z * (1 / np.hypot(HALF_SPAN, z) - 1 / rest_length)


def potential_energy(z, p):
    length = np.hypot(HALF_SPAN, z)
    return EA / REST_LENGTH * (length - REST_LENGTH) ** 2 + p * z


LIMIT_LOAD = load(LIMIT_HEIGHT)


def truss(stages=(), height=HEIGHT, supports="xy"):
    rest_length = float(np.hypot(HALF_SPAN, height))
    return Structure(
        name="von Mises truss",
        nodes={"left": (-HALF_SPAN, 0, 0), "right": (HALF_SPAN, 0, 0), "top": (0, 0, height)},
        members={
            "s1": Member("strut", ("left", "top"), rest_length, stiffness=EA),
            "s2": Member("strut", ("right", "top"), rest_length, stiffness=EA),
        },
        supports={"left": "xyz", "right": "xyz", "top": supports},
        stages=stages,
    )


def stage(name, p):
    return Stage(name, loads={"top": (0, 0, -p)})


def pushed(p, **settings):
    return solve_path(truss(), loads={("top", "z"): -p}, settings=PathSettings(**settings))


def height_of(equilibrium):
    return equilibrium.node("top")[2]


@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.9, 0.99, 0.9999])
def test_stable_range_follows_the_closed_form(share):
    path = pushed(share * LIMIT_LOAD)
    expected = brentq(lambda z: load(z) - share * LIMIT_LOAD, LIMIT_HEIGHT, HEIGHT, xtol=1e-15)
    assert path.status is Status.STABLE
    assert path.critical_points == ()
    # The stiffness falls as √(1 − share) towards the limit, and the error of the height grows with it.
    assert height_of(path.final) == pytest.approx(expected, abs=POSITION / np.sqrt(1 - share))
    tension = EA * (np.hypot(HALF_SPAN, expected) / REST_LENGTH - 1)
    np.testing.assert_allclose(path.final.tensions, tension, rtol=1e-7)
    slope = (load(expected + 1e-6) - load(expected - 1e-6)) / 2e-6
    assert path.final.lowest_eigenvalue == pytest.approx(-slope, rel=1e-5)  # −dP/dz, as z falls with P


@pytest.mark.parametrize("share", [-0.5, -2.0])
def test_pulled_up_it_only_stiffens(share):
    path = pushed(share * LIMIT_LOAD)
    expected = brentq(lambda z: load(z) - share * LIMIT_LOAD, HEIGHT, 2.0)
    assert path.status is Status.STABLE
    assert height_of(path.final) == pytest.approx(expected, abs=POSITION)


@pytest.mark.parametrize("largest", [1.1, 2.0, 10.0])
@pytest.mark.parametrize("first_step", [0.25, 0.01])
def test_the_snap_at_the_limit_load_is_reported(largest, first_step):
    path = pushed(largest * LIMIT_LOAD, first_step=first_step)
    assert path.status is Status.SNAPPED
    (point,) = path.critical_points
    assert point.kind == "limit point"
    assert point.stage == "actuation"
    assert point.parameter * largest == pytest.approx(1.0, abs=LOCATION * largest)
    assert point.moved_nodes == ("top",)
    landing = brentq(lambda z: load(z) - LIMIT_LOAD, -10.0, -HEIGHT)
    assert point.snap == pytest.approx(LIMIT_HEIGHT - landing, rel=NEAR_LIMIT)
    expected = brentq(lambda z: load(z) - largest * LIMIT_LOAD, -10.0, -HEIGHT)
    assert height_of(path.final) == pytest.approx(expected, abs=POSITION)
    assert path.final.lowest_eigenvalue > 0.0
    assert "limit point" in path.reason


def test_the_energy_released_is_the_fall_of_the_potential():
    (point,) = pushed(2.0 * LIMIT_LOAD).critical_points
    landing = brentq(lambda z: load(z) - LIMIT_LOAD, -10.0, -HEIGHT)
    fall = potential_energy(LIMIT_HEIGHT, LIMIT_LOAD) - potential_energy(landing, LIMIT_LOAD)
    # At a limit point dΠ/dz = 0: the energy is better than the height by another order.
    assert point.energy_released == pytest.approx(fall, rel=NEAR_LIMIT**2 + 10 * LOCATION)


def test_there_and_back_past_both_limit_points():
    # Down past the first limit, up past the second, which is its mirror image: a hysteresis loop.
    stages = (stage("down", 2 * LIMIT_LOAD), stage("up", -2 * LIMIT_LOAD), stage("off", 0.0))
    path = solve_path(truss(stages))
    down, up = path.critical_points
    assert (down.stage, up.stage) == ("down", "up")
    assert down.parameter == pytest.approx(0.5, abs=LOCATION)
    assert up.parameter == pytest.approx(0.75, abs=LOCATION)
    assert up.snap == pytest.approx(down.snap, rel=NEAR_LIMIT)
    assert [s.status for s in path.stages] == [Status.SNAPPED, Status.SNAPPED, Status.STABLE]
    assert path.status is Status.SNAPPED  # the history as a whole left its branch
    assert height_of(path.final) == pytest.approx(HEIGHT, abs=POSITION)


def test_stop_ends_at_the_limit_point():
    path = pushed(2.0 * LIMIT_LOAD, policy="stop")
    assert path.status is Status.UNSTABLE
    assert "limit point" in path.reason
    (point,) = path.critical_points
    assert point.snap == 0.0
    assert point.parameter == pytest.approx(0.5, abs=LOCATION)
    assert height_of(path.final) == pytest.approx(LIMIT_HEIGHT, rel=NEAR_LIMIT)
    assert path.final.residual <= 1e-9  # an equilibrium, under the load that it stopped at


def test_bifurcation_of_a_high_truss():
    height = 3.0
    rest_length = np.hypot(HALF_SPAN, height)

    def lateral_stiffness(z):
        length = np.hypot(HALF_SPAN, z)
        tension = EA * (length / rest_length - 1)
        return EA / rest_length * (HALF_SPAN / length) ** 2 + tension * z**2 / length**3

    critical_height = brentq(lateral_stiffness, 1.5, height)
    critical_load = load(critical_height, height)
    limit_height = np.sqrt((HALF_SPAN**2 * rest_length) ** (2 / 3) - HALF_SPAN**2)
    assert critical_height > limit_height  # it comes before the limit point
    path = solve_path(truss(height=height, supports="y"), loads={("top", "z"): -2 * critical_load})
    assert path.status is Status.SNAPPED
    first = path.critical_points[0]
    assert first.kind == "bifurcation"
    assert first.parameter == pytest.approx(0.5, abs=LOCATION)
    assert path.final.succeeded
    assert path.final.lowest_eigenvalue > 0.0


def test_below_its_bifurcation_the_high_truss_stays_straight():
    path = solve_path(truss(height=3.0, supports="y"), loads={("top", "z"): -100.0})
    assert path.status is Status.STABLE
    assert path.final.node("top")[0] == pytest.approx(0.0, abs=POSITION)
    expected = brentq(lambda z: load(z, 3.0) - 100.0, 2.0, 3.0)
    assert height_of(path.final) == pytest.approx(expected, abs=POSITION)


def test_the_traced_branch_is_the_closed_form_through_both_limit_points():
    path = pushed(2.0 * LIMIT_LOAD, policy="trace")
    assert path.status is Status.SNAPPED  # stable at its end, by way of an unstable part
    first, second = path.critical_points
    assert first.kind == second.kind == "limit point"
    assert first.parameter == pytest.approx(0.5, abs=LOCATION)
    assert second.parameter == pytest.approx(-0.5, abs=LOCATION)  # the mirror image, under a pull
    for point in path.history:
        if point.stage == "actuation":
            assert load(point.nodes[-1, 2]) == pytest.approx(
                2.0 * LIMIT_LOAD * point.parameter, abs=1e-7 * LIMIT_LOAD
            )
    heights = np.array([point.nodes[-1, 2] for point in path.history])
    assert np.all(np.diff(heights) <= 1e-12)  # it only goes down
    expected = brentq(lambda z: load(z) - 2 * LIMIT_LOAD, -10.0, -HEIGHT)
    assert height_of(path.final) == pytest.approx(expected, abs=POSITION)


def test_the_traced_branch_stays_straight_past_a_bifurcation():
    path = solve_path(
        truss(height=3.0, supports="y"), loads={("top", "z"): -300.0}, settings=PathSettings(policy="trace")
    )
    assert path.status is Status.UNSTABLE
    assert [point.kind for point in path.critical_points] == ["bifurcation"]
    assert path.final.n_negative == 1
    assert path.final.residual <= 1e-9
    expected = brentq(lambda z: load(z, 3.0) - 300.0, 1.1, 3.0)
    np.testing.assert_allclose(path.final.node("top"), [0.0, 0.0, expected], atol=POSITION)


@pytest.mark.parametrize("p", [0.0, 0.2 * LIMIT_LOAD])
def test_the_stepped_procedure_agrees_where_nothing_is_lost(p):
    # Without load two struts find a place where they carry nothing: a residual relative to nothing.
    rest_lengths = {"s1": 1.03 * REST_LENGTH, "s2": 1.02 * REST_LENGTH}
    structure = truss((stage("load", p), Stage("longer", rest_lengths=rest_lengths)), supports="y")
    stepped = solve_path(structure, settings=PathSettings(path="stepped"))
    followed = solve_path(structure)
    assert stepped.status is followed.status is Status.STABLE
    np.testing.assert_allclose(stepped.final.nodes, followed.final.nodes, atol=POSITION)
