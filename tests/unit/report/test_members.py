"""What `check` tells of the members, and of numbers that are likely a slip of units."""

import json
from math import sqrt

import pytest

from tensegra.report.check import check_structure
from tensegra.report.tables import check_lines, member_table
from tensegra.structure import library, parse_structure

HANGER = {
    "units": {"length": "cm", "force": "kN"},
    "nodes": {1: [0, 0, 0], 2: [0, 0, -200]},
    "materials": {"steel": {"youngs_modulus": "210 GPa", "weight": "78.5 kN/m^3"}},
    "members": {
        "c": {"kind": "cable", "nodes": [1, 2], "material": "steel", "area": "2 cm^2", "strength": 40}
    },
    "supports": {1: "xyz", 2: "xy"},
    "gravity": [0, 0, -1],
    "stages": [{"loads": {2: [0, 0, -20]}}],
}


def hanger(material=None, member=None, **changes):
    content = json.loads(json.dumps({**HANGER, **changes}))
    content["materials"]["steel"] |= material or {}
    content["members"]["c"] |= member or {}
    return check_structure(parse_structure(content))


def test_a_member_is_told_as_it_stands():
    result = hanger()
    (member,) = result.members
    weight = 78.5e-6 * 2 * 200  # kN/cm^3 by cm^2 by cm
    tension = 20 + weight / 2  # half of it hangs from the support
    assert (member.name, member.kind, member.rest_length) == ("c", "cable", 200.0)
    assert member.tension == pytest.approx(tension)
    assert member.strain == pytest.approx(tension / (21000 * 2))
    assert member.length == pytest.approx(200 * (1 + member.strain))
    assert member.force_density == pytest.approx(tension / member.length)
    assert member.utilisation == pytest.approx(tension / 40)
    told = result.to_dict()
    assert told["weight"] == pytest.approx(weight)
    assert told["size"] == [0.0, 0.0, 200.0]
    assert told["members"]["c"]["tension"] == pytest.approx(tension)
    assert told["warnings"] == []


def test_the_rest_length_is_that_after_the_stages():
    stages = [
        {"rest_length_changes": {"c": -0.01}},
        {"rest_length_changes": {"c": -0.1}, "loads": {2: [0, 0, -1]}},
    ]
    assert hanger(stages=stages).members[0].rest_length == pytest.approx(200 * 0.99 * 0.9)


def test_self_stress_is_told_as_ratios():
    ratios = check_structure(library.prism()).self_stress_ratios
    # A regular prism turned by 30 degrees: by hand, from the balance of a node.
    assert ratios["s0"] == [pytest.approx(-1.0)]
    strut, vertical = sqrt(1 + 2 * (1 + sqrt(3) / 2)), sqrt(1 + 2 * (1 - sqrt(3) / 2))
    assert ratios["v0"] == [pytest.approx(vertical / strut)]


def test_the_table_lists_those_that_carry_most():
    table = member_table(check_structure(library.paper_beam()))
    assert len(table.rows) == 24
    assert table.note == "the 24 of 48 that carry most"
    assert table.header[1:4] == ("Rest length\n[cm]", "Length\n[cm]", "Strain\n[%]")


SLIPS = {
    "a modulus in pascal where kN/cm^2 are declared": (
        {"material": {"youngs_modulus": 210e9}},
        "Material steel has a modulus of 2.1e+18 Pa, which no solid has; is it in kN/cm^2?",
    ),
    "a modulus a thousand times too small": (
        {"material": {"youngs_modulus": 21}},
        "beyond what the linear law holds",
    ),
    "a mass density for a weight": (
        {"material": {"weight": 7850}},
        "weighs 7.85e+12 N/m^3, which nothing does",
    ),
    "an area in square millimetres": ({"member": {"area": 50_000}}, "Member c is as thick as long"),
    "an area in square metres": ({"member": {"area": 2e-10}}, "a millionth as thick as long"),
    "a load in newtons": (
        {"stages": [{"loads": {2: [0, 0, -20_000]}}]},
        "beyond what the linear law holds",
    ),
    "a strength in meganewtons": ({"member": {"strength": 0.04}}, "loaded beyond strength or buckling load"),
    "no support": (
        {"supports": {}, "stages": [], "gravity": [0, 0, 0]},
        "Neither supports nor loads hold the body",
    ),
}


@pytest.mark.parametrize(("changes", "told"), SLIPS.values(), ids=SLIPS)
def test_a_slip_of_units_is_asked_about(changes, told):
    result = hanger(**changes)
    assert any(told in warning for warning in result.to_dict()["warnings"])
    assert any(line.startswith("Warning: ") for line in check_lines(result))


@pytest.mark.parametrize("name", ["paper_beam", "prism", "tower", "grid", "levy_dome", "gripper", "d_bar"])
def test_the_library_has_no_slip(name):
    result = check_structure(getattr(library, name)())
    assert [slip for slip in result.slips if not slip.startswith("No support")] == []
