"""Files as other programs and people make them, which tensegra has not written."""

import json
from itertools import pairwise

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

import tensegra as tg
from tensegra.exchange.clusters import path_of

PRISM = np.array([[1, -0.5, -0.5, 0.5, -1, 0.5], [0, 0.9, -0.9, 0.9, 0, -0.9], [0, 0, 0, 1, 1, 1.0]])


def incidence(pairs, n=6):
    C = np.zeros((len(pairs), n))
    for row, (start, end) in enumerate(pairs):
        C[row, start - 1], C[row, end - 1] = -1, 1
    return C


BARS = [(1, 4), (2, 5), (3, 6)]
STRINGS = [(1, 2), (2, 3), (3, 1), (4, 5), (6, 5), (6, 4), (1, 5), (2, 6), (3, 4)]


def prism(**changes):
    """Return the workspace of a prism whose top is one string, as the programs leave it."""
    S = np.zeros((10, 12))
    S[:6, :6] = np.eye(6)
    S[6, 6:9] = 1
    S[7:, 9:] = np.eye(3)
    values = {
        "N": PRISM,
        "C_b": incidence(BARS),
        "C_s": incidence(STRINGS),
        "S": S,
        "E": np.full((12, 1), 2e11),
        "A": np.r_[np.full(3, 1e-4), np.full(9, 1e-6)][:, None],
        "l0": np.full((12, 1), 1.0),
        "pinned_X": np.array([[1.0]]),
        "pinned_Z": np.array([[1.0], [2.0], [3.0]]),
        "gravity": 9.8,
    }
    return {name: value for name, value in (values | changes).items() if value is not None}


@pytest.mark.parametrize("pack", ["plain", "struct", "sparse", "npz"])
def test_matrices_of_a_clustered_prism(pack, tmp_path):
    values = prism()
    file = tmp_path / ("a.npz" if pack == "npz" else "a.mat")
    if pack == "npz":
        np.savez(file, **values)
    elif pack == "struct":
        savemat(file, {"data": values, "other": 1.0})
    else:
        if pack == "sparse":
            values |= {name: csc_array(values[name]) for name in ("C_b", "C_s", "S")}
        savemat(file, values)
    found = tg.read_structure(file)
    assert repr(found) == "Structure('a': 6 nodes, 3 struts, 6 cables, 1 clustered; 14 free dof; units m, N)"
    assert found.members["c4"].nodes == ("4", "5", "6", "4")
    assert found.members["c4"].rest_length == 3.0
    assert found.members["s1"].nodes == ("1", "4")
    assert found.axial_stiffness("s1") == pytest.approx(2e7)
    assert found.materials["material1"].youngs_modulus == 2e11
    assert dict(found.supports) == {"1": "xz", "2": "z", "3": "z"}


def test_pairs_of_indices_and_one_clustered_vector(tmp_path):
    values = prism(
        C_b=None,
        C_s=None,
        C_b_in=np.array(BARS),
        C_s_in=np.array(STRINGS),
        l0=None,
        l0_c=np.arange(1.0, 11.0),
    )
    savemat(tmp_path / "a.mat", values)
    found = tg.read_structure(tmp_path / "a.mat", unit="mm")
    assert [found.members[name].rest_length for name in ("s1", "c1", "c4")] == [1.0, 4.0, 7.0]
    assert found.units.length == "mm"


def test_an_order_of_its_own_and_nodes_that_are_drawn_only(tmp_path):
    order = [3, 0, 4, 1, 5, 2, *range(6, 12)]
    C = incidence(BARS + STRINGS)[order]
    S1 = np.array([[3.2, 0.0], [0.0, 1.7]])  # singular values, which such programs call S, too
    N = np.c_[PRISM, [[9.0], [9.0], [9.0]]]
    wide = {
        name: np.c_[matrix, np.zeros(len(matrix))]
        for name, matrix in {"C": C, "C_b": incidence(BARS), "C_s": incidence(STRINGS)}.items()
    }
    values = prism(N=N, S=S1, E=None, A=None, l0=None, t=np.arange(1.0, 13.0), **wide)
    savemat(tmp_path / "a.mat", values)
    found = tg.read_structure(tmp_path / "a.mat", strut_stiffness="20 MN", cable_stiffness=2e5)
    assert len(found.nodes) == 6
    kinds = [member.kind for member in found.members.values()]
    assert kinds == ["cable", "strut", "cable", "strut", "cable", "strut", *["cable"] * 6]
    # The rest length is the one with which the member carries its tension where it is.
    member = found.members["s1"]
    length = np.linalg.norm(np.subtract(found.nodes["1"], found.nodes["4"]))
    assert 2e7 * (length - member.rest_length) / member.rest_length == pytest.approx(2.0, rel=1e-6)


