"""The data of the kernels: what runs share, what is asked of each, what comes out, what lanes hold."""

from typing import Any, NamedTuple

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import Pattern

CACHE_LINE = 64
"""Bytes of a cache line, as many as of a pack."""


LARGEST_IN_LANES = 1500
"""Block rows above which a single run is solved in arrays of its own: idle lanes would cost more than they
save, and compiling for them would not."""


class Topology(NamedTuple):
    """What all runs share: numbers, and the addresses of the arrays of `StructureArrays` and `Pattern`.

    Addresses of integers are read with `item`, two a segment in `segment_nodes` and `segment_local`, two a
    pair in `pair_local`, 8 × 8 a segment in `slide_target`. Those of floats are read with `number`: `numbers`
    holds the size of the structure; `free` (3 n_nodes), `is_cable` and `moving` (n_members) are one or zero;
    `translation` and `spin` (n_rigid × 3 n_nodes) are the rigid motions that nothing holds, t and ω at each
    node. All are integers of one kind, for a tuple of many kinds takes long to recognise at every call.
    """

    n_members: int
    n_coordinates: int
    n_blocks: int
    n_entries: int
    n_held_entry: int
    n_held_diagonal: int
    n_rigid: int
    segment_nodes: int
    segment_start: int
    node_block: int
    block_node: int
    column_start: int
    row: int
    left_start: int
    left_column: int
    left_entry: int
    segment_entry: int
    path_start: int
    segment_local: int
    pair_start: int
    pair_local: int
    pair_entry: int
    slide_start: int
    slide_target: int
    held_entry: int
    held_diagonal: int
    free: int
    is_cable: int
    moving: int
    translation: int
    spin: int
    numbers: int


class Shared(NamedTuple):
    """A `Topology` with what it points to."""

    topology: Topology
    arrays: tuple[np.ndarray, ...]
    n_segments: int
    longest_path: int


class Runs(NamedTuple):
    """A block of runs of one stage. An array whose first axis is 1 holds for all of them.

    Attributes
    ----------
    start
        Positions at λ = 0, ``(n_runs | 1, 3 n_nodes)``; the supports move on from there.
    rest_length
        Coefficients of the effective rest lengths by powers of λ, ``(n_runs, n_members, degree + 1)``.
    stiffness
        EA, ``(n_runs | 1, n_members)``.
    loads_start, loads_rate
        Nodal forces at λ = 0 and their change, ``(n_runs | 1, 3 n_nodes)``.
    support_rate
        Change of the held coordinates, ``(n_runs | 1, 3 n_nodes)``.
    reference
        What counts as a tension of the structure, ``(n_runs | 1,)``.
    """

    start: FloatArray
    rest_length: FloatArray
    stiffness: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    reference: FloatArray

    def take(self, runs: IndexArray) -> "Runs":
        """Return some of the runs."""
        return Runs(*(column if len(column) == 1 else column[runs] for column in self))


class Outcome(NamedTuple):
    """Where runs stand; the kernels begin there and leave there, one row a run.

    Attributes
    ----------
    end
        Why the kernel stopped: one of the codes of the kernel that did, ``(n_runs,)``.
    parameter
        λ, ``(n_runs,)``.
    nodes, tensions
        Positions, ``(n_runs, 3 n_nodes)``, and tensions, ``(n_runs, n_members)``.
    velocity
        dx/dλ at the last accepted point, ``(n_runs, 3 n_nodes)``.
    residual
        Relative, of the last measure, ``(n_runs,)``.
    steps, iterations
        Counts so far, ``(n_runs,)``.
    """

    end: IndexArray
    parameter: FloatArray
    nodes: FloatArray
    tensions: FloatArray
    velocity: FloatArray
    residual: FloatArray
    steps: IndexArray
    iterations: IndexArray

    def take(self, runs: IndexArray) -> "Outcome":
        """Return a copy of some rows."""
        return self._replace(**{name: column[runs] for name, column in self._asdict().items()})

    def put(self, runs: IndexArray, part: "Outcome") -> None:
        """Write rows back that `take` gave."""
        for column, values in zip(self, part, strict=True):
            column[runs] = values


class Lanes(NamedTuple):
    """Addresses of the state and workspace of one pack, or of a single run.

    `x`, `velocity`, `bend` and their like are nodal, `stress` (the tensions as the last solve predicts
    them), `tension` (those of the last measure) and their like are of members. ``base_…`` is the last
    accepted point, from which the next is predicted; `third` is the estimate of the third derivative.
    `n_powers` is the number of coefficients of a rest length.
    """

    n_powers: int
    x: int
    guess: int
    velocity: int
    bend: int
    base_x: int
    base_velocity: int
    base_bend: int
    base_third: int
    motion: int
    push: int
    force: int
    loads_start: int
    loads_rate: int
    support_rate: int
    rest_length: int
    rest_length_rate: int
    rest_length_bend: int
    stiffness: int
    taut: int
    stress: int
    stress_rate: int
    stress_bend: int
    base_stress: int
    base_stress_rate: int
    base_stress_bend: int
    base_stress_third: int
    base_taut: int
    edge: int
    tension: int
    axial: int
    length: int
    length_rate: int
    pull: int
    coefficients: int
    unit: int
    inverse_length: int
    gradient: int
    blocks: int
    pivot_inverse: int
    rhs: int
    second: int
    basis: int
    image: int
    rigid: int
    parameter: int
    residual: int
    n_negative: int
    shift: int
    step: int
    scale: int
    measure_of: int
    active: int


