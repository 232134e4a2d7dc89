"""The data of runs in lockstep: what they share, what is asked, what comes out, what lanes hold."""

from typing import NamedTuple

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import Pattern

STANDS, NOT_DEFINITE, FLAT, LOST, BRANCH_ENDS = 1, 2, 3, 4, 5
"""How a run came to its end (`Outcome.done`): in an equilibrium where K is positive definite, in one
where it is not, where nothing carries force any more, nowhere, or at the end of the stable branch."""


CACHE_LINE = 64
"""Bytes of a cache line, as many as of a pack."""


class Topology(NamedTuple):
    """What all runs share: `StructureArrays` and `Pattern` as the kernels take them."""

    segment_nodes: IndexArray
    segment_start: IndexArray
    node_block: IndexArray
    block_node: IndexArray
    column_start: IndexArray
    row: IndexArray
    left_start: IndexArray
    left_column: IndexArray
    left_entry: IndexArray
    segment_entry: IndexArray
    path_start: IndexArray
    segment_local: IndexArray
    pair_start: IndexArray
    pair_local: IndexArray
    pair_entry: IndexArray
    held_entry: IndexArray
    held_diagonal: IndexArray
    free: FloatArray
    is_cable: FloatArray
    longest_path: int
    size: float


class Runs(NamedTuple):
    """A block of runs of one stage. An array whose first axis is 1 holds for all of them.

    Attributes
    ----------
    start
        Equilibria at λ = 0, ``(n_runs | 1, 3 n_nodes)``.
    rest_length
        Coefficients of the effective rest lengths by powers of λ, ``(n_runs, n_members, degree + 1)``.
    stiffness
        EA, ``(n_runs | 1, n_members)``.
    loads_start, loads_rate
        Nodal forces at λ = 0 and their change, ``(n_runs | 1, 3 n_nodes)``.
    support_rate
        Change of the held coordinates, ``(n_runs | 1, 3 n_nodes)``.
    modes
        Guess of the three softest modes in elimination order, ``(3, 3 n_blocks)``; no eigenvalue is
        computed where it has no rows.
    by_rest_length, by_stiffness, by_force
        Directions of the derivatives asked for: ``(n_runs | 1, n_directions, n_members)`` twice and
        ``(n_runs | 1, n_directions, 3 n_nodes)``.
    """

    start: FloatArray
    rest_length: FloatArray
    stiffness: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    modes: FloatArray
    by_rest_length: FloatArray
    by_stiffness: FloatArray
    by_force: FloatArray


class Increments(NamedTuple):
    """What the plain procedure needs beside `Runs`.

    Attributes
    ----------
    number
        Of the increments of each run, ``(n_runs,)``.
    flat_below
        Largest tension that counts as none where nothing is loaded, ``(n_runs | 1,)``.
    moving
        One for a member that touches a node that can move, else zero, ``(n_members,)``.
    farthest
        Coordinate at which a run is given up.
    most_iterations
        Iterations of one increment after which a run is given up.
    """

    number: IndexArray
    flat_below: FloatArray
    moving: FloatArray
    farthest: float
    most_iterations: int


class Outcome(NamedTuple):
    """Results, filled in by the kernels; one row a run, of the shapes that the names tell.

    ``done`` is 0 for a run that is given back, else how it ended; ``parameter`` is the λ up to which
    it was followed.
    """

    done: IndexArray
    parameter: FloatArray
    nodes: FloatArray
    tensions: FloatArray
    residual: FloatArray
    lowest_eigenvalue: FloatArray
    steps: IndexArray
    iterations: IndexArray
    nodes_by: FloatArray
    tensions_by: FloatArray


class Lanes(NamedTuple):
    """State and workspace of one pack; all arrays are ``(n, WIDTH)``."""

    x: FloatArray
    guess: FloatArray
    accepted: FloatArray
    velocity: FloatArray
    bend: FloatArray
    rest_length: FloatArray
    rest_length_rate: FloatArray
    rest_length_bend: FloatArray
    coefficients: FloatArray
    stiffness: FloatArray
    motion: FloatArray
    push: FloatArray
    pull: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    taut: FloatArray
    stress: FloatArray
    tension: FloatArray
    accepted_tension: FloatArray
    tension_rate: FloatArray
    tension_bend: FloatArray
    axial: FloatArray
    length: FloatArray
    length_rate: FloatArray
    unit: FloatArray
    inverse_length: FloatArray
    force: FloatArray
    gradient: FloatArray
    blocks: FloatArray
    pivot_inverse: FloatArray
    rhs: FloatArray
    second: FloatArray
    basis: FloatArray
    image: FloatArray
    parameter: FloatArray
    residual: FloatArray
    n_negative: FloatArray
    shift: FloatArray
    scale: FloatArray
    measure_of: FloatArray
    active: FloatArray


def topology_of(arrays: StructureArrays, pattern: Pattern) -> Topology:
    """Collect what the kernels need of a structure."""
    return Topology(
        arrays.segment_nodes,
        arrays.segment_start,
        pattern.node_block,
        pattern.block_node,
        pattern.column_start,
        pattern.row,
        pattern.left_start,
        pattern.left_column,
        pattern.left_entry,
        pattern.segment_entry,
        pattern.path_start,
        pattern.segment_local,
        pattern.pair_start,
        pattern.pair_local,
        pattern.pair_entry,
        pattern.held_entry,
        pattern.held_diagonal,
        arrays.free.reshape(-1).astype(np.float64),
        arrays.is_cable.astype(np.float64),
        int(np.diff(pattern.path_start).max()),
        arrays.size,
    )


def lanes_for(arrays: StructureArrays, pattern: Pattern, degree: int) -> Lanes:
    """Allocate one pack's state and workspace, for rest lengths of the given degree in λ."""
    nodal, members = 3 * arrays.n_nodes, arrays.n_members
    segments, unknowns = len(arrays.segment_nodes), 3 * pattern.n_blocks
    rows = dict.fromkeys(NODAL, nodal) | dict.fromkeys(OF_MEMBERS, members)
    rows |= {
        "coefficients": members * (degree + 1),
        "unit": 3 * segments,
        "inverse_length": segments,
        "gradient": 3 * int(np.diff(pattern.path_start).max()),
        "blocks": 9 * pattern.n_entries,
        "pivot_inverse": 6 * pattern.n_blocks,
        "rhs": unknowns,
        "second": unknowns,
        "basis": 3 * unknowns,
        "image": 3 * unknowns,
        "measure_of": 9,
    }
    return Lanes(**{name: _packs(rows.get(name, 1)) for name in Lanes._fields})


def _packs(n: int) -> FloatArray:
    """Return zeros, ``(n, WIDTH)``, that begin with a cache line: no pack lies across two of them."""
    spare = CACHE_LINE // 8
    buffer = np.zeros(n * WIDTH + spare)
    first = -buffer.ctypes.data % CACHE_LINE // 8
    return buffer[first : first + n * WIDTH].reshape(n, WIDTH)


NODAL = (
    *("x", "guess", "accepted", "velocity", "bend", "motion", "push", "force"),
    *("loads_start", "loads_rate", "support_rate"),
)
"""Fields of `Lanes` with a row for each coordinate."""

OF_MEMBERS = (
    *("rest_length", "rest_length_rate", "rest_length_bend", "stiffness", "taut", "stress", "tension"),
    *("accepted_tension", "tension_rate", "tension_bend", "axial", "length", "length_rate", "pull"),
)
"""Fields of `Lanes` with a row for each member."""
