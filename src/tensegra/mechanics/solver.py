"""From the stage inputs of runs to the kernels, on several threads."""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cached_property
from threading import Timer, local
from typing import Any

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.certify import Certificate, Directions, certify_runs
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.follow import Control, Record, follow_runs
from tensegra.mechanics.grip import Grip
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.pattern import Pattern, build_pattern
from tensegra.mechanics.rigid import RigidMotions, held_for
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.state import (
    LARGEST_IN_LANES,
    N_VECTORS,
    Lanes,
    Outcome,
    Runs,
    Topology,
    Workspace,
    share,
)
from tensegra.mechanics.step import LENGTH_ROUNDING

Kernel = Callable[[Lanes, int, int], None]
"""Works on a range of the runs with the lanes given."""

_CALLED: set[Any] = set()  # kernels that have run before in this process

_logger = logging.getLogger("tensegra")

COMPILING_AFTER = 2.0
"""Seconds after which a first call is not loading kernels from disk but compiling them."""

LARGEST_ITERATED = 300
"""Block rows above which Lanczos' method finds a lowest eigenvalue sooner than three iterated vectors."""

RECORDED_BYTES = 2**24
"""Memory of a record of a path: as many points as fit in it, not below eight."""

FEWEST_RUNS_A_THREAD = 16
"""Runs below which another thread costs more than it brings: two packs."""


NO_REFERENCE = np.zeros(1)
"""Tension of a structure of which none is known: no run is held to have lost its own."""


class _Kept(local):
    """What a thread keeps of a solver from one call to the next."""

    def __init__(self) -> None:
        self.workspaces: dict[tuple[int, bool], Workspace] = {}
        self.record: Record | None = None


