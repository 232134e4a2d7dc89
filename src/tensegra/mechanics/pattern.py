"""The sparsity of the tangent stiffness, worked out once for a topology.

Every node that can move is one 3 × 3 block. A member of one segment couples its two nodes; a
clustered cable couples all nodes of its path through (EA/l₀) b bᵀ. A short path takes these blocks
into the pattern; a long one would fill it with m × m blocks and is kept out as one column of a
low-rank term, ``K = A + B diag(EA/l₀) Bᵀ`` (`tensegra.mechanics.tangent`).
"""

from dataclasses import dataclass

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays

LONGEST_FILLED_PATH = 24
"""Paths over more nodes than this are kept as low-rank terms (m² blocks against m vectors)."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Elimination order and block structure of the Cholesky-like factor of K.

    Blocks are stored by columns, the diagonal block first, rows ascending; rows and columns count
    the movable nodes in elimination order.

    Attributes
    ----------
    node_block
        Block row of each node, −1 where all its coordinates are held, shape ``(n_nodes,)``.
    block_node
        Node of each block row, shape ``(n_blocks,)``.
    column_start, row
        Compressed columns of the factor's lower triangle.
    left_start, left_column, left_entry
        For each row j, the columns k < j that hold a block in it, and where that block is stored.
    segment_entry
        Storage of the block that couples the two nodes of a segment, −1 where one is held.
    path_start, path_node
        Distinct nodes of each member's path, compressed by members.
    segment_local
        Position of a segment's two nodes within `path_node` of its member, ``(n_segments, 2)``.
    pair_start, pair_local, pair_entry
        Blocks of b bᵀ of the clustered members that are filled in: local nodes (row, column).
    low_rank_member
        Clustered members that are kept as low-rank terms.
    low_rank_column
        Column of each member in the low-rank term, −1 for the others, shape ``(n_members,)``.
    held_entry, held_diagonal
        Scalars (flat, nine a block) of partly held nodes that are to be zero, and those on the
        diagonal that are to be one.
    """

    node_block: IndexArray
    block_node: IndexArray
    column_start: IndexArray
    row: IndexArray
    left_start: IndexArray
    left_column: IndexArray
    left_entry: IndexArray
    segment_entry: IndexArray
    path_start: IndexArray
    path_node: IndexArray
    segment_local: IndexArray
    pair_start: IndexArray
    pair_local: IndexArray
    pair_entry: IndexArray
    low_rank_member: IndexArray
    low_rank_column: IndexArray
    held_entry: IndexArray
    held_diagonal: IndexArray

    @property
    def n_blocks(self) -> int:
        """Number of movable nodes."""
        return len(self.block_node)

    @property
    def n_entries(self) -> int:
        """Number of stored 3 × 3 blocks of the factor."""
        return len(self.row)


def build_pattern(arrays: StructureArrays, longest_filled_path: int = LONGEST_FILLED_PATH) -> Pattern:
    """Order the unknowns for little fill-in and lay out the factor.

    Parameters
    ----------
    arrays
        The structure.
    longest_filled_path
        Clustered paths over more nodes than this become low-rank terms.
    """
    path_start, path_node, segment_local = _paths(arrays)
    path_lengths = np.diff(path_start)
    clustered = arrays.n_segments > 1
    low_rank = clustered & (path_lengths > longest_filled_path)
    filled = clustered & ~low_rank

    movable = np.flatnonzero(arrays.free.any(axis=1))
    first, second = _couplings(arrays, path_start, path_node, filled)
    order = _elimination_order(arrays.n_nodes, movable, first, second)
    node_block = np.full(arrays.n_nodes, -1, dtype=np.int64)
    node_block[order] = np.arange(len(order))

    column_start, row = _symbolic_factor(node_block, len(order), first, second)
    keys = np.repeat(np.arange(len(order)), np.diff(column_start)) * np.int64(len(order)) + row

    def entry_of(nodes_a: IndexArray, nodes_b: IndexArray) -> IndexArray:
        a, b = node_block[nodes_a], node_block[nodes_b]
        held = (a < 0) | (b < 0)
        wanted = np.minimum(a, b) * np.int64(len(order)) + np.maximum(a, b)
        return np.where(held, -1, np.searchsorted(keys, np.where(held, 0, wanted)))

    pair_start, pair_local, pair_nodes = _cluster_pairs(path_start, path_node, filled, node_block)
    left_start, left_column, left_entry = _rows(column_start, row, len(order))
    held_entry, held_diagonal = _held_scalars(arrays, order, column_start, row)
    low_rank_column = np.full(arrays.n_members, -1, dtype=np.int64)
    low_rank_column[low_rank] = np.arange(low_rank.sum())
    return Pattern(
        node_block=node_block,
        block_node=order,
        column_start=column_start,
        row=row,
        left_start=left_start,
        left_column=left_column,
        left_entry=left_entry,
        segment_entry=entry_of(arrays.segment_nodes[:, 0], arrays.segment_nodes[:, 1]),
        path_start=path_start,
        path_node=path_node,
        segment_local=segment_local,
        pair_start=pair_start,
        pair_local=pair_local,
        pair_entry=entry_of(pair_nodes[:, 0], pair_nodes[:, 1]),
        low_rank_member=np.flatnonzero(low_rank),
        low_rank_column=low_rank_column,
        held_entry=held_entry,
        held_diagonal=held_diagonal,
    )


