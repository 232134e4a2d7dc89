import pytest

from tensegra.errors import ModelError
from tensegra.structure import apply_changes, library, read_structure


@pytest.fixture
def tripod(tripod_file):
    return read_structure(tripod_file)


def test_nothing_changed_is_the_same(tripod):
    assert apply_changes(tripod, {}) == tripod


def test_mappings_are_merged_and_the_rest_replaced(tripod):
    changed = apply_changes(
        tripod,
        {
            "gravity": [0, 0, -1],
            "nodes": {9: [0, 0, 120]},
            "members": {"K1": {"rest_length": "2.4 m", "groups": ["top", "all"]}},
            "stages": [{"name": "only", "loads": {9: [0, "2 kN", 0]}}],
        },
    )
    assert changed.gravity == (0.0, 0.0, -1.0)
    assert changed.nodes["9"] == (0.0, 0.0, 120.0)
    assert changed.nodes["3"] == tripod.nodes["3"]
    assert changed.members["K1"].rest_length == 240.0
    assert changed.members["K1"].area == tripod.members["K1"].area
    assert changed.groups == {"top": ("K1",), "all": ("K1",)}
    assert [stage.name for stage in changed.stages] == ["only"]
    assert changed.stages[0].loads == {"9": (0.0, 2.0, 0.0)}
    assert tripod.gravity == (0.0, 0.0, 0.0)


def test_none_removes(tripod):
    changed = apply_changes(
        tripod,
        {
            "stages": None,
            "actuators": {"A1": None},
            "members": {"K1": {"area": None, "stiffness": 5000}},
        },
    )
    assert changed.stages == ()
    assert not changed.actuators
    assert changed.axial_stiffness("K1") == 5000.0


def test_a_removed_rest_length_is_measured_anew(tripod):
    moved = {"nodes": {9: [0, 0, 120]}}
    assert apply_changes(tripod, moved).members["s1"].rest_length == 100.0
    measured = {**moved, "members": {"s1": {"rest_length": None}}}
    assert apply_changes(tripod, measured).members["s1"].rest_length == 120.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"gravty": [0, 0, 0]}, r"changes: found 'gravty', expected one of .*; did you mean 'gravity'\?"),
        ({"members": {"K9": {}}}, r"changes\.members\.K9\.kind: found nothing, expected a value"),
        (
            {"members": {"K1": {"area": "-3 mm^2"}}},
            r"changes\.members\.K1\.area: found '-3 mm\^2', expected a number",
        ),
        ({"nodes": {9: None}}, r"changes\.members\.s1\.nodes\[1\]: found '9', expected the id of a node"),
        ({"nodes": {9: [0, 0, 1], "9": [0, 0, 2]}}, r"changes\.nodes: found '9', expected each key once"),
        (
            {"stages": [{"loads": {8: [0, 0, 0]}}]},
            r"changes\.stages\[0\]\.loads: found '8', expected the id of a node",
        ),
        ({"units": {"length": "m"}}, r"changes: found 'units', expected another key"),
        ([1], r"changes: found \[1\], expected a mapping"),
    ],
)
def test_places_begin_with_changes(tripod, changes, message):
    with pytest.raises(ModelError, match=f"^{message}"):
        apply_changes(tripod, changes)


def test_the_beam_without_gravity():
    assert apply_changes(library.paper_beam(), {"gravity": [0, 0, 0]}) == library.paper_beam().replace(
        gravity=(0, 0, 0)
    )
