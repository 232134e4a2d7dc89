"""A stand-in for the batch solver: same arguments, same result, mathematics that tests can check.

Every node moves along z by 100 times the sum of all inputs, along y by ten times it, and every member
carries the sum as its tension. A run whose first input lies above `FAILS_ABOVE` fails.
"""

import time

import numpy as np

from tensegra.mechanics import Batch
from tensegra.mechanics.inputs import Actuation
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.stages import ground_of
from tensegra.mechanics.variants import Variants

FAILS_ABOVE = 0.098
SECONDS_PER_BATCH = 0.0


def solve(structure, **inputs):
    columns = [np.asarray(column) for group in inputs.values() for column in group.values()]
    total = np.sum(columns, axis=0)
    n = len(total)
    failed = columns[0] > FAILS_ABOVE
    moves = np.zeros((n, structure.n_nodes, 3))
    moves[:, :, 1], moves[:, :, 2] = 10 * total[:, None], 100 * total[:, None]
    moves[failed] = np.nan
    tensions = np.repeat(total[:, None], structure.n_members, axis=1)
    tensions[failed] = np.nan
    time.sleep(SECONDS_PER_BATCH)
    return Batch(
        structure=structure,
        status=np.where(failed, "failed", np.where(total > 0.18, "snapped", "stable")),
        reason=np.where(failed, "no equilibrium was found", "").astype(object),
        nodes=structure.coordinates + moves,
        start=structure.coordinates[None],
        tensions=tensions,
        slack=tensions < 0,
        residual=np.where(failed, np.nan, 1e-12),
        lowest_eigenvalue=np.where(failed, np.nan, 0.02),
        steps=np.full(n, 4),
        iterations=np.full(n, 12),
        parameter=np.ones(n),
        seconds=np.full(n, 1e-3),
        nodes_by=np.zeros((n, 0, structure.n_nodes, 3)),
        tensions_by=np.zeros((n, 0, structure.n_members)),
        inputs=Actuation({}, {}, {}, {}),
        variants=Variants({}, {}, {}),
        ground=ground_of(structure, PathSettings()),
    )


def solve_slowly(structure, **inputs):
    """Give a test the time to kill a process between two blocks."""
    time.sleep(0.02)
    return solve(structure, **inputs)
