"""Selection of the runs to learn from: the solver's certificate, and the paper's clustering beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from tensegra.study.entry import Count, Entry, Examples

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["CERTIFIED", "NO_GROUP", "Selection", "SelectionEntry", "select"]

CERTIFIED = ("stable", "snapped")
"""Statuses of an equilibrium that stands."""

NO_GROUP = -1
"""Label of a run that belongs to no group: HDBSCAN's noise, and runs without outputs."""

Method: TypeAlias = Literal["certificate", "hdbscan", "both"]

RULES: dict[Method, str] = {
    "certificate": "certified by the solver",
    "hdbscan": "in the largest group that HDBSCAN finds in the outputs",
    "both": "certified by the solver and in the largest group that HDBSCAN finds in the outputs",
}
"""What the runs kept by each method are."""


class SelectionEntry(Entry):
    """How a study selects its training data.

    ``certificate`` keeps every run that the solver certifies, ``hdbscan`` the largest group of the
    outputs, which is the paper's rule, ``both`` the runs that satisfy both.
    """

    examples: ClassVar[Examples] = ({"method": "both", "min_cluster_size": 40},)

    method: Method = "certificate"
    """`certificate` keeps every run that the solver certifies, `hdbscan` the largest group of the outputs,
    `both` the runs that satisfy both."""
    min_cluster_size: Annotated[Count, Field(ge=2)] = 40
    """Smallest group that HDBSCAN looks for. [1]"""


@dataclass(frozen=True, eq=False)
class Selection:
    """Which runs to learn from, and how the two opinions on them agree.

    Attributes
    ----------
    labels
        Group of each run, shape (n_runs,); the largest is 0, the next 1, and so on, `NO_GROUP` for a
        run in no group.
    keep
        Whether to learn from a run, shape (n_runs,).
    table
        Agreement: a row for each status, the number of runs in the largest group, in other groups, in
        none.
    rule
        What the runs kept are, in words.
    note
        How many runs are judged otherwise than the solver does; empty if none is.
    """

    labels: NDArray[np.int64]
    keep: NDArray[np.bool_]
    table: "pd.DataFrame"
    rule: str = RULES["certificate"]
    note: str = ""

    @property
    def n_kept(self) -> int:
        """Number of runs to learn from."""
        return int(self.keep.sum())


def select(
    frame: "pd.DataFrame",
    outputs: Sequence[str],
    *,
    method: Method = "certificate",
    min_cluster_size: int = 40,
    statuses: Sequence[str] = CERTIFIED,
    compare: bool = True,
) -> Selection:
    """Select the runs to learn from.

    The paper (Appendix B) clusters the outputs of all runs by HDBSCAN (Campello, Moulavi and Sander,
    *PAKDD* 2013, 160-172) with groups of at least 40, takes the largest for the viable runs and the
    rest for failures. It has to, for its solver gives no certificate. Ours does, and so the solver's
    word is the rule here: HDBSCAN looks for gaps and dense regions, calls the thin rim of a single
    cloud noise and may cut the cloud in two, and none of that is a fault of a run (of 1,024 runs of
    the beam at 9 to 10 %, all stable, the largest group holds 162; of 16,384 at 1 to 10 %, 15,883).
    The paper's rule stands beside it, to reproduce the paper and to show where the two differ.

    Parameters
    ----------
    frame
        Runs as `Campaign.frame` returns them: the columns `outputs` and ``status``.
    outputs
        The outputs to cluster, each standardised to mean 0 and standard deviation 1.
    method
        ``certificate`` keeps the runs with one of the `statuses`; ``hdbscan`` the largest group,
        whatever their status; ``both`` the runs that satisfy both.
    min_cluster_size
        Smallest group.
    statuses
        The statuses that certify a run.
    compare
        Whether to cluster the outputs even if the method does not need it, for labels and table.

    Returns
    -------
    Selection
        Labels, mask and table.

    Examples
    --------
    >>> import pandas as pd
    >>> runs = pd.DataFrame({"w": [1.0, None, 1.1], "status": ["stable", "failed", "snapped"]})
    >>> select(runs, ["w"]).keep
    array([ True, False,  True])
    """
    Y = frame[list(outputs)].to_numpy(dtype=np.float64)
    has_outputs = np.isfinite(Y).all(axis=1)
    certified = has_outputs & frame["status"].isin(list(statuses)).to_numpy()
    labels = np.where(has_outputs, 0, NO_GROUP).astype(np.int64)
    # Fewer runs than a group needs are one.
    if (compare or method != "certificate") and has_outputs.sum() > min_cluster_size:
        labels[has_outputs] = _groups(Y[has_outputs], min_cluster_size)
    keep = {"certificate": certified, "hdbscan": labels == 0, "both": certified & (labels == 0)}[method]
    return Selection(labels, keep, _agreement(frame, labels), RULES[method], _note(certified, keep))


def _note(certified: NDArray[np.bool_], keep: NDArray[np.bool_]) -> str:
    """Say how many runs are judged otherwise than the solver does."""
    lost, doubtful = int((certified & ~keep).sum()), int((keep & ~certified).sum())
    parts = [f"{lost} of {certified.sum()} certified runs are left out"] if lost else []
    parts += [f"{doubtful} of the {keep.sum()} runs kept are not certified"] if doubtful else []
    return "; ".join(parts)


def _groups(Y: NDArray[np.float64], min_cluster_size: int) -> NDArray[np.int64]:
    """Cluster the standardised outputs; groups are numbered by size, the largest 0."""
    scale = Y.std(axis=0)
    found = _hdbscan_labels((Y - Y.mean(axis=0)) / np.where(scale > 0, scale, 1.0), min_cluster_size)
    names, sizes = np.unique(found[found != NO_GROUP], return_counts=True)
    number = np.full(len(names) + 1, NO_GROUP)
    number[names[np.argsort(-sizes, kind="stable")]] = np.arange(len(names))
    return number[found].astype(np.int64)


def _hdbscan_labels(Z: NDArray[np.float64], min_cluster_size: int) -> NDArray[np.int64]:
    import warnings

    with warnings.catch_warnings():
        # hdbscan 0.8 has invalid escapes in its docstrings (Python 3.12 warns when it compiles them).
        warnings.simplefilter("ignore", SyntaxWarning)
        # It passes scikit-learn's old names of arguments, and joblib's.
        warnings.simplefilter("ignore", FutureWarning)
        warnings.simplefilter("ignore", DeprecationWarning)
        from hdbscan import HDBSCAN

        clusterer = HDBSCAN(min_cluster_size=min_cluster_size, core_dist_n_jobs=1)
        return np.asarray(clusterer.fit_predict(Z), dtype=np.int64)


def _agreement(frame: "pd.DataFrame", labels: NDArray[np.int64]) -> "pd.DataFrame":
    import pandas as pd

    groups = np.select([labels == 0, labels > 0], ["largest group", "other groups"], "no group")
    table = pd.crosstab(frame["status"].to_numpy(), groups, rownames=["status"])
    columns = pd.Index(["largest group", "other groups", "no group"])
    return table.reindex(columns=columns, fill_value=0)
