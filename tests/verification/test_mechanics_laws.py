"""Laws that hold for every structure: invariances, reversal, energy, one-sided cables."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tensegra.mechanics import PathSettings, Status, solve_batch, solve_path
from tensegra.structure import Member, Stage, Structure, library, read_structure

CASES = Path(__file__).parents[1] / "validation" / "cases"

SAME_POSITION = 1e-8
"""Of the size: residuals of 1e-9 over a lowest eigenvalue 1e-6 of the largest, less what polishing gains."""

SAME_TENSION = 1e-8
"""Of the largest tension: as far as the positions agree."""

SAME_EIGENVALUE = 1e-6
"""Relative: the lowest eigenvalue is a hundredth of the entries that cancel in it, and moves with them."""

ENERGY = 1e-9
"""Of the change of energy: eight Gauss points integrate a smooth path to rounding."""


@cache
def beam():
    return library.paper_beam()


@cache
def slackening_beam():
    """Return a beam whose braces go slack one by one, also a clustered cable."""
    return read_structure(CASES / "mj_beam12_actuated.structure.json")


def size_of(structure):
    return np.ptp(structure.coordinates, axis=0).max()


def assert_same_state(found, expected, size):
    np.testing.assert_allclose(found.nodes, expected.nodes, rtol=0.0, atol=SAME_POSITION * size)
    largest = np.abs(expected.tensions).max()
    np.testing.assert_allclose(found.tensions, expected.tensions, rtol=0.0, atol=SAME_TENSION * largest)
    np.testing.assert_array_equal(found.slack, expected.slack)
    assert found.lowest_eigenvalue == pytest.approx(expected.lowest_eigenvalue, rel=SAME_EIGENVALUE)
    assert found.strain_energy == pytest.approx(expected.strain_energy, rel=SAME_TENSION)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    rotation=st.tuples(*[st.floats(-np.pi, np.pi)] * 3),
    translation=st.tuples(*[st.floats(-1e3, 1e3)] * 3),
    a14=st.floats(0.0, 0.1),
    a23=st.floats(0.0, 0.1),
)
def test_a_rigid_motion_changes_no_tension(rotation, translation, a14, a23):
    turn = Rotation.from_euler("xyz", rotation).as_matrix()
    nodes = beam().coordinates @ turn.T + translation
    moved = beam().replace(
        nodes=dict(zip(beam().nodes, nodes.tolist(), strict=True)),
        gravity=tuple(turn @ beam().gravity),
    )
    actuation = {"A14": a14, "A23": a23}
    here, there = solve_path(beam(), actuation), solve_path(moved, actuation)
    assert here.status is there.status is Status.STABLE
    back = (there.final.nodes - translation) @ turn
    # A translation by a thousand costs three of the sixteen digits that the coordinates have.
    np.testing.assert_allclose(back, here.final.nodes, rtol=0.0, atol=1e-7 * size_of(beam()))
    largest = np.abs(here.final.tensions).max()
    np.testing.assert_allclose(there.final.tensions, here.final.tensions, rtol=0.0, atol=1e-7 * largest)
    assert there.final.lowest_eigenvalue == pytest.approx(here.final.lowest_eigenvalue, rel=1e-4)
    np.testing.assert_allclose(
        there.displacements, here.displacements @ turn.T, rtol=0.0, atol=2e-7 * size_of(beam())
    )


def in_other_units(structure, length, force):
    """Write the same structure in units of which `length` and `force` make one old unit."""
    return structure.replace(
        nodes={name: tuple(length * c for c in at) for name, at in structure.nodes.items()},
        members={
            name: Member(
                member.kind, member.nodes, length * member.rest_length, stiffness=force * member.stiffness
            )
            for name, member in structure.members.items()
        },
        stages=tuple(
            Stage(
                stage.name,
                rest_lengths={name: length * value for name, value in stage.rest_lengths.items()},
                loads={name: tuple(force * c for c in load) for name, load in stage.loads.items()},
            )
            for stage in structure.stages
        ),
    )


@pytest.mark.parametrize(
    ("length", "force"), [(1e3, 1.0), (1e-3, 1.0), (1.0, 1e9), (1.0, 1e-9), (1e-3, 1e-12)]
)
@pytest.mark.parametrize("name", ["cts_dbar_planar", "mj_beam12_actuated", "mj_prism3_closed_loop"])
def test_the_system_of_units_changes_nothing(name, length, force):
    # One with partly held nodes and an unstable start, one with slack cables, one with a closed loop.
    structure = read_structure(CASES / f"{name}.structure.json")
    here, there = solve_path(structure), solve_path(in_other_units(structure, length, force))
    assert [s.status for s in there.stages] == [s.status for s in here.stages]
    for found, expected in zip(there.stages, here.stages, strict=True):
        np.testing.assert_allclose(
            found.nodes / length, expected.nodes, rtol=0.0, atol=SAME_POSITION * size_of(structure)
        )
        largest = np.abs(expected.tensions).max()
        np.testing.assert_allclose(
            found.tensions / force, expected.tensions, rtol=0.0, atol=SAME_TENSION * largest
        )
        np.testing.assert_array_equal(found.slack, expected.slack)
        assert found.lowest_eigenvalue * length / force == pytest.approx(
            expected.lowest_eigenvalue, rel=SAME_EIGENVALUE
        )


def test_the_order_of_nodes_and_members_changes_nothing():
    shuffle = np.random.default_rng(0).permutation

    def shuffled(mapping):
        names = list(mapping)
        return {names[i]: mapping[names[i]] for i in shuffle(len(names))}

    other = beam().replace(nodes=shuffled(beam().nodes), members=shuffled(beam().members))
    actuation = {"A14": 0.08, "A23": 0.05}
    here, there = solve_path(beam(), actuation).final, solve_path(other, actuation).final
    for node in beam().nodes:
        np.testing.assert_allclose(
            there.node(node), here.node(node), rtol=0.0, atol=SAME_POSITION * size_of(beam())
        )
    for member in beam().members:
        largest = np.abs(here.tensions).max()
        assert there.tension(member) == pytest.approx(here.tension(member), abs=SAME_TENSION * largest)


def reversed_history(structure):
    """Append the stages again from the last but one back to the first."""
    return structure.replace(
        stages=(
            *structure.stages,
            *(
                Stage(f"back to {stage.name}", rest_lengths=stage.rest_lengths, loads=stage.loads)
                for stage in structure.stages[-2::-1]
            ),
        )
    )


@pytest.mark.parametrize("name", ["mj_beam12_actuated", "mj_prism3_closed_loop", "cts_quad_prism2"])
def test_the_way_back_ends_at_the_start(name):
    structure = read_structure(CASES / f"{name}.structure.json")
    path = solve_path(reversed_history(structure))
    assert path.status is Status.STABLE
    n = len(structure.stages)
    assert len(path.stages) == 2 * n - 1
    for there, back in zip(path.stages[: n - 1], path.stages[:-n:-1], strict=True):
        assert back.stage == f"back to {there.stage}"
        assert_same_state(back, there, size_of(structure))
    assert np.abs(path.stages[n - 1].nodes - path.stages[0].nodes).max() > 1e-2 * size_of(structure)


def test_slack_events_on_the_way_back_undo_those_on_the_way():
    path = solve_path(reversed_history(slackening_beam()))
    slack = set()
    for event in path.slack_events:
        assert event.becomes in ("slack", "taut")
        (slack.add if event.becomes == "slack" else slack.remove)(event.member)
    assert len(path.slack_events) > 10
    assert slack == set(path.final.slack_members) - set(first_slack(path))


def first_slack(path):
    """Cables that were slack where the history began and that no event has named since."""
    named = {event.member for event in path.slack_events}
    return [member for member in path.final.slack_members if member not in named]


def test_slack_events_lead_from_the_first_slack_list_to_the_last():
    structure = slackening_beam()
    path = solve_path(structure)
    assert path.stages[0].slack_members != path.final.slack_members
    slack = set(path.stages[0].slack_members)
    for event in path.slack_events:
        if event.stage != structure.stages[0].name:
            (slack.add if event.becomes == "slack" else slack.remove)(event.member)
    assert slack == set(path.final.slack_members)


def test_slack_events_go_through_a_snap_and_a_collapse():
    weightless = beam().replace(gravity=(0, 0, 0))
    path = solve_path(weightless, {"A23": 0.25})
    assert path.status is Status.COLLAPSED
    slack = set(path.stages[-1].slack_members)
    for event in path.slack_events:
        (slack.add if event.becomes == "slack" else slack.remove)(event.member)
    assert slack == set(path.final.slack_members)


def test_slack_carries_zero_and_taut_carries_tension():
    structure = slackening_beam()
    rest_length = {name: member.rest_length for name, member in structure.members.items()}
    for stage, result in zip(structure.stages, solve_path(structure).stages, strict=True):
        rest_length.update(stage.rest_lengths)
        for row, (name, member) in enumerate(structure.members.items()):
            x = [result.node(node) for node in member.nodes]
            length = np.linalg.norm(np.diff(x, axis=0), axis=1).sum()
            tension = member.stiffness * (length / rest_length[name] - 1)
            if member.kind == "strut":
                assert not result.slack[row]
            else:
                assert result.slack[row] == (length <= rest_length[name])
                tension = max(0.0, tension)
                assert result.tensions[row] >= 0.0
                assert (result.tensions[row] == 0.0) == result.slack[row]
            assert result.tensions[row] == pytest.approx(tension, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("structure", "actuation"),
    [
        (beam(), {"A14": 0.10, "A23": 0.10}),
        (beam(), {"A14": 0.02, "A23": 0.06}),
        (
            library.paper_beam_slender().replace(gravity=(0, 0, 0)),
            {"A1": 0.3, "A2": 0.2, "A3": 0.25, "A4": 0.1},
        ),
    ],
)
@pytest.mark.parametrize(
    "step_control", [{"first_step": s} for s in (0.5, 0.1, 0.01, 0.001)] + [{"largest_move": 0.005}]
)
def test_the_final_state_does_not_depend_on_the_steps(structure, actuation, step_control):
    expected = solve_path(structure, actuation)
    found = solve_path(structure, actuation, settings=PathSettings(**step_control))
    assert found.status is expected.status is Status.STABLE
    assert_same_state(found.final, expected.final, size_of(structure))


def test_neither_does_a_path_with_slack_cables():
    expected = solve_path(slackening_beam()).final
    for first_step in (0.5, 0.01, 0.001):
        found = solve_path(slackening_beam(), settings=PathSettings(first_step=first_step)).final
        assert_same_state(found, expected, size_of(slackening_beam()))


def test_one_long_stage_ends_where_many_short_ones_do():
    structure = slackening_beam()
    first, last = structure.stages[0], structure.stages[-1]
    assert_same_state(
        solve_path(structure.replace(stages=(first, last))).final,
        solve_path(structure).final,
        size_of(structure),
    )


def energy_balance(structure, actuation, temperature):
    """Change of strain energy, and work of actuators, warming and weight, by Gauss quadrature.

    With U = Σ ½ (EA/l₀)(ℓ − l₀)², ∂U/∂x balances the loads and ∂U/∂l₀ = −T − T²/(2 EA).
    """
    points, weights = np.polynomial.legendre.leggauss(8)
    values = 0.5 * (points + 1.0)
    runs = solve_batch(
        structure,
        actuation={name: values * value for name, value in actuation.items()},
        temperature={name: values * value for name, value in temperature.items()},
    )
    assert np.all(runs.status == "stable")
    assert not runs.slack.any()  # a kink would spoil the quadrature
    work = 0.0
    for row, (name, member) in enumerate(structure.members.items()):
        start = member.rest_length
        for stage in structure.stages:
            start *= 1.0 + stage.rest_length_changes.get(name, 0.0)
        rate = sum(
            (-value if structure.actuators[actuator].effect == "shorten" else value)
            for actuator, value in actuation.items()
            if name in structure.actuators[actuator].members
        )
        warming = structure.thermal_expansion(name) * sum(
            value for group, value in temperature.items() if name in structure.members_named(group)
        )
        change = start * (rate * (1 + warming * values) + (1 + rate * values) * warming)
        tension, stiffness = runs.tensions[:, row], structure.axial_stiffness(name)
        work -= np.sum(0.5 * weights * (tension + tension**2 / (2 * stiffness)) * change)
    path = solve_path(structure, actuation, temperature)
    for name, member in structure.members.items():
        for i, j in member.segments:
            length = np.linalg.norm(np.subtract(structure.nodes[i], structure.nodes[j]))
            half = 0.5 * structure.weight_per_length(name) * length
            for node in (i, j):
                moved = path.displacements[list(structure.nodes).index(node)]
                work += half * np.dot(structure.gravity, moved)
    return path.final.strain_energy - path.stages[-1].strain_energy, work


@pytest.mark.parametrize(
    ("actuation", "temperature"),
    [({"A14": 0.1, "A23": 0.1}, {}), ({"A14": 0.05, "A23": 0.02}, {"top": 150.0}), ({}, {"bottom": 100.0})],
)
def test_the_work_done_is_the_change_of_strain_energy(actuation, temperature):
    change, work = energy_balance(beam(), actuation, temperature)
    assert change == pytest.approx(work, rel=ENERGY)
    assert abs(change) > 1.0  # kN cm


def test_the_strain_energy_is_that_of_its_definition():
    path = solve_path(beam(), {"A14": 0.1})
    energy = 0.0
    for name, member in beam().members.items():
        tension, stiffness = path.final.tension(name), beam().axial_stiffness(name)
        rest_length = member.rest_length * (1 - 0.0255) * 0.9 if name in ("K1", "K4") else member.rest_length
        energy += tension**2 * rest_length / (2 * stiffness)
    assert path.final.strain_energy == pytest.approx(energy, rel=1e-10)


def test_prestress_alone_holds_up_a_prism_at_any_scale_of_stress():
    # Doubling all tensions with stiff members leaves the shape: only rest lengths know the difference.
    soft, hard = (solve_path(library.prism(prestress=value)).final for value in (1000.0, 2000.0))
    np.testing.assert_allclose(hard.nodes, soft.nodes, atol=SAME_POSITION)
    np.testing.assert_allclose(hard.tensions, 2.0 * soft.tensions, rtol=SAME_TENSION)


def test_a_structure_held_everywhere_is_solved():
    held = Structure(
        name="string",
        nodes={"1": (0, 0, 0), "2": (2, 0, 0)},
        members={"K": Member("cable", ("1", "2"), 1.9, stiffness=19.0)},
        supports={"1": "xyz", "2": "xyz"},
    )
    path = solve_path(held, positions={("2", "x"): 0.1})
    assert path.status is Status.STABLE
    assert path.final.tension("K") == pytest.approx(2.0)


def test_a_rope_at_rest_can_be_loaded():
    # Nothing holds it at first, which is reported; then it hangs.
    rope = Structure(
        name="rope",
        nodes={"1": (0, 0, 0), "2": (2, 0, 0)},
        members={"K": Member("cable", ("1", "2"), 2.0, stiffness=1e4)},
        supports={"1": "xyz"},
    )
    path = solve_path(rope, loads={("2", "z"): -1.0})
    assert path.stages[0].status is Status.COLLAPSED
    assert path.final.succeeded, path.reason
    np.testing.assert_allclose(path.final.node("2"), [0, 0, -2.0002], atol=2 * SAME_POSITION)
