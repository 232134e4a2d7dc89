"""Changes by hand: what they make stands or does not, and what cannot be is refused in words."""

import pytest

from tensegra.errors import ModelError
from tensegra.structure import library
from tensegra.studio.edit import changed, verdict


@pytest.fixture(scope="module")
def tower():
    return library.tower(n_stages=1, n_struts=4)


def test_a_cable_taken_away_and_put_back(tower):
    assert verdict(tower)["stands"]
    removed = tower.members["v0_0"]
    without = changed(tower, "remove_member", {"member": "v0_0"})
    found = verdict(without)
    assert not found["stands"]
    assert found["self_stress"] == 0
    back = changed(
        without,
        "add_member",
        {
            "member": "v0_0",
            "kind": "cable",
            "nodes": list(removed.nodes),
            "like": "v0_1",
            "strain": 0.005,
        },
    )
    assert verdict(back)["stands"]


def test_a_member_leaves_actuators_and_stages_with_it():
    beam = library.paper_beam()
    without = changed(beam, "remove_member", {"member": "K1"})
    assert "K1" not in without.members
    assert all("K1" not in actuator.members for actuator in without.actuators.values())
    assert all("K1" not in stage.rest_length_changes for stage in without.stages)


def test_nodes_are_moved_and_added(tower):
    moved = changed(tower, "move_node", {"node": "r1_0", "position": [1.0, 0.0, 1.2]})
    assert moved.nodes["r1_0"] == (1.0, 0.0, 1.2)
    given = {"node": "n", "position": [0, 0, 2], "to": ["r1_0", "r1_1"], "kind": "cable", "like": "v0_0"}
    added = changed(tower, "add_node", given)
    assert added.members["n-r1_0"].nodes == ("n", "r1_0")
    assert added.members["n-r1_0"].stiffness == tower.members["v0_0"].stiffness


def test_supports_and_quantities_are_set(tower):
    free = changed(tower, "set_support", {"node": "r0_0", "axes": ""})
    assert "r0_0" not in free.supports
    assert changed(free, "set_support", {"node": "r0_0", "axes": "zx"}).supports["r0_0"] == "xz"
    longer = changed(tower, "set_member", {"member": "v0_0", "quantity": "rest_length", "value": 0.9})
    assert longer.members["v0_0"].rest_length == 0.9


CABLE = {"member": "x", "kind": "cable", "nodes": ["r0_0", "r1_0"], "like": "v0_1"}
"""A new one that can be."""
NODE = {"node": "n", "position": [0, 0, 2], "to": ["r1_0"], "kind": "cable", "like": "v0_0"}


@pytest.mark.parametrize(
    ("change", "given", "message"),
    [
        ("explode", {}, "a change"),
        ("__init__", {}, "a change"),
        (["move_node"], {}, "a change"),
        ("move_node", {"node": "r9_9", "position": [0, 0, 0]}, "a node"),
        ("move_node", {"node": "r1_0"}, "position"),
        ("move_node", {"node": "r1_0", "position": [0, 0]}, "r1_0"),
        ("move_node", {"node": "r1_0", "position": "x + 1"}, "r1_0"),
        ("move_node", {"node": "r1_0", "position": [0, 0, {}]}, "a number, a text or a list"),
        ("move_node", {"structure": 1, "node": "r1_0", "position": [0, 0, 0]}, "structure"),
        (
            "set_member",
            {"member": "v0_0", "quantity": "kind", "value": 1.0},
            "area, rest_length or stiffness",
        ),
        ("set_member", {"member": "v0_0", "quantity": "rest_length", "value": -1.0}, "rest_length"),
        ("remove_member", {"member": "v0-0"}, "did you mean 'v0_0'"),
        (
            "add_member",
            {"member": "v0_0", "kind": "cable", "nodes": ["r0_0", "r1_0"], "like": "v0_1"},
            "no member",
        ),
        ("add_member", CABLE | {"kind": "spring"}, "kind"),
        ("add_member", CABLE | {"nodes": ["r0_0"]}, "nodes"),
        (
            "add_member",
            CABLE | {"strain": -1.0},
            "prestrain",
        ),
        (
            "add_node",
            NODE | {"to": []},
            "joined",
        ),
        ("set_support", {"node": "r0_0", "axes": "q"}, "axes|axis"),
        ("move_node", None, "values by name"),
    ],
)
def test_what_cannot_be_is_refused(tower, change, given, message):
    with pytest.raises(ModelError, match=message):
        changed(tower, change, given)
