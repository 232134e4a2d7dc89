"""Designs in blocks of runs, asked of a model in chunks: one failed run spoils its whole block."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.inputs import RandomInputs
from tensegra.analysis.model import Model

Array = NDArray[np.float64]

CHUNK = 4096


@dataclass(frozen=True)
class BlockRuns:
    """What a model says of a design whose rows are blocks of equal length.

    Attributes
    ----------
    values
        Outputs, shape (n_runs, n_outputs).
    kept
        Which blocks have no failed run, shape (n_blocks,).
    n_failed
        Number of failed runs.
    statuses
        Runs by status.
    """

    values: Array
    kept: NDArray[np.bool_]
    n_failed: int
    statuses: dict[str, int]


def ask_blocks(
    model: Model,
    columns: Sequence[int],
    U: Array,
    inputs: Callable[[Array], Array],
    n_blocks: int,
    *,
    chunk: int,
    progress: Callable[[int, int], None] | None,
) -> BlockRuns:
    """Ask a model for some of its outputs at the points of a design.

    Parameters
    ----------
    model, columns
        Who is asked, and for which of its outputs.
    U
        The design in the unit cube, blocks one after the other, shape (n_runs, n_dimensions).
    inputs
        Returns the model's inputs for points of the cube.
    n_blocks
        Number of blocks.
    chunk, progress
        Runs that are asked at once; called with (runs done, in all).
    """
    values, valid = np.empty((len(U), len(columns))), np.empty(len(U), dtype=bool)
    statuses: dict[str, int] = {}
    for start in range(0, len(U), chunk):
        rows = slice(start, start + chunk)
        answer = model.evaluate(inputs(U[rows]))
        values[rows], valid[rows] = answer.values[:, columns], answer.valid
        for status, count in answer.tally().items():
            statuses[status] = statuses.get(status, 0) + count
        if progress is not None:
            progress(min(start + chunk, len(U)), len(U))
    kept = np.asarray(valid.reshape(n_blocks, -1).all(axis=1))
    return BlockRuns(values, kept, int((~valid).sum()), statuses)


def unit_cube(laws: RandomInputs) -> dict[str, Any]:
    """Describe the unit cube to SALib; the laws are applied afterwards, by our own quantile functions."""
    d = laws.n_dimensions
    return {"num_vars": d, "names": list(laws.independent), "bounds": [[0.0, 1.0]] * d}
