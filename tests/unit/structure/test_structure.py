import copy
import json
import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from tensegra.errors import ModelError
from tensegra.structure import Actuator, Material, Member, Stage, Structure, parse_structure, read_structure


@pytest.fixture
def tripod(tripod_file):
    return read_structure(tripod_file)


def test_the_repr_counts_classical_and_clustered_cables_apart(tripod):
    assert repr(tripod) == (
        "Structure('tripod': 4 nodes, 1 strut, 1 cable, 1 clustered; 7 free dof; units cm, kN)"
    )


def test_counts_and_orders(tripod):
    assert (tripod.n_nodes, tripod.n_members, tripod.n_free) == (4, 3, 7)
    assert tripod.node_ids == ("1", "2", "3", "9")
    assert tripod.member_ids == ("K1", "s1", "K2")
    assert tripod.groups == {"top": ("K1",)}


def test_coordinates_are_an_array_that_cannot_be_written(tripod):
    np.testing.assert_array_equal(tripod.coordinates, [[0, 0, 0], [100, 0, 0], [0, 100, 0], [0, 0, 100]])
    with pytest.raises(ValueError, match="read-only"):
        tripod.coordinates[0, 0] = 1.0


def test_stiffness_weight_and_expansion_come_from_material_and_area_or_from_stiffness(tripod):
    assert tripod.axial_stiffness("K1") == pytest.approx(11500 * 0.5)
    assert tripod.weight_per_length("K1") == pytest.approx(7.85e-5 * 0.5)
    assert tripod.thermal_expansion("K1") == 1.6e-5
    assert tripod.axial_stiffness("s1") == 1e6
    assert tripod.weight_per_length("s1") == 0.0
    assert tripod.thermal_expansion("s1") == 0.0


def test_a_material_beside_a_stiffness_gives_the_expansion_alone(rope):
    steel = Material(youngs_modulus=2e11, weight=7.7e4, thermal_expansion=1.2e-5)
    heated = rope.replace(
        materials={"steel": steel},
        members={"K1": Member("cable", ("1", "2"), 5.0, "steel", stiffness=1000.0)},
    )
    assert heated.axial_stiffness("K1") == 1000.0
    assert heated.weight_per_length("K1") == 0.0
    assert heated.thermal_expansion("K1") == 1.2e-5


def test_members_are_addressed_by_id_or_group(tripod):
    assert tripod.members_named("top") == tripod.members_named("K1") == ("K1",)
    with pytest.raises(ModelError, match=r"found 'tpo', expected the id of a member or of a group; .*'top'"):
        tripod.members_named("tpo")
    with pytest.raises(ModelError, match=r"found 's12', expected the id of a member; did you mean 's1'\?"):
        tripod.member("s12")


def test_members_know_their_shape(tripod):
    loop = tripod.members["K1"]
    assert (loop.is_cable, loop.is_clustered, loop.segments) == (True, True, (("1", "2"), ("2", "3")))
    strut = tripod.member("s1")
    assert (strut.is_cable, strut.is_clustered, strut.segments) == (False, False, (("1", "9"),))


def test_actuators_shorten_or_lengthen():
    assert Actuator(("a",), "shorten").factor(0.1) == 0.9
    assert Actuator(("a",), "lengthen").factor(0.1) == 1.1


def test_integers_become_text_ids_and_numbers_floats():
    structure = Structure(
        name="rope",
        nodes={1: np.array([0, 0, 0]), np.int64(2): (2, 0, 0)},
        members={
            "K": Member("cable", [1, np.int64(2)], rest_length=2, stiffness=np.float32(5), groups="all")
        },
        supports={1: "zyx"},
        stages=[Stage(name=1, loads={2: [1, 0, 0]})],
    )
    assert structure.nodes == {"1": (0.0, 0.0, 0.0), "2": (2.0, 0.0, 0.0)}
    assert structure.members["K"].nodes == ("1", "2")
    assert structure.members["K"].groups == ("all",)
    assert type(structure.members["K"].stiffness) is float
    assert structure.supports == {"1": "xyz"}
    assert structure.stages[0].loads == {"2": (1.0, 0.0, 0.0)}
    assert structure.stages[0].name == "1"


def test_nothing_in_a_structure_can_be_changed(tripod):
    with pytest.raises(FrozenInstanceError):
        tripod.gravity = (0, 0, -1)
    for mapping in (tripod.nodes, tripod.groups, tripod.stages[0].rest_length_changes):
        with pytest.raises(TypeError):
            mapping["new"] = 1.0
    with pytest.raises(FrozenInstanceError):
        tripod.members["K1"].rest_length = 1.0


def test_a_structure_does_not_follow_the_mapping_it_was_made_from(rope):
    nodes = {"1": (0.0, 0.0, 0.0), "2": (3.0, 4.0, 0.0)}
    structure = rope.replace(nodes=nodes)
    nodes["2"] = (9.0, 9.0, 9.0)
    assert structure.nodes["2"] == (3.0, 4.0, 0.0)


def through_pickle(structure):
    return pickle.loads(pickle.dumps(structure))  # noqa: S301 — our own pickle