APART = np.vstack([np.eye(12)[:3], np.eye(12)[3] + np.eye(12)[7], np.eye(12)[[4, 5, 6, 8, 9, 10, 11]]])
"""Two strings that do not meet as one member."""


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"N": None}, "expected the matrix N"),
        ({"N": np.ones((2, 6))}, r"N: found 'a matrix of \(2, 6\)', expected coordinates"),
        ({"N": np.where(PRISM == 1, np.nan, PRISM)}, "N: found 'a number that is not finite'"),
        ({"N": PRISM.astype(complex)}, "N: found 'an array of complex128', expected real numbers"),
        ({"N": PRISM[:, :5]}, "6 columns', expected one for each of the 5 nodes"),
        ({"C_s": incidence(STRINGS) * 2}, "C_s: .* expected rows with one −1 and one"),
        ({"C_s": np.abs(incidence(STRINGS))}, "C_s: .*one −1 and one"),
        ({"S": np.ones((3, 12))}, "S: .* a single 1 in each column"),
        ({"S": np.eye(11)}, "S: .* 12 columns"),
        ({"S": np.vstack([np.r_[1, 1, np.zeros(10)], np.eye(12)[2:]])}, "row 1: found 'a bar among several'"),
        ({"S": APART}, "row 4: found 'segments 1–2, 6–5', expected segments that one cable runs along"),
        ({"l0": np.ones(7)}, "l0: found '7 numbers', expected 12 numbers, .*, or 10"),
        ({"A": np.linspace(1, 2, 12)}, "A, row 7 of S: .*expected one number for all segments"),
        ({"pinned_X": np.array([[7.0]])}, "pinned_X: .* whole numbers from 1 to 6"),
        ({"pinned_X": np.array([[0.5]])}, "pinned_X"),
        ({"l0": -np.ones(12)}, "rest_length"),
    ],
)
def test_matrices_that_cannot_be(changes, said, tmp_path):
    savemat(tmp_path / "a.mat", prism(**changes))
    with pytest.raises(tg.ModelError, match=f"^a.mat.*{said}"):
        tg.read_structure(tmp_path / "a.mat")


@pytest.mark.parametrize(
    ("segments", "path"),
    [
        ([(0, 1)], [0, 1]),
        ([(2, 1), (0, 1)], [0, 1, 2]),
        ([(0, 1), (2, 0), (1, 2)], [0, 1, 2, 0]),
        ([(1, 2), (1, 2), (1, 0)], [0, 1, 2, 1]),
    ],
)
def test_segments_in_any_order_are_one_path(segments, path):
    found = path_of(np.array(segments), "S")
    steps = sorted(tuple(sorted(pair)) for pair in pairwise(found))
    assert steps == sorted(tuple(sorted(pair)) for pair in segments)
    assert len(found) == len(path)


def test_tables_as_people_make_them(tmp_path):
    (tmp_path / "tower nodes.csv").write_text(
        "node;x;y;z;supports\nA;0;0;0;xyz\nB;1 m;0;0;yz\nC;0;1;0;xy\n", encoding="utf-8-sig"
    )
    (tmp_path / "tower members.csv").write_text(
        "member;kind;start;end;nodes;youngs_modulus;area;rest_length;groups\n"
        "s;strut;A;B;;210 GPa;100 mm^2;;\n\n"
        'k;cable;;;B, C, A;2.1e11;1e-6;2.4;"top, all"\n',
        encoding="utf-8",
    )
    found = tg.read_structure(tmp_path / "tower members.csv")
    assert found.members["k"].nodes == ("B", "C", "A")
    assert found.members["k"].groups == ("top", "all")
    assert found.axial_stiffness("s") == pytest.approx(2.1e7)
    assert found.nodes["B"] == (1.0, 0.0, 0.0)
    assert found == tg.read_structure(tmp_path / "tower nodes.csv").replace(name=found.name)


