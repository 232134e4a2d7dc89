"""The accuracy that is promised on the source paper's five-variable design, 1,000 runs to learn from."""

import numpy as np
import pytest
from scipy.stats import qmc

from tensegra.mechanics import solve_batch
from tensegra.structure import library
from tensegra.study.data import TrainingData
from tensegra.surrogate import fit

pytestmark = pytest.mark.slow

BOUNDS = np.array([[0.09, 0.10], [0.09, 0.10], [0.0, 150.0], [0.0, 150.0], [0.0, 150.0]])

# Kind, options, and the largest mean relative error (Eq. 7, a fraction) that is promised.
GOALS = {
    "gpr": ("gpr", {}, 2e-8),
    "the paper's network": ("nn", {"training": "two_stage"}, 1e-4),
    "Levenberg–Marquardt": ("nn", {}, 1e-5),
    "pce": ("pce", {}, 2e-9),
}


@pytest.fixture(scope="module")
def beam():
    X = qmc.scale(qmc.Sobol(5, seed=1).random(4096)[:3500], *BOUNDS.T)
    runs = solve_batch(
        library.paper_beam(),
        actuation={"A14": X[:, 0], "A23": X[:, 1]},
        temperature={"top": X[:, 2], "middle": X[:, 3], "bottom": X[:, 4]},
    )
    Y = np.stack([runs.displacement(axis, nodes=[23]) for axis in "yz"], axis=1)
    return TrainingData(X=X, Y=Y, bounds=BOUNDS, output_names=("v", "w"))


@pytest.mark.parametrize("goal", GOALS.values(), ids=GOALS)
def test_goal(beam, goal):
    kind, options, largest = goal
    surrogate = fit(beam.rows(np.arange(1000)), kind, validation=beam.rows(np.arange(1000, 3500)), **options)
    assert max(surrogate.validation.relative_error) <= largest
    assert min(surrogate.validation.r2) > 0.9999
