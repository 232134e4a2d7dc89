"""What stops a run is told: runs that lose their prestress, where their branch ends and where they rest."""

import re
from dataclasses import replace

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, Status, solve_batch, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.falls import FLAT_TENSION
from tensegra.mechanics.kernels import ZERO_EIGENVALUE
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Member, Structure, apply_changes, library

RESIDUAL = 1e-9
"""What is promised of every result."""

LOCATED = 1.01e-4
"""Of the stage: a reason tells where in per cent, to four digits."""

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
        _, residual = tangent.measure(batch.nodes[run], path.load)
        assert residual <= RESIDUAL
        values = np.linalg.eigvalsh(tangent.matrix())
        zero = ZERO_EIGENVALUE * tangent.stiffness_scale
        assert values[0] > -zero
        assert values[0] == pytest.approx(batch.lowest_eigenvalue[run], abs=zero)
        n_free = len(batch.mechanisms(run))
        assert f"; {n_free} free mechanism" in path.reason
        assert n_free == np.sum(np.abs(values) < 100.0 * zero)  # as `stability.SINGULAR` counts
        # What is left of the prestress is rounding, and told as nothing.
        flat = FLAT_TENSION * np.abs(path.stages[-1].tensions).max()
        told = np.where(np.abs(tangent.tension) <= flat, 0.0, tangent.tension)
        np.testing.assert_array_equal(batch.tensions[run], told)


@pytest.mark.parametrize("policy", ["stop", "trace"])
def test_other_policies_are_those_of_the_run_alone(case, policy):
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
        assert coarse.steps[run] <= fine.steps[run]


def test_a_fold_is_located_as_finely_as_is_asked_for():
    truss = library.von_mises_truss()
    top = next(node for node in truss.nodes if truss.supports.get(node) != "xyz")
    limit = next(
        load
        for load in -np.logspace(0, 12, 60)
        if solve_path(truss, loads={(top, "z"): load}).critical_points
    )
    ends = {}
    for smallest in (1e-2, 1e-7):
        path = solve_path(truss, loads={(top, "z"): limit}, settings=PathSettings(smallest_step=smallest))
        ends[smallest] = path.critical_points[0].parameter, path.final.steps
    assert ends[1e-2][0] < ends[1e-7][0] < ends[1e-2][0] + 2e-2
    assert ends[1e-2][1] < ends[1e-7][1]


def test_a_singular_stiffness_does_not_stand_whatever_its_pivots_say():
    # All pivots of K are positive here, some by nothing but rounding: it was told as a snap.
    beam = apply_changes(library.paper_beam_slender(), {"gravity": [0, 0, 0]})
    inputs = {"A1": 0.05666222974254652, "A2": 0.09579054394954681, "A3": 0.2237369768635662}
    path = solve_path(beam, {**inputs, "A4": 0.06163305685642937})
    assert path.status is Status.COLLAPSED


def two_prisms(supports):
    """Hang a prism on a node of another."""
    prism = library.prism()
    low, high = (
        min(prism.nodes, key=lambda n: prism.nodes[n][2]),
        max(prism.nodes, key=lambda n: prism.nodes[n][2]),
    )
    away = np.subtract(prism.nodes[high], prism.nodes[low])
    name = {node: high if node == low else f"q{node}" for node in prism.nodes}
    nodes = {name[node]: tuple(np.add(at, away)) for node, at in prism.nodes.items()} | dict(prism.nodes)
    members = {e: replace(member, groups=()) for e, member in prism.members.items()}
    members |= {
        f"q{e}": replace(member, nodes=tuple(name[node] for node in member.nodes))
        for e, member in members.items()
    }
    return Structure(
        name="two", nodes=nodes, members=members, supports=supports, materials=dict(prism.materials)
    )


@pytest.mark.parametrize("held", [True, False])
def test_what_turns_freely_within_is_no_rigid_motion_but_does_not_stand(held):
    # K has three zeros, or nine: no fall is pushed off saddles that are none.
    prism = library.prism()
    path = solve_path(two_prisms(prism.supports if held else {}))
    assert path.status == Status.COLLAPSED
    assert "3 free mechanisms" in path.reason
    assert path.final.residual <= RESIDUAL
    np.testing.assert_allclose(
        np.sort(path.final.tensions)[::2], np.sort(solve_path(prism).final.tensions), rtol=1e-8
    )


def test_a_body_that_changes_its_shape_is_in_balance_at_every_coordinate_that_no_support_holds():
    # Two cables pull a node onto the strut between their ends. A coordinate that is held for the rigid
    # motions keeps it off that line and carries force: that is no equilibrium, and is not called one.
    nodes = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.1, 0.05), "c": (2.0, 0.0, 0.0)}
    members = {
        "s": Member("strut", ("a", "c"), 2.0, stiffness=1e4),
        "k": Member("cable", ("a", "b"), 0.9, stiffness=100.0),
        "l": Member("cable", ("b", "c"), 0.9, stiffness=100.0),
    }
    free = Structure(name="bow", nodes=nodes, members=members, supports={})
    path = solve_path(free)
    if str(path.status) == "failed":
        assert "rigid motions" in path.reason
        return
    _, residual = Tangent(structure_arrays(free)).measure(path.final.nodes, path.load)
    assert residual <= RESIDUAL
