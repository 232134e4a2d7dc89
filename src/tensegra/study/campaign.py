"""Campaigns: all runs of a study, in a folder that survives what happens to the process."""

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensegra.errors import StudyError
from tensegra.presented import Presented
from tensegra.savable import Savable
from tensegra.study.data import TrainingData
from tensegra.study.derivatives import derivative_name
from tensegra.study.lock import Driver, driver_of
from tensegra.study.reading import read_study
from tensegra.study.selection import Selection, select
from tensegra.study.store import STUDY, Store, read_manifest, row_keys
from tensegra.study.study import Study, design_points

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Campaign", "CampaignState", "open_campaign"]

logger = logging.getLogger(__name__)


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
        How many rows that are not stable, or strained beyond their law, give each reason, the most
        frequent first.
    seconds_per_run
        Mean solver time of a run, NaN if there is none yet.
    driver, host
        Process that is running the campaign now and its machine, or None.
    rate
        Rows a second since that process started, NaN if there is none.
    """

    n_points: int
    n_done: int
    statuses: dict[str, int]
    reasons: dict[str, int]
    seconds_per_run: float
    driver: int | None = None
    host: str | None = None
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
class Campaign(Presented, Savable):
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
        return Store.of(self.folder, self.study)

    def frame(self, columns: Sequence[str] | None = None) -> "pd.DataFrame":
        """Return the rows that there are, in the order of the design.

        Parameters
        ----------
        columns
            The columns wanted beside the variables; all if left out.

        Returns
        -------
        DataFrame
            The index ``point`` counts the points of the design. Columns: the variables, the outputs,
            then ``status, reason, residual, lowest_eigenvalue, steps, iterations, seconds``, then the
            derivatives such as ``dw/dA14``, if the study asks for them. A run that failed has a reason,
            and NaN for its outputs. Rows of points that the design no longer has stay in the folder and
            are left out here.

        Raises
        ------
        StudyError
            If a shard cannot be read.
        """
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

    def to_dataframe(self) -> "pd.DataFrame":
        """Return all rows that there are; see `frame`."""
        return self.frame()

    def select(self, frame: "pd.DataFrame | None" = None, *, compare: bool = True) -> Selection:
        """Select the runs to learn from, as the study says; see `tensegra.study.select`."""
        entry = self.study.selection
        return select(
            self.frame() if frame is None else frame,
            self.study.output_names,
            method=entry.method,
            min_cluster_size=entry.min_cluster_size,
            compare=compare,
        )

    def training_data(self, outputs: Sequence[str] | None = None) -> TrainingData:
        """Return the runs that the study selects as training data.

        With them come their derivatives, if the study asks for them and every output wanted has some.

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
        selection = self.select(frame, compare=False)
        kept = frame[selection.keep]
        if kept.empty:
            raise StudyError(
                f"{self.folder}: found none of {len(frame)} runs to learn from, expected some that are "
                f"{selection.rule}"
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
            space=study.space,
            study_fingerprint=study.fingerprint,
        )
        if outputs is not None:
            data = data.select_outputs(outputs)
        return self._with_derivatives(data, kept)

    def _with_derivatives(self, data: TrainingData, frame: "pd.DataFrame") -> TrainingData:
        """Return the data with the derivatives that the same rows have; rows without any are left out."""
        known = set(self.study.derivative_names)
        names = [derivative_name(output, name) for output in data.output_names for name in data.input_names]
        if not known.issuperset(names):
            return data
        dY = frame[names].to_numpy(dtype=np.float64)
        has_all = np.isfinite(dY).all(axis=1)
        if not has_all.all():
            logger.warning(
                "%s: %d selected runs have no derivative and are left out", self.folder, (~has_all).sum()
            )
        return replace(
            data.rows(has_all), dY=dY[has_all].reshape(-1, len(data.output_names), len(data.input_names))
        )

    def state(self) -> CampaignState:
        """Return how far the campaign is; it may be running."""
        frame = self.frame(["status", "reason", "seconds"])
        driver = driver_of(self.folder)
        rate = np.nan if driver is None else _rate(driver)
        said = frame["reason"][(frame["status"] != "stable") | (frame["reason"] != "")]
        return CampaignState(
            n_points=self.study.n_points,
            n_done=len(frame),
            statuses=dict(Counter(frame["status"]).most_common()),
            reasons=dict(Counter(said).most_common()),
            seconds_per_run=float(frame["seconds"].mean()) if len(frame) else np.nan,
            driver=None if driver is None else int(driver["pid"]),
            host=None if driver is None else str(driver.get("host", "?")),
            rate=rate,
        )

    def __repr__(self) -> str:
        study = self.study
        names = ", ".join(study.input_names), ", ".join(output.name for output in study.outputs)
        return f"Campaign({str(self.folder)!r}: {study.name!r}; {study.n_points} points, {' → '.join(names)})"


def _rate(driver: Driver) -> float:
    """Return the rows a second that a driver tells of, NaN where it tells of none yet."""
    rows, seconds = driver.get("rows"), driver.get("seconds")
    if not (isinstance(rows, int) and isinstance(seconds, float) and rows > 0 and seconds > 0.0):
        return np.nan
    return rows / seconds


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
