"""The sparsity of the tangent stiffness, worked out once for a topology.

Every node that can move is one 3 × 3 block. A member of one segment couples its two nodes; a
clustered cable couples all nodes of its path through (EA/l₀) b bᵀ. A short path takes these blocks
into the pattern; a long one would fill it with m × m blocks and gets unknowns of its own instead: how
far the cable has run over each pulley. With these transports q each of its m segments is a member of
stiffness m EA/l₀ that stretches by n·(u₂ − u₁) + q₁ − q₂ (M8), and couples its neighbours alone. To eliminate
the q, which is always possible (their block is tridiagonal and definite), gives (EA/l₀) b bᵀ exactly, and
leaves the inertia of K as it is; three of them share a block.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tensegra.mechanics.arrays import BoolArray, FloatArray, IndexArray, StructureArrays

LONGEST_FILLED_PATH = 24
"""Paths over more nodes than this get transports of their own (m² blocks against m / 3 more)."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Elimination order and block structure of the Cholesky-like factor of K.

    Blocks are stored by columns, the diagonal block first, rows ascending; rows and columns count
    the movable nodes, and the blocks of transports, in elimination order.

    Attributes
    ----------
    node_block
        Block row of each node, −1 where all its coordinates are held, shape ``(n_nodes,)``.
    block_node
        Node of each block row, −1 for transports, shape ``(n_blocks,)``.
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
    slide_start
        First segment of each member in `slide_target`, ``(n_members + 1,)``: none but of long clustered
        cables.
    slide_target
        Where the products of a segment's eight unknowns stand in the blocks, ``(n, 8, 8)``: those of its
        first node, of its second, and the transports at its ends; −1 where one is held, or above the
        diagonal.
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
    slide_start: IndexArray
    slide_target: IndexArray
    held_entry: IndexArray
    held_diagonal: IndexArray

    @property
    def n_blocks(self) -> int:
        """Number of block rows."""
        return len(self.block_node)

    @property
    def transports(self) -> BoolArray:
        """True for a block of transports, shape ``(n_blocks,)``."""
        mask: BoolArray = self.block_node < 0
        return mask

    @property
    def n_entries(self) -> int:
        """Number of stored 3 × 3 blocks of the factor."""
        return len(self.row)


