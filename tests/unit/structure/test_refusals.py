"""Every refusal that the format promises: one line of the file is spoilt, one message tells where."""

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.structure import Structure, parse_structure, read_structure

S1 = "s1: {kind: strut, nodes: [1, 9], stiffness: 1e6}"
NODES = "nodes: {1: [0, 0, 0],"
MEMBER_KEYS = "one of kind, nodes, material, area, stiffness, rest_length, groups, section_inertia, strength"
IN_CM2 = "a number (in cm^2) or a quantity of area such as '1 cm^2'"

# What is replaced, by what, and the message, which follows the file's name.
REFUSALS = {
    "unknown key": (
        "gravity",
        "gravty",
        (
            "stages[1]: found 'gravty', expected one of name, rest_length_changes, "
            "rest_lengths, loads, temperatures, positions, gravity; did you mean 'gravity'?"
        ),
    ),
    "unknown key of a member": (
        "rest_length: 2.3 m",
        "restlength: 1",
        f"members.K1: found 'restlength', expected {MEMBER_KEYS}; did you mean 'rest_length'?",
    ),
    "unknown key at the top": (
        "supports:",
        "support:",
        (
            "found 'support', expected one of schema, units, name, description, nodes, materials, members, "
            "supports, gravity, actuators, stages; did you mean 'supports'?"
        ),
    ),
    "unknown key of the units": (
        "length: cm",
        "lenght: cm",
        "units: found 'lenght', expected one of length, force, temperature; did you mean 'length'?",
    ),
    "missing key": ("kind: strut, ", "", "members.s1.kind: found nothing, expected a value"),
    "no schema": (
        "schema: tensegra/structure/1",
        "",
        "schema: found nothing, expected 'tensegra/structure/1'",
    ),
    "unknown node": (
        "[1, 2, 3]",
        "[1, 2, 99]",
        "members.K1.nodes[2]: found '99', expected the id of a node; did you mean '9'?",
    ),
    "unknown material": (
        "material: steel",
        "material: stele",
        "members.K1.material: found 'stele', expected the name of a material; did you mean 'steel'?",
    ),
    "unknown group": (
        "{top: 20 K}",
        "{tops: 20}",
        (
            "stages[1].temperatures: found 'tops', "
            "expected the id of a member or of a group; did you mean 'top'?"
        ),
    ),
    "unknown kind": (
        "kind: strut",
        "kind: Srut",
        "members.s1.kind: found 'Srut', expected 'strut' or 'cable'; did you mean 'strut'?",
    ),
    "unknown effect": (
        "effect: shorten",
        "effect: shortn",
        "actuators.A1.effect: found 'shortn', expected 'shorten' or 'lengthen'; did you mean 'shorten'?",
    ),
    "unknown axis": (
        "2: zy",
        "2: zw",
        "supports.2: found 'zw', expected axes out of x, y and z, such as 'xyz'; did you mean 'z'?",
    ),
    "axis twice": (
        "2: zy",
        "2: yy",
        "supports.2: found 'yy', expected axes out of x, y and z, such as 'xyz'; did you mean 'y'?",
    ),
    "no axis": ("2: zy", "2: ''", "supports.2: found '', expected axes out of x, y and z, such as 'xyz'"),
    "support of nothing": (
        "1: xyz,",
        "1: xyz, 99: z,",
        "supports: found '99', expected the id of a node; did you mean '9'?",
    ),
    "unknown unit": (
        "length: cm",
        "length: cmm",
        "units.length: found 'cmm', expected the name of a unit of length, such as 'cm'; did you mean 'mm'?",
    ),
    "unit of something else": (
        "force: kN",
        "force: kg",
        "units.force: found 'kg', expected the name of a unit of force, such as 'kN'",
    ),
    "unknown unit of a quantity": (
        "50 mm^2",
        "50 mmm^2",
        f"members.K1.area: found '50 mmm^2', expected {IN_CM2}; did you mean '50 mm^2'?",
    ),
    "quantity of something else": ("50 mm^2", "50 mm", f"members.K1.area: found '50 mm', expected {IN_CM2}"),
    "actuator of nothing": ("[K1, K2]", "[]", "actuators.A1.members: found [], expected at least one member"),
    "actuator of no member": (
        "[K1, K2]",
        "[K1, K20]",
        "actuators.A1.members[1]: found 'K20', expected the id of a member or of a group; did you mean 'K2'?",
    ),
    "actuator of one member twice": (
        "[K1, K2]",
        "[K1, K1]",
        "actuators.A1.members[1]: found 'K1', expected each member once",
    ),
    "not a number": ("50 mm^2", ".nan", "members.K1.area: found nan, expected a finite number"),
    "infinite number": ("1e6", ".inf", "members.s1.stiffness: found inf, expected a finite number"),
    "number beyond floats": ("1e6", "1e400", "members.s1.stiffness: found inf, expected a finite number"),
    "infinite coordinate": (
        "[0, 0, 100]",
        "[0, 0, -.inf]",
        "nodes.9[2]: found -inf, expected a finite number",
    ),
    "text for a number": ("50 mm^2", "much", f"members.K1.area: found 'much', expected {IN_CM2}"),
    "truth value for a number": ("50 mm^2", "true", f"members.K1.area: found True, expected {IN_CM2}"),
    "negative area": (
        "50 mm^2",
        "-50 mm^2",
        "members.K1.area: found '-50 mm^2', expected a number greater than 0",
    ),
    "zero stiffness": ("1e6", "0", "members.s1.stiffness: found 0.0, expected a number greater than 0"),
    "zero modulus": (
        "115 GPa",
        "0 GPa",
        "materials.steel.youngs_modulus: found '0 GPa', expected a number greater than 0",
    ),
    "negative weight": (
        "7.85e-5",
        "-1",
        "materials.steel.weight: found -1.0, expected a number of at least 0",
    ),
    "zero rest length": ("2.3 m", "0", "members.K1.rest_length: found 0.0, expected a number greater than 0"),
    "two coordinates": (
        "[0, 100, 0]",
        "[0, 100]",
        "nodes.3: found [0, 100], expected three numbers [x, y, z]",
    ),
    "strut over three nodes": (
        "[1, 9]",
        "[1, 9, 2]",
        "members.s1.nodes: found ['1', '9', '2'], expected two nodes, for a strut runs straight between them",
    ),
    "path of one node": (
        "[9, 2]",
        "[9]",
        "members.K2.nodes: found ['9'], expected a path of at least two nodes",
    ),
    "path that stands still": (
        "[1, 2, 3]",
        "[1, 2, 2, 3]",
        "members.K1.nodes[2]: found '2', expected another node than the one before it",
    ),
    "member of zero length": (
        "[0, 0, 100]",
        "[0, 0, 0]",
        (
            "members.s1.nodes[1]: found '9', "
            "expected a node apart from '1': the segment between them has no length"
        ),
    ),
    "stiffness and area": (
        S1,
        S1.replace("}", ", area: 3}"),
        "members.s1.area: found 3.0, expected no area beside a stiffness: the stiffness is EA already",
    ),
    "material without area": (
        ", area: 50 mm^2",
        "",
        "members.K1.area: found nothing, expected an area beside the material, or a stiffness (EA)",
    ),
    "area without material": (
        " material: steel,",
        "",
        "members.K1.material: found nothing, expected the name of a material beside the area",
    ),
    "neither": (
        ", stiffness: 1e6",
        "",
        "members.s1: found nothing, expected either material and area, or stiffness (EA)",
    ),
    "inertia of a cable": (
        "groups: [top]",
        "section_inertia: 5",
        "members.K1.section_inertia: found 5.0, expected this key in struts with a material only",
    ),
    "zero strength": (
        S1,
        S1.replace("}", ", strength: 0}"),
        "members.s1.strength: found 0.0, expected a number greater than 0",
    ),
    "lonely node": (
        NODES,
        f"{NODES} 10: [1, 1, 1],",
        "nodes.10: found '10', expected a node that a member touches",
    ),
    "duplicate node": (NODES, f"{NODES} 1: [1, 1, 1],", "nodes: found '1', expected each key once"),
    "duplicate node as a text": (
        NODES,
        f"{NODES} '1': [1, 1, 1],",
        "nodes: found '1', expected each key once",
    ),
    "duplicate member": ("  K2:", "  s1:", "members: found 's1', expected each key once"),
    "duplicate key of a member": (
        "kind: strut,",
        "kind: strut, kind: strut,",
        "members.s1: found 'kind', expected each key once",
    ),
    "duplicate stage": (
        "name: load",
        "name: prestress",
        "stages[1].name: found 'prestress', expected a name that no earlier stage has",
    ),
    "group twice": ("[top]", "[top, top]", "members.K1.groups[1]: found 'top', expected each group once"),
    "group named as a member": (
        "[top]",
        "[K2, top]",
        "members.K1.groups[0]: found 'K2', expected another name, for a member has this one",
    ),
    "id that is neither": (
        NODES,
        "nodes: {1.5: [0, 0, 0],",
        "nodes: found 1.5, expected a key that is a text or a whole number",
    ),
    "empty id": ("s1:", "'':", "members: found '', expected a name: a whole number, or a text on one line"),
    "list for an id": (
        "material: steel",
        "material: [steel]",
        "members.K1.material: found ['steel'], expected a name: a whole number, or a text on one line",
    ),
    "text for a list": ("groups: [top]", "groups: top", "members.K1.groups: found 'top', expected a list"),
    "list for a mapping": (
        "{9: [0, 0, -1]}",
        "[9]",
        "stages[1].loads: found [9], expected a mapping of names to values",
    ),
    "change to nothing": (
        "-0.0255",
        "-1",
        (
            "stages[0].rest_length_changes.K1: found -1.0, "
            "expected a number greater than -1: the member keeps no rest length otherwise"
        ),
    ),
    "change of no member": (
        "{K1: -0.0255}",
        "{tip: -0.0255}",
        "stages[0].rest_length_changes: found 'tip', expected the id of a member or of a group",
    ),
    "rest length of a stage in other units": (
        "{K1: 225}",
        "{K1: 225e9}",
        (
            "stages[1].rest_lengths.K1: found 225000000000.0, "
            "expected a length within a factor of 1e+06 of 230, the rest length that the member begins with"
        ),
    ),
    "rest length of a stage": (
        "{K1: 225}",
        "{K1: -225}",
        "stages[1].rest_lengths.K1: found -225.0, expected a number greater than 0",
    ),
    "change beside a rest length": (
        "{K1: -0.0255}",
        "{K1: -0.0255}, rest_lengths: {K1: 225}",
        (
            "stages[0].rest_length_changes.K1: found -0.0255, "
            "expected no change beside a new rest length of the same member in one stage"
        ),
    ),
    "load on no node": (
        "{9: [0",
        "{99: [0",
        "stages[1].loads: found '99', expected the id of a node; did you mean '9'?",
    ),
    "load that is not finite": (
        "[0, 0, -1]}",
        "[0, 0, .nan]}",
        "stages[1].loads.9[2]: found nan, expected a finite number",
    ),
    "temperature that melts the rest length": (
        "20 K",
        "-1e5",
        (
            "stages[1].temperatures.top: found -100000.0, "
            "expected a temperature that leaves member 'K1' a rest length"
        ),
    ),
    "two temperatures of one member": (
        "{top: 20 K}",
        "{top: 20, K1: 30}",
        (
            "stages[1].temperatures.K1: found 30.0, expected one temperature of member 'K1', "
            "which 'top' sets too"
        ),
    ),
    "the same temperature of one member twice": (
        "{top: 20 K}",
        "{K1: 20, top: 20}",
        (
            "stages[1].temperatures.top: found 20.0, expected one temperature of member 'K1', "
            "which 'K1' sets too"
        ),
    ),
    "position of a free node": (
        "{2: [100, 1, 0]}",
        "{9: [0, 0, 0]}",
        "stages[1].positions: found '9', expected the id of a supported node",
    ),
    "position along a free axis": (
        "{2: [100, 1, 0]}",
        "{2: [101, 1, 0]}",
        (
            "stages[1].positions.2[0]: found 101.0, "
            "expected 100.0, as in `nodes`: no support holds the node along x"
        ),
    ),
    "gravity in one number": (
        "gravity: [0, 0, -1]",
        "gravity: -1",
        "stages[1].gravity: found -1, expected three numbers [x, y, z]",
    ),
}


