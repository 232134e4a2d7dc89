from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.pattern import LONGEST_FILLED_PATH, build_pattern, dense_matrix
from tensegra.structure import library

SEEDS = range(12)

ROUNDING = 1e-11
"""Of inverses of well-conditioned matrices with entries up to 50."""

BEAM_ENTRIES = 137
"""Blocks of the paper beam's factor at the time of writing; a dense one has 210."""


def stored(pattern):
    columns = np.repeat(np.arange(pattern.n_blocks), np.diff(pattern.column_start))
    return set(zip(pattern.row.tolist(), columns.tolist(), strict=True))


def coupled(pattern, nodes):
    """Block positions in the lower triangle that the movable ones of `nodes` couple."""
    blocks = sorted({int(pattern.node_block[node]) for node in nodes} - {-1})
    return {(high, low) for low, high in combinations(blocks, 2)}


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_is_a_permutation_of_the_movable_nodes(random_structure, seed):
    arrays = structure_arrays(random_structure(seed))
    pattern = build_pattern(arrays)
    movable = np.flatnonzero(arrays.free.any(axis=1))
    assert sorted(pattern.block_node) == movable.tolist()
    np.testing.assert_array_equal(pattern.node_block[pattern.block_node], np.arange(len(movable)))
    np.testing.assert_array_equal(np.delete(pattern.node_block, movable), -1)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_factor_holds_every_coupling_of_a_member(random_structure, seed):
    structure = random_structure(seed)
    arrays = structure_arrays(structure)
    pattern = build_pattern(arrays)
    blocks = stored(pattern)
    assert len(blocks) == pattern.n_entries
    assert {(j, j) for j in range(pattern.n_blocks)} <= blocks
    for member in structure.members.values():
        assert coupled(pattern, [arrays.node_index[node] for node in member.nodes]) <= blocks


@pytest.mark.parametrize("seed", SEEDS)
def test_the_factor_holds_its_own_fill(random_structure, seed):
    pattern = build_pattern(structure_arrays(random_structure(seed)))
    blocks = stored(pattern)
    for column in range(pattern.n_blocks):
        rows = pattern.row[pattern.column_start[column] : pattern.column_start[column + 1]]
        assert rows[0] == column
        assert np.all(np.diff(rows) > 0)
        assert {(high, low) for low, high in combinations(rows[1:].tolist(), 2)} <= blocks


@pytest.mark.parametrize("seed", SEEDS)
def test_the_rows_list_each_block_left_of_the_diagonal_once(random_structure, seed):
    pattern = build_pattern(structure_arrays(random_structure(seed)))
    found = set()
    for j in range(pattern.n_blocks):
        for t in range(pattern.left_start[j], pattern.left_start[j + 1]):
            k, entry = int(pattern.left_column[t]), int(pattern.left_entry[t])
            assert pattern.row[entry] == j
            assert pattern.column_start[k] < entry < pattern.column_start[k + 1]
            found.add((j, k))
    assert found == {(row, column) for row, column in stored(pattern) if row > column}


def test_fill_of_the_paper_beam():
    pattern = build_pattern(structure_arrays(library.paper_beam()))
    assert pattern.n_blocks == 20
    assert pattern.n_entries == BEAM_ENTRIES


@pytest.fixture(params=SEEDS)
def sliding(request, random_structure):
    """Return a structure all of whose clustered cables have transports, with its pattern."""
    arrays = structure_arrays(random_structure(request.param, n_nodes=10, n_clustered=5))
    return arrays, build_pattern(arrays, longest_filled_path=1)


