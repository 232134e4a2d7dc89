import json
import subprocess
import sys

import numpy as np
import pytest

from tensegra.errors import ModelError
from tensegra.structure import Stage, Units, parse_structure, read_structure


def test_a_file_is_read_in_its_own_units(tripod_file):
    tripod = read_structure(tripod_file)
    assert tripod.units == Units("cm", "kN", "degC")
    assert tripod.materials["steel"].youngs_modulus == 11500.0
    assert tripod.materials["steel"].thermal_expansion == 1.6e-5
    loop = tripod.members["K1"]
    assert (loop.kind, loop.nodes, loop.area, loop.rest_length) == ("cable", ("1", "2", "3"), 0.5, 230.0)
    assert tripod.supports == {"1": "xyz", "2": "yz"}
    assert tripod.gravity == (0.0, 0.0, 0.0)
    assert tripod.actuators["A1"].members == ("K1", "K2")
    assert tripod.stages == (
        Stage("prestress", rest_length_changes={"K1": -0.0255}),
        Stage(
            "load",
            rest_lengths={"K1": 225.0},
            loads={"9": (0.0, 0.0, -1.0)},
            temperatures={"top": 20.0},
            positions={"2": (100.0, 1.0, 0.0)},
            gravity=(0.0, 0.0, -1.0),
        ),
    )


def test_json_and_yaml_say_the_same(tripod_file):
    tripod = read_structure(tripod_file)
    content = {
        "schema": "tensegra/structure/1",
        "name": "tripod",
        "units": {"length": "cm", "force": "kN", "temperature": "degC"},
        "nodes": {"1": [0, 0, 0], "2": ["1 m", 0, 0], "3": [0, 100, 0], "9": [0, 0, 100]},
        "materials": {
            "steel": {"youngs_modulus": 11500, "weight": "78.5 kN/m^3", "thermal_expansion": "1.6e-5"}
        },
        "members": {
            "K1": {
                "kind": "cable",
                "nodes": [1, 2, "3"],
                "material": "steel",
                "area": 0.5,
                "rest_length": 230,
                "groups": ["top"],
            },
            "s1": {"kind": "strut", "nodes": ["1", "9"], "stiffness": "1000 MN"},
            "K2": {"kind": "cable", "nodes": ["9", "2"], "stiffness": "1e6"},
        },
        "supports": {"1": "xyz", "2": "yz"},
        "actuators": {"A1": {"members": ["K1", "K2"], "effect": "shorten"}},
        "stages": [
            {"name": "prestress", "rest_length_changes": {"K1": "-2.55 %"}},
            {
                "name": "load",
                "rest_lengths": {"K1": "2.25 m"},
                "loads": {"9": [0, 0, "-1000 N"]},
                "temperatures": {"top": "36 degF"},
                "positions": {"2": ["1 m", "10 mm", 0]},
                "gravity": [0, 0, -1],
            },
        ],
    }
    path = tripod_file.with_suffix(".json")
    path.write_text(json.dumps(content), encoding="utf-8")
    assert read_structure(path) == tripod


def test_what_is_left_out_has_a_default(rope):
    assert rope.units == Units("m", "N", "K")
    assert rope.members["K1"].rest_length == 5.0
    assert rope.gravity == (0.0, 0.0, 0.0)
    assert not rope.materials
    assert not rope.actuators
    assert rope.stages == ()


def test_a_file_without_a_name_lends_its_own(tripod_text, tmp_path):
    path = tmp_path / "mast.structure.yml"
    path.write_text(tripod_text.replace("name: tripod\n", ""), encoding="utf-8")
    assert read_structure(path).name == "mast"


def test_a_stage_without_a_name_is_called_by_its_number(tripod_text, tmp_path):
    path = tmp_path / "mast.yaml"
    path.write_text(tripod_text.replace("  - name: load\n    rest", "  - rest"), encoding="utf-8")
    assert [stage.name for stage in read_structure(path).stages] == ["prestress", "stage 2"]


def test_the_length_along_a_closed_loop_is_its_rest_length():
    loop = parse_structure(
        {
            "nodes": dict(enumerate(np.eye(3))),
            "members": {"loop": {"kind": "cable", "nodes": [0, 1, 2, 0], "stiffness": 1.0}},
            "supports": {0: "xyz"},
        }
    )
    assert loop.members["loop"].rest_length == pytest.approx(3 * 2**0.5)


