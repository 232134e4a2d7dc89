"""The plain procedure: many runs are the runs alone, bit for bit, wherever a run ends; and its words."""

import re

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, Status, solve_batch, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.stepped import farthest_coordinate, n_increments
from tensegra.structure import apply_changes, library

EIGENVALUE = 1e-6
"""Relative: what inverse iteration leaves of the lowest eigenvalue."""

DERIVATIVE = 1e-8
"""Of the largest derivative: both come from one factor of K at the same position."""

SAME = 1e-9
"""Centimetres and kilonewtons: EA of varied structures is a product of other factors than alone."""

STEPPED = PathSettings(path="stepped")
BEAMS = {"printed": library.paper_beam, "slender": library.paper_beam_slender}
GROUPS = {"with gravity": (0.10, ("A14", "A23")), "without gravity": (0.30, ("A1", "A2", "A3", "A4"))}
COLUMNS = ("status", "reason", "nodes", "tensions", "slack", "residual", "steps", "iterations")


def random_runs(beam, group, n_runs, seed):
    largest, actuators = GROUPS[group]
    values = np.random.default_rng(seed).uniform(0.01, largest, (len(actuators), n_runs))
    gravity = [0, 0, -1 if group == "with gravity" else 0]
    return apply_changes(BEAMS[beam](), {"gravity": gravity}), dict(zip(actuators, values, strict=True))


def assert_the_run_is(batch, run, path, atol=0.0):
    final = path.final
    assert batch.status[run] == path.status
    # A single run names its mechanisms too; of many they are told when asked for.
    named = re.sub(r"; \d+ free mechanisms?, .*", "", path.reason)
    assert batch.reason[run] == named
    assert (named != path.reason) == bool(batch.mechanisms(run))
    assert (batch.steps[run], batch.iterations[run]) == (final.steps, final.iterations)
    # Newton's method far from an equilibrium is chaotic: equal ends need equal roundings.
    np.testing.assert_allclose(batch.nodes[run], final.nodes, rtol=0, atol=atol)
    np.testing.assert_allclose(batch.tensions[run], final.tensions, rtol=0, atol=atol)
    np.testing.assert_array_equal(batch.slack[run], final.slack)
    np.testing.assert_allclose(batch.residual[run], final.residual, rtol=0, atol=max(1e-15, 1e-3 * atol))
    np.testing.assert_allclose(batch.lowest_eigenvalue[run], final.lowest_eigenvalue, rtol=EIGENVALUE)


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("beam", BEAMS)
def test_a_run_among_others_is_the_run_alone(beam, group):
    structure, actuation = random_runs(beam, group, n_runs=24, seed=3)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED)
    for run in range(batch.n_runs):
        inputs = {name: values[run] for name, values in actuation.items()}
        assert_the_run_is(batch, run, solve_path(structure, inputs, settings=STEPPED))


def test_every_way_to_end_is_told_as_alone():
    structure, actuation = random_runs("printed", "without gravity", n_runs=200, seed=5)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED)
    for status in (Status.STABLE, Status.UNSTABLE, Status.COLLAPSED, Status.FAILED):
        runs = np.flatnonzero(batch.status == status)
        assert len(runs)
        inputs = {name: values[runs[0]] for name, values in actuation.items()}
        assert_the_run_is(batch, runs[0], solve_path(structure, inputs, settings=STEPPED))


def test_prestress_lost_on_the_way_is_told_as_alone(monkeypatch):
    # With the usual threshold Newton's method is almost always done before: a coarse one is met.
    monkeypatch.setattr("tensegra.mechanics.falls.FLAT_TENSION", 0.5)
    beam = library.paper_beam().replace(gravity=(0.0, 0.0, 0.0))
    values = np.array([-0.02, -0.05, -0.10])
    batch = solve_batch(beam, actuation={"A14": values, "A23": -values}, settings=STEPPED)
    assert any("prestress lost at increment" in reason for reason in batch.reason)
    for run, value in enumerate(values):
        assert_the_run_is(batch, run, solve_path(beam, {"A14": value, "A23": -value}, settings=STEPPED))