def test_only_paths_that_are_too_long_get_transports():
    arrays = structure_arrays(library.paper_beam())
    assert not build_pattern(arrays, longest_filled_path=6).transports.any()
    assert not build_pattern(arrays).transports.any()
    pattern = build_pattern(arrays, longest_filled_path=5)
    clustered = arrays.n_segments > 1
    # One transport fewer than segments, three a block.
    n_transports = int((arrays.n_segments[clustered] - 1).sum())
    assert pattern.transports.sum() == -(-n_transports // 3)
    assert pattern.n_blocks == 20 + pattern.transports.sum()
    np.testing.assert_array_equal(np.diff(pattern.slide_start), np.where(clustered, arrays.n_segments, 0))
    assert not np.diff(pattern.pair_start).any()


def test_each_long_cable_has_one_transport_less_than_segments(sliding):
    arrays, pattern = sliding
    n_transports = int((arrays.n_segments - 1).sum())
    assert pattern.transports.sum() == -(-n_transports // 3) > 0
    diagonal = set()
    for s in range(len(pattern.slide_target)):
        diagonal |= set(pattern.slide_target[s, [6, 7], [6, 7]].tolist()) - {-1}
    assert len(diagonal) == n_transports  # and no two of them stand in the same place


def test_movable_nodes_and_transports_share_the_order(sliding):
    arrays, pattern = sliding
    movable = np.flatnonzero(arrays.free.any(axis=1))
    nodal = pattern.block_node[~pattern.transports]
    assert sorted(nodal) == movable.tolist()
    np.testing.assert_array_equal(pattern.node_block[nodal], np.flatnonzero(~pattern.transports))
    np.testing.assert_array_equal(np.delete(pattern.node_block, movable), -1)


def test_a_transport_couples_the_segments_at_its_two_sides_alone(sliding):
    arrays, pattern = sliding
    blocks = stored(pattern)
    segments = np.flatnonzero(np.repeat(arrays.n_segments > 1, arrays.n_segments))
    assert len(pattern.slide_target) == len(segments)
    columns = np.repeat(np.arange(pattern.n_blocks), np.diff(pattern.column_start))
    for target, segment in zip(pattern.slide_target, segments, strict=True):
        i, j = np.nonzero(target >= 0)
        entry, scalar = np.divmod(target[i, j], 9)
        row, column = 3 * pattern.row[entry] + scalar // 3, 3 * columns[entry] + scalar % 3
        node = 3 * pattern.node_block[arrays.segment_nodes[segment]][:, None] + np.arange(3)
        # Rows and columns of the eight unknowns, of which the transports are known by themselves.
        unknown = [*node.ravel(), *np.full(2, -1)]
        for q in (6, 7):
            if target[q, q] >= 0:
                unknown[q] = 3 * pattern.row[target[q, q] // 9] + target[q, q] % 9 // 3
        unknown = np.array(unknown)
        np.testing.assert_array_equal(row, unknown[i])
        np.testing.assert_array_equal(column, unknown[j])
        assert np.all(row // 3 >= column // 3)
        assert set(zip((row // 3).tolist(), (column // 3).tolist(), strict=True)) <= blocks


def test_transports_of_a_long_cable_fill_less_than_its_square():
    tower = library.tower(40, 4, clustered="full")
    arrays = structure_arrays(tower)
    longest = max(len(set(member.nodes)) for member in tower.members.values())
    assert longest > LONGEST_FILLED_PATH
    filled, slid = build_pattern(arrays, longest_filled_path=10**6), build_pattern(arrays)
    assert slid.transports.any()
    assert filled.n_entries > longest**2 / 2
    assert slid.n_entries < 0.5 * filled.n_entries


def test_blocks_and_dense_matrix_hold_the_same_numbers():
    pattern = build_pattern(structure_arrays(library.prism(clustered=True)))
    rng = np.random.default_rng(0)
    blocks = rng.standard_normal(9 * pattern.n_entries)
    matrix = dense_matrix(pattern, blocks)
    np.testing.assert_array_equal(matrix, matrix.T)
    for column in range(pattern.n_blocks):
        for p in range(pattern.column_start[column], pattern.column_start[column + 1]):
            row = pattern.row[p]
            block = blocks[9 * p : 9 * p + 9].reshape(3, 3)
            found = matrix[3 * row : 3 * row + 3, 3 * column : 3 * column + 3]
            if row == column:
                block = np.tril(block)  # the diagonal blocks are symmetric: only their lower half is read
                found = np.tril(found)
            np.testing.assert_array_equal(found, block)
    some = np.array([0, 3, 4])
    np.testing.assert_array_equal(dense_matrix(pattern, blocks, some), matrix[np.ix_(some, some)])


def test_the_dense_matrix_eliminates_transports(sliding):
    _, pattern = sliding
    rng = np.random.default_rng(1)
    blocks = rng.standard_normal(9 * pattern.n_entries)
    diagonal = pattern.column_start[:-1]
    blocks.reshape(-1, 3, 3)[diagonal] += 50.0 * np.eye(3)  # so that the transports can be eliminated
    transports = np.repeat(pattern.transports, 3)
    assert transports.any()
    matrix = dense_matrix(pattern, blocks)
    assert not matrix[transports].any()
    # The block of an inverse is the inverse of the complement of Schur.
    whole = dense_matrix(replace(pattern, block_node=np.zeros_like(pattern.block_node)), blocks)
    expected = np.linalg.inv(np.linalg.inv(whole)[np.ix_(~transports, ~transports)])
    np.testing.assert_allclose(matrix[np.ix_(~transports, ~transports)], expected, rtol=0, atol=ROUNDING)