class Solver:
    """Solves runs of one structure, eight lanes a thread.

    Parameters
    ----------
    arrays
        The structure with its own supports.
    settings
        How paths are followed.
    threads
        Number of threads.
    motions
        Neutral rigid motions, for which coordinates are held.
    nodes
        Where the structure is when these are chosen, ``(n_nodes, 3)``.
    pattern
        Of the structure where it is known already, and there are no motions.
    turning
        Rigid motions that the supports leave, neutral or not.
    """

    def __init__(
        self,
        arrays: StructureArrays,
        settings: PathSettings,
        threads: int = 1,
        motions: RigidMotions | None = None,
        nodes: FloatArray | None = None,
        pattern: Pattern | None = None,
        turning: RigidMotions | None = None,
    ) -> None:
        self.turning = turning
        self.settings, self.threads, self.motions = settings, threads, motions
        self._kept = _Kept()
        self.given = arrays
        self._held_at = arrays.coordinates if nodes is None else nodes
        self.arrays = arrays if motions is None or nodes is None else held_for(arrays, motions, nodes)
        self.pattern = build_pattern(self.arrays, np.any(arrays.free, axis=1)) if pattern is None else pattern
        given = None if motions is None else (motions.translation, motions.spin)
        self.shared = share(self.arrays, self.pattern, given)
        self.topology: Topology = self.shared.topology
        self.control = Control(
            first_step=settings.first_step,
            smallest_step=settings.smallest_step,
            largest_move=settings.largest_move * arrays.size,
            contraction=settings.contraction,
            max_steps=settings.max_steps,
            tolerance=settings.residual,
        )

    @cached_property
    def grip(self) -> Grip:
        """Watches the coordinates that are held for neutral motions."""
        none = np.zeros((0, self.arrays.n_nodes, 3))
        motions = RigidMotions((), none, none) if self.motions is None else self.motions
        return Grip(motions, self.given.free & ~self.arrays.free, self._held_at)

    def held_anew(self, nodes: FloatArray) -> "Solver":
        """Return the same with other coordinates held, good where a run is, ``(n_nodes, 3)``."""
        return Solver(self.given, self.settings, 1, self.motions, nodes, turning=self.turning)

    @cached_property
    def nothing_recorded(self) -> Record:
        """A record without room."""
        return self.record(0)

    def record(self, capacity: int | None = None) -> Record:
        """Return an empty record; of as many points as `RECORDED_BYTES` allow where nothing is said.

        That one is the calling thread's own, to be emptied before the next run is recorded.
        """
        if capacity is None:
            if self._kept.record is None:
                n, m = self.topology.n_coordinates, self.topology.n_members
                self._kept.record = self.record(max(8, min(512, RECORDED_BYTES // (8 * (n + m)))))
            return self._kept.record
        n, m = self.topology.n_coordinates, self.topology.n_members
        events = 4 * capacity + 2 * m if capacity else 0
        return Record(
            parameter=np.zeros(capacity),
            nodes=np.zeros((capacity, n)),
            tensions=np.zeros((capacity, m)),
            iterations=np.zeros(capacity, dtype=np.int64),
            event_parameter=np.zeros(events),
            event_member=np.zeros(events, dtype=np.int64),
            event_taut=np.zeros(events, dtype=np.int64),
            counts=np.zeros(2, dtype=np.int64),
        )

    def runs(
        self,
        stage: StageInputs,
        stiffness: FloatArray,
        start: FloatArray,
        n_runs: int,
        reference: FloatArray = NO_REFERENCE,
    ) -> Runs:
        """Lay out the runs of a stage as the kernels take them.

        Parameters
        ----------
        stage
            Inputs along the stage; arrays with or without a leading axis of runs.
        stiffness
            EA, with or without a leading axis of runs.
        start
            Positions at λ = 0, ``(n_runs | 1, n_nodes, 3)``.
        n_runs
            Number of runs.
        reference
            What counts as a tension of the structure, ``(n_runs | 1,)``.
        """
        n, m = self.topology.n_coordinates, self.topology.n_members
        rest_length = np.empty((n_runs, *stage.rest_length.shape[-2:]))
        rest_length[:] = stage.rest_length
        return Runs(
            start=_rows(start, n),
            rest_length=rest_length,
            stiffness=_rows(stiffness, m),
            loads_start=_rows(stage.loads_start, n),
            loads_rate=_rows(stage.loads_end - stage.loads_start, n),
            support_rate=_rows(stage.positions_end - stage.positions_start, n),
            reference=reference,
        )

    def outcome(self, nodes: FloatArray, n_runs: int, parameter: float | FloatArray = 0.0) -> Outcome:
        """Return runs that stand at given positions ``(n_runs | 1, n_nodes, 3)``; no more is known."""
        n, m = self.topology.n_coordinates, self.topology.n_members
        placed = np.empty((n_runs, n))
        placed[:] = nodes.reshape(-1, n)
        return Outcome(
            end=np.zeros(n_runs, dtype=np.int64),
            parameter=np.full(n_runs, parameter, dtype=np.float64),
            nodes=placed,
            tensions=np.full((n_runs, m), np.nan),
            velocity=np.zeros((n_runs, n)),
            residual=np.full(n_runs, np.nan),
            steps=np.zeros(n_runs, dtype=np.int64),
            iterations=np.zeros(n_runs, dtype=np.int64),
        )

    def follow(self, runs: Runs, outcome: Outcome, record: Record | None = None) -> None:
        """Follow all runs from where the outcome says that they stand to λ = 1, or to where they are left."""
        kept = self.nothing_recorded if record is None else record

        def kernel(lanes: Lanes, first: int, last: int) -> None:
            follow_runs(self.topology, runs, self.control, outcome, kept, lanes, first, last)

        self._share(kernel, follow_runs, runs, len(outcome.end))

    def stand(self, runs: Runs, outcome: Outcome) -> None:
        """Bring runs into balance where they are, at their λ, by Newton's method in positions and tensions.

        `Outcome.end` is `OUT_OF_STEPS` for a run that stands then, since it is given no step to go on.
        """
        here = self.control._replace(max_steps=0)

        def kernel(lanes: Lanes, first: int, last: int) -> None:
            follow_runs(self.topology, runs, here, outcome, self.nothing_recorded, lanes, first, last)

        self._share(kernel, follow_runs, runs, len(outcome.end))

    def fall(self, runs: Runs, which: IndexArray, outcome: Outcome, flat_below: FloatArray) -> None:
        """Let some of the runs fall from where the rows of the outcome, one a fall, say that they are."""
        # Only who falls pays for compiling it.
        from tensegra.mechanics.descend import Falls, fall_runs

        falls = Falls(
            np.asarray(which, dtype=np.int64), np.ascontiguousarray(flat_below), self.control.tolerance
        )

        def kernel(lanes: Lanes, first: int, last: int) -> None:
            fall_runs(self.topology, runs, falls, outcome, lanes, first, last)

        self._share(kernel, fall_runs, runs, len(which))

    def step(
        self,
        runs: Runs,
        outcome: Outcome,
        number: IndexArray,
        flat_below: FloatArray,
        record: Record | None = None,
    ) -> None:
        """Take all runs from λ = 0 to λ = 1 by the plain procedure, in `number` increments each."""
        from tensegra.mechanics.stepped import Increments, farthest_coordinate, step_runs

        increments = Increments(
            number=np.array(np.broadcast_to(number, (len(outcome.end),))),
            flat_below=np.ascontiguousarray(flat_below),
            farthest=farthest_coordinate(self.arrays),
            tolerance=self.control.tolerance,
        )
        kept = self.nothing_recorded if record is None else record

        def kernel(lanes: Lanes, first: int, last: int) -> None:
            step_runs(self.topology, runs, increments, outcome, kept, lanes, first, last)

        self._share(kernel, step_runs, runs, len(outcome.end))

    def certify(
        self,
        runs: Runs,
        outcome: Outcome,
        modes: FloatArray | None,
        directions: Sequence[Direction] = (),
    ) -> tuple[Certificate, Directions]:
        """Measure all runs where they stand: residual, inertia, lowest eigenvalue and derivatives.

        Parameters
        ----------
        runs, outcome
            The runs; tensions and residuals of the outcome are measured anew.
        modes
            Guess of the softest modes, ``(3, 3 n_blocks)``; no eigenvalue is computed where it is None.
        directions
            Changes of the inputs to differentiate by, with or without a leading axis of runs.
        """
        n_runs, n, m = len(outcome.end), self.topology.n_coordinates, self.topology.n_members
        certificate = Certificate(
            modes=np.zeros((0, 0)) if modes is None else modes,
            lowest_eigenvalue=np.full(n_runs, np.nan),
            n_negative=np.zeros(n_runs, dtype=np.int64),
            strain_energy=np.zeros(n_runs),
            proof=np.zeros(n_runs, dtype=np.int64),
        )
        asked = Directions(
            by_rest_length=_stacked([_rows(by.rest_length, m) for by in directions], m),
            by_stiffness=_stacked([_rows(by.stiffness, m) for by in directions], m),
            by_force=_stacked([_rows(by.force, n) for by in directions], n),
            nodes_by=np.full((n_runs, len(directions), n), np.nan),
            tensions_by=np.full((n_runs, len(directions), m), np.nan),
        )
        scale = LENGTH_ROUNDING / self.control.tolerance

        def kernel(lanes: Lanes, first: int, last: int) -> None:
            certify_runs(self.topology, runs, outcome, certificate, asked, scale, lanes, first, last)

        self._share(kernel, certify_runs, runs, n_runs)
        return certificate, asked

    def iterates(self, n_runs: int) -> bool:
        """Whether three vectors are iterated for the lowest eigenvalue: many runs share the work."""
        return self.pattern.n_blocks <= (LARGEST_ITERATED if n_runs == 1 else LARGEST_IN_LANES)

    @cached_property
    def any_modes(self) -> FloatArray:
        """Vectors to begin the search for the softest modes with, ``(3, 3 n_blocks)``."""
        return np.random.default_rng(0).standard_normal((N_VECTORS, 3 * self.pattern.n_blocks))

    def _share(self, kernel: Kernel, compiled: Any, runs: Runs, n_runs: int) -> None:  # noqa: ANN401 - a Dispatcher
        """Work on parts of the runs on threads, each with lanes of its own."""
        if n_runs == 0:
            return
        single = n_runs == 1 and self.pattern.n_blocks > LARGEST_IN_LANES
        degree = runs.rest_length.shape[2] - 1
        n_threads = max(1, min(self.threads, -(-n_runs // FEWEST_RUNS_A_THREAD)))
        with _told_while_compiling(compiled):
            if n_threads == 1:
                kernel(self._workspace(degree, single=single).lanes, 0, n_runs)
                return
            borders = np.linspace(0, n_runs, n_threads + 1).astype(int)

            def work(i: int) -> None:
                own = Workspace(self.shared, degree)
                kernel(own.lanes, int(borders[i]), int(borders[i + 1]))

            with ThreadPoolExecutor(n_threads) as pool:
                list(pool.map(work, range(n_threads)))

    def _workspace(self, degree: int, *, single: bool) -> Workspace:
        """Return the calling thread's workspace, the same as the last time where it fits."""
        kept = self._kept.workspaces
        if (degree, single) not in kept:
            kept[degree, single] = Workspace(self.shared, degree, single=single)
        return kept[degree, single]


@contextmanager
def _told_while_compiling(kernel: Any) -> Iterator[None]:  # noqa: ANN401 - a Dispatcher
    """Say so when the first call takes long: it compiles, once, unless the kernels are on disk."""
    if kernel in _CALLED:
        yield
        return
    notice = Timer(COMPILING_AFTER, _logger.warning, ["compiling the kernels, once for this machine"])
    notice.daemon = True
    notice.start()
    try:
        yield
        _CALLED.add(kernel)
    finally:
        notice.cancel()


def _stacked(fields: Sequence[FloatArray], width: int) -> FloatArray:
    """Return fields over the runs side by side, ``(n_runs | 1, n_fields, width)``."""
    if not any(np.any(field) for field in fields):
        return np.zeros((1, len(fields), 0))  # the kernel skips what has no width
    n_rows = max(len(field) for field in fields)
    return np.stack([np.broadcast_to(field, (n_rows, width)) for field in fields], axis=1)


def _rows(values: FloatArray, width: int) -> FloatArray:
    """Return a field as rows over the runs, one row where it is the same for all."""
    return np.ascontiguousarray(values).reshape(-1, width)
