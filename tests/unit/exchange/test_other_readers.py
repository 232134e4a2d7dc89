"""What is written opens in the programs and libraries that it is for, and says there what it says here."""

import csv
import json
from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy.io import loadmat, netcdf_file

import tensegra as tg
from tensegra.exchange.formats import format_for
from tensegra.exchange.scene import Frame, Scene
from tensegra.structure import Member, Structure, library

RELAXED = 1e-6
"""Distance from our nodes, as a share of the size, at which another program's relaxation has arrived."""

MOST_STEPS = 200_000
"""Steps after which MuJoCo's relaxation is given up; the beam takes a fifth."""


def read_vtu(file):
    meshio = pytest.importorskip("meshio")
    return meshio.read(file)


def test_meshio_reads_a_position(beam_path, tmp_path):
    beam_path.save(tmp_path / "a.vtu")
    mesh = read_vtu(tmp_path / "a.vtu")
    structure = beam_path.structure
    assert np.array_equal(mesh.points, beam_path.final.nodes)
    (lines,) = mesh.cells
    owner = mesh.cell_data["member"][0]
    assert np.array_equal(mesh.cell_data["tension"][0], beam_path.final.tensions[owner])
    assert np.array_equal(mesh.cell_data["rest_length"][0], beam_path.load.rest_length[owner])
    for e, member in enumerate(structure.members.values()):
        path = [structure.node_ids.index(node) for node in member.nodes]
        assert [list(pair) for pair in lines.data[owner == e]] == [list(pair) for pair in pairwise(path)]
        assert set(mesh.cell_data["kind"][0][owner == e]) == {member.is_cable + member.is_clustered}
    assert np.array_equal(mesh.cell_data["slack"][0] == 1, beam_path.final.slack[owner])
    assert np.array_equal(mesh.point_data["force"], beam_path.final.forces)
    held = [[axis in structure.supports.get(node, "") for axis in "xyz"] for node in structure.node_ids]
    assert np.array_equal(mesh.point_data["held"] == 1, held)
    assert mesh.field_data["status"] == [1]


def test_a_player_finds_every_step(beam_path, tmp_path):
    beam_path.save(tmp_path / "a.pvd")
    listed = ET.parse(tmp_path / "a.pvd").getroot().iter("DataSet")  # noqa: S314 — our own
    frames = [(float(item.get("timestep")), read_vtu(tmp_path / item.get("file"))) for item in listed]
    times = [time for time, _ in frames]
    assert times == sorted(set(times))
    steps = [point for i, point in enumerate(beam_path.history) if i == 0 or point.parameter > 0.0]
    assert len(frames) == len(steps) > len(beam_path.stages)
    for (_, mesh), point in zip(frames, steps, strict=True):
        assert np.abs(mesh.points - point.nodes).max() < 1e-9
    assert np.abs(frames[-1][1].point_data["displacement"]).max() > 1.0


def test_a_player_finds_every_run(beam_runs, tmp_path):
    beam_runs.save(tmp_path / "runs.pvd")
    meshes = [read_vtu(tmp_path / "runs" / f"runs_{run:04d}.vtu") for run in range(beam_runs.n_runs)]
    for run, mesh in enumerate(meshes):
        assert np.array_equal(mesh.points, beam_runs.nodes[run])


