"""A hanging chain of many links tends to the elastic catenary, with the square of the link's length.

A rope of unstretched length L, weight W and stiffness EA between level hooks at distance d pulls at
the hooks with V = W/2 downwards and H inwards, where

    d = H L/EA + (2 H L/W) asinh(W/2H),
    x(s) = H s/EA + (H L/W) (asinh(V/H) − asinh((V − W s/L)/H)),
    z(s) = −(W s/EA) (1/2 − s/2L) − (H L/W) (√(1 + (V/H)²) − √(1 + ((V − W s/L)/H)²))

(H. M. Irvine, Cable Structures, MIT Press 1981, section 2.3).
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from tensegra.mechanics import Status, solve_path
from tensegra.structure import Material, Member, Structure

SPAN, LENGTH, WEIGHT = 3.0, 4.0, 8.0

EA = 1e3
"""The rope stretches by about half a percent."""

ORDER = 0.05
"""Of the fitted order two: the next term of the error is of order four, a few percent at 8 links."""

FINEST = 2.5e-4
"""Relative to the sag, with 64 links: a polygon of n corners errs by about (π/n)²/12 = 2.0e-4."""


def catenary(stiffness):
    """H, and the curve as a function of the unstretched arc length."""

    def span(pull):
        return pull * LENGTH / stiffness + 2 * pull * LENGTH / WEIGHT * np.arcsinh(WEIGHT / (2 * pull)) - SPAN

    pull = brentq(span, 1e-3, 1e3, xtol=1e-14)
    end = 0.5 * WEIGHT / pull

    def curve(s):
        here = (0.5 * WEIGHT - WEIGHT * s / LENGTH) / pull
        x = pull * s / stiffness + pull * LENGTH / WEIGHT * (np.arcsinh(end) - np.arcsinh(here))
        sag = WEIGHT * s / stiffness * (0.5 - s / (2 * LENGTH))
        return x, -sag - pull * LENGTH / WEIGHT * (np.hypot(1, end) - np.hypot(1, here))

    return pull, curve


def chain(n_links, stiffness=EA):
    """Links of equal length, drawn as a V with every link at its rest length and without tension."""
    s = np.linspace(0.0, 1.0, n_links + 1)
    depth = np.sqrt((LENGTH / 2) ** 2 - (SPAN / 2) ** 2)
    nodes = {str(i): (SPAN * t, 0.0, -2 * depth * min(t, 1 - t)) for i, t in enumerate(s)}
    members = {
        f"k{i}": Member("cable", (str(i), str(i + 1)), LENGTH / n_links, material="rope", area=1.0)
        for i in range(n_links)
    }
    return Structure(
        name=f"chain of {n_links}",
        nodes=nodes,
        materials={"rope": Material(youngs_modulus=stiffness, weight=WEIGHT / LENGTH)},
        members=members,
        supports={"0": "xyz", str(n_links): "xyz"},
        gravity=(0, 0, -1),
    )


def hang(n_links, stiffness=EA):
    path = solve_path(chain(n_links, stiffness))
    assert path.status is Status.STABLE, path.reason
    assert path.final.slack_members == ()
    return path.final


def errors(n_links):
    pull, curve = catenary(EA)
    final = hang(n_links)
    lengths = np.linalg.norm(np.diff(final.nodes, axis=0), axis=1)
    found = final.tensions * np.diff(final.nodes[:, 0]) / lengths
    np.testing.assert_allclose(found, found[0], rtol=1e-8)  # no load acts sideways
    sag = -curve(LENGTH / 2)[1]
    return abs(-final.nodes[:, 2].min() / sag - 1), abs(found[0] / pull - 1)


@pytest.mark.parametrize("stiffness", [1e2, 1e3, 1e4, 1e5])
def test_a_fine_chain_hangs_as_the_elastic_catenary(stiffness):
    final = hang(64, stiffness)
    assert final.residual <= 1e-9
    _, curve = catenary(stiffness)
    x, z = curve(np.linspace(0.0, LENGTH, 65))
    tolerance = FINEST * np.abs(z).max()
    np.testing.assert_allclose(final.nodes[:, 0], x, rtol=0.0, atol=tolerance)
    np.testing.assert_allclose(final.nodes[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(final.nodes[:, 2], z, rtol=0.0, atol=tolerance)


def test_the_error_falls_with_the_square_of_the_link():
    links = np.array([8, 16, 32, 64])
    by_sag, by_pull = np.array([errors(n) for n in links]).T
    for found in (by_sag, by_pull):
        order = -np.polyfit(np.log(links), np.log(found), 1)[0]
        assert order == pytest.approx(2.0, abs=ORDER)


@pytest.mark.parametrize(("n_links", "stiffness"), [(2, 1e6), (2, 1e7), (8, 1e6), (8, 1e7), (64, 1e6)])
def test_a_rope_of_steel_hangs_too(n_links, stiffness):
    # A steel rope carries its weight a million times over; drawn slack, it falls into place.
    final = hang(n_links, stiffness)
    lowest = final.nodes[:, 2].min()
    inextensible = -np.sqrt((LENGTH / 2) ** 2 - (SPAN / 2) ** 2)
    if n_links == 2:
        assert lowest == pytest.approx(inextensible, rel=1e-5)  # the stretch of W/EA
    assert inextensible * (1 + 1e-5) <= lowest < 0.8 * inextensible
