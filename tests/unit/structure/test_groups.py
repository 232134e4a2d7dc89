"""A group stands wherever members are named."""

import pytest

from tensegra.errors import ModelError
from tensegra.structure import parse_structure

CABLE = {"kind": "cable", "stiffness": 1000}
CONTENT = {
    "nodes": {1: [0, 0, 0], 2: [1, 0, 0], 3: [2, 0, 0], 4: [3, 0, 0]},
    "members": {
        "a": {**CABLE, "nodes": [1, 2], "groups": ["left", "outer"]},
        "b": {**CABLE, "nodes": [2, 3]},
        "c": {**CABLE, "nodes": [3, 4], "groups": ["outer"]},
    },
    "supports": {1: "xyz", 2: "yz", 3: "yz", 4: "xyz"},
}


def test_an_actuator_acts_on_groups():
    actuators = {"A": {"members": ["outer", "b"], "effect": "shorten"}}
    structure = parse_structure({**CONTENT, "actuators": actuators})
    assert structure.actuators["A"].members == ("a", "c", "b")


def test_a_stage_changes_groups():
    stages = [
        {"rest_length_changes": {"outer": -0.01, "b": -0.02}},
        {"rest_lengths": {"outer": 0.9, "a": 0.9}},
    ]
    first, second = parse_structure({**CONTENT, "stages": stages}).stages
    assert first.rest_length_changes == {"a": -0.01, "c": -0.01, "b": -0.02}
    assert second.rest_lengths == {"a": 0.9, "c": 0.9}


@pytest.mark.parametrize("key", ["rest_length_changes", "rest_lengths"])
def test_two_values_of_one_member_are_refused(key):
    told = rf"stages\[0\]\.{key}\.left: found 0\.5, expected one value for member 'a', which 'outer' sets too"
    with pytest.raises(ModelError, match=told):
        parse_structure({**CONTENT, "stages": [{key: {"outer": 0.25, "left": 0.5}}]})


@pytest.mark.parametrize("name", ["a", "outer"])
@pytest.mark.parametrize("key", ["rest_length_changes", "rest_lengths"])
def test_what_is_no_number_is_refused_as_such(key, name):
    # NaN differs from itself, which must not be taken for two values.
    with pytest.raises(ModelError, match=rf"stages\[0\]\.{key}\.\w+: found nan, expected"):
        parse_structure({**CONTENT, "stages": [{key: {name: float("nan")}}]})


def test_a_member_that_an_actuator_has_twice_is_refused():
    actuators = {"A": {"members": ["outer", "a"], "effect": "shorten"}}
    with pytest.raises(ModelError, match=r"actuators\.A\.members\[2\]: found 'a', expected each member once"):
        parse_structure({**CONTENT, "actuators": actuators})
