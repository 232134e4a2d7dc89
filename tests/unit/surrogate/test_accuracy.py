"""The accuracy that is promised: on the source paper's five-variable design, and across regimes."""

import numpy as np
import pytest
from scipy.stats import qmc

from tensegra.mechanics import solve_batch
from tensegra.structure import apply_changes, library
from tensegra.study.data import TrainingData
from tensegra.surrogate import RegimeData, fit, regime_labels

pytestmark = pytest.mark.slow

BOUNDS = np.array([[0.09, 0.10], [0.09, 0.10], [0.0, 150.0], [0.0, 150.0], [0.0, 150.0]])

# Kind, options, and the largest mean relative error (Eq. 7, a fraction) that is promised.
GOALS = {
    "gpr": ("gpr", {}, 2e-8),
    "the paper's network": ("nn", {"training": "two_stage"}, 1e-4),
    "Levenberg–Marquardt": ("nn", {}, 1e-5),
    "pce": ("pce", {}, 2e-9),
}


INPUTS = {
    "A14": "actuation",
    "A23": "actuation",
    "top": "temperature",
    "middle": "temperature",
    "bottom": "temperature",
}

# Without gravity and over [0, 30] % of three actuators, 16,384 runs (a sixth of what the goals allow): mean
# error over mean displacement, and the share of outcomes predicted right.
TAUT, STANDING, OUTCOME = 5e-5, 5e-4, 0.99


@pytest.fixture(scope="module")
def beam():
    X = qmc.scale(qmc.Sobol(5, seed=1).random(4096)[:3500], *BOUNDS.T)
    given = {"actuation": {}, "temperature": {}}
    for (name, kind), values in zip(INPUTS.items(), X.T, strict=True):
        given[kind][name] = values
    runs = solve_batch(library.paper_beam(), **given)
    tip = runs.node_ids.index("23")
    slopes = [runs.derivative(name, kind).nodes[:, tip, 1:] for name, kind in INPUTS.items()]
    return TrainingData(
        X=X,
        Y=runs.displacements[:, tip, 1:],
        dY=np.stack(slopes, axis=2),
        bounds=BOUNDS,
        output_names=("v", "w"),
    )


@pytest.mark.parametrize("goal", GOALS.values(), ids=GOALS)
def test_goal(beam, goal):
    kind, options, largest = goal
    own = {} if kind == "gpr" else {"derivatives": False}
    surrogate = fit(
        beam.rows(np.arange(1000)), kind, validation=beam.rows(np.arange(1000, 3500)), **own, **options
    )
    assert max(surrogate.validation.relative_error) <= largest
    assert min(surrogate.validation.r2) > 0.9999


@pytest.mark.parametrize("kind", ["pce", "nn"])
def test_derivatives_of_100_runs_do_better_than_400_runs_without(beam, kind):
    held_out = beam.rows(np.arange(1000, 3500))
    errors = {
        (n, derivatives): max(
            fit(
                beam.rows(np.arange(n)), kind, validation=held_out, derivatives=derivatives
            ).validation.relative_error
        )
        for n, derivatives in ((100, True), (400, False))
    }
    assert errors[100, True] < errors[400, False]


def test_it_knows_where_not_to_answer():
    beam = apply_changes(library.paper_beam(), {"gravity": [0, 0, 0]})

    def runs(n, seed):
        X = 0.3 * qmc.Sobol(3, seed=seed).random(n)
        batch = solve_batch(beam, actuation=dict(zip(("A1", "A23", "A4"), X.T, strict=True)))
        w = batch.displacement("z", nodes=["18", "23"])
        return RegimeData.of(X, w, regime_labels(batch), bounds=[[0, 0.3]] * 3, output_names=("w",))

    held_out = runs(4096, 77)
    surrogate = fit(runs(16384, 3), "piecewise", validation=held_out)
    assert surrogate.validation.outcome_right >= OUTCOME
    assert surrogate.validation.error <= STANDING
    Y, regime = surrogate.predict(held_out.runs.X, return_regime=True)
    taut = (held_out.regimes == "taut") & (regime == "taut")
    true = held_out.runs.Y[taut]
    assert np.abs(Y[taut] - true).mean() <= TAUT * np.abs(true).mean()
