"""Nets of cables: they stand by their prestress or by what hangs on them, and by nothing else."""

import numpy as np
import pytest

from tensegra.mechanics import Status, solve_path
from tensegra.structure import Actuator, Member, Stage, Structure

STIFFNESS = 1e3


def net(n, *, rest_length=0.95, load=0.0):
    """Build a flat square net of n × n meshes of side one, held along its edge."""
    nodes = {f"{i}_{j}": (float(i), float(j), 0.0) for i in range(n + 1) for j in range(n + 1)}
    members = {}
    for i in range(n + 1):
        for j in range(n + 1):
            for name, end in ((f"x{i}_{j}", f"{i + 1}_{j}"), (f"y{i}_{j}", f"{i}_{j + 1}")):
                if end in nodes:
                    members[name] = Member("cable", (f"{i}_{j}", end), rest_length, stiffness=STIFFNESS)
    edge = {node for node in nodes if {"0", str(n)} & set(node.split("_"))}
    return Structure(
        name="net",
        nodes=nodes,
        members=members,
        supports=dict.fromkeys(edge, "xyz"),
        actuators={"let_out": Actuator(tuple(members), "lengthen")},
        stages=[Stage("hang", loads={node: (0, 0, -load) for node in nodes if node not in edge})],
    )


@pytest.mark.parametrize("n", [4, 7, 14])  # the last has more than 400 degrees of freedom
def test_a_flat_net_is_stiff_across_by_its_tension_alone(n):
    final = solve_path(net(n)).final
    tension = STIFFNESS * (1 / 0.95 - 1)
    assert final.status is Status.STABLE
    np.testing.assert_allclose(final.tensions, tension, rtol=1e-9)
    # Across: the Laplacian of the grid, 4 − 4 cos(π/n) times the tension over the mesh.
    assert final.lowest_eigenvalue == pytest.approx(tension * (4 - 4 * np.cos(np.pi / n)), rel=1e-6)


@pytest.mark.parametrize("value", [0.06, 0.2])
@pytest.mark.parametrize("n", [4, 14])
def test_a_net_let_out_collapses(n, value):
    path = solve_path(net(n), {"let_out": value})
    assert path.status is Status.COLLAPSED, path.reason
    assert "prestress lost" in path.reason
    assert path.final.slack.sum() > 0
    assert path.final.mechanisms


@pytest.mark.parametrize("value", [0.0, 0.06, 0.2])
def test_a_net_with_a_load_at_every_knot_only_hangs_deeper(value):
    path = solve_path(net(4, load=1.0), {"let_out": value})
    assert path.status is Status.STABLE, path.reason
    assert path.final.residual <= 1e-9
    assert path.final.lowest_eigenvalue > 0.0
    middle = path.final.node("2_2")
    np.testing.assert_allclose(middle[:2], 2.0, atol=1e-9)
    # The edge carries the nine loads.
    pull = 0.0
    for row, member in enumerate(path.structure.members.values()):
        ends = [path.final.node(node) for node in member.nodes]
        held = [node in path.structure.supports for node in member.nodes]
        if sum(held) == 1:
            along = np.subtract(ends[held.index(True)], ends[held.index(False)])
            pull += path.final.tensions[row] * along[2] / np.linalg.norm(along)
    assert pull == pytest.approx(9.0, rel=1e-8)


def test_deeper_with_longer_cables():
    depth = [
        -solve_path(net(4, load=1.0), {"let_out": value}).final.node("2_2")[2]
        for value in (0.0, 0.05, 0.1, 0.2)
    ]
    assert np.all(np.diff(depth) > 0.0)


def test_it_goes_slack_under_a_single_load_and_says_so():
    # Knots off the axes of the loaded one hang on slack cables: their place is not unique.
    path = solve_path(net(4), {"let_out": 0.2}, loads={("2_2", "z"): -10.0})
    assert path.status is not Status.STABLE
    assert path.status is not Status.FAILED, path.reason
    assert path.reason