@pytest.mark.parametrize(("written", "spoilt", "message"), REFUSALS.values(), ids=REFUSALS)
def test_a_file_is_refused_with_place_found_expected_and_nearest(
    tripod_text, tmp_path, written, spoilt, message
):
    assert written in tripod_text
    path = tmp_path / "tripod.yaml"
    path.write_text(tripod_text.replace(written, spoilt, 1), encoding="utf-8")
    with pytest.raises(ModelError) as caught:
        read_structure(path)
    told = str(caught.value)
    assert told.partition(" (and ")[0] == f"tripod.yaml: {message}"
    assert "\n" not in told


def test_a_part_that_nothing_holds_is_refused_beside_another(tripod_text, tmp_path):
    path = tmp_path / "tripod.yaml"
    loose = tripod_text.replace("9: [0, 0, 100]}", "9: [0, 0, 100], 20: [1, 0, 0], 21: [2, 0, 0]}").replace(
        "  K2:", "  K3: {kind: cable, nodes: [20, 21], stiffness: 1}\n  K2:"
    )
    path.write_text(loose, encoding="utf-8")
    with pytest.raises(
        ModelError, match=r"nodes\.20: found '20', expected a node connected to the others, or a"
    ):
        read_structure(path)
    path.write_text(loose.replace("1: xyz,", "1: xyz, 21: xyz,"), encoding="utf-8")
    assert read_structure(path).n_members == 4


def test_other_problems_are_counted(tripod_text, tmp_path):
    path = tmp_path / "tripod.yaml"
    path.write_text(tripod_text.replace("kind: ", "kin: "), encoding="utf-8")
    with pytest.raises(
        ModelError, match=r"^tripod\.yaml: members\.K1: found 'kin', .* \(and 5 more problems\)$"
    ):
        read_structure(path)


anything = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["1", "K1", "top"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4) | st.integers(), inner, max_size=3)
    ),
    max_leaves=6,
)


def places(value, place=()):
    """Return the places of all values inside mappings and lists."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [found for key, item in inside for found in ((*place, key), *places(item, (*place, key)))]


@given(data=st.data(), value=anything)
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_written_is_a_structure_or_a_model_error(tripod_text, data, value):
    content = yaml.safe_load(tripod_text)
    *above, last = data.draw(st.sampled_from(places(content)))
    target = content
    for key in above:
        target = target[key]
    target[last] = value
    try:
        result = parse_structure(content)
    except ModelError as error:
        assert "\n" not in str(error)  # noqa: PT017 — most contents are refused, some are not
    else:
        assert isinstance(result, Structure)
