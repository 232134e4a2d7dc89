import numpy as np
import pytest

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics import PathSettings, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.vibration import mass_matrix, natural_frequencies
from tensegra.structure import library, parse_structure

ROUNDING = 1e-12
"""Relative: sums of some dozens of positive terms."""

GRAVITY = 9.80665


@pytest.fixture(scope="module")
def beam():
    return solve_path(library.paper_beam())


def pendulum(units=None, **other):
    """Return a rod between a hinge and nothing, with a massless cable to the side where asked."""
    return parse_structure(
        {
            "units": units or {},
            "nodes": {"1": [0, 0, 0], "2": ["0 m", "0 m", "-1 m"]},
            "materials": {"steel": {"youngs_modulus": "210 GPa", "weight": "78500 N/m^3"}},
            "members": {"rod": {"kind": "strut", "nodes": [1, 2], "material": "steel", "area": "1 cm^2"}},
            "supports": {"1": "xyz"},
            "gravity": [0, 0, -1],
            **other,
        }
    )


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_all_masses_together_are_the_mass_of_the_members(mass):
    structure = library.paper_beam()
    arrays = structure_arrays(structure)
    matrix = mass_matrix(structure, arrays, mass)
    gravity = structure.units.number("9.80665 m", "length")
    assert matrix.sum() == pytest.approx(arrays.nodal_weight.sum() / gravity, rel=ROUNDING)
    np.testing.assert_array_equal(matrix, matrix.T)
    # What a node and its neighbours have of a body that moves as a whole is its lumped weight.
    np.testing.assert_allclose(matrix.sum(axis=1), arrays.nodal_weight / gravity, rtol=ROUNDING)


def test_consistent_masses_turn_as_the_bodies_do():
    structure = pendulum()
    matrix = mass_matrix(structure, structure_arrays(structure))
    mass, length = 78500 * 1e-4 / GRAVITY, 1.0
    np.testing.assert_allclose(matrix, mass / 6 * np.array([[2, 1], [1, 2]]), rtol=ROUNDING)
    turn = np.array([0.0, length])
    assert turn @ matrix @ turn == pytest.approx(mass * length**2 / 3, rel=ROUNDING)


def test_the_masses_are_consistent_unless_lumped_ones_are_asked_for(beam):
    consistent, lumped = natural_frequencies(beam), natural_frequencies(beam, mass="lumped")
    assert (consistent.frequencies > lumped.frequencies).all()
    np.testing.assert_array_equal(
        natural_frequencies(beam, mass="consistent").frequencies, consistent.frequencies
    )


def test_shapes_move_no_support_and_are_orthogonal_over_the_mass(beam):
    found = natural_frequencies(beam, 60)
    arrays = structure_arrays(beam.structure)
    assert not found.shapes[:, ~arrays.free].any()
    np.testing.assert_allclose(np.abs(found.shapes).max(axis=(1, 2)), 1.0, rtol=ROUNDING)
    masses = mass_matrix(beam.structure, arrays)
    product = np.einsum("aic,ij,bjc->ab", found.shapes, masses, found.shapes)
    scale = np.sqrt(np.diagonal(product))
    # The stiffnesses of a strut and of the prestress are some 1e6 apart, which eigenvectors feel.
    np.testing.assert_allclose(product / np.outer(scale, scale), np.eye(60), atol=1e-8)


def test_units_change_no_frequency():
    metres = natural_frequencies(solve_path(pendulum())).frequencies
    other = pendulum(units={"length": "cm", "force": "kN"})
    np.testing.assert_allclose(natural_frequencies(solve_path(other)).frequencies, metres, rtol=1e-9)


def test_nodes_without_a_mass_follow_the_others():
    # A weightless stay of two links along x, whose inner node is held sideways: it moves half as far,
    # and the two are one link of twice the length.
    link = {"kind": "strut", "stiffness": 100.0}
    stayed = pendulum()
    whole = parse_structure(
        {
            "nodes": {"1": [0, 0, 0], "2": [0, 0, -1], "w": [4, 0, -1]},
            "materials": {"steel": {"youngs_modulus": 2.1e11, "weight": 78500}},
            "members": {
                "rod": {"kind": "strut", "nodes": [1, 2], "material": "steel", "area": 1e-4},
                "stay": {**link, "nodes": [2, "w"], "rest_length": 4.0},
            },
            "supports": {"1": "xyz", "w": "xyz"},
            "gravity": [0, 0, -1],
        }
    )
    split = parse_structure(
        {
            "nodes": {"1": [0, 0, 0], "2": [0, 0, -1], "m": [2, 0, -1], "w": [4, 0, -1]},
            "materials": {"steel": {"youngs_modulus": 2.1e11, "weight": 78500}},
            "members": {
                "rod": {"kind": "strut", "nodes": [1, 2], "material": "steel", "area": 1e-4},
                "stay": {**link, "nodes": [2, "m"], "rest_length": 2.0},
                "tail": {**link, "nodes": ["m", "w"], "rest_length": 2.0},
            },
            "supports": {"1": "xyz", "m": "yz", "w": "xyz"},
            "gravity": [0, 0, -1],
        }
    )
    one, two = (natural_frequencies(solve_path(structure)) for structure in (whole, split))
    plain = natural_frequencies(solve_path(stayed))
    np.testing.assert_allclose(two.frequencies, one.frequencies, rtol=1e-6)  # it sags by some 1e-7
    assert two.frequencies[1] > 2.0 * plain.frequencies[1]
    swing = two.shapes[1]
    assert swing[2, 0] == pytest.approx(0.5 * swing[1, 0], rel=1e-6)


def test_a_mass_that_nothing_shares_is_told():
    with pytest.raises(SolverError, match="need a member with a weight"):
        natural_frequencies(solve_path(library.prism()))


def test_another_kind_of_mass_is_refused(beam):
    with pytest.raises(ModelError, match=r"mass: found 'lumpd'.*did you mean 'lumped'"):
        natural_frequencies(beam, mass="lumpd")


def test_a_failed_run_has_no_frequencies():
    few = PathSettings(largest_move=1e-3, max_steps=8)
    with pytest.raises(SolverError, match="failed"):
        natural_frequencies(solve_path(library.prism(), {"top": 0.3}, settings=few))