TWO, HEAD = "node,x,y,z\n1,0,0,0\n2,1,0,0\n", "member,kind,nodes,stiffness\n"


@pytest.mark.parametrize(
    ("nodes", "members", "said"),
    [
        ("node,x,y\n1,0,0\n", "member,kind,nodes\n", "nodes.csv, first line: .* a column 'z'"),
        ("node,x,y,z,colour\n", "member,kind,nodes\n", "first line: found 'colour', expected columns named"),
        (TWO.replace("\n2", "\n1"), HEAD, "line 3: found '1', expected the id of another node"),
        ("node,x,y,z\n1,0,nan,0\n2,1,0,0\n", HEAD + "a,strut,1 2,1\n", "nodes.1"),
        (TWO, "member,kind,stiffness\na,strut,5\n", "line 2: found 'no nodes'"),
        (TWO, HEAD + "a,strut,1 2,much\n", "line 2, stiffness: found 'much'"),
        (TWO, HEAD + "a,rod,1 2,5\n", "did you mean 'strut'"),
        (TWO, HEAD + "a,strut,1 3,5\n", "members.a.nodes"),
        ("node,x,y,z\n1,0,0,0,9\n", "member,kind,nodes\n", "line 2: found '5 cells', expected at most 4"),
        ('node,x,y,z\n1,0,0,"0\n', "member,kind,nodes\n", "this is not a table"),
    ],
)
def test_tables_that_cannot_be(nodes, members, said, tmp_path):
    (tmp_path / "nodes.csv").write_text(nodes, encoding="utf-8")
    (tmp_path / "members.csv").write_text(members, encoding="utf-8")
    with pytest.raises(tg.ModelError, match=said):
        tg.read_structure(tmp_path / "nodes.csv")


@pytest.fixture
def drawing(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    made = ezdxf.new("R2000")
    made.header["$INSUNITS"] = 4
    space = made.modelspace()
    for layer, start, end in (
        ("Bars", (0, 0, 0), (1000, 0, 0)),
        ("tendon-top", (1000, 0.0001, 0), (0, 0, 500)),
        ("7", (0, 0, 500), (0, 0, 0)),
    ):
        space.add_line(start, end, dxfattribs={"layer": layer})
    space.add_polyline3d([(0, 0, 0), (0, 800, 0), (0, 0, 500)], dxfattribs={"layer": "CABLES_side"})
    space.add_circle((0, 0), 5)
    made.saveas(tmp_path / "a.dxf")
    return tmp_path / "a.dxf"


def test_a_drawing_of_lines_by_layer(drawing):
    said = {"strut_stiffness": "10 MN", "cable_stiffness": 1e5}
    with pytest.raises(tg.ModelError, match="layer: found '7', expected a name that begins with 'strut'"):
        tg.read_structure(drawing, **said)
    found = tg.read_structure(drawing, cables=["7"], **said)
    assert repr(found) == "Structure('a': 4 nodes, 1 strut, 2 cables, 1 clustered; 12 free dof; units mm, N)"
    assert [member.groups for member in found.members.values()] == [(), ("top",), ("7",), ("side",)]
    assert found.members["c3"].nodes == ("1", "4", "3")
    assert tg.read_structure(drawing, unit="cm", cables=["7"], **said).units.length == "cm"
    with pytest.raises(tg.ModelError, match=r"stiffness of 1 struts .* --strut-stiffness"):
        tg.read_structure(drawing, cables=["7"], cable_stiffness=1e5)


def network(**changes):
    value = {
        "dtype": "compas.datastructures/Network",
        "data": {
            "attributes": {"name": "arch"},
            "default_node_attributes": {"x": 0.0, "y": 0.0, "z": 0.0, "is_support": False},
            "default_edge_attributes": {"q": -2.0},
            "node": {"0": {"is_support": True}, "1": {"x": 1.0}, "'a b'": {"y": 1.0, "is_support": True}},
            "edge": {"0": {"1": {}}, "1": {"'a b'": {"q": 3.0, "f": 30.0}}},
            "adjacency": {},
        },
    }
    value["data"] |= changes
    return value


def test_a_network_of_force_densities(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(network()), encoding="utf-8")
    found = tg.read_structure(tmp_path / "a.json", strut_stiffness=1e6, cable_stiffness=1e6)
    assert found.name == "arch"
    assert [member.kind for member in found.members.values()] == ["strut", "cable"]
    assert dict(found.supports) == {"0": "xyz", "a b": "xyz"}
    assert found.members["c1"].rest_length == pytest.approx(2**0.5 / (1 + 30 / 1e6), rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"edge": {"0": {"7": {}}}}, "data.edge: found '7', expected the key of a node"),
        ({"default_edge_attributes": {}}, "data.edge.0.1: found .*expected a kind"),
        ({"node": []}, "data.node: .* a mapping"),
        (
            {"attributes": {"members": {"k": {"kind": "cable", "nodes": ["0", "1"]}}}},
            "an edge without a member",
        ),
        ({"edge": {"0": {"1": {"kind": "strut", "rest_length": float("nan")}}}}, "rest_length"),
    ],
)
def test_networks_that_cannot_be(changes, said, tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(network(**changes)), encoding="utf-8")
    with pytest.raises(tg.ModelError, match=f"^a.json.*{said}"):
        tg.read_structure(tmp_path / "a.json", strut_stiffness=1e6, cable_stiffness=1e6)


