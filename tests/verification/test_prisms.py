"""Prisms against theory: which stand, and with what self-stress.

A prism of n struts has 4n members against 6n − 6 free coordinates and one state of self-stress, hence
2n − 5 infinitesimal mechanisms, and is stable whatever its material and prestress (Connelly & Terrell
1995, Structural Topology 21, 59–78). A closed loop in place of the top polygon's cables frees n − 1
further mechanisms; whether the prestress stiffens them is told by the lowest eigenvalue of K alone.
"""

import numpy as np
import pytest

from tensegra.mechanics import Status, solve_path
from tensegra.mechanics.stability import prestress_stiffness, self_stress
from tensegra.structure import library

# Share of the classical prism's lowest eigenvalue below which a sign could be rounding.
CLEAR_SIGN = 1e-6

# Second-order terms of a prestress that strains the members by 1e-5.
SMALL_STRAIN = 1e-3


def lowest(n_struts, **options):
    return solve_path(library.prism(n_struts, **options)).final.lowest_eigenvalue


@pytest.mark.parametrize("n_struts", [3, 4, 5, 6, 8])
@pytest.mark.parametrize("top_radius", [0.6, 1.0, 1.5])
def test_a_classical_prism_has_one_self_stress_and_stands(n_struts, top_radius):
    prism = library.prism(n_struts, top_radius=top_radius)
    found = self_stress(prism)
    assert (found.n_self_stress, found.n_mechanisms) == (1, 2 * n_struts - 5)
    path = solve_path(prism)
    assert path.status is Status.STABLE
    assert prestress_stiffness(path) > 0.0


@pytest.mark.parametrize("n_struts", [3, 4, 5, 6])
def test_a_closed_loop_frees_a_mechanism_for_each_further_side(n_struts):
    found = self_stress(library.prism(n_struts, clustered=True))
    assert (found.n_self_stress, found.n_mechanisms) == (1, 2 * n_struts - 5 + n_struts - 1)


@pytest.mark.parametrize("top_radius", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("height", [0.3, 1.0, 5.0])
def test_three_struts_stand_with_a_closed_loop(top_radius, height):
    path = solve_path(library.prism(3, height=height, top_radius=top_radius, clustered=True))
    assert path.status is Status.STABLE
    classical = lowest(3, height=height, top_radius=top_radius)
    assert CLEAR_SIGN * classical < path.final.lowest_eigenvalue <= classical * (1.0 + CLEAR_SIGN)


@pytest.mark.parametrize("n_struts", [4, 5, 6, 8])
@pytest.mark.parametrize(("height", "stands"), [(0.3, True), (0.7, True), (2.0, False), (5.0, False)])
def test_with_more_struts_a_closed_loop_stands_in_flat_prisms_only(n_struts, height, stands):
    path = solve_path(library.prism(n_struts, height=height, clustered=True))
    scale = lowest(n_struts, height=height)
    assert path.status is (Status.STABLE if stands else Status.UNSTABLE)
    assert (path.final.n_negative == 0) is stands
    assert abs(path.final.lowest_eigenvalue) > CLEAR_SIGN * scale
    assert (path.final.lowest_eigenvalue > 0.0) is stands
    assert (prestress_stiffness(path) > 0.0) is stands


def test_four_struts_with_a_closed_loop_do_not_stand_as_high_as_wide():
    path = solve_path(library.prism(4, clustered=True))
    assert path.status is Status.UNSTABLE
    assert path.final.lowest_eigenvalue < 0.0


@pytest.mark.parametrize(("n_struts", "status"), [(3, Status.STABLE), (4, Status.UNSTABLE)])
def test_the_verdict_on_a_closed_loop_is_the_prestress_s_and_grows_with_it(n_struts, status):
    stiffness = []
    for prestress in (10.0, 100.0):
        path = solve_path(library.prism(n_struts, prestress=prestress, clustered=True))
        assert path.status is status
        stiffness.append(prestress_stiffness(path))
    assert np.sign(stiffness[0]) == (1.0 if status is Status.STABLE else -1.0)
    assert stiffness[1] == pytest.approx(10.0 * stiffness[0], rel=SMALL_STRAIN)


def test_a_closed_loop_carries_one_tension_under_a_load_that_is_not_symmetric():
    prism = library.prism(3, clustered=True)
    path = solve_path(prism, loads={("t0", "x"): 20.0, ("t1", "z"): -30.0})
    assert path.status is Status.STABLE
    segments = solve_path(library.prism(3), loads={("t0", "x"): 20.0, ("t1", "z"): -30.0}).final
    sides = [segments.tension(f"h{i}") for i in range(3)]
    assert min(sides) < path.final.tension("loop") < max(sides)
