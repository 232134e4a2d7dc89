"""Scenes hold what the solver found, in flat arrays, and nothing where it found nothing."""

import json
from base64 import b64decode

import numpy as np
import pytest

from tensegra.errors import ModelError
from tensegra.mechanics import solve_batch, solve_path
from tensegra.structure import Member, Structure, library
from tensegra.viewer.scene import scene, shapes_scene

SINGLE = 1e-6
"""Of the largest number: arrays travel in single precision."""


def unpacked(packed):
    array = np.frombuffer(b64decode(packed["data"]), dtype=f"<{packed['type']}")
    return array.reshape(packed["shape"])


@pytest.fixture(scope="module")
def path():
    return solve_path(library.paper_beam(), {"A14": 0.1, "A23": 0.1})


def assert_close(packed, expected):
    expected = np.asarray(expected)
    np.testing.assert_allclose(unpacked(packed), expected, rtol=0.0, atol=SINGLE * np.abs(expected).max())


def test_a_path_has_a_frame_for_each_accepted_step(path):
    drawn = scene(path)
    assert len(drawn["labels"]) == len(path.history)
    assert_close(drawn["positions"], [point.nodes for point in path.history])
    assert_close(drawn["tensions"], [point.tensions for point in path.history])
    assert_close(drawn["reference"], path.stages[-1].nodes)
    assert drawn["statuses"][-1] == "stable"
    assert json.loads(json.dumps(drawn, allow_nan=False)) == drawn


def test_forces_grow_within_a_stage_as_the_stage_says(path):
    forces = unpacked(scene(path)["forces"])
    ends = {stage.stage: stage for stage in (*path.stages, path.actuation)}
    starts = [np.zeros_like(path.final.forces), *(end.forces for end in ends.values())]
    before = dict(zip(ends, starts, strict=False))
    for found, point in zip(forces, path.history, strict=True):
        start, end = before[point.stage], ends[point.stage].forces
        np.testing.assert_allclose(found, start + point.parameter * (end - start), atol=1e-5)


def test_modes_are_the_softest_and_their_largest_move_is_one(path):
    modes = scene(path, modes=3)["modes"]
    assert [mode["name"].split(":")[0] for mode in modes] == ["mode 1", "mode 2", "mode 3"]
    assert f"{path.final.lowest_eigenvalue:.4g} kN/cm" in modes[0]["name"]
    for mode in modes:
        assert np.linalg.norm(unpacked(mode["shape"]), axis=1).max() == pytest.approx(1.0, rel=1e-6)


def test_a_structure_shows_its_mechanisms_and_no_tension():
    drawn = scene(library.paper_beam())
    assert drawn["tensions"] is None
    assert len(drawn["modes"]) == 17  # as many as the equilibrium matrix has


def test_runs_without_an_equilibrium_are_left_out_and_the_others_keep_their_names():
    runs = solve_batch(library.paper_beam(), actuation={"A14": [0.02, 0.9999, 0.05]})
    finite = np.isfinite(runs.nodes).all(axis=(1, 2))
    drawn = scene(runs, labels=["a", "b", "c"])
    assert drawn["labels"] == [name for name, found in zip("abc", finite, strict=True) if found]
    assert_close(drawn["positions"], runs.nodes[finite])


def test_segments_follow_the_clustered_cables():
    structure = library.paper_beam()
    rows = unpacked(scene(structure)["segments"])
    for e, (name, member) in enumerate(structure.members.items()):
        ids = [(structure.node_ids[n], structure.node_ids[m]) for n, m, of in rows if of == e]
        assert tuple(ids) == member.segments, name


def test_thickness_goes_with_the_square_root_of_the_area_within_a_kind():
    members = {
        "s": Member("strut", ("a", "b"), 1.0, stiffness=400.0),
        "thin": Member("cable", ("b", "c"), 1.0, stiffness=100.0),
        "thick": Member("cable", ("c", "a"), 1.0, stiffness=400.0),
    }
    nodes = {"a": (0, 0, 0), "b": (1, 0, 0), "c": (0, 1, 0)}
    drawn = scene(Structure("three", nodes, members))
    assert unpacked(drawn["thickness"]).tolist() == [1.0, 0.5, 1.0]


def test_limits_are_those_of_the_utilisation(path):
    drawn, final = scene(path), path.final
    tension, compression = unpacked(drawn["tension_limit"]), unpacked(drawn["compression_limit"])
    with np.errstate(divide="ignore"):
        shares = np.maximum(np.abs(final.tensions) / tension, np.maximum(0, -final.tensions) / compression)
    for name, share in final.utilisation.items():
        assert shares[path.structure.member_ids.index(name)] == pytest.approx(share, rel=1e-5)


def test_a_path_that_failed_shows_the_drawing():
    # A pushed ball that nothing holds finds no equilibrium.
    ball = library.prism().replace(supports={})
    failed = solve_path(ball, loads={(ball.node_ids[0], "x"): 1.0})
    assert not failed.final.succeeded
    drawn = scene(failed)
    assert np.isfinite(unpacked(drawn["positions"])).all()


def test_shapes_begin_with_the_reference():
    structure = library.prism()
    drawn = shapes_scene(structure, structure.coordinates, {"moved": structure.coordinates + 1.0})
    assert drawn["labels"] == ["reference", "moved"]
    assert_close(drawn["positions"], [structure.coordinates, structure.coordinates + 1.0])


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(ModelError, match="a structure, a path or a batch"):
        scene("beam")
