"""The way from stage inputs of many runs to `follow_runs` on several threads."""

import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from threading import Timer

import numpy as np

from tensegra.mechanics.arrays import FloatArray, StructureArrays
from tensegra.mechanics.derivatives import Direction
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.lockstep import follow_runs
from tensegra.mechanics.lockstep_data import Outcome, Runs, lanes_for, topology_of
from tensegra.mechanics.pattern import Pattern

_logger = logging.getLogger("tensegra")

LONGEST_STEP, SHORTEST_STEP = 0.5, 0.02
"""First step of a stage, and the step below which a run is given back to be followed alone."""

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
        self, stage: StageInputs, start: FloatArray, n_runs: int, directions: Sequence[Direction] = ()
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

        Returns
        -------
        Outcome
            ``done`` is zero for the runs that are given back.
        """
        arrays, pattern = self.arrays, self.pattern
        n, m = 3 * arrays.n_nodes, arrays.n_members
        n_directions = len(directions)
        rest_length = np.broadcast_to(stage.rest_length, (n_runs, *stage.rest_length.shape[-2:]))
        runs = Runs(
            start=_rows(start, n),
            rest_length=np.ascontiguousarray(rest_length),
            stiffness=_rows(arrays.stiffness, m),
            loads_start=_rows(stage.loads_start, n),
            loads_rate=_rows(stage.loads_end - stage.loads_start, n),
            support_rate=_rows(stage.positions_end - stage.positions_start, n),
            modes=self.modes,
            by_rest_length=_stacked([_rows(by.rest_length, m) for by in directions], m),
            by_stiffness=_stacked([_rows(by.stiffness, m) for by in directions], m),
            by_force=_stacked([_rows(by.force, n) for by in directions], n),
        )
        outcome = Outcome(
            done=np.zeros(n_runs, dtype=np.int64),
            nodes=np.full((n_runs, n), np.nan),
            tensions=np.full((n_runs, m), np.nan),
            residual=np.full(n_runs, np.nan),
            lowest_eigenvalue=np.full(n_runs, np.nan),
            steps=np.zeros(n_runs, dtype=np.int64),
            iterations=np.zeros(n_runs, dtype=np.int64),
            nodes_by=np.full((n_runs, n_directions, n), np.nan),
            tensions_by=np.full((n_runs, n_directions, m), np.nan),
        )
        borders = np.linspace(0, n_runs, min(self.threads, n_runs) + 1).astype(int)

        def follow_part(i: int) -> None:
            lanes = lanes_for(arrays, pattern, rest_length.shape[2] - 1)
            follow_runs(
                self.topology, runs, outcome, lanes, int(borders[i]), int(borders[i + 1]),
                LONGEST_STEP, SHORTEST_STEP, LARGEST_MOVE * arrays.size,
            )  # fmt: skip

        with _told_while_compiling():
            if len(borders) == 2:
                follow_part(0)
            else:
                with ThreadPoolExecutor(len(borders) - 1) as pool:
                    list(pool.map(follow_part, range(len(borders) - 1)))
        return outcome


@contextmanager
def _told_while_compiling() -> Iterator[None]:
    """Say so when the first call takes long: it compiles, once, unless the kernels are on disk."""
    if follow_runs.signatures:
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