ROBOT = """<mujoco>
  <compiler angle="degree"/>
  <default><geom type="capsule" size="0.02"/><tendon stiffness="500"/></default>
  <worldbody>
    <body name="base"><geom name="mast" fromto="0 0 0 0 0 2"/>
      <site name="foot" pos="0 0 0"/><site name="head" pos="0 0 2.015"/></body>
    <body name="boom" pos="0 0 3" euler="0 90 0"><freejoint/><geom name="boom" fromto="0 0 -1 0 0 1"/>
      <site name="left" pos="0 0 -1"/><site name="right" pos="0 0 1"/></body>
    <site name="wall" pos="5 0 0"/>
  </worldbody>
  <tendon>
    <spatial name="stay" springlength="0 2.5">
      <site site="left"/><site site="head"/><site site="right"/></spatial>
    <spatial name="guy" springlength="4.5"><site site="head"/><site site="wall"/></spatial>
    <spatial name="low"><site site="left"/><site site="foot"/></spatial>
  </tendon>
</mujoco>"""


def test_a_robot_of_capsules_and_tendons(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "robot.xml").write_text(ROBOT, encoding="utf-8")
    found = tg.read_structure(tmp_path / "robot.xml", strut_stiffness="5 MN")
    assert found.members["stay"].nodes == ("left", "head", "right")
    assert found.members["stay"].stiffness == pytest.approx(1250.0)
    assert found.members["guy"].kind == "cable"
    assert found.members["guy"].rest_length == 4.5
    assert found.members["mast"].nodes == ("foot", "head")
    assert found.members["boom"].rest_length == pytest.approx(2.0)
    assert found.nodes["left"] == pytest.approx((-1.0, 0.0, 3.0))
    assert dict(found.supports) == {"foot": "xyz", "head": "xyz", "wall": "xyz"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("2.015", "1.5", "site head: found .a point within a capsule"),
        ('<site name="wall" pos="5 0 0"/>', "", "MuJoCo refuses it"),
        (
            "<worldbody>",
            '<worldbody><replicate count="1000000000"><geom size="1"/></replicate>',
            "<replicate>",
        ),
        (
            "<mujoco>",
            '<!DOCTYPE m [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><mujoco model="&b;">',
            "a document type",
        ),
        ("</mujoco>", "", "this is not XML"),
        ("<worldbody>", '<include file="/etc/hostname"/><worldbody>', "<include>"),
        ("5 0 0", "nan 0 0", "robot.xml"),
    ],
)
def test_models_that_cannot_be(old, new, said, tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.xml").write_text(ROBOT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(tg.ModelError, match=said):
        tg.read_structure(tmp_path / "robot.xml", strut_stiffness="5 MN")
    assert [file.name for file in tmp_path.iterdir()] == ["robot.xml"]
