from itertools import combinations

import numpy as np
import pytest

from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.pattern import build_pattern, dense_matrix
from tensegra.structure import library

SEEDS = range(12)

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


def test_a_long_clustered_cable_is_left_out_of_the_pattern():
    arrays = structure_arrays(library.paper_beam())
    pattern = build_pattern(arrays, longest_filled_path=5)
    clustered = np.flatnonzero(arrays.n_segments > 1)
    np.testing.assert_array_equal(pattern.low_rank_member, clustered)
    assert build_pattern(arrays, longest_filled_path=6).low_rank_member.size == 0
    assert pattern.n_entries < BEAM_ENTRIES
    pairs = np.diff(pattern.pair_start)
    assert not pairs.any()


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