NODAL = (
    *("x", "guess", "velocity", "bend", "base_x", "base_velocity", "base_bend", "base_third"),
    *("motion", "push", "force", "loads_start", "loads_rate", "support_rate"),
)
"""Fields of `Lanes` with a row for each coordinate."""

OF_MEMBERS = (
    *("rest_length", "rest_length_rate", "rest_length_bend", "stiffness", "taut"),
    *("stress", "stress_rate", "stress_bend", "tension", "axial", "length", "length_rate", "pull"),
    *("base_stress", "base_stress_rate", "base_stress_bend", "base_stress_third", "base_taut", "edge"),
)
"""Fields of `Lanes` with a row for each member."""

N_VECTORS = 3
"""Vectors that are iterated together for the lowest eigenvalue."""


class Workspace:
    """The arrays of one pack, ``(n, WIDTH)``, or of a single run, ``(n,)``, as attributes; and `lanes`.

    Parameters
    ----------
    shared
        Of the structure.
    degree
        Of the rest lengths in λ.
    single
        Whether it is for a single run of a structure so large that seven idle lanes cost more than they save.
    """

    x: FloatArray
    guess: FloatArray
    velocity: FloatArray
    bend: FloatArray
    base_x: FloatArray
    base_velocity: FloatArray
    base_bend: FloatArray
    base_third: FloatArray
    motion: FloatArray
    push: FloatArray
    force: FloatArray
    loads_start: FloatArray
    loads_rate: FloatArray
    support_rate: FloatArray
    rest_length: FloatArray
    rest_length_rate: FloatArray
    rest_length_bend: FloatArray
    stiffness: FloatArray
    taut: FloatArray
    stress: FloatArray
    stress_rate: FloatArray
    stress_bend: FloatArray
    base_stress: FloatArray
    base_stress_rate: FloatArray
    base_stress_bend: FloatArray
    base_stress_third: FloatArray
    base_taut: FloatArray
    edge: FloatArray
    tension: FloatArray
    axial: FloatArray
    length: FloatArray
    length_rate: FloatArray
    pull: FloatArray
    coefficients: FloatArray
    unit: FloatArray
    inverse_length: FloatArray
    gradient: FloatArray
    blocks: FloatArray
    pivot_inverse: FloatArray
    rhs: FloatArray
    second: FloatArray
    basis: FloatArray
    image: FloatArray
    rigid: FloatArray
    parameter: FloatArray
    residual: FloatArray
    n_negative: FloatArray
    shift: FloatArray
    step: FloatArray
    scale: FloatArray
    measure_of: FloatArray
    active: FloatArray

    def __init__(self, shared: Shared, degree: int, *, single: bool = False) -> None:
        topology = shared.topology
        unknowns, n_rigid = 3 * topology.n_blocks, topology.n_rigid
        rows = dict.fromkeys(NODAL, topology.n_coordinates) | dict.fromkeys(OF_MEMBERS, topology.n_members)
        rows |= {
            "coefficients": topology.n_members * (degree + 1),
            "unit": 3 * shared.n_segments,
            "inverse_length": shared.n_segments,
            "gradient": 3 * shared.longest_path,
            "blocks": 9 * topology.n_entries,
            "pivot_inverse": 6 * topology.n_blocks,
            "rhs": unknowns,
            "second": unknowns,
            "basis": N_VECTORS * unknowns,
            "image": N_VECTORS * unknowns,
            "rigid": n_rigid * unknowns,
            "measure_of": N_VECTORS**2,
        }
        names = Lanes._fields[1:]
        sizes = [max(1, rows.get(name, 1)) for name in names]
        # Packs begin with a cache line, so that none lies across two of them.
        width, spare = (1 if single else WIDTH), CACHE_LINE // 8
        buffer = np.zeros(sum(sizes) * width + spare)
        place = -buffer.ctypes.data % CACHE_LINE // 8
        address: Any = np.uint64 if single else int
        addresses: list[int] = []
        for name, size in zip(names, sizes, strict=True):
            field = buffer[place : place + size * width]
            setattr(self, name, field if single else field.reshape(size, width))
            addresses.append(address(field.ctypes.data))
            place += size * width
        self.lanes = Lanes(degree + 1, *addresses)


def share(
    arrays: StructureArrays, pattern: Pattern, motions: tuple[FloatArray, FloatArray] | None = None
) -> Shared:
    """Collect what the kernels need of a structure.

    Parameters
    ----------
    arrays, pattern
        The structure, with the coordinates held that stand for the rigid motions, and its pattern.
    motions
        Rigid motions that nothing holds, ``(n_rigid, n_nodes, 3)`` each: t and ω at every node.
    """
    translation, spin = (np.zeros((0, arrays.n_nodes, 3)),) * 2 if motions is None else motions
    names = Topology._fields[Topology._fields.index("segment_nodes") : Topology._fields.index("free")]
    integers = [
        np.ascontiguousarray(getattr(arrays if hasattr(arrays, name) else pattern, name), dtype=np.int64)
        for name in names
    ]
    floats = [
        np.ascontiguousarray(values, dtype=np.float64)
        for values in (arrays.free, arrays.is_cable, arrays.moving, translation, spin, [arrays.size])
    ]
    topology = Topology(
        arrays.n_members,
        3 * arrays.n_nodes,
        pattern.n_blocks,
        pattern.n_entries,
        len(pattern.held_entry),
        len(pattern.held_diagonal),
        len(translation),
        *(int(values.ctypes.data) for values in (*integers, *floats)),
    )
    longest = int(np.diff(pattern.path_start).max())
    return Shared(topology, (*integers, *floats), len(arrays.segment_nodes), longest)
