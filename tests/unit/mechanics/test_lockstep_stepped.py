"""The plain procedure in lockstep is the plain procedure alone, bit for bit, wherever a run ends."""

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, Status, solve_batch, solve_path
from tensegra.mechanics.lockstep_solver import LockstepSolver
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
    assert batch.reason[run] == path.reason
    assert (batch.steps[run], batch.iterations[run]) == (final.steps, final.iterations)
    # Newton's method far from an equilibrium is chaotic: equal ends need equal roundings.
    np.testing.assert_allclose(batch.nodes[run], final.nodes, rtol=0, atol=atol)
    np.testing.assert_allclose(batch.tensions[run], final.tensions, rtol=0, atol=atol)
    np.testing.assert_array_equal(batch.slack[run], final.slack)
    np.testing.assert_allclose(batch.residual[run], final.residual, rtol=0, atol=max(1e-15, 1e-3 * atol))
    np.testing.assert_allclose(batch.lowest_eigenvalue[run], final.lowest_eigenvalue, rtol=EIGENVALUE)


@pytest.fixture
def in_lockstep(monkeypatch):
    """Refuse to follow any run alone."""

    def refused(*_):
        raise AssertionError("a run was followed alone")

    monkeypatch.setattr("tensegra.mechanics.block.actuate", refused)


@pytest.mark.usefixtures("in_lockstep")
@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("beam", BEAMS)
def test_a_run_in_lockstep_is_the_run_alone(beam, group):
    structure, actuation = random_runs(beam, group, n_runs=24, seed=3)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED)
    for run in range(batch.n_runs):
        inputs = {name: values[run] for name, values in actuation.items()}
        assert_the_run_is(batch, run, solve_path(structure, inputs, settings=STEPPED))


@pytest.mark.usefixtures("in_lockstep")
def test_every_way_to_end_is_told_as_alone():
    structure, actuation = random_runs("printed", "without gravity", n_runs=200, seed=5)
    batch = solve_batch(structure, actuation=actuation, settings=STEPPED)
    for status in (Status.STABLE, Status.UNSTABLE, Status.COLLAPSED, Status.FAILED):
        runs = np.flatnonzero(batch.status == status)
        assert len(runs)
        inputs = {name: values[runs[0]] for name, values in actuation.items()}
        assert_the_run_is(batch, runs[0], solve_path(structure, inputs, settings=STEPPED))


@pytest.mark.usefixtures("in_lockstep")
def test_prestress_lost_on_the_way_is_told_as_alone(monkeypatch):
    # With the usual threshold Newton's method is almost always done before: a coarse one is met.
    for module in ("stepped", "lockstep_solver"):
        monkeypatch.setattr(f"tensegra.mechanics.{module}.FLAT_TENSION", 0.5)
    beam = library.paper_beam().replace(gravity=(0.0, 0.0, 0.0))
    values = np.array([-0.02, -0.05, -0.10])
    batch = solve_batch(beam, actuation={"A14": values, "A23": -values}, settings=STEPPED)
    assert any("prestress lost at increment" in reason for reason in batch.reason)
    for run, value in enumerate(values):
        assert_the_run_is(batch, run, solve_path(beam, {"A14": value, "A23": -value}, settings=STEPPED))


@pytest.mark.usefixtures("in_lockstep")
def test_varied_structures_loads_and_supports_go_in_lockstep_too():
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


def test_what_lockstep_does_not_serve_is_stepped_alone(monkeypatch):
    structure, actuation = random_runs("printed", "with gravity", n_runs=3, seed=4)
    expected = solve_batch(structure, actuation=actuation, settings=STEPPED)
    monkeypatch.setattr(LockstepSolver, "serves", property(lambda _self: False))
    alone = solve_batch(structure, actuation=actuation, settings=STEPPED)
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(alone, column), getattr(expected, column), err_msg=column)
