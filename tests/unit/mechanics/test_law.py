"""The law of a member: derivatives by complex steps, energy by quadrature, and the same numbers compiled."""

import inspect

import numpy as np
import pytest

from tensegra.mechanics import law
from tensegra.mechanics.law import plain

ROUNDING = 1e-14
"""Relative: a handful of products and quotients."""

COMPLEX = 1e-30
"""A complex step has no cancellation, so it may be this small: its truncation is its square."""

STEP = 1e-5
"""Of central differences over lengths of about one: truncation and rounding 1e-10."""

DIFFERENCE = 1e-7
"""What they leave, with a margin for rest lengths that are short and change fast."""

N = 50


@pytest.fixture(scope="module")
def members():
    """Return ℓ, l₀ and EA of members that are stretched, and of some that are shortened."""
    rng = np.random.default_rng(0)
    length = rng.uniform(0.5, 5.0, N)
    return length, length * rng.uniform(0.8, 1.2, N), 10.0 ** rng.uniform(0.0, 6.0, N)


def names():
    return [name for name in vars(plain) if not name.startswith("_")]


def test_tension_is_stiffness_times_strain(members):
    length, l0, ea = members
    np.testing.assert_allclose(plain.tension(length, l0, ea) / ea, length / l0 - 1.0, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(plain.tension(l0, l0, ea), 0.0)


@pytest.mark.parametrize(("name", "at"), [("by_length", 0), ("by_rest_length", 1), ("by_stiffness", 2)])
def test_derivatives_are_those_of_the_tension(members, name, at):
    moved = [values + (1j * COMPLEX if i == at else 0.0) for i, values in enumerate(members)]
    expected = plain.tension(*moved).imag / COMPLEX
    found = plain.by_stiffness(*members[:2]) if name == "by_stiffness" else getattr(plain, name)(*members)
    np.testing.assert_allclose(found, expected, rtol=ROUNDING)


def along(members, t, rates, bends):
    """ℓ, l₀ and T a time t along a way that bends."""
    length, l0, ea = members
    length = length + t * rates[0] + 0.5 * t * t * bends[0]
    l0 = l0 + t * rates[1] + 0.5 * t * t * bends[1]
    return plain.tension(length, l0, ea)


@pytest.fixture(scope="module")
def way():
    rng = np.random.default_rng(1)
    return rng.standard_normal((2, N)), rng.standard_normal((2, N))


def test_rate_is_the_derivative_along_a_way(members, way):
    rates, bends = way
    expected = along(members, 1j * COMPLEX, rates, bends).imag / COMPLEX
    found = plain.rate(*members, rates[0], rates[1])
    scale = plain.by_length(*members) * np.abs(rates).sum(axis=0)
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=1e-13)


def test_bend_is_the_second_derivative_along_a_way_on_which_the_length_goes_straight(members, way):
    rates, bends = way
    k = plain.by_length(*members)
    found = plain.bend(*members, rates[0], rates[1], bends[1]) + k * bends[0]
    up, down = (along(members, t + 1j * COMPLEX, rates, bends).imag / COMPLEX for t in (STEP, -STEP))
    expected = (up - down) / (2.0 * STEP)
    scale = k * (1.0 + np.abs(rates).sum(axis=0) + np.abs(bends).sum(axis=0)) ** 2
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=DIFFERENCE)
    straight = plain.bend(*members, rates[0], 0.0, 0.0)
    np.testing.assert_array_equal(straight, 0.0)  # the law is linear: with l₀ at rest nothing bends


def test_energy_is_the_work_of_the_tension(members):
    length, l0, ea = members
    x, weights = np.polynomial.legendre.leggauss(4)  # exact for polynomials: T is linear in ℓ
    half = 0.5 * (length - l0)
    at = l0 + half * (1.0 + x[:, None])
    work = half * np.sum(weights[:, None] * plain.tension(at, l0, ea), axis=0)
    np.testing.assert_allclose(plain.energy(length, l0, ea), work, rtol=1e-12)
    gradient = plain.energy(length + 1j * COMPLEX, l0, ea).imag / COMPLEX
    np.testing.assert_allclose(gradient, plain.tension(length, l0, ea), rtol=1e-13)


def test_the_size_is_what_a_rounded_length_makes_of_the_tension(members):
    length, l0, ea = members
    relative = 1e-7
    change = plain.tension(length * (1.0 + relative), l0, ea) - plain.tension(length, l0, ea)
    np.testing.assert_allclose(plain.size(length, l0, ea) * relative, change, rtol=1e-6)


def test_the_rest_length_for_a_tension_gives_that_tension(members):
    length, l0, ea = members
    tension = plain.tension(length, l0, ea)
    np.testing.assert_allclose(plain.rest_length_for(length, tension, ea), l0, rtol=ROUNDING)


@pytest.mark.parametrize("name", names())
def test_compiled_and_plain_are_the_same_numbers(members, way, name):
    rates, bends = way
    values = (*members, *rates, *bends)
    compiled, python = getattr(law, name), getattr(plain, name)
    n = len(inspect.signature(python).parameters)
    of_arrays = python(*values[:n])
    for i in range(N):
        arguments = [float(column[i]) for column in values[:n]]
        assert compiled(*arguments) == python(*arguments) == of_arrays[i]


def test_plain_names_every_function_of_the_law():
    compiled = {name for name, value in vars(law).items() if hasattr(value, "py_func")}
    assert set(names()) == compiled