def build_pattern(
    arrays: StructureArrays,
    movable: BoolArray | None = None,
    longest_filled_path: int = LONGEST_FILLED_PATH,
) -> Pattern:
    """Order the unknowns for little fill-in and lay out the factor.

    Parameters
    ----------
    arrays
        The structure.
    movable
        Nodes that are unknowns, also where each of their coordinates is held, ``(n_nodes,)``; those with a
        free coordinate where left out.
    longest_filled_path
        Clustered paths over more nodes than this get transports.
    """
    path_start, path_node, segment_local = _paths(arrays)
    clustered = arrays.n_segments > 1
    slides = clustered & (np.diff(path_start) > longest_filled_path)
    filled = clustered & ~slides
    ends, n_transports = _transports(arrays, slides)
    n_extra = -(-n_transports // 3)

    moves = arrays.free.any(axis=1) if movable is None else movable
    unknown = np.concatenate([np.flatnonzero(moves), arrays.n_nodes + np.arange(n_extra)])
    first, second = _couplings(arrays, path_start, path_node, filled, slides, ends)
    order = _elimination_order(arrays.n_nodes + n_extra, unknown, first, second)
    block = np.full(arrays.n_nodes + n_extra, -1, dtype=np.int64)
    block[order] = np.arange(len(order))

    column_start, row = _symbolic_factor(block, len(order), first, second)
    keys = np.repeat(np.arange(len(order)), np.diff(column_start)) * np.int64(len(order)) + row

    def entry_of(nodes_a: IndexArray, nodes_b: IndexArray) -> IndexArray:
        a, b = block[nodes_a], block[nodes_b]
        held = (a < 0) | (b < 0)
        wanted = np.minimum(a, b) * np.int64(len(order)) + np.maximum(a, b)
        return np.where(held, -1, np.searchsorted(keys, np.where(held, 0, wanted)))

    pair_start, pair_local, pair_nodes = _cluster_pairs(path_start, path_node, filled, block)
    left_start, left_column, left_entry = _rows(column_start, row, len(order))
    free = np.zeros((len(block), 3), dtype=np.bool_)
    free[: arrays.n_nodes] = arrays.free
    free[arrays.n_nodes :] = (np.arange(3 * n_extra) < n_transports).reshape(-1, 3)
    held_entry, held_diagonal = _held_scalars(free, order, column_start, row)
    slide_start = np.concatenate([[0], np.cumsum(np.where(slides, arrays.n_segments, 0))]).astype(np.int64)
    return Pattern(
        node_block=block[: arrays.n_nodes].copy(),
        block_node=np.where(order < arrays.n_nodes, order, -1),
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
        slide_start=slide_start,
        slide_target=_slide_targets(arrays, slides, ends, block, entry_of),
        held_entry=held_entry,
        held_diagonal=held_diagonal,
    )


def dense_matrix(pattern: Pattern, blocks: FloatArray, free: IndexArray | None = None) -> FloatArray:
    """Write the lower-triangular blocks, shape ``(9 n_entries,)``, as a full symmetric matrix.

    Rows and columns are the coordinates of the movable nodes in elimination order, restricted to
    the indices `free` where given; transports are eliminated.
    """
    n = 3 * pattern.n_blocks
    matrix = np.zeros((n, n))
    column = np.repeat(np.arange(pattern.n_blocks), np.diff(pattern.column_start))
    rows = 3 * pattern.row[:, None, None] + np.arange(3)[:, None]
    columns = 3 * column[:, None, None] + np.arange(3)
    matrix[rows, columns] = blocks.reshape(-1, 3, 3)
    matrix = np.tril(matrix) + np.tril(matrix, -1).T
    transports = np.repeat(pattern.transports, 3)
    if transports.any():
        across = matrix[np.ix_(transports, ~transports)]
        inner = np.linalg.solve(matrix[np.ix_(transports, transports)], across)
        matrix[np.ix_(~transports, ~transports)] -= across.T @ inner
        matrix[transports] = matrix[:, transports] = 0.0
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


def _transports(arrays: StructureArrays, slides: BoolArray) -> tuple[IndexArray, int]:
    """Count the transports; return those at the two ends of each segment, −1 for none, and how many."""
    ends, count = np.full((len(arrays.segment_nodes), 2), -1, dtype=np.int64), 0
    for e in np.flatnonzero(slides):
        first, last = arrays.segment_start[e], arrays.segment_start[e + 1]
        ends[first : last - 1, 1] = ends[first + 1 : last, 0] = count + np.arange(last - first - 1)
        count += int(last - first - 1)
    return ends, count


def _couplings(
    arrays: StructureArrays,
    path_start: IndexArray,
    path_node: IndexArray,
    filled: BoolArray,
    slides: BoolArray,
    ends: IndexArray,
) -> tuple[IndexArray, IndexArray]:
    """Return the pairs of nodes, and of blocks of transports behind them, that hold a block of K."""
    first, second = [arrays.segment_nodes[:, 0]], [arrays.segment_nodes[:, 1]]
    for segment in np.flatnonzero(np.repeat(slides, arrays.n_segments)):
        transports = arrays.n_nodes + np.unique(ends[segment][ends[segment] >= 0]) // 3
        unknowns = np.concatenate([arrays.segment_nodes[segment], transports])
        a, b = np.triu_indices(len(unknowns), 1)
        first.append(unknowns[a])
        second.append(unknowns[b])
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
    path_start: IndexArray, path_node: IndexArray, filled: BoolArray, node_block: IndexArray
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


def _slide_targets(
    arrays: StructureArrays,
    slides: BoolArray,
    ends: IndexArray,
    block: IndexArray,
    entry_of: Callable[[IndexArray, IndexArray], IndexArray],
) -> IndexArray:
    """Return where the products of the unknowns of the segments of long cables stand in the blocks."""
    segments = np.flatnonzero(np.repeat(slides, arrays.n_segments))
    coordinates = np.repeat(arrays.segment_nodes[segments], 3, axis=1)
    transports = ends[segments]
    node = np.hstack([coordinates, arrays.n_nodes + np.maximum(transports, 0) // 3])
    component = np.hstack([np.tile([0, 1, 2, 0, 1, 2], (len(segments), 1)), np.maximum(transports, 0) % 3])
    there = np.hstack([np.ones_like(coordinates, dtype=np.bool_), transports >= 0])
    i, j = np.indices((8, 8))
    row, column = node[:, i], node[:, j]
    entry = entry_of(row.ravel(), column.ravel()).reshape(row.shape)
    wanted = there[:, i] & there[:, j] & (entry >= 0) & (block[row] >= block[column])
    return np.where(wanted, 9 * entry + 3 * component[:, i] + component[:, j], -1)


def _held_scalars(
    free: BoolArray, order: IndexArray, column_start: IndexArray, row: IndexArray
) -> tuple[IndexArray, IndexArray]:
    held = ~free[order]
    columns = np.repeat(np.arange(len(order)), np.diff(column_start))
    i, j = np.divmod(np.arange(9), 3)
    zero = held[row][:, i] | held[columns][:, j]
    flat = 9 * np.arange(len(row))[:, None] + np.arange(9)
    diagonal = flat[(row == columns)[:, None] & (i == j) & held[row][:, i]]
    return flat[zero], diagonal
