"""Campaigns: all runs of a study, in a folder that survives what happens to the process."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.structure import Structure
from tensegra.study.data import TrainingData
from tensegra.study.evaluate import Runs, Solver, evaluate
from tensegra.study.executors import Executor, executor_for
from tensegra.study.lock import driver_of, lock_folder
from tensegra.study.outputs import Output
from tensegra.study.reading import read_study
from tensegra.study.selection import CERTIFIED, Selection, select
from tensegra.study.store import STUDY, Store, read_manifest, row_keys
from tensegra.study.study import Study, design_points
from tensegra.study.variables import Variable

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Campaign", "CampaignState", "open_campaign", "run_campaign"]

Array: TypeAlias = NDArray[np.float64]
Progress: TypeAlias = Callable[[int, int, int], object]
Block: TypeAlias = tuple[int, Array]

BLOCKS_PER_CAMPAIGN = 64
"""Blocks into which a campaign is cut, within the limits below: enough for progress and for few runs
to be lost with a killed driver."""

BLOCK_SIZES = (16, 2048)
"""Fewer runs in a block, and starting it costs more than it does; more, and it grows out of the cache."""


@dataclass(frozen=True)
class CampaignState:
    """How far a campaign is.

    Attributes
    ----------
    n_points, n_done
        Points of the design, and how many of them have a row.
    statuses
        How many rows have each status, the most frequent first.
    reasons
        How many rows that are not stable give each reason, the most frequent first.
    seconds_per_run
        Mean solver time of a run, NaN if there is none yet.
    driver
        Process that is running the campaign now, or None.
    rate
        Rows a second since that process started, NaN if there is none.
    """

    n_points: int
    n_done: int
    statuses: dict[str, int]
    reasons: dict[str, int]
    seconds_per_run: float
    driver: int | None = None
    rate: float = np.nan

    @property
    def n_failed(self) -> int:
        """Number of rows without a result."""
        return self.statuses.get("failed", 0)

    @property
    def n_pending(self) -> int:
        """Number of points without a row."""
        return self.n_points - self.n_done

    @property
    def seconds_left(self) -> float:
        """Expected time to the end at the present rate, NaN if there is none."""
        return self.n_pending / self.rate if self.rate > 0 else np.nan


@dataclass(frozen=True, eq=False, repr=False)
class Campaign:
    """The runs of a study that are in a folder, be it finished or not.

    Attributes
    ----------
    folder
        Where they are.
    study
        What they answer.
    """

    folder: Path
    study: Study

    @property
    def store(self) -> Store:
        """The folder's rows as they are stored."""
        return Store(self.folder, self.study.input_names, self.study.output_names)

    def frame(self) -> "pd.DataFrame":
        """Return the rows that there are, in the order of the design.

        Returns
        -------
        DataFrame
            The index ``point`` counts the points of the design. Columns: the variables, the outputs,
            then ``status, reason, residual, lowest_eigenvalue, steps, iterations, seconds``. A run that
            failed has a reason, and NaN for its outputs. Rows of points that the design no longer has
            stay in the folder and are left out here.
        """
        return self._in_order_of_design(None)

    def _in_order_of_design(self, columns: Sequence[str] | None) -> "pd.DataFrame":
        frame = self.store.read(columns)
        X = design_points(self.study)
        row_of = {
            key: row for row, key in enumerate(row_keys(frame[list(self.study.input_names)].to_numpy()))
        }
        rows = np.array([row_of.get(key, -1) for key in row_keys(X)], dtype=np.int64)
        points = np.flatnonzero(rows >= 0)
        ordered = frame.iloc[rows[points]]
        ordered.index = points
        return ordered.rename_axis(index="point")

    def select(self, frame: "pd.DataFrame | None" = None) -> Selection:
        """Select the runs to learn from, as the study says; see `tensegra.study.select`."""
        entry = self.study.selection
        return select(
            self.frame() if frame is None else frame,
            self.study.output_names,
            method=entry.method,
            min_cluster_size=entry.min_cluster_size,
            merge_distance=entry.merge_distance,
        )

    def training_data(self, outputs: Sequence[str] | None = None) -> TrainingData:
        """Return the selected runs as training data: certified by the solver and kept by the selection.

        Parameters
        ----------
        outputs
            Names of the outputs wanted; all if left out. The selection always looks at all of them.

        Raises
        ------
        StudyError
            If there is no such output, or no run to learn from.
        """
        study = self.study
        frame = self.frame()
        kept = frame[self.select(frame).keep]
        if kept.empty:
            raise StudyError(
                f"{self.folder}: found none of {len(frame)} runs to learn from, expected some that are "
                + " or ".join(CERTIFIED)
            )
        X = kept[list(study.input_names)].to_numpy(dtype=np.float64)
        bounds = study.space.bounds
        data = TrainingData(
            X=X,
            Y=kept[list(study.output_names)].to_numpy(dtype=np.float64),
            input_names=study.input_names,
            output_names=study.output_names,
            input_units=study.space.units,
            output_units=tuple(output.unit for output in study.outputs),
            # Points from a file may lie in the law's support and outside the box.
            bounds=np.stack(
                [np.minimum(bounds[:, 0], X.min(axis=0)), np.maximum(bounds[:, 1], X.max(axis=0))], axis=1
            ),
            distributions=study.space.distributions,
            study_fingerprint=study.fingerprint,
        )
        return data if outputs is None else data.select_outputs(outputs)

    def state(self) -> CampaignState:
        """Return how far the campaign is; it may be running."""
        frame = self._in_order_of_design(["status", "reason", "seconds"])
        driver = driver_of(self.folder)
        rate = np.nan
        if driver is not None:
            elapsed = time() - driver["started"]
            rate = self.store.count_since(driver["started"]) / elapsed if elapsed > 0 else np.nan
        not_stable = frame["reason"][frame["status"] != "stable"]
        return CampaignState(
            n_points=self.study.n_points,
            n_done=len(frame),
            statuses=dict(Counter(frame["status"]).most_common()),
            reasons=dict(Counter(not_stable).most_common()),
            seconds_per_run=float(frame["seconds"].mean()) if len(frame) else np.nan,
            driver=None if driver is None else int(driver["pid"]),
            rate=rate,
        )

    def __repr__(self) -> str:
        return f"Campaign({str(self.folder)!r}: {self.study.name!r})"