@pytest.mark.parametrize("name", ["prism", "paper_beam", "tower", "levy_dome"])
def test_mujoco_relaxes_to_our_equilibrium(name, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    structure = getattr(library, name)()
    path = tg.solve_path(structure)
    path.save(tmp_path / "a.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    target = path.final.nodes
    sites = [model.site(node).id for node in structure.node_ids]
    assert np.array_equal(data.site_xpos[sites], target)
    # Pushed away by a hundredth of its size, it has to find its way back by itself.
    size = np.ptp(target, axis=0).max()
    data.qpos[:] = 0.01 * size * np.random.default_rng(1).uniform(-1.0, 1.0, model.nq)
    mujoco.mj_kinematics(model, data)
    assert np.abs(data.site_xpos[sites] - target).max() > 1e-3 * size
    for step in range(MOST_STEPS):
        mujoco.mj_step(model, data)
        if step % 500 == 0 and np.abs(data.qvel).max() < 1e-12:
            break
        if step % 500 == 0:
            mujoco.mj_kinematics(model, data)
            if np.abs(data.site_xpos[sites] - target).max() < 0.1 * RELAXED * size:
                break
    assert np.abs(data.site_xpos[sites] - target).max() < RELAXED * size


def test_mujoco_has_our_tensions(beam_path, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    beam_path.save(tmp_path / "a.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    largest = np.abs(beam_path.final.tensions).max()
    stretched = data.ten_length - model.tendon_lengthspring[:, 1]
    tensions = np.ravel(model.tendon_stiffness) * stretched
    slack = (stretched < 0.0) & (model.tendon_lengthspring[:, 0] == 0.0)
    found = np.where(slack, 0.0, tensions)
    assert np.abs(found - beam_path.final.tensions).max() < 1e-9 * largest
    assert np.abs(data.qfrc_passive + data.qfrc_actuator).max() < 1e-6 * largest


def test_trimesh_reads_a_scene(beam_path, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    beam_path.save(tmp_path / "a.gltf")
    scene = trimesh.load_scene(tmp_path / "a.gltf")
    structure = beam_path.structure
    # Centimetres to metres, z upwards to y upwards.
    turned = 0.01 * beam_path.final.nodes @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    size = np.ptp(turned, axis=0).max()
    for node, place in zip(structure.node_ids, turned, strict=True):
        placed, _ = scene.graph.get(f"node {node}")
        assert np.abs(placed[:3, 3] - place).max() < 1e-12 * size
    assert len(scene.graph.nodes_geometry) == sum(len(m.segments) for m in structure.members.values())
    # Each cylinder runs from one end of its segment to the other.
    for name, member in structure.members.items():
        if not member.is_clustered:
            placed, _ = scene.graph.get(name)
            start, end = (turned[structure.node_ids.index(node)] for node in member.nodes)
            assert np.abs((placed @ [0, 0, 1, 1])[:3] - end).max() < 1e-9 * size
            assert np.abs((placed @ [0, 0, 0, 1])[:3] - start).max() < 1e-12 * size


def test_a_scene_keeps_to_the_format(tmp_path):
    library.hanging_chain().save(tmp_path / "a.gltf")
    scene = json.loads((tmp_path / "a.gltf").read_text(encoding="utf-8"))
    for node in scene["nodes"]:
        if "rotation" in node:
            assert abs(np.linalg.norm(node["rotation"]) - 1.0) < 1e-12
    (buffer,) = scene["buffers"]
    assert sum(view["byteLength"] for view in scene["bufferViews"]) == buffer["byteLength"]


def test_xarray_reads_frames_and_runs(beam_path, beam_runs, tmp_path):
    xarray = pytest.importorskip("xarray")
    beam_path.save(tmp_path / "path.nc")
    with xarray.open_dataset(tmp_path / "path.nc", engine="scipy") as frames:
        assert np.array_equal(frames.nodes.values[-1], beam_path.final.nodes)
        assert np.array_equal(frames.tensions.sel(member="K1").values[-1], beam_path.final.tension("K1"))
        assert frames.nodes.attrs["units"] == "cm"
        assert frames.status.values[-1] == "stable"
    beam_runs.save(tmp_path / "runs.nc")
    with xarray.open_dataset(tmp_path / "runs.nc", engine="scipy") as runs:
        assert np.array_equal(runs.nodes.values, beam_runs.nodes)
        assert np.array_equal(runs.actuation_A14.values, [0.05, 0.10])
        assert list(runs.status.values) == list(beam_runs.status)


def test_netcdf_needs_no_other_library_to_be_read(beam_runs, tmp_path):
    pytest.importorskip("xarray")
    beam_runs.save(tmp_path / "runs.nc")
    with netcdf_file(tmp_path / "runs.nc", mmap=False) as file:
        assert np.array_equal(file.variables["tensions"][:], beam_runs.tensions)


def test_matlab_has_the_matrices_of_its_programs(beam_path, tmp_path):
    beam_path.save(tmp_path / "a.mat")
    found = loadmat(tmp_path / "a.mat")
    N, C, S = found["N"], found["C"], found["S"]
    assert N.shape == (3, 24)
    # As TsgFEM and CTSFEM compute: element vectors N Cᵀ, lengths, then lengths of the clustered members S l.
    lengths = np.linalg.norm(N @ C.T, axis=0)
    clustered = S @ lengths
    rest_length, E, A = (found[name].ravel() for name in ("l0_c", "E_c", "A_c"))
    tension = E * A * (clustered - rest_length) / rest_length
    n_bars = len(found["C_b"])
    assert n_bars == 12
    cable = np.arange(len(S)) >= n_bars
    tension[cable] = np.maximum(tension[cable], 0.0)
    assert np.abs(tension - found["t_c"].ravel()).max() < 1e-9 * np.abs(tension).max()
    # The forces of the members balance the loads at every coordinate that is not pinned.
    density = (S.T @ tension) / lengths
    forces = (N @ C.T * density) @ C
    free = np.ones((3, 24), dtype=bool)
    for axis, name in enumerate(("pinned_X", "pinned_Y", "pinned_Z")):
        free[axis, found[name].ravel().astype(int) - 1] = False
    assert np.abs((forces - beam_path.final.forces.T)[free]).max() < 1e-7 * np.abs(tension).max()


def test_runs_are_numbers_in_every_table(beam_runs, tmp_path):
    beam_runs.save(tmp_path / "a.mat")
    beam_runs.save(tmp_path / "a.npz")
    beam_runs.save(tmp_path / "a.csv")
    mat = loadmat(tmp_path / "a.mat")
    assert np.array_equal(mat["nodes"], beam_runs.nodes)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        assert np.array_equal(archive["tensions"], beam_runs.tensions)
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for name, values in {
        "x_18": beam_runs.coordinate("x", 18),
        "tension_K1": beam_runs.tension("K1"),
        "actuation_A14": [0.05, 0.10],
    }.items():
        assert [float(row[name]) for row in rows] == list(values)


def test_compas_reads_and_writes_what_comes_back(beam_path, tmp_path):
    data = pytest.importorskip("compas.data")
    beam_path.save(tmp_path / "a.json", format="compas")
    graph = data.json_load(tmp_path / "a.json")
    structure = beam_path.structure
    for n, node in enumerate(structure.node_ids):
        assert graph.node_coordinates(int(node)) == beam_path.final.nodes[n].tolist()
    assert graph.number_of_edges() == sum(len(member.segments) for member in structure.members.values())
    data.json_dump(graph, tmp_path / "b.json")
    again = tg.read_structure(tmp_path / "b.json")
    assert again == tg.read_structure(tmp_path / "a.json")


def test_ezdxf_finds_no_fault(beam_path, tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    beam_path.save(tmp_path / "a.dxf")
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    assert not drawing.audit().errors
    layers = {layer.dxf.name for layer in drawing.layers}
    assert {"cables top", "clustered cables clustered", "supports"} <= layers
    assert len(drawing.modelspace().query("LINE")) == 44
    assert len(drawing.modelspace().query("POLYLINE")) == 4


def test_figures_are_pictures(beam_path, tmp_path):
    beam_path.save(tmp_path / "a.svg")
    assert ET.parse(tmp_path / "a.svg").getroot().tag.endswith("svg")  # noqa: S314 — our own
    library.prism().save(tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize("suffix", ["gltf", "vtu", "xml", "mat", "json"])
def test_ends_that_have_met_are_written(suffix, tmp_path):
    structure = Structure(
        name="fold",
        nodes={1: (0, 0, 0), 2: (1, 0, 0), 3: (0, 0, 0), 4: (0, 0, -1)},
        members={
            "k": Member("cable", (1, 2, 3), rest_length=1.0, stiffness=10.0),
            "s": Member("strut", (3, 4), rest_length=1.0, stiffness=10.0),
        },
        supports={1: "xyz", 4: "xyz"},
    )
    frame = Frame("met", 0.0, "stable", np.zeros((4, 3)), np.zeros(2))
    ones = np.ones(2)
    scene = Scene(structure, (frame,), ones, ones, np.zeros((4, 3)))
    form = format_for(tmp_path / f"a.{suffix}", "compas" if suffix == "json" else None, can="write")
    form.write(scene, tmp_path / f"a.{suffix}")
    assert (tmp_path / f"a.{suffix}").stat().st_size > 500
