"""The paper's selection of runs: groups of the outputs of stepped runs, the largest of which is kept."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.study import select
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.models import lift_runs
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["OUTPUTS", "PRINTED_GROUPS", "Groups", "run_table", "stepped_groups"]

Mask: TypeAlias = NDArray[np.bool_]

OUTPUTS = ("u", "v", "w")
"""What the publication's q of Eq. 10 holds."""

PRINTED_GROUPS = ("v", "w")
"""Outputs whose groups are as many as printed; which were clustered is not said."""


@dataclass(frozen=True, eq=False)
class Groups:
    """What HDBSCAN made of some outputs of runs.

    Attributes
    ----------
    outputs
        What was clustered.
    labels
        Group of each run, the largest 0, −1 for noise and for runs without outputs, shape (n_runs,).
    keep
        Whether a run is in the largest group, shape (n_runs,).
    seconds
        Time that it took.
    """

    outputs: tuple[str, ...]
    labels: NDArray[np.int64]
    keep: Mask
    seconds: float

    @property
    def name(self) -> str:
        """The outputs in brackets."""
        return f"({', '.join(self.outputs)})"

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return int(self.labels.max()) + 1

    def counts(self, stands: Mask) -> tuple[int, int, int]:
        """Return the numbers of runs kept, of these that do not stand, and of others that stand.

        Examples
        --------
        >>> keep, stands = np.array([True, True, False, False]), np.array([True, False, True, False])
        >>> Groups(("w",), np.array([0, 0, 1, -1]), keep, 0.0).counts(stands)
        (2, 1, 1)
        """
        return int(self.keep.sum()), int((self.keep & ~stands).sum()), int((~self.keep & stands).sum())


def run_table(runs: BeamRuns) -> "pd.DataFrame":
    """Return inputs, outputs and statuses as selections and figures take them."""
    import pandas as pd

    outputs = runs.tip.mean(axis=1)
    columns = dict(runs.inputs) | dict(zip(OUTPUTS, outputs.T, strict=True))
    return pd.DataFrame({**columns, "status": runs.status})


def stepped_groups(setting: Setting, outputs: Sequence[str], first: int | None = None) -> Groups:
    """Cluster outputs of the stepped runs by HDBSCAN, as in Appendix B, now or before.

    The smallest group has 40 runs, runs that did not converge count as noise, and outputs are standardised,
    of which the publication says nothing. `first` is the number of runs that are clustered, all if left out.
    """
    size = int(published("selection", "min_cluster_size"))

    def make() -> dict[str, NDArray[Any]]:
        runs = lift_runs(setting, stepped=True)
        began = perf_counter()
        found = select(run_table(runs).iloc[:first], list(outputs), method="hdbscan", min_cluster_size=size)
        return {"labels": found.labels, "keep": found.keep, "seconds": np.array(perf_counter() - began)}

    kept = setting.kept(f"groups-{''.join(outputs)}", [list(outputs), size, first], make)
    return Groups(tuple(outputs), kept["labels"], kept["keep"], float(kept["seconds"]))
