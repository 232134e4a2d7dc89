"""The way from stage inputs of many runs to `follow_runs` on several threads."""

import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Timer
from typing import Any

import numpy as np

from tensegra.mechanics.arrays import FloatArray, IndexArray, StructureArrays
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.equilibrium import FLAT_TENSION
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.lockstep import certify_runs, follow_runs
from tensegra.mechanics.lockstep_data import Increments, Lanes, Outcome, Runs, lanes_for, topology_of
from tensegra.mechanics.pattern import Pattern
from tensegra.mechanics.stepped import MAX_ITERATIONS, farthest_coordinate, n_increments

Part = Callable[[Lanes, int, int], None]
"""Follows a range of the runs with the lanes given."""

_logger = logging.getLogger("tensegra")

LONGEST_STEP, CAREFUL_STEP = 0.5, 0.02
"""First step of a stage, and the step below which a run goes with care, or not on."""

COMPILING_AFTER = 2.0
"""Seconds after which a first call is not loading kernels from disk but compiling them."""

LARGEST_MOVE = 0.15
"""Largest move of a coordinate in one step, as a share of the structure's size."""

SOFT_MODES = 3
"""Vectors that are iterated for the lowest eigenvalue."""


class LockstepSolver:
    """Follows many runs of one structure through a stage, eight lanes a thread.

    Parameters
    ----------
    arrays, pattern
        The structure; a pattern with low-rank terms is not for lockstep (see `serves`).
    modes
        Guess of the softest modes of K, ``(3, n_nodes, 3)``.
    threads
        Number of threads.
    """

    def __init__(self, arrays: StructureArrays, pattern: Pattern, modes: FloatArray, threads: int) -> None:
        self.arrays, self.pattern, self.threads = arrays, pattern, threads
        self.topology = topology_of(arrays, pattern)
        self.modes = modes[:, pattern.block_node].reshape(len(modes), -1)

    @property
    def serves(self) -> bool:
        """Whether the structure can be solved in lockstep."""
        return not len(self.pattern.low_rank_member) and len(self.modes) == SOFT_MODES

    def follow(
        self,
        stage: StageInputs,
        start: FloatArray,
        n_runs: int,
        directions: Sequence[Direction] = (),
        smallest_step: float = CAREFUL_STEP,
    ) -> Outcome:
        """Follow all runs from their equilibria at λ = 0 to λ = 1.

        Parameters
        ----------
        stage
            Inputs along the stage; arrays with or without a leading axis of runs.
        start
            Positions at λ = 0, ``(n_runs | 1, n_nodes, 3)``.
        n_runs
            Number of runs.
        directions
            Changes of the inputs to differentiate by, with or without a leading axis of runs.
        smallest_step
            Increment of λ below which the stable branch is held to end.

        Returns
        -------
        Outcome
            ``done`` is `STANDS`, or `BRANCH_ENDS` where no step is small enough, with the last point
            of the branch, or zero where not even the start stands.
        """
        runs = self._runs(stage, start, n_runs, directions)
        outcome = self._outcome(n_runs, len(directions))
        largest_move = LARGEST_MOVE * self.arrays.size

        def follow_part(lanes: Lanes, first: int, last: int) -> None:
            follow_runs(
                self.topology, runs, outcome, lanes, first, last,
                LONGEST_STEP, CAREFUL_STEP, smallest_step, largest_move,
            )  # fmt: skip

        self._share(follow_part, n_runs, runs, follow_runs)
        self._certify(runs, outcome)
        return outcome

    def follow_stepped(
        self,
        stage: StageInputs,
        start: FloatArray,
        n_runs: int,
        increment: float,
        reference_tension: FloatArray,
        directions: Sequence[Direction] = (),
    ) -> Outcome:
        """Take all runs from λ = 0 to λ = 1 by the plain procedure.

        Parameters
        ----------
        stage, start, n_runs, directions
            As in `follow`.
        increment
            Largest relative change of a rest length in one increment.
        reference_tension
            What counts as a tension of the structure, ``(n_runs | 1,)``.

        Returns
        -------
        Outcome
            ``done`` tells how each run ended; those that are lost have no positions.
        """
        # Only who steps pays for compiling it.
        from tensegra.mechanics.lockstep_stepped import follow_stepped

        runs = self._runs(stage, start, n_runs, directions)
        outcome = self._outcome(n_runs, len(directions))
        arrays = self.arrays
        increments = Increments(
            number=np.array(np.broadcast_to(n_increments(stage, increment), (n_runs,))),
            flat_below=FLAT_TENSION * reference_tension,
            moving=arrays.moving.astype(np.float64),
            farthest=farthest_coordinate(arrays),
            most_iterations=MAX_ITERATIONS,
        )

        def follow_part(lanes: Lanes, first: int, last: int) -> None:
            follow_stepped(self.topology, runs, increments, outcome, lanes, first, last)

        self._share(follow_part, n_runs, runs, follow_stepped)
        self._certify(runs, outcome)
        return outcome

    def fall(
        self,
        stage: StageInputs,
        start: FloatArray,
        n_runs: int,
        which: IndexArray,
        nodes: FloatArray,
        parameter: FloatArray,
        flat_below: FloatArray,
        largest_move: float,
    ) -> Outcome:
        """Let some of the runs fall under what acts at a point of the stage.

        Parameters
        ----------
        stage, start, n_runs
            As in `follow`.
        which
            The runs that fall, ``(n_falls,)``.
        nodes
            Where they fall from, ``(n_falls, n_nodes, 3)``.
        parameter
            λ of what acts, ``(n_falls,)``.
        flat_below
            Largest tension that counts as none, ``(n_falls,)``.
        largest_move
            Bound on a single move, unit of length.

        Returns
        -------
        Outcome
            ``done`` is `STANDS`, `NOT_DEFINITE`, `FLAT`, or `LOST` for a fall that has to be looked at alone.
        """
        from tensegra.mechanics.lockstep_fall import Falls, fall_runs

        runs = self._runs(stage, start, n_runs, ())
        outcome = self._outcome(len(which), 0)
        moving = self.arrays.moving.astype(np.float64)
        falls = Falls(which, _rows(nodes, nodes[0].size), parameter, flat_below, moving, largest_move)

        def fall_part(lanes: Lanes, first: int, last: int) -> None:
            fall_runs(self.topology, runs, falls, outcome, lanes, first, last)

        self._share(fall_part, len(which), runs, fall_runs)
        return outcome

    def _certify(self, runs: Runs, outcome: Outcome) -> None:
        """Find eigenvalues and derivatives of the runs that stand: all lanes of a pack at once."""

        def certify_part(lanes: Lanes, first: int, last: int) -> None:
            certify_runs(self.topology, runs, outcome, lanes, first, last)

        self._share(certify_part, len(outcome.done), runs, certify_runs)

    def _runs(
        self, stage: StageInputs, start: FloatArray, n_runs: int, directions: Sequence[Direction]
    ) -> Runs:
        """Lay out the runs as the kernels take them."""
        n, m = 3 * self.arrays.n_nodes, self.arrays.n_members
        rest_length = np.broadcast_to(stage.rest_length, (n_runs, *stage.rest_length.shape[-2:]))
        return Runs(
            start=_rows(start, n),
            rest_length=np.ascontiguousarray(rest_length),
            stiffness=_rows(self.arrays.stiffness, m),
            loads_start=_rows(stage.loads_start, n),
            loads_rate=_rows(stage.loads_end - stage.loads_start, n),
            support_rate=_rows(stage.positions_end - stage.positions_start, n),
            modes=self.modes,
            by_rest_length=_stacked([_rows(by.rest_length, m) for by in directions], m),
            by_stiffness=_stacked([_rows(by.stiffness, m) for by in directions], m),
            by_force=_stacked([_rows(by.force, n) for by in directions], n),
        )

    def _outcome(self, n_runs: int, n_directions: int) -> Outcome:
        n, m = 3 * self.arrays.n_nodes, self.arrays.n_members
        return Outcome(
            done=np.zeros(n_runs, dtype=np.int64),
            parameter=np.zeros(n_runs),
            nodes=np.full((n_runs, n), np.nan),
            tensions=np.full((n_runs, m), np.nan),
            residual=np.full(n_runs, np.nan),
            lowest_eigenvalue=np.full(n_runs, np.nan),
            steps=np.zeros(n_runs, dtype=np.int64),
            iterations=np.zeros(n_runs, dtype=np.int64),
            nodes_by=np.full((n_runs, n_directions, n), np.nan),
            tensions_by=np.full((n_runs, n_directions, m), np.nan),
        )

    def _share(self, follow_part: Part, n_runs: int, runs: Runs, kernel: Any) -> None:  # noqa: ANN401 - a Dispatcher
        """Follow parts of the runs on threads, each with lanes of its own."""
        borders = np.linspace(0, n_runs, min(self.threads, n_runs) + 1).astype(int)

        def follow(i: int) -> None:
            lanes = lanes_for(self.arrays, self.pattern, runs.rest_length.shape[2] - 1)
            follow_part(lanes, int(borders[i]), int(borders[i + 1]))

        with _told_while_compiling(kernel):
            if len(borders) == 2:
                follow(0)
            else:
                with ThreadPoolExecutor(len(borders) - 1) as pool:
                    list(pool.map(follow, range(len(borders) - 1)))


@contextmanager
def _told_while_compiling(kernel: Any) -> Iterator[None]:  # noqa: ANN401 - a Dispatcher
    """Say so when the first call takes long: it compiles, once, unless the kernels are on disk."""
    if kernel.signatures:
        yield
        return
    notice = Timer(COMPILING_AFTER, _logger.warning, ["compiling the batch kernels, once for this machine"])
    notice.daemon = True
    notice.start()
    try:
        yield
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