def test_varied_structures_loads_and_supports_are_stepped_together_too():
    beam = library.paper_beam()
    rng = np.random.default_rng(0)
    n = 6
    modulus, load, shift = rng.uniform(9000, 13000, n), rng.uniform(-1e-3, 1e-3, n), rng.uniform(-1, 1, n)
    batch = solve_batch(
        beam,
        actuation={"A14": np.full(n, 0.05), "A23": np.full(n, 0.05)},
        loads={("23", "z"): load},
        positions={("1", "z"): shift},
        youngs_modulus={"steel": modulus},
        settings=STEPPED,
    )
    for run in range(n):
        steel = {"materials": {"steel": {"youngs_modulus": modulus[run]}}}
        path = solve_path(
            apply_changes(beam, steel),
            {"A14": 0.05, "A23": 0.05},
            loads={("23", "z"): load[run]},
            positions={("1", "z"): shift[run]},
            settings=STEPPED,
        )
        assert_the_run_is(batch, run, path, atol=SAME)
        np.testing.assert_allclose(batch.start[run], path.stages[-1].nodes, rtol=0, atol=SAME)


@pytest.mark.parametrize("threads", [2, 3])
def test_results_depend_neither_on_the_threads_nor_on_the_order(threads):
    structure, actuation = random_runs("slender", "without gravity", n_runs=37, seed=1)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED, threads=1)
    order = np.random.default_rng(1).permutation(batch.n_runs)
    shuffled = {name: values[order] for name, values in actuation.items()}
    other = solve_batch(structure, actuation=shuffled, settings=STEPPED, threads=threads)
    for column in (*COLUMNS, "lowest_eigenvalue"):
        np.testing.assert_array_equal(getattr(other, column), getattr(batch, column)[order], err_msg=column)


def test_derivatives_are_those_of_the_run_alone():
    structure, actuation = random_runs("printed", "with gravity", n_runs=9, seed=2)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED, derivatives=["A14", "A23"])
    assert "stable" in batch.status
    for run in range(batch.n_runs):
        path = solve_path(structure, {k: v[run] for k, v in actuation.items()}, settings=STEPPED)
        for name in ("A14", "A23"):
            found = batch.derivative(name)
            if not path.final.succeeded:
                assert np.isnan(found.nodes[run]).all()
                continue
            expected = path.derivative(name)
            largest = np.abs(expected.nodes).max()
            np.testing.assert_allclose(found.nodes[run], expected.nodes, rtol=0, atol=DERIVATIVE * largest)


def test_steps_of_the_stepped_procedure_tell_their_own_iterations():
    path = solve_path(library.paper_beam(), {"A14": 0.05, "A23": 0.05}, path="stepped")
    steps = [point for point in path.history if point.stage == "actuation"]
    assert len(steps) == path.final.steps == 5
    assert sum(point.iterations for point in steps) == path.final.iterations
    np.testing.assert_allclose([point.parameter for point in steps], np.arange(1, 6) / 5, rtol=1e-15)


def test_increments_are_counted_by_the_rest_length_that_changes_most():
    rest_length = np.array(
        [[[2.0, 0.0], [1.0, 0.05]], [[2.0, -0.0601], [1.0, 0.03]], [[2.0, 0.0], [1.0, 0.0]]]
    )
    nowhere = np.zeros((2, 3))
    stage = StageInputs(rest_length, nowhere, nowhere, nowhere, nowhere)
    np.testing.assert_array_equal(n_increments(stage, 0.01), [5, 4, 1])
    np.testing.assert_array_equal(n_increments(stage, 0.05), [1, 1, 1])


def test_a_run_is_given_up_where_it_has_left_the_structure():
    arrays = structure_arrays(library.paper_beam())
    assert farthest_coordinate(arrays) > 10.0 * np.abs(arrays.coordinates).max()
