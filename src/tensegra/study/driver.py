"""The driver of a campaign: solves what is missing of a design, block by block, and stores it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.structure import Structure
from tensegra.study.campaign import Campaign
from tensegra.study.evaluate import Runs, evaluate
from tensegra.study.executors import Executor, executor_for
from tensegra.study.lock import lock_folder
from tensegra.study.outputs import Output
from tensegra.study.solver import Solver, SolverEntry
from tensegra.study.store import Store, require_same_study, row_keys
from tensegra.study.study import Study, design_points
from tensegra.study.variables import Variable

__all__ = ["pending_points", "require_folder", "run_campaign"]

Array: TypeAlias = NDArray[np.float64]
Progress: TypeAlias = Callable[[int, int, int], object]

SECONDS_PER_BLOCK = 1.0
"""Work in a block: little to lose with a killed driver, much beside what starting and storing it costs."""

BLOCKS_PER_CAMPAIGN = 16
"""Blocks of a campaign at least, so that one whose runs are quick tells how far it is, too."""

BLOCK_SIZES = (16, 16_384)
"""Fewer runs in a block, and starting it costs more than it does; more, and it is much memory."""

GROWTH = 8
"""A block is at most so many times larger than one whose time is known."""


def run_campaign(
    study: Study,
    folder: str | PathLike[str],
    workers: int = 1,
    *,
    scheduler: str | None = None,
    progress: Progress | None = None,
    executor: Executor | None = None,
    solver: Solver | None = None,
) -> Campaign:
    """Run what is missing of a study's design in a folder; see `Study.run`."""
    folder = Path(folder)
    executor = executor_for(workers, scheduler) if executor is None else executor
    require_folder(folder, study)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder}: cannot be created ({(error.strerror or str(error)).lower()})") from None
    with lock_folder(folder) as held:
        store = Store.prepare(folder, study)
        store.repair()
        campaign = Campaign(folder, study)
        X = design_points(study)
        rows = campaign.frame(["status"])
        done, failed = len(rows), int((rows["status"] == "failed").sum())
        already = done
        report = progress or (lambda *_: None)
        report(done, len(X), failed)
        missing, repeats = _missing(X, rows.index.to_numpy())
        blocks = Blocks(X, missing)
        if len(missing) == 0:
            return campaign
        solve = Task(
            study.structure, study.variables, study.outputs, study.solver, study.derivatives, solver,
            executor.threads,
        )  # fmt: skip
        for solved in executor.map(solve, blocks):
            store.write(solved.runs, int(solved.points[0]))
            blocks.learn(len(solved.runs), solved.seconds)
            counts = repeats[solved.points]
            done, failed = done + int(counts.sum()), failed + int(counts[solved.runs.failed].sum())
            held.tell(done - already)
            report(done, len(X), failed)
    return campaign


def require_folder(folder: Path, study: Study) -> None:
    """Refuse what cannot be the folder of a study's campaign; it need not be there yet.

    Raises
    ------
    StudyError
        Saying what is there instead.
    """
    if "\0" in str(folder):
        raise StudyError.at("campaign", str(folder), "the name of a folder")
    try:
        if folder.is_symlink() and not folder.exists():
            raise StudyError(f"{folder}: a link to {str(folder.readlink())!r}, which is not there")
        if folder.is_dir():
            require_same_study(folder, study)
        elif folder.exists():
            raise StudyError(f"{folder}: a file is there, expected a new or empty folder")
    except OSError as error:
        raise StudyError(f"{folder}: cannot be read ({(error.strerror or str(error)).lower()})") from None


def pending_points(study: Study, folder: str | PathLike[str] | None = None) -> NDArray[np.int64]:
    """Return the points that a run of the study in a folder would solve; nothing is written.

    Parameters
    ----------
    study
        The study.
    folder
        The campaign's folder, be it there or not; all points are pending if left out.

    Returns
    -------
    ndarray
        Indices of the points in the design, each point once.

    Raises
    ------
    StudyError
        If the folder holds the campaign of another study, or something else.
    """
    done = np.empty(0, dtype=np.int64)
    if folder is not None:
        require_folder(Path(folder), study)
    if folder is not None and Path(folder).is_dir():
        done = Campaign(Path(folder), study).frame([]).index.to_numpy()
    return _missing(design_points(study), done)[0]


def _missing(X: Array, done: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the points to be run, in order, and how often each point of the design is there.

    Of points that are the same only the first is run.
    """
    first: dict[bytes, int] = {}
    firsts = np.array([first.setdefault(key, point) for point, key in enumerate(row_keys(X))], dtype=np.int64)
    repeats = np.bincount(firsts, minlength=len(X))
    is_wanted = repeats > 0
    is_wanted[done] = False
    return np.flatnonzero(is_wanted), repeats


@dataclass(frozen=True, eq=False)
class Block:
    """Design points to be solved together: their indices in the design, and their inputs."""

    points: NDArray[np.int64]
    X: Array


class Blocks:
    """Cuts points into blocks of about `SECONDS_PER_BLOCK` each, learning from those that are done.

    Which runs go together makes no difference to any of them.
    """

    def __init__(self, X: Array, points: NDArray[np.int64]) -> None:
        self.X, self.points = X, points
        least, most = BLOCK_SIZES
        self.most = min(most, max(least, len(points) // BLOCKS_PER_CAMPAIGN))
        self.size = least

    def __iter__(self) -> Iterator[Block]:
        at = 0
        while at < len(self.points):
            points = self.points[at : at + self.size]
            at += len(points)
            yield Block(points, self.X[points])

    def learn(self, n_runs: int, seconds: float) -> None:
        """Choose the size of the next blocks by what one has taken."""
        wanted = n_runs * min(GROWTH, SECONDS_PER_BLOCK / max(seconds, 1e-9))
        self.size = max(BLOCK_SIZES[0], min(self.most, int(wanted)))


@dataclass(frozen=True, eq=False)
class Solved:
    """The runs of a block, and the seconds that they took."""

    points: NDArray[np.int64]
    runs: Runs
    seconds: float


@dataclass(frozen=True, eq=False)
class Task:
    """What is done with each block, wherever it is done."""

    structure: Structure
    variables: tuple[Variable, ...]
    outputs: tuple[Output, ...]
    settings: SolverEntry
    derivatives: bool
    solver: Solver | None
    threads: int | None

    def __call__(self, block: Block) -> Solved:
        began = perf_counter()
        runs = evaluate(
            self.structure,
            self.variables,
            self.outputs,
            block.X,
            derivatives=self.derivatives,
            solver=self.solver or self.settings.solver(self.threads),
        )
        return Solved(block.points, runs, perf_counter() - began)