def test_ids_that_yaml_1_1_would_bend_stay_what_they_are(tmp_path):
    path = tmp_path / "rope.yaml"
    path.write_text(
        "{schema: tensegra/structure/1, nodes: {no: [0, 0, 0], 1:30: [1e0, 0, 0], y: [2, 0, 010]},"
        " members: {on: {kind: cable, nodes: [no, 1:30], stiffness: 1e3},"
        " 2024-01-01: {kind: cable, nodes: [1:30, y], stiffness: 5.E-1}}}",
        encoding="utf-8",
    )
    rope = read_structure(path)
    assert rope.nodes == {"no": (0.0, 0.0, 0.0), "1:30": (1.0, 0.0, 0.0), "y": (2.0, 0.0, 10.0)}
    assert rope.member_ids == ("on", "2024-01-01")
    assert rope.members["on"].stiffness == 1000.0


def test_yaml_anchors_and_merge_keys_serve_repetition(tmp_path):
    path = tmp_path / "rope.yaml"
    path.write_text(
        "schema: tensegra/structure/1\n"
        "nodes: {1: [0, 0, 0], 2: [1, 0, 0], 3: [2, 0, 0]}\n"
        "members:\n"
        "  a: &cable {kind: cable, stiffness: 5, nodes: [1, 2]}\n"
        "  b: {<<: *cable, nodes: [2, 3]}\n",
        encoding="utf-8",
    )
    members = read_structure(path).members
    assert members["b"].stiffness == members["a"].stiffness
    assert members["b"].nodes == ("2", "3")


def test_a_byte_order_mark_does_no_harm(tripod_file, tripod_text):
    tripod_file.write_text(tripod_text, encoding="utf-8-sig")
    assert read_structure(str(tripod_file)).name == "tripod"


def test_a_plain_file_is_read_without_pint(tmp_path, tripod_text):
    plain = tripod_text.replace("115 GPa", "11500").replace(" 1/K", "").replace("50 mm^2", "0.5")
    plain = plain.replace("2.3 m", "230").replace("20 K", "20")
    path = tmp_path / "plain.yaml"
    path.write_text(plain, encoding="utf-8")
    program = (
        "import sys; import tensegra.structure as s; assert 'pydantic' not in sys.modules;"
        f"s.read_structure({str(path)!r}); assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)  # noqa: S603 — a fixed program


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.yaml", "", r"a\.yaml: found None, expected a mapping of keys to values"),
        ("a.yaml", "- 1", r"a\.yaml: found \[1\], expected a mapping"),
        ("a.yaml", "a: [1", r"a\.yaml: line \d+, column \d+: "),
        (
            "a.yaml",
            "a: !!python/object:os.system 1",
            r"a\.yaml: line 1, column 4: could not determine a constructor",
        ),
        ("a.yaml", "a: &x [*x]", r"a\.yaml: found a list that holds itself"),
        ("a.yaml", "a: \x00", r"a\.yaml: .*control characters"),
        ("a.yaml", "{a: 1}\n---\n{a: 1}", r"a\.yaml: .*document"),
        ("a.yaml", "{schema: tensegra/structure/2}", r"schema: found 'tensegra/structure/2', expected"),
        ("a.json", "{", r"a\.json: line 1, column 2: Expecting property name"),
        ("a.json", "[" * 100_000, r"a\.json: nested too deeply"),
        ("a.json", '{"schema": 1, "schema": 2}', r"a\.json: found 'schema', expected each key once"),
        ("a.txt", "", r"a\.txt: found '\.txt', expected a file named \.yaml, \.yml or \.json"),
    ],
)
def test_a_text_that_is_no_structure_is_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=message):
        read_structure(tmp_path / name)


def test_aliases_of_aliases_cannot_fill_the_memory(tmp_path):
    layers = "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 60))
    path = tmp_path / "laughs.yaml"
    path.write_text(
        f"schema: tensegra/structure/1\na0: &a0 [0]\n{layers}nodes: *a59\nmembers: {{}}\n", encoding="utf-8"
    )
    with pytest.raises(ModelError, match=r"laughs\.yaml: found more than \d+ values"):
        read_structure(path)


def test_a_file_that_cannot_be_read_is_named(tmp_path, tripod_file):
    with pytest.raises(ModelError, match=r"tripodd\.yaml: no such file; did you mean 'tripod\.yaml'\?$"):
        read_structure(tmp_path / "tripodd.yaml")
    with pytest.raises(ModelError, match=r"nowhere.*tripod\.yaml: no such file$"):
        read_structure(tmp_path / "nowhere" / "tripod.yaml")
    (tmp_path / "folder.yaml").mkdir()
    with pytest.raises(ModelError, match=r"folder\.yaml: is a directory"):
        read_structure(tmp_path / "folder.yaml")
    tripod_file.write_bytes(b"name: \xff")
    with pytest.raises(ModelError, match=r"^tripod\.yaml: this is not a text in UTF-8$"):
        read_structure(tripod_file)
