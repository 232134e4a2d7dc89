"""The commands new, schema, import and export: what they write, and what they refuse without writing."""

import json
import os
import zlib
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.io import savemat

import tensegra as tg
from tensegra.exchange import files
from tensegra.structure import library

STUDY = {
    "schema": "tensegra/study/1",
    "structure": "library:prism",
    "variables": {"top": {"actuator": "top", "distribution": {"uniform": [0.0, 0.02]}}},
    "outputs": {"w": {"displacement": "z", "nodes": ["t2"]}},
    "derivatives": True,
    "design": {"sampler": "sobol", "sizes": 8},
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def refused(tensegra, *arguments):
    """Run a command that has to be refused with one line; return it."""
    code, out, err = tensegra(*arguments)
    assert (code, out) == (2, ""), err
    assert err.startswith("tensegra: error: ")
    assert err.count("\n") == 1
    return err


def test_new_files_run_as_they_are(tensegra, folder):
    (folder / "mine").mkdir()
    code, out, _ = tensegra("new", "mine/tower.yaml")
    assert code == 0
    assert "tensegra check" in out
    assert names(folder / "mine") == ["study.yaml", "tower.yaml"]
    assert tg.read_structure("mine/tower.yaml") == library.prism()
    assert tensegra("check", "mine/tower.yaml")[0] == 0
    assert tensegra("run", "mine/study.yaml", "-o", "runs")[0] == 0
    text = Path("mine/tower.yaml").read_text(encoding="utf-8")
    for section in ("nodes", "materials", "members", "supports", "gravity", "actuators", "stages", "units"):
        line = next(
            i for i, line in enumerate(text.splitlines()) if line.lstrip("# ").startswith(f"{section}:")
        )
        assert text.splitlines()[line - 1].startswith("#"), section


@pytest.mark.parametrize("name", library.__all__)
def test_every_built_in_structure_is_a_beginning(tensegra, folder, name):
    assert tensegra("new", "--from", f"library:{name}", "--study", "question.yml", "--json")[0] == 0
    assert tg.read_structure("structure.yaml") == getattr(library, name)()
    study = tg.read_study("question.yml")
    assert study.structure == getattr(library, name)()
    assert names(folder) == ["question.yml", "structure.yaml"]


@pytest.mark.slow
@pytest.mark.parametrize("name", library.__all__)
def test_every_first_study_runs(tensegra, folder, name):
    assert tensegra("new", "--from", f"library:{name}")[0] == 0
    assert tensegra("check", "structure.yaml")[0] == 0
    assert tensegra("run", "study.yaml", "-o", "runs")[0] == 0
    assert set(tg.open_campaign(folder / "runs").state().statuses) == {"stable"}


def test_new_writes_over_nothing_unasked(tensegra, folder):
    (folder / "study.yaml").write_text("mine")
    assert "there is such a file already; --force writes over it" in refused(tensegra, "new")
    assert names(folder) == ["study.yaml"]
    assert tensegra("new", "--force")[0] == 0
    assert "found 'a.yaml'" in refused(tensegra, "new", "a.yaml", "--study", "a.yaml")
    assert "named .yaml or .yml" in refused(tensegra, "new", "a.txt")
    assert "did you mean 'prism'" in refused(
        tensegra, "new", "a.yaml", "--study", "b.yaml", "--from", "library:prsm"
    )
    assert "a built-in structure" in refused(
        tensegra, "new", "a.yaml", "--study", "b.yaml", "--from", "x.yaml"
    )
    assert names(folder) == ["structure.yaml", "study.yaml"]


@pytest.mark.parametrize("name", ["structure", "study"])
def test_schemas_are_printed(tensegra, name):
    code, out, _ = tensegra("schema", name)
    assert code == 0
    assert json.loads(out)["title"] == f"tensegra/{name}/1"


def test_an_unknown_schema_is_refused(tensegra):
    assert "did you mean 'structure'" in refused(tensegra, "schema", "structures")


@pytest.mark.usefixtures("folder")
def test_import_writes_a_structure_file(tensegra):
    library.paper_beam().save("beam.mat")
    code, out, _ = tensegra("import", "beam.mat", "-o", "beam.yaml", "--unit", "cm", "--force-unit", "kN")
    assert code == 0
    assert "units cm, kN" in out
    assert tensegra("check", "beam.yaml")[0] in (0, 1)
    library.prism().save("graph.json", format="compas")
    code, out, _ = tensegra("import", "graph.json", "-o", "b.json", "--json")
    assert (code, json.loads(out)["members"]) == (0, 12)
    assert tg.read_structure("b.json").n_members == 12


@pytest.mark.usefixtures("folder")
def test_commands_take_a_foreign_file_as_it_is(tensegra):
    library.prism().save("prism.mat")
    assert tensegra("check", "prism.mat")[0] == 0


@pytest.mark.usefixtures("folder")
def test_export_writes_where_the_structure_comes_to_rest(tensegra):
    code, out, _ = tensegra("export", "library:prism", "-a", "top=0.02", "-o", "a.mat", "--json")
    assert (code, json.loads(out)["status"]) == (0, "stable")
    path = tg.solve_path(library.prism(), {"top": 0.02})
    found = tg.read_structure("a.mat")
    assert np.abs(found.coordinates - path.final.nodes).max() < 1e-12
    assert tensegra("export", "library:prism", "--drawing", "-o", "b.mat")[0] == 0
    assert np.array_equal(tg.read_structure("b.mat").coordinates, library.prism().coordinates)
    assert tensegra("export", "library:prism", "--format", "compas", "-o", "c.json")[0] == 0
    assert json.loads(Path("c.json").read_text())["dtype"].startswith("compas")


def test_export_of_a_path_that_ends_early_is_told(tensegra, folder):
    code, out, _ = tensegra("export", "library:von_mises_truss", "-o", "a.vtu")
    assert code == 0
    (folder / "falls.yaml").write_text(yaml.safe_dump({
        "schema": "tensegra/structure/1",
        "nodes": {1: [0, 0, 0], 2: [1, 0, 0]},
        "members": {"k": {"kind": "cable", "nodes": [1, 2], "stiffness": 10, "rest_length": 2}},
        "supports": {1: "xyz"},
    }))  # fmt: skip
    code, out, _ = tensegra("export", "falls.yaml", "-o", "falls.vtu")
    assert code == 1
    assert "falls.vtu: collapsed" in out
    assert Path("falls.vtu").is_file()


def test_export_of_a_campaign(tensegra, folder):
    (folder / "study.yaml").write_text(yaml.safe_dump(STUDY))
    assert tensegra("run", "study.yaml", "-o", "runs")[0] == 0
    frame = tg.open_campaign(folder / "runs").frame()
    assert tensegra("export", "runs", "-o", "a.csv")[0] == 0
    lines = Path("a.csv").read_text().splitlines()
    assert lines[0].split(",")[:3] == ["point", "top", "w"]
    assert [float(line.split(",")[2]) for line in lines[1:]] == list(frame["w"])
    for file in ("a.mat", "a.npz"):
        assert tensegra("export", "runs", "-o", file)[0] == 0
    with np.load("a.npz") as archive:
        assert np.array_equal(archive["dw_dtop"], frame["dw/dtop"])
    assert tensegra("export", "runs", "--figure", "1", "-o", "a.svg")[0] == 0
    assert "<svg" in Path("a.svg").read_text()
    assert "one of the" in refused(tensegra, "export", "runs", "--figure", "99", "-o", "b.svg")
    assert "its rows have no shapes" in refused(tensegra, "export", "runs", "-o", "b.vtu")
    assert "solved already" in refused(tensegra, "export", "runs", "-a", "top=0.1", "-o", "b.csv")
    assert not Path("b.svg").exists()
    assert not Path("b.vtu").exists()


def test_a_campaign_in_netcdf(tensegra, folder):
    xarray = pytest.importorskip("xarray")
    (folder / "study.yaml").write_text(yaml.safe_dump(STUDY))
    assert tensegra("run", "study.yaml", "-o", "runs")[0] == 0
    assert tensegra("export", "runs", "-o", "a.nc")[0] == 0
    with xarray.open_dataset("a.nc", engine="scipy") as runs:
        assert runs["dw_dtop"].attrs["long_name"] == "dw/dtop"
        assert runs["w"].attrs["units"] == "m"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("import", "none.mat", "-o", "a.yaml"), "none.mat: no such file"),
        (("import", ".", "-o", "a.yaml"), "to read: .mat, .npz"),
        (("import", "a.stl", "-o", "a.yaml"), "to read: .mat, .npz"),
        (("import", "p.vtu", "-o", "a.yaml"), "found '.vtu'"),
        (("import", "p.mat", "-o", "a.txt"), "expected a file named .yaml"),
        (("import", "p.mat", "-o", "no/a.yaml"), "no such file or directory"),
        (("import", "p.mat", "--unit", "feet2", "-o", "a.yaml"), "units.length: found 'feet2'"),
        (("import", "p.mat", "--format", "dfx", "-o", "a.yaml"), "did you mean 'dxf'"),
        (("import", "s.yaml", "--unit", "cm", "-o", "a.yaml"), "says its units and stiffnesses itself"),
        (("import", "s.yaml", "-o", "s.yaml"), "another file than the one that is read"),
        (("export", "library:prism", "-o", "a.stl"), "to write: .mat"),
        (("export", "library:prism", "-o", "no/a.mat"), "cannot be written (no such file or directory)"),
        (("export", "library:prism", "-o", "folder.mat"), "it is a folder"),
        (("export", "library:prism", "--drawing", "-a", "top=0.1", "-o", "a.mat"), "leave out -a"),
        (("export", "library:prism", "--figure", "1", "-o", "a.svg"), "--figure is for a campaign"),
        (("export", "library:prism", "-a", "tip=0.1", "-o", "a.mat"), "did you mean 'top'"),
        (("export", "nothing", "-o", "a.mat"), "nothing"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(tensegra, folder, arguments, said):
    library.prism().save("p.mat")
    library.prism().save("s.yaml")
    (folder / "folder.mat").mkdir()
    before = names(folder)
    assert said in refused(tensegra, *arguments)
    assert names(folder) == before


def _pipe(file):
    os.mkfifo(file)


def _bomb(file):
    """Write a variable of MATLAB that unpacks to a hundred times what is allowed."""
    body = (14).to_bytes(4, "little") + (2**32 - 8).to_bytes(4, "little") + bytes(100)
    packed = zlib.compress(body)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    file.write_bytes(head + (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little") + packed)


def _spoilt_cells(file):
    """Write names in cells that are noise, at which SciPy's reader may end by a fault of memory."""
    library.prism(clustered=True).save(file)
    content = bytearray(file.read_bytes())
    at = content.index(b"member_ids")
    random = np.random.default_rng(3)
    for place in random.integers(at + 16, at + 200, 40):
        content[place] = random.integers(256)
    file.write_bytes(content)


def _pickled(file):
    np.savez(file, N=np.array([{"a": 1}], dtype=object), allow_pickle=True)


def _cut(file):
    savemat(file, {"N": np.zeros((3, 50))}, do_compression=True)
    file.write_bytes(file.read_bytes()[:-20])


HOSTILE = {
    "empty.mat": lambda file: file.write_bytes(b""),
    "noise.mat": lambda file: file.write_bytes(bytes(range(256)) * 4),
    "v73.mat": lambda file: file.write_bytes(b"MATLAB 7.3".ljust(124) + b"\x00\x02IM\x89HDF\r\n\x1a\n"),
    "bomb.mat": _bomb,
    "cut.mat": _cut,
    "spoilt.mat": _spoilt_cells,
    "pickled.npz": _pickled,
    "noise.npz": lambda file: file.write_bytes(b"PK\x03\x04" + bytes(100)),
    "noise.dxf": lambda file: file.write_bytes(bytes(range(256))),
    "empty.dxf": lambda file: file.write_text("0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n"),
    "broken.xml": lambda file: file.write_text("<mujoco><worldbody>"),
    "other.xml": lambda file: file.write_text("<svg/>"),
    "lol.xml": lambda file: file.write_text(
        "<!DOCTYPE l [<!ENTITY a 'lol'>" + "".join(
            f"<!ENTITY {b} '{f'&{a};' * 10}'>" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
        ) + "]><mujoco model='&i;'/>"
    ),
    "utf16.xml": lambda file: file.write_text("<!DOCTYPE l [<!ENTITY a 'b'>]><mujoco/>", encoding="utf-16"),
    "deep.json": lambda file: file.write_text('{"dtype": "compas", "a": ' + "[" * 9_999 + "]" * 9_999 + "}"),
    "nan.json": lambda file: file.write_text(
        '{"dtype": "compas.datastructures/Graph", "data": {"node": {"0": {"x": NaN}, "1": {"x": 1}}, '
        '"edge": {"0": {"1": {"kind": "strut", "stiffness": 1}}}}}'
    ),
    "a_nodes.csv": lambda file: file.write_bytes(b"node,x,y,z\n\xff\xfe"),
    "long_nodes.csv": lambda file: file.write_text("node,x,y,z\n" + "9" * 200_000 + ",0,0,0\n"),
    "pipe.mat": _pipe,
    "pipe.xml": _pipe,
    "pipe.dxf": _pipe,
    "pipe.json": _pipe,
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_in_a_line(tensegra, folder, name):
    if name.endswith(".dxf"):
        pytest.importorskip("ezdxf")
    if name.endswith(".xml"):
        pytest.importorskip("mujoco")
    if name.startswith("pipe") and not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    HOSTILE[name](folder / name)
    said = refused(tensegra, "import", name, "-o", "out.yaml")
    assert name in said
    assert names(folder) == [name]


@pytest.mark.usefixtures("folder")
def test_a_file_of_any_size_is_asked_for_its_size_first(tensegra, monkeypatch):
    library.prism().save("p.mat")
    monkeypatch.setattr(files, "LARGEST_FILE", 100)
    assert "a file of at most 100 bytes" in refused(tensegra, "import", "p.mat", "-o", "out.yaml")


def test_names_of_a_structure_lead_nowhere(tensegra, folder):
    structure = library.prism().replace(name="../../elsewhere")
    (folder / "in").mkdir()
    structure.save("in/s.yaml")
    for suffix in ("mat", "vtu", "pvd", "gltf", "csv"):
        assert tensegra("export", "in/s.yaml", "-o", f"in/a.{suffix}")[0] == 0
    assert names(folder) == ["in"]
    assert names(folder / "in") == [
        "a", "a.gltf", "a.mat", "a.pvd", "a.vtu", "a_members.csv", "a_nodes.csv", "s.yaml"
    ]  # fmt: skip


@pytest.mark.parametrize(("module", "file"), [("ezdxf", "a.dxf"), ("xarray", "a.nc"), ("mujoco", "a.xml")])
def test_a_missing_library_is_named_with_its_extra(tensegra, folder, monkeypatch, module, file):
    (folder / "a.xml").write_text("<mujoco/>")
    monkeypatch.setitem(__import__("sys").modules, module, None)
    arguments = (
        ("import", file, "-o", "b.yaml") if file == "a.xml" else ("export", "library:prism", "-o", file)
    )
    said = refused(tensegra, *arguments)
    assert f"needs the library '{module}', which is not installed" in said
    assert "pip install tensegra[exchange]" in said
    assert names(folder) == ["a.xml"]


@pytest.mark.usefixtures("folder")
def test_a_temperature_may_carry_its_unit_as_for_solve(tensegra):
    for name, value in (("plain", "top=50"), ("quantity", "top=90 degF"), ("cold", "top=0")):
        code, _, err = tensegra("export", "library:paper_beam", "-t", value, "-o", f"{name}.csv")
        assert code == 0, err
    plain, quantity, cold = (Path(f"{name}_nodes.csv").read_text() for name in ("plain", "quantity", "cold"))
    assert plain == quantity != cold
    message = refused(tensegra, "export", "library:paper_beam", "-t", "top=1e6", "-o", "hot.csv")
    assert "solid" in message