def open_campaign(folder: str | PathLike[str]) -> Campaign:
    """Open the campaign in a folder; the study's original files are not needed.

    Raises
    ------
    StudyError
        If there is none, or its resolved study is not the one that its manifest is of.
    """
    folder = Path(folder)
    manifest = read_manifest(folder)
    study = read_study(folder / STUDY)
    if study.fingerprint != manifest["fingerprint"]:
        raise StudyError(f"{folder}: {STUDY} is not the study that the rows belong to; restore it")
    return Campaign(folder, study)


def run_campaign(
    study: Study,
    folder: str | PathLike[str],
    workers: int = 2,
    *,
    progress: Progress | None = None,
    executor: Executor | None = None,
    solver: Solver | None = None,
) -> Campaign:
    """Run what is missing of a study's design in a folder; see `Study.run`."""
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder}: cannot be created ({(error.strerror or str(error)).lower()})") from None
    executor = executor_for(workers) if executor is None else executor
    with lock_folder(folder):
        store = Store.prepare(folder, study)
        store.repair()
        campaign = Campaign(folder, study)
        X = design_points(study)
        rows = campaign._in_order_of_design(["status"])  # noqa: SLF001 - of this module
        done, failed = len(rows), int((rows["status"] == "failed").sum())
        missing = _missing(X, rows.index.to_numpy())
        repeats = Counter(row_keys(X))
        report = progress or (lambda *_: None)
        report(done, len(X), failed)
        solve = partial(_solve_block, study.structure, study.variables, study.outputs, solver)
        for first, runs in executor.map(solve, _blocks(X, missing)):
            store.write(runs, first)
            counts = np.array([repeats[key] for key in row_keys(runs.X)])
            done, failed = done + int(counts.sum()), failed + int(counts[runs.failed].sum())
            report(done, len(X), failed)
    return campaign


def _missing(X: Array, done: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the points to be run, in order; of points that are the same, the first."""
    is_done = np.zeros(len(X), dtype=np.bool_)
    is_done[done] = True
    first: dict[bytes, int] = {}
    for point, key in enumerate(row_keys(X)):
        first.setdefault(key, point)
    return np.array([point for point in first.values() if not is_done[point]], dtype=np.int64)


def _blocks(X: Array, missing: NDArray[np.int64]) -> Iterator[Block]:
    """Cut the missing points into blocks, each with the index of its first point.

    The borders depend on the design alone, not on what is done, so that a resumed campaign hands the
    solver the same blocks as an undisturbed one.
    """
    size = block_size(len(X))
    for block in np.split(missing, np.flatnonzero(np.diff(missing // size)) + 1):
        if len(block):
            yield int(block[0]), X[block]


def block_size(n_points: int) -> int:
    """Return the number of runs in a block, a power of two.

    Examples
    --------
    >>> block_size(100), block_size(12_500), block_size(10**6)
    (16, 128, 2048)
    """
    least, most = BLOCK_SIZES
    wanted = max(1, n_points // BLOCKS_PER_CAMPAIGN)
    return min(most, max(least, 1 << (wanted.bit_length() - 1)))


def _solve_block(
    structure: Structure,
    variables: tuple[Variable, ...],
    outputs: tuple[Output, ...],
    solver: Solver | None,
    block: Block,
) -> tuple[int, Runs]:
    first, X = block
    return first, evaluate(structure, variables, outputs, X, solver=solver)