def dense_matrix(pattern: Pattern, blocks: FloatArray, free: IndexArray | None = None) -> FloatArray:
    """Write the lower-triangular blocks, shape ``(9 n_entries,)``, as a full symmetric matrix.

    Rows and columns are the coordinates of the movable nodes in elimination order, restricted to
    the indices `free` where given.
    """
    n = 3 * pattern.n_blocks
    matrix = np.zeros((n, n))
    kernels.write_dense(pattern.column_start, pattern.row, blocks, matrix)
    return matrix if free is None or len(free) == n else matrix[np.ix_(free, free)]


def _paths(arrays: StructureArrays) -> tuple[IndexArray, IndexArray, IndexArray]:
    start = [0]
    nodes: list[int] = []
    local = np.zeros((len(arrays.segment_nodes), 2), dtype=np.int64)
    for e in range(arrays.n_members):
        place: dict[int, int] = {}
        for s in range(arrays.segment_start[e], arrays.segment_start[e + 1]):
            for side in (0, 1):
                node = int(arrays.segment_nodes[s, side])
                local[s, side] = place.setdefault(node, len(place))
        nodes.extend(place)
        start.append(len(nodes))
    return np.array(start, dtype=np.int64), np.array(nodes, dtype=np.int64), local


def _couplings(
    arrays: StructureArrays, path_start: IndexArray, path_node: IndexArray, filled: np.ndarray
) -> tuple[IndexArray, IndexArray]:
    first, second = [arrays.segment_nodes[:, 0]], [arrays.segment_nodes[:, 1]]
    for e in np.flatnonzero(filled):
        nodes = path_node[path_start[e] : path_start[e + 1]]
        a, b = np.triu_indices(len(nodes), 1)
        first.append(nodes[a])
        second.append(nodes[b])
    return np.concatenate(first), np.concatenate(second)


def _elimination_order(
    n_nodes: int, movable: IndexArray, first: IndexArray, second: IndexArray
) -> IndexArray:
    """Order the movable nodes by minimum degree (SuperLU's, on the graph of couplings)."""
    from scipy.sparse import coo_array, eye_array
    from scipy.sparse.linalg import splu

    if len(movable) < 3:
        return movable
    place = np.full(n_nodes, -1, dtype=np.int64)
    place[movable] = np.arange(len(movable))
    a, b = place[first], place[second]
    inside = (a >= 0) & (b >= 0)
    n = len(movable)
    graph = coo_array((np.ones(inside.sum()), (a[inside], b[inside])), shape=(n, n)).tocsc()
    graph = graph + graph.T
    degree = np.asarray(graph.sum(axis=0)).ravel().max(initial=0.0)
    dominant = (eye_array(n, format="csc") * (2.0 * degree + 1.0) - graph).tocsc()
    factor = splu(
        dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return movable[np.argsort(factor.perm_c)]


def _symbolic_factor(
    node_block: IndexArray, n_blocks: int, first: IndexArray, second: IndexArray
) -> tuple[IndexArray, IndexArray]:
    """Return the columns of the factor: each is its own couplings and those of its children."""
    a, b = node_block[first], node_block[second]
    inside = (a >= 0) & (b >= 0)
    low, high = np.minimum(a, b)[inside], np.maximum(a, b)[inside]
    columns: list[set[int]] = [set() for _ in range(n_blocks)]
    for column, row in zip(low.tolist(), high.tolist(), strict=True):
        columns[column].add(row)
    start, rows = [0], []
    for column in range(n_blocks):
        below = columns[column]
        below.discard(column)
        ordered = sorted(below)
        rows.append(column)
        rows.extend(ordered)
        start.append(len(rows))
        if ordered:
            columns[ordered[0]].update(ordered)
        columns[column] = set()
    return np.array(start, dtype=np.int64), np.array(rows, dtype=np.int64)


def _rows(
    column_start: IndexArray, row: IndexArray, n_blocks: int
) -> tuple[IndexArray, IndexArray, IndexArray]:
    columns = np.repeat(np.arange(n_blocks), np.diff(column_start))
    below = np.flatnonzero(row > columns)
    by_row = below[np.lexsort((columns[below], row[below]))]
    counts = np.bincount(row[by_row], minlength=n_blocks)
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return start, columns[by_row], by_row


def _cluster_pairs(
    path_start: IndexArray, path_node: IndexArray, filled: np.ndarray, node_block: IndexArray
) -> tuple[IndexArray, IndexArray, IndexArray]:
    start, local, nodes = [0], [], []
    for e, is_filled in enumerate(filled):
        if is_filled:
            path = path_node[path_start[e] : path_start[e + 1]]
            for p, node_p in enumerate(path):
                for q, node_q in enumerate(path):
                    if node_block[node_p] >= node_block[node_q] >= 0:
                        local.append((p, q))
                        nodes.append((node_p, node_q))
        start.append(len(local))
    return (
        np.array(start, dtype=np.int64),
        np.array(local, dtype=np.int64).reshape(-1, 2),
        np.array(nodes, dtype=np.int64).reshape(-1, 2),
    )


def _held_scalars(
    arrays: StructureArrays, order: IndexArray, column_start: IndexArray, row: IndexArray
) -> tuple[IndexArray, IndexArray]:
    held = ~arrays.free[order]
    columns = np.repeat(np.arange(len(order)), np.diff(column_start))
    i, j = np.divmod(np.arange(9), 3)
    zero = held[row][:, i] | held[columns][:, j]
    flat = 9 * np.arange(len(row))[:, None] + np.arange(9)
    diagonal = flat[(row == columns)[:, None] & (i == j) & held[row][:, i]]
    return flat[zero], diagonal