@pytest.mark.parametrize("duplicate", [through_pickle, copy.deepcopy, copy.copy])
def test_copies_are_equal_and_stay_read_only(tripod, duplicate):
    assert tripod.coordinates.shape == (4, 3)  # derived before the copy, derived anew after it
    twin = duplicate(tripod)
    assert twin == tripod
    assert hash(twin) == hash(tripod)
    assert not twin.coordinates.flags.writeable


def test_equality_is_of_content_and_order(rope):
    assert rope != rope.replace(gravity=(0, 0, 1))
    assert rope != rope.replace(description="a rope")
    assert rope != rope.replace(nodes=dict(reversed(list(rope.nodes.items()))))
    assert rope != "rope"
    assert rope == rope.replace(nodes=dict(rope.nodes))
    assert len({rope, rope.replace(), rope.replace(gravity=(0, 0, 1))}) == 2


def test_the_fingerprint_covers_what_results_depend_on(rope):
    assert len(rope.fingerprint) == 64
    assert int(rope.fingerprint, 16) > 0
    assert rope.replace(name="cord", description="the same").fingerprint == rope.fingerprint
    for change in (
        {"gravity": (0, 0, 1)},
        {"supports": {"1": "xyz", "2": "y"}},
        {"nodes": {"1": (0, 0, 0), "2": (3, 4, 1e-12)}},
        {"stages": [Stage("prestress", rest_length_changes={"K1": -0.01})]},
    ):
        assert rope.replace(**change).fingerprint != rope.fingerprint


def test_the_fingerprint_is_the_same_tomorrow(rope):
    # A campaign is found again by it: a change of this value makes every campaign on disk a stranger.
    assert rope.fingerprint == "2975c5b1aa3131bb30795d82d01fe10fd0eb78def82f7a4941b1647445e31bae"


def test_replacing_is_checked(rope):
    with pytest.raises(ModelError, match=r"^supports: found '3', expected the id of a node$"):
        rope.replace(supports={"3": "xyz"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": {1: (0, 0, 0), "1": (1, 0, 0)}}, "nodes: found '1', expected each id once"),
        ({"nodes": {"1": (0, 0), "2": (1, 0, 0)}}, r"nodes\.1: found \(0\.0, 0\.0\), expected three numbers"),
        ({"nodes": {"1": "abc", "2": (1, 0, 0)}}, r"nodes\.1: found 'abc', expected three numbers"),
        ({"nodes": {"1": None, "2": (1, 0, 0)}}, r"nodes\.1: found None, expected three numbers"),
        ({"gravity": (0, 0, True)}, r"gravity\[2\]: found True, expected a finite number"),
        ({"members": {}}, "members: found nothing, expected at least one member"),
        ({"name": ""}, "name: found '', expected a name"),
        ({"name": "two\nlines"}, "name: found .*, expected a name"),
    ],
)
def test_a_structure_made_in_python_has_the_checks_of_a_file(rope, change, message):
    with pytest.raises(ModelError, match=message):
        rope.replace(**change)


def test_the_message_tells_the_first_problem_and_counts_the_others(rope):
    with pytest.raises(ModelError) as caught:
        rope.replace(gravity=(0, 0, float("nan")), supports={"1": "abc", "2": "z"})
    assert str(caught.value) == (
        "supports.1: found 'abc', expected axes out of x, y and z, such as 'xyz' (and 1 more problem)"
    )


def test_messages_stay_short_whatever_was_found(rope):
    with pytest.raises(ModelError) as caught:
        rope.replace(gravity=list(range(10_000)))
    assert len(str(caught.value)) < 200


def test_the_content_is_plain_json(tripod):
    from tensegra.structure import structure_to_mapping

    assert parse_structure(json.loads(json.dumps(structure_to_mapping(tripod)))) == tripod


@pytest.mark.parametrize("left_out", [{}, {"rest_length": None}])
def test_a_member_without_a_rest_length_is_as_long_as_its_nodes(left_out):
    nodes = {"1": (0, 0, 0), "2": (3, 4, 0), "3": (3, 4, 1)}
    rope = Structure(
        name="rope",
        nodes=nodes,
        members={"K": Member("cable", ("1", "2", "3"), stiffness=10.0, **left_out)},
        supports={"1": "xyz", "2": "xyz", "3": "xyz"},
    )
    assert rope.members["K"].rest_length == 6.0
    # Measured once: a node that moves later leaves it as it is.
    assert rope.replace(nodes=nodes | {"3": (3, 4, 2)}).members["K"].rest_length == 6.0


def test_a_nan_that_was_computed_is_no_rest_length_that_was_left_out():
    with pytest.raises(ModelError, match=r"rest_length: found nan"):
        Structure(
            name="rope",
            nodes={"1": (0, 0, 0), "2": (3, 4, 0)},
            members={"K": Member("cable", ("1", "2"), rest_length=float("nan"), stiffness=10.0)},
        )


@pytest.mark.parametrize("node", [("a", 0, 0), (1, 2), None, (float("inf"), 0, 0)])
def test_a_bad_node_is_told_and_not_the_length_that_it_spoils(node):
    with pytest.raises(ModelError) as told:
        Structure(
            name="rope",
            nodes={"1": (0, 0, 0), "2": node},
            members={"K": Member("cable", ("1", "2"), stiffness=10.0)},
        )
    assert "nodes" in str(told.value)
    assert "rest_length" not in str(told.value)
