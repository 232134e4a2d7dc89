"""Natural frequencies against closed forms: a rod on a hinge, a string, a mass between ropes."""

import numpy as np
import pytest

from tensegra.mechanics import solve_path
from tensegra.mechanics.vibration import natural_frequencies
from tensegra.structure import parse_structure

GRAVITY = 9.80665

STIFF = 1e-5
"""Relative: a rod under its own weight is longer by some 1e-7, and stretches while it swings."""


def rod(length=1.0):
    return parse_structure(
        {
            "nodes": {"1": [0, 0, 0], "2": [0, 0, -length]},
            "materials": {"steel": {"youngs_modulus": 2.1e11, "weight": 78500}},
            "members": {"rod": {"kind": "strut", "nodes": [1, 2], "material": "steel", "area": 1e-4}},
            "supports": {"1": "xyz"},
            "gravity": [0, 0, -1],
        }
    )


@pytest.mark.parametrize("length", [0.5, 1.0, 3.0])
def test_a_rod_on_a_hinge_swings_as_a_compound_pendulum(length):
    # m g L/2 of stiffness over m L²/3 of inertia; lumped, m L²/2: as a point on a thread.
    path = solve_path(rod(length))
    compound, thread = np.sqrt([3 * GRAVITY / (2 * length), GRAVITY / length]) / (2 * np.pi)
    np.testing.assert_allclose(natural_frequencies(path).frequencies[:2], compound, rtol=STIFF)
    np.testing.assert_allclose(natural_frequencies(path, mass="lumped").frequencies[:2], thread, rtol=STIFF)


def test_the_rod_of_a_metre_has_0_6104_hertz():
    path = solve_path(rod())
    assert natural_frequencies(path).frequencies[0] == pytest.approx(0.6104, abs=5e-5)
    assert natural_frequencies(path, mass="lumped").frequencies[0] == pytest.approx(0.4984, abs=5e-5)


@pytest.mark.parametrize(("mass", "share"), [("consistent", 2 / 3), ("lumped", 1.0)])
def test_a_mass_on_two_ropes_swings_as_a_string_does(mass, share):
    # The middle of two ropes of length l and mass m each, under T: across k = 2 T/l, along 2 EA/l₀.
    tension, length, stiffness, weight = 5.0, 2.0, 1e3, 0.1
    rest = length / (1 + tension / stiffness)
    rope = {"kind": "cable", "material": "rope", "area": 1.0, "rest_length": rest}
    structure = parse_structure(
        {
            "nodes": {"1": [0, 0, 0], "2": [length, 0, 0], "3": [2 * length, 0, 0]},
            "materials": {"rope": {"youngs_modulus": stiffness, "weight": weight / length}},
            "members": {"a": {**rope, "nodes": [1, 2]}, "b": {**rope, "nodes": [2, 3]}},
            "supports": {"1": "xyz", "3": "xyz"},
        }
    )
    moving = share * weight / GRAVITY
    across, along = np.sqrt(2 * tension / length / moving), np.sqrt(2 * stiffness / rest / moving)
    expected = np.array([across, across, along]) / (2 * np.pi)
    found = natural_frequencies(solve_path(structure), mass=mass)
    np.testing.assert_allclose(found.frequencies, expected, rtol=1e-9)


def string(n):
    """Return a string of length 1, tension 10 and mass per length 1 in n links, held against sagging."""
    nodes = {str(i): [i / n, 0, 0] for i in range(n + 1)}
    rest = 1 / n / (1 + 10.0 / 1e6)
    rope = {"kind": "cable", "material": "rope", "area": 1.0, "rest_length": rest}
    return parse_structure(
        {
            "nodes": nodes,
            "materials": {"rope": {"youngs_modulus": 1e6, "weight": GRAVITY}},
            "members": {f"k{i}": {**rope, "nodes": [str(i), str(i + 1)]} for i in range(n)},
            "supports": {str(i): "xyz" if i in (0, n) else "xz" for i in range(n + 1)},
        }
    )


def test_a_string_tends_to_its_tones_from_above_and_lumped_from_below():
    # f = sqrt(T/μ)/(2 L); linear elements err by (π/n)²/24 in either direction.
    exact = np.sqrt(10.0) / 2
    errors = {
        mass: [
            natural_frequencies(solve_path(string(n)), mass=mass).frequencies[0] / exact - 1
            for n in (8, 16, 32)
        ]
        for mass in ("consistent", "lumped")
    }
    expected = np.pi**2 / np.array([8, 16, 32]) ** 2 / 24
    np.testing.assert_allclose(errors["consistent"], expected, rtol=0.02)
    np.testing.assert_allclose(errors["lumped"], -expected, rtol=0.02)
