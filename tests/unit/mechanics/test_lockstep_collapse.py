"""Runs that lose their prestress, in lockstep: where the branch ends, and where they come to rest."""

import re

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, Status, block, solve_batch, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.equilibrium import ZERO_EIGENVALUE, descend, unbalanced
from tensegra.mechanics.lockstep_data import FLAT, NOT_DEFINITE, STANDS
from tensegra.mechanics.lockstep_ends import Ending
from tensegra.mechanics.lockstep_solver import LockstepSolver
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import apply_changes, library

RESIDUAL = 1e-9
"""What is promised of every result."""

LOCATED = 1.01e-4
"""Of the stage: a reason tells where in per cent, to four digits."""

MOST_ALONE = 0.1
"""Share of the collapsing runs that may still need to be followed alone."""

ACTUATORS = ("A1", "A2", "A3", "A4")
BEAMS = {"printed": library.paper_beam, "slender": library.paper_beam_slender}


def collapsing(beam, n_runs, seed=0):
    """Actuations of the beam without gravity, drawn until that many collapse, with their batch."""
    structure = apply_changes(BEAMS[beam](), {"gravity": [0, 0, 0]})
    values = np.random.default_rng(seed).uniform(0.01, 0.30, (len(ACTUATORS), 20 * n_runs))
    batch = solve_batch(structure, actuation=dict(zip(ACTUATORS, values, strict=True)))
    runs = np.flatnonzero(batch.status == Status.COLLAPSED)[:n_runs]
    assert len(runs) == n_runs
    return structure, dict(zip(ACTUATORS, values[:, runs], strict=True))


def located(reason):
    return float(re.search(r"collapse at ([\d.]+) % of stage 'actuation'", reason)[1]) / 100.0


@pytest.fixture(scope="module", params=BEAMS)
def case(request):
    return collapsing(request.param, n_runs=12)


def test_collapsing_runs_end_as_they_do_alone(case):
    structure, actuation = case
    batch = solve_batch(structure, actuation=actuation)
    for run in range(batch.n_runs):
        path = solve_path(structure, {name: values[run] for name, values in actuation.items()})
        assert batch.status[run] == path.status == Status.COLLAPSED
        assert located(batch.reason[run]) == pytest.approx(located(path.reason), abs=LOCATED)


def test_where_they_come_to_rest_is_a_neutral_equilibrium(case):
    structure, actuation = case
    batch = solve_batch(structure, actuation=actuation)
    assert np.all(batch.status == Status.COLLAPSED)
    assert batch.residual.max() <= RESIDUAL
    tangent = Tangent(structure_arrays(structure))
    for run in range(batch.n_runs):
        path = solve_path(structure, {name: values[run] for name, values in actuation.items()})
        _, residual = unbalanced(tangent, batch.nodes[run], path.load)
        assert residual <= RESIDUAL
        values = np.linalg.eigvalsh(tangent.matrix())
        zero = ZERO_EIGENVALUE * tangent.stiffness_scale
        assert values[0] > -zero
        assert values[0] == pytest.approx(batch.lowest_eigenvalue[run], abs=zero)
        n_free = int(re.search(r"(\d+) free mechanisms", batch.reason[run])[1])
        assert n_free == np.sum(np.abs(values) < 100.0 * zero)  # as `stability.SINGULAR` counts
        np.testing.assert_array_equal(batch.tensions[run], tangent.tension)


def test_hardly_any_of_them_is_followed_alone(case, monkeypatch):
    structure, actuation = case
    followed = []
    actuate = block.actuate
    monkeypatch.setattr(block, "actuate", lambda *run: followed.append(run) or actuate(*run))
    batch = solve_batch(structure, actuation=actuation)
    assert len(followed) <= np.ceil(MOST_ALONE * batch.n_runs)


@pytest.mark.parametrize("policy", ["stop", "trace"])
def test_other_policies_are_followed_alone(case, policy):
    structure, actuation = case
    few = {name: values[:2] for name, values in actuation.items()}
    batch = solve_batch(structure, actuation=few, policy=policy)
    for run in range(2):
        path = solve_path(structure, {name: values[run] for name, values in few.items()}, policy=policy)
        assert (batch.status[run], batch.reason[run]) == (path.status, path.reason)
        assert path.status != Status.COLLAPSED


def test_settings_of_the_steps_are_obeyed(case):
    structure, actuation = case
    few = {name: values[:2] for name, values in actuation.items()}
    coarse = solve_batch(structure, actuation=few, settings=PathSettings(smallest_step=1e-3))
    fine = solve_batch(structure, actuation=few)
    for run in range(2):
        assert located(fine.reason[run]) - 3e-3 < located(coarse.reason[run]) <= located(fine.reason[run])
        assert coarse.steps[run] < fine.steps[run]


def test_a_singular_stiffness_does_not_stand_whatever_its_pivots_say():
    # All pivots of K are positive here, some by nothing but rounding: it was told as a snap.
    beam = apply_changes(library.paper_beam_slender(), {"gravity": [0, 0, 0]})
    inputs = {"A1": 0.05666222974254652, "A2": 0.09579054394954681, "A3": 0.2237369768635662}
    path = solve_path(beam, {**inputs, "A4": 0.06163305685642937})
    assert path.status is Status.COLLAPSED


@pytest.fixture
def falls():
    """Return runs on the way to a collapse, and what lets them fall at any point of it."""
    structure = apply_changes(library.paper_beam(), {"gravity": [0, 0, 0]})
    kept = []

    class Recorded(Ending):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            kept.append(self)

    patch = pytest.MonkeyPatch()
    patch.setattr(block, "Ending", Recorded)
    solve_batch(structure, actuation={"A14": [-0.10, -0.05], "A23": [0.10, 0.05]})
    patch.undo()
    (ending,) = kept
    tangent = ending.tangent
    modes = np.zeros((3, tangent.arrays.n_nodes, 3))
    return ending, LockstepSolver(tangent.arrays, tangent.pattern, modes, threads=1)


@pytest.mark.parametrize("parameter", [0.0, 0.02, 0.6, 1.0])
def test_a_fall_in_lockstep_is_the_fall_alone(falls, parameter):
    ending, solver = falls
    arrays = ending.tangent.arrays
    start = np.array([arrays.coordinates, arrays.coordinates])
    which = np.array([1, 0, 1])
    nodes = start[which] + np.random.default_rng(1).uniform(-1.0, 1.0, (3, arrays.n_nodes, 3)) * arrays.free
    bounds = {"largest_move": 0.02 * arrays.size}
    fallen = solver.fall(ending.stage, start, 2, which, nodes, np.full(3, parameter), np.zeros(3), **bounds)
    assert np.isin(fallen.done, (STANDS, NOT_DEFINITE, FLAT)).all()
    for q, run in enumerate(which):
        load = ending.load(run, parameter)
        alone = descend(ending.tangent, nodes[q], load, reference_tension=0.0, **bounds)
        assert alone.converged
        neutral = ending.is_neutral(run, fallen.nodes[q], parameter)
        assert neutral == alone.neutral
        _, residual = unbalanced(ending.tangent, fallen.nodes[q].reshape(-1, 3), load)
        assert residual <= RESIDUAL
        if not neutral:
            assert fallen.done[q] == STANDS
            np.testing.assert_allclose(
                fallen.nodes[q], alone.nodes.reshape(-1), rtol=0, atol=1e-6 * arrays.size
            )
