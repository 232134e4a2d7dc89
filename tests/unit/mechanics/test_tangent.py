"""Long clustered cables as low-rank terms give what the filled pattern gives."""

import numpy as np
import pytest

from tensegra.mechanics import solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.pattern import build_pattern
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import library

SOLVE = 1e-8
"""Relative: both factors solve the same system, the low-rank one through a worse-conditioned A."""

EIGENVALUE = 1e-10
"""Of the largest entry of K: both are read from the same dense matrix, summed in another order."""


def both(arrays, x, rest_length):
    tangents = Tangent(arrays), Tangent(arrays, build_pattern(arrays, longest_filled_path=2))
    for tangent in tangents:
        tangent.measure(x, rest_length, arrays.stiffness)
    filled, low_rank = tangents
    assert low_rank.pattern.low_rank_member.size > 0
    assert filled.pattern.low_rank_member.size == 0
    return filled, low_rank


def in_node_order(tangent):
    flat = (3 * tangent.pattern.block_node[:, None] + np.arange(3)).ravel()[tangent.free_index]
    order = np.argsort(flat)
    return tangent.matrix()[np.ix_(order, order)]


def assert_same(arrays, x, rest_length, seed=0):
    filled, low_rank = both(arrays, x, rest_length)
    matrix = in_node_order(filled)
    scale = np.abs(matrix).max()
    np.testing.assert_allclose(in_node_order(low_rank), matrix, atol=EIGENVALUE * scale)
    np.testing.assert_allclose(
        low_rank.spectrum(3).values, filled.spectrum(3).values, atol=EIGENVALUE * scale
    )
    assert low_rank.factorise() == filled.factorise() == (np.linalg.eigvalsh(matrix) < 0.0).sum()
    force = np.random.default_rng(seed).standard_normal((arrays.n_nodes, 3))
    expected = filled.solve(force)
    np.testing.assert_allclose(low_rank.solve(force), expected, atol=SOLVE * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(20))
def test_low_rank_of_random_structures(random_structure, seed):
    arrays = structure_arrays(random_structure(seed, n_nodes=10, n_clustered=6))
    assert_same(arrays, arrays.coordinates, arrays.rest_length)


@pytest.mark.parametrize("value", [0.0, 0.05, 0.10])
def test_low_rank_of_the_beam_in_equilibrium(value):
    beam = library.paper_beam()
    arrays = structure_arrays(beam)
    x = solve_path(beam, {"A14": value, "A23": value}).final.nodes
    factor = np.ones(arrays.n_members)
    for member, change in {"K1": -0.0255, "K4": -0.0255}.items():
        factor[arrays.member_index[member]] += change
    for member, change in {"K1": -value, "K4": -value, "K2": value, "K3": value}.items():
        factor[arrays.member_index[member]] *= 1.0 + change
    assert_same(arrays, x, arrays.rest_length * factor)


def test_low_rank_with_a_shift(random_structure):
    arrays = structure_arrays(random_structure(3))
    filled, low_rank = both(arrays, arrays.coordinates, arrays.rest_length)
    values = np.linalg.eigvalsh(filled.matrix())
    for shift in 0.5 * (values[:-1] + values[1:]):
        assert low_rank.factorise(-shift) == filled.factorise(-shift) == (values < shift).sum()


def test_low_rank_without_prestress():
    # Without tension A alone is singular wherever only the clustered cable holds a node.
    prism = library.prism(clustered=True)
    arrays = structure_arrays(prism)
    stiff = arrays.stiffness
    tangents = both(arrays, arrays.coordinates, arrays.rest_length)
    solutions = []
    for tangent in tangents:
        tangent.measure(arrays.coordinates, arrays.rest_length, stiff)
        tangent.stress = np.zeros(arrays.n_members)
        tangent.factorise(1.0)
        solutions.append(tangent.solve(np.ones((arrays.n_nodes, 3))))
    np.testing.assert_allclose(solutions[1], solutions[0], atol=SOLVE * np.abs(solutions[0]).max())


def test_a_slack_low_rank_cable_adds_nothing(random_structure):
    arrays = structure_arrays(random_structure(5))
    clustered = arrays.n_segments > 1
    rest_length = np.where(clustered, 10.0 * arrays.rest_length, arrays.rest_length)
    assert_same(arrays, arrays.coordinates, rest_length)


def test_lanczos_equals_the_dense_eigenvalues(random_structure, monkeypatch):
    arrays = structure_arrays(random_structure(1, n_nodes=30))
    tangent = Tangent(arrays)
    tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
    dense = tangent.spectrum(3)
    assert dense.values[0] < 0.0  # the harder case: the shift has to be found first
    monkeypatch.setattr("tensegra.mechanics.tangent.LARGEST_DENSE", 0)
    sparse = tangent.spectrum(3)
    np.testing.assert_allclose(sparse.values, dense.values, rtol=1e-6)  # ARPACK's own tolerance
    for mode, expected in zip(sparse.vectors, dense.vectors, strict=True):
        assert abs(np.sum(mode * expected)) == pytest.approx(1.0, abs=1e-6)
