"""Runs with what became of them: in which regime they stand, or that they do not.

Over a large box of inputs a structure behaves in several ways: all cables taut, some slack, collapsed. The
response is smooth within a regime, has kinks between two that stand, and ends where nothing stands.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.study.selection import CERTIFIED

if TYPE_CHECKING:
    from tensegra.mechanics import Batch
    from tensegra.study import Campaign

__all__ = ["FALLEN", "STANDING", "RegimeData", "campaign_runs", "regime_labels"]

Array: TypeAlias = NDArray[np.float64]
Labels: TypeAlias = NDArray[np.str_]

STANDING, FALLEN = "standing", "fallen"
TAUT, SLACK = "taut", "slack"
WITHOUT_OUTPUTS = ("collapsed", "unstable", "failed", FALLEN)


@dataclass(frozen=True, eq=False, kw_only=True)
class RegimeData:
    """Runs to learn from, the regime of each, and the design points at which nothing stands.

    Rows are counted through: those that stand, then those that do not.

    Parameters
    ----------
    runs
        The runs that stand.
    regimes
        Regime of each of them, shape (n_standing,).
    fallen_X
        Inputs of the others, shape (n_fallen, n_inputs).
    fallen
        What became of each, shape (n_fallen,).

    Raises
    ------
    StudyError
        If the shapes do not fit, or a regime is said both to stand and not to.
    """

    runs: TrainingData
    regimes: Labels
    fallen_X: Array  # noqa: N815 - X as in TrainingData
    fallen: Labels

    def __post_init__(self) -> None:
        regimes, fallen = (np.asarray(each, dtype=np.str_) for each in (self.regimes, self.fallen))
        X = np.asarray(self.fallen_X, dtype=np.float64).reshape(-1, self.runs.n_inputs)
        if regimes.shape != (self.runs.n_points,) or fallen.shape != (len(X),):
            found = (regimes.shape, fallen.shape)
            raise StudyError.at("regimes: shapes", found, f"({self.runs.n_points},) and ({len(X)},)")
        both = set(regimes.tolist()) & set(fallen.tolist())
        if both:
            raise StudyError.at("regimes", min(both), "a regime in which every run has outputs, or none has")
        for name, value in (("regimes", regimes), ("fallen", fallen), ("fallen_X", X)):
            object.__setattr__(self, name, value)

    @classmethod
    def of(
        cls,
        X: ArrayLike,
        Y: ArrayLike,
        regimes: ArrayLike | None = None,
        *,
        dY: ArrayLike | None = None,
        without_outputs: Collection[str] = WITHOUT_OUTPUTS,
        **labels: Any,  # noqa: ANN401 - fields of TrainingData, which types them
    ) -> "RegimeData":
        """Sort rows into those that stand and those that do not.

        Parameters
        ----------
        X, Y, dY
            As for `TrainingData`; the outputs of a run that does not stand are not read.
        regimes
            What became of each run, shape (n_points,). Left out, the rows without a number for each output
            are ``fallen``, the others ``standing``.
        without_outputs
            The regimes in which nothing stands.
        **labels
            Names, units, bounds and so on: further fields of `TrainingData`.

        Examples
        --------
        >>> data = RegimeData.of([[0.0], [1.0], [2.0]], [1.0, 2.0, np.nan], ["taut", "slack", "collapsed"])
        >>> data
        RegimeData(2 of 3 points stand: x1 → y1; 1 collapsed, 1 slack, 1 taut)
        """
        X, Y = np.asarray(X, dtype=np.float64), np.asarray(Y, dtype=np.float64)
        Y = Y[:, None] if Y.ndim == 1 else Y
        known = np.isfinite(Y).all(axis=1)
        if regimes is None:
            regimes = np.where(known, STANDING, FALLEN)
        regimes = np.asarray(regimes, dtype=np.str_)
        if X.ndim != 2 or not len(X) == len(Y) == len(regimes):
            found = (X.shape, Y.shape, regimes.shape)
            raise StudyError.at("regimes: shapes of X, Y and regimes", found, "a row for each run")
        stands = ~np.isin(regimes, list(without_outputs))
        if not stands.any():
            raise StudyError.at("regimes", sorted(set(regimes.tolist())), "some runs that stand")
        labels.setdefault("bounds", np.stack([X.min(axis=0), X.max(axis=0)], axis=1))
        slopes = None if dY is None else np.asarray(dY, dtype=np.float64)[stands]
        runs = TrainingData(X=X[stands], Y=Y[stands], dY=slopes, **labels)
        return cls(runs=runs, regimes=regimes[stands], fallen_X=X[~stands], fallen=regimes[~stands])

    @property
    def n_points(self) -> int:
        """Number of design points, standing or not."""
        return len(self.regimes) + len(self.fallen)

    @property
    def X(self) -> Array:  # noqa: N802 - as in TrainingData
        """Inputs of all design points, shape (n_points, n_inputs)."""
        return np.concatenate([self.runs.X, self.fallen_X])

    @property
    def labels(self) -> Labels:
        """Regime of all design points, shape (n_points,)."""
        return np.concatenate([self.regimes, self.fallen])

    def rows(self, index: ArrayLike) -> "RegimeData":
        """Return the data at the rows of an index array."""
        index = np.asarray(index)
        standing, others = index[index < len(self.regimes)], index[index >= len(self.regimes)]
        others = others - len(self.regimes)
        return RegimeData(
            runs=self.runs.rows(standing),
            regimes=self.regimes[standing],
            fallen_X=self.fallen_X[others],
            fallen=self.fallen[others],
        )

    def select_outputs(self, names: Sequence[str]) -> "RegimeData":
        """Return the data of some outputs, in the order named.

        Raises
        ------
        StudyError
            If there is no such output.
        """
        return RegimeData(
            runs=self.runs.select_outputs(names),
            regimes=self.regimes,
            fallen_X=self.fallen_X,
            fallen=self.fallen,
        )

    def __repr__(self) -> str:
        names, counts = np.unique(self.labels, return_counts=True)
        tally = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))
        return (
            f"RegimeData({len(self.regimes)} of {self.n_points} points stand: "
            f"{', '.join(self.runs.input_names)} → {', '.join(self.runs.output_names)}; {tally})"
        )


def regime_labels(batch: "Batch") -> Labels:
    """Return the regime of each run of a batch, shape (n_runs,).

    ``taut`` or ``slack`` for a run that stands (is certified stable, or has snapped to where it is), else its
    status.

    Examples
    --------
    >>> from tensegra.mechanics import solve_batch
    >>> from tensegra.structure import library
    >>> regime_labels(solve_batch(library.prism(), actuation={"top": [0.0, 0.02]})).tolist()
    ['taut', 'taut']
    """
    status = np.asarray(batch.status, dtype=np.str_)
    standing = np.where(batch.slack.any(axis=1), SLACK, TAUT)
    return np.where(np.isin(status, CERTIFIED), standing, status)


def campaign_runs(campaign: "Campaign") -> RegimeData:
    """Return all runs of a campaign with their regimes.

    Those that the study selects as training data stand; where it has an output of the quantity
    ``slack_cables`` for ``all``, they are told apart as ``taut`` and ``slack``. Runs that failed are left
    out: nobody knows what became of them.

    Raises
    ------
    StudyError
        If no run can be learnt from.
    """
    data = campaign.training_data()
    frame = campaign.frame()
    X = frame[list(data.input_names)].to_numpy(dtype=np.float64)
    status = frame["status"].to_numpy(dtype=np.str_)
    counts = [
        output.name
        for output in campaign.study.outputs
        if output.quantity == "slack_cables" and output.target == "all"
    ]
    labels = np.full(len(X), STANDING, dtype="U16")
    if counts:
        labels = np.where(frame[counts[0]].to_numpy(dtype=np.float64) > 0, SLACK, TAUT)
    label_of = {row.tobytes(): label for row, label in zip(X, labels.tolist(), strict=True)}
    fell = ~np.isin(status, [*CERTIFIED, "failed"])
    return RegimeData(
        runs=data,
        regimes=np.array([label_of[row.tobytes()] for row in data.X]),
        fallen_X=X[fell],
        fallen=status[fell],
    )
