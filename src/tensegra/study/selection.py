"""Selection of the runs to learn from: the paper's clustering beside the solver's certificate."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tensegra.study.entry import Count, Entry, Number

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CERTIFIED", "NO_GROUP", "Selection", "SelectionEntry", "select"]

CERTIFIED = ("stable", "snapped")
"""Statuses of an equilibrium that stands."""

NO_GROUP = -1
"""Label of a run that belongs to no group: HDBSCAN's noise, and runs without outputs."""

MERGE_DISTANCE = 0.5
"""In standard deviations. HDBSCAN by itself splits a single cloud too, for it is made to find groups: of
2,048 stable runs of the paper's beam at 9 to 10 % its largest group held 1,117, with this merging 2,048.
Collapsed and irregular shapes lie whole standard deviations away."""

LEAST_SHARE = 0.5
"""A largest group that holds less of the certified runs than this is not the bulk that the paper means
(98 % of its runs) but a chance fragment."""


class SelectionEntry(Entry):
    """How a study selects its training data.

    ``hdbscan`` keeps the largest group of the outputs, ``status`` every run that the solver certifies.
    Groups nearer than `merge_distance`, in standard deviations of the outputs, count as one; with 0 it
    is HDBSCAN as the paper has it.
    """

    method: Literal["hdbscan", "status"] = "status"
    min_cluster_size: Annotated[Count, Field(ge=2)] = 40
    merge_distance: Annotated[Number, Field(ge=0)] = MERGE_DISTANCE


@dataclass(frozen=True, eq=False)
class Selection:
    """Which runs to learn from, and how the two opinions on them agree.

    Attributes
    ----------
    labels
        Group of each run, shape (n_runs,); the largest is 0, the next 1, and so on, `NO_GROUP` for a
        run in no group.
    keep
        Whether to learn from a run, shape (n_runs,): in the largest group and certified.
    table
        Agreement: a row for each status, the number of runs in the largest group, in other groups, in
        none.
    note
        What a reader of the result should know; empty if all went as meant.
    """

    labels: NDArray[np.int64]
    keep: NDArray[np.bool_]
    table: "pd.DataFrame"
    note: str = ""

    @property
    def n_kept(self) -> int:
        """Number of runs to learn from."""
        return int(self.keep.sum())


def select(
    frame: "pd.DataFrame",
    outputs: Sequence[str],
    *,
    method: Literal["hdbscan", "status"] = "hdbscan",
    min_cluster_size: int = 40,
    merge_distance: float = MERGE_DISTANCE,
    statuses: Sequence[str] = CERTIFIED,
) -> Selection:
    """Select the runs to learn from.

    The paper (Appendix B) clusters the outputs of all runs by HDBSCAN (Campello, Moulavi and Sander,
    *PAKDD* 2013, 160-172) with groups of at least 40 and keeps the largest. The solver's status says
    the same with a proof; the table sets the two side by side.

    Parameters
    ----------
    frame
        Runs as `Campaign.frame` returns them: the columns `outputs` and ``status``.
    outputs
        The outputs to cluster, each standardised to mean 0 and standard deviation 1.
    method
        ``hdbscan``, or ``status`` for the certificate alone.
    min_cluster_size
        Smallest group.
    merge_distance
        Groups nearer than this, in standard deviations, count as one; 0 for HDBSCAN as it is.
    statuses
        The statuses that certify a run.

    Returns
    -------
    Selection
        Labels, mask and table.

    Examples
    --------
    >>> import pandas as pd
    >>> runs = pd.DataFrame({"w": [1.0, None, 1.1], "status": ["stable", "failed", "snapped"]})
    >>> select(runs, ["w"], method="status").keep
    array([ True, False,  True])
    """
    Y = frame[list(outputs)].to_numpy(dtype=np.float64)
    has_outputs = np.isfinite(Y).all(axis=1)
    certified = has_outputs & frame["status"].isin(list(statuses)).to_numpy()
    labels = np.where(has_outputs, 0, NO_GROUP).astype(np.int64)
    if method == "status":
        return Selection(labels, certified, _agreement(frame, labels))

    note = ""
    if has_outputs.sum() > min_cluster_size:
        labels[has_outputs] = _groups(Y[has_outputs], min_cluster_size, merge_distance)
    keep = certified & (labels == 0)
    if keep.sum() < LEAST_SHARE * certified.sum():
        note = (
            f"HDBSCAN found no group that stands out: the largest holds {keep.sum()} of {certified.sum()} "
            "certified runs. All certified runs are kept"
        )
        keep = certified
    return Selection(labels, keep, _agreement(frame, labels), note)


def _groups(Y: NDArray[np.float64], min_cluster_size: int, merge_distance: float) -> NDArray[np.int64]:
    """Cluster the standardised outputs; groups are numbered by size, the largest 0."""
    scale = Y.std(axis=0)
    found = _hdbscan_labels(
        (Y - Y.mean(axis=0)) / np.where(scale > 0, scale, 1.0), min_cluster_size, merge_distance
    )
    names, sizes = np.unique(found[found != NO_GROUP], return_counts=True)
    by_size = names[np.argsort(-sizes, kind="stable")]
    number = {int(name): i for i, name in enumerate(by_size)} | {NO_GROUP: NO_GROUP}
    return np.array([number[int(name)] for name in found], dtype=np.int64)


def _hdbscan_labels(
    Z: NDArray[np.float64], min_cluster_size: int, merge_distance: float
) -> NDArray[np.int64]:
    import warnings

    with warnings.catch_warnings():
        # hdbscan 0.8 has invalid escapes in its docstrings (Python 3.12 warns when it compiles them).
        warnings.simplefilter("ignore", SyntaxWarning)
        # It passes scikit-learn's old names of arguments, and joblib's.
        warnings.simplefilter("ignore", FutureWarning)
        warnings.simplefilter("ignore", DeprecationWarning)
        from hdbscan import HDBSCAN

        clusterer = HDBSCAN(
            min_cluster_size=min_cluster_size,
            cluster_selection_epsilon=merge_distance,
            # Merging may leave one group, which HDBSCAN by itself would not accept.
            allow_single_cluster=merge_distance > 0,
            core_dist_n_jobs=1,
        )
        return np.asarray(clusterer.fit_predict(Z), dtype=np.int64)


def _agreement(frame: "pd.DataFrame", labels: NDArray[np.int64]) -> "pd.DataFrame":
    import pandas as pd

    groups = np.select([labels == 0, labels > 0], ["largest group", "other groups"], "no group")
    table = pd.crosstab(frame["status"].to_numpy(), groups, rownames=["status"])
    columns = pd.Index(["largest group", "other groups", "no group"])
    return table.reindex(columns=columns, fill_value=0)
