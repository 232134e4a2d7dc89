import json
from dataclasses import replace

import numpy as np
import pytest

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics import CriticalPoint, PathSettings, Status, solve_path
from tensegra.mechanics.status import axis_index
from tensegra.structure import Member, Stage, Structure, library, parse_structure


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


@pytest.fixture(scope="module")
def path(beam):
    return solve_path(beam, {"A14": 0.02})


@pytest.fixture(scope="module")
def bent(beam):
    return solve_path(beam, {"A14": 0.10, "A23": 0.10})


@pytest.fixture(scope="module")
def failed():
    """Give an actuation up after eight of hundreds of small steps; what comes before is at rest."""
    return solve_path(library.prism(), {"top": 0.3}, settings=PathSettings(largest_move=1e-3, max_steps=8))


@pytest.fixture(scope="module")
def collapsed(beam):
    return solve_path(beam.replace(gravity=(0, 0, 0)), {"A23": 0.25})


def strict_json(value):
    """Write and read as JSON; NaN and infinities are refused."""
    return json.loads(json.dumps(value, allow_nan=False))


def test_path_as_plain_values(path, beam):
    result = strict_json(path.to_dict())
    assert result["structure"] == "paper_beam"
    assert result["units"]["length"] == "cm"
    assert result["status"] == "stable"
    assert result["reason"] == ""
    assert [stage["name"] for stage in result["stages"]] == ["prestress"]
    actuation = result["actuation"]
    np.testing.assert_array_equal(list(actuation["nodes"].values()), path.final.nodes)
    np.testing.assert_array_equal(list(actuation["displacements"].values()), path.displacements)
    assert list(actuation["nodes"]) == list(beam.nodes)
    assert actuation["tensions"]["K1"] == path.final.tension("K1")
    assert actuation["slack"] == []
    assert list(actuation["reactions"]) == list(beam.supports)
    assert actuation["reactions"]["4"] == path.final.reactions[beam.node_ids.index("4")].tolist()
    assert actuation["lowest_eigenvalue"] == path.final.lowest_eigenvalue
    for key in ("residual", "steps", "iterations", "reason", "strain_energy"):
        assert key in actuation


def test_a_failure_has_no_numbers(failed):
    assert failed.status is Status.FAILED
    assert "8 steps" in failed.reason
    final = failed.final
    assert np.isnan(final.nodes).all()
    assert np.isnan(final.tensions).all()
    assert np.isnan(failed.displacements).all()
    result = strict_json(failed.to_dict())
    actuation = result["actuation"]
    numbers = (
        "nodes",
        "tensions",
        "slack",
        "reactions",
        "residual",
        "lowest_eigenvalue",
        "strain_energy",
        "displacements",
    )
    for key in numbers:
        assert actuation[key] is None, key
    assert result["stages"][0]["nodes"] is not None  # the stage before was solved


def test_a_collapse_names_its_mechanisms(collapsed):
    assert collapsed.status is Status.COLLAPSED
    result = strict_json(collapsed.to_dict())
    assert result["actuation"]["mechanisms"]
    assert all(result["actuation"]["mechanisms"])
    assert "mechanism" in collapsed.reason
    assert "prestress lost" in collapsed.reason
    assert "collapse" in [point.kind for point in collapsed.critical_points]
    assert collapsed.final.lowest_eigenvalue == pytest.approx(0.0, abs=1e-6)  # K of about 1e4 kN/cm
    assert np.abs(collapsed.final.tensions).max() < 82.0  # what is left is held between pinned nodes


def test_success_is_returned_by_raise_for_status(path):
    assert path.raise_for_status() is path
    assert path.final.raise_for_status() is path.final
    assert path.final.succeeded


def test_failure_is_raised_by_raise_for_status(failed, collapsed):
    with pytest.raises(SolverError, match=r"actuation.*failed"):
        failed.raise_for_status()
    with pytest.raises(SolverError, match="collapsed"):
        collapsed.raise_for_status()
    with pytest.raises(SolverError, match="prestress lost"):
        collapsed.final.raise_for_status()


@pytest.mark.parametrize("status", [Status.STABLE, Status.SNAPPED])
def test_statuses_that_stand_are_not_raised(path, status):
    standing = replace(path.final, status=status)
    assert standing.raise_for_status() is standing


@pytest.mark.parametrize("status", [Status.UNSTABLE, Status.COLLAPSED, Status.FAILED])
def test_statuses_that_do_not_stand_are_raised(path, status):
    with pytest.raises(SolverError):
        replace(path.final, status=status, reason="because").raise_for_status()


def test_lookups_take_texts_and_integers(path, beam):
    final = path.final
    row = list(beam.nodes).index("18")
    np.testing.assert_array_equal(final.node(18), final.nodes[row])
    np.testing.assert_array_equal(final.node("18"), final.nodes[row])
    assert final.tension("K1") == final.tensions[list(beam.members).index("K1")]
    mean = path.displacements[[row, list(beam.nodes).index("23")], 2].mean()
    assert path.displacement("z", [18, "23"]) == mean


def test_a_looked_up_position_is_a_copy(path):
    before = path.final.node(18)
    path.final.node(18)[:] = 0.0
    np.testing.assert_array_equal(path.final.node(18), before)


def test_integer_named_members():
    structure = library.prism()
    renamed = structure.replace(
        members={str(i): member for i, member in enumerate(structure.members.values())}, actuators={}
    )
    equilibrium = solve_path(renamed).final
    assert equilibrium.tension(3) == equilibrium.tension("3") == equilibrium.tensions[3]


def test_misspelt_lookups_name_the_nearest(path):
    with pytest.raises(ModelError, match="expected the id of a node"):
        path.final.node(1800)
    with pytest.raises(ModelError, match="did you mean 'K1'"):
        path.final.tension("k1")
    with pytest.raises(ModelError, match="did you mean '18'"):
        path.displacement("z", [180])
    with pytest.raises(ModelError, match="x, y or z"):
        path.displacement("w", [18])


def test_nodes_given_as_one_text_are_one_node_or_refused(path):
    # "18" is a sequence of "1" and "8", both nodes of the beam: it must not be read as these two.
    try:
        found = path.displacement("z", "18")
    except ModelError:
        return
    assert found == path.displacement("z", ["18"])


def test_displacements_without_actuation_are_none(beam):
    path = solve_path(beam)
    assert path.actuation is None
    assert path.final is path.stages[-1]
    assert not path.displacements.any()
    assert strict_json(path.to_dict())["actuation"] is None


@pytest.mark.parametrize(("axis", "index"), [("x", 0), ("y", 1), ("z", 2)])
def test_axis_index(axis, index):
    assert axis_index(axis) == index


@pytest.mark.parametrize("axis", ["", "xy", "X", "w"])
def test_no_other_axis(axis):
    with pytest.raises(ModelError, match="x, y or z"):
        axis_index(axis)


def test_slack_members_are_named():
    # The lower rope is longer than the way.
    structure = Structure(
        name="mast",
        nodes={"a": (0, 0, 0), "b": (0, 0, 1), "c": (0, 0, 2)},
        members={
            "low": Member("cable", ("a", "b"), 1.2, stiffness=10.0),
            "high": Member("cable", ("b", "c"), 0.9, stiffness=10.0),
        },
        supports={"a": "xyz", "b": "xy", "c": "xyz"},
        stages=[Stage("hang", loads={"b": (0, 0, -0.1)})],
    )
    final = solve_path(structure).final
    assert final.slack_members == ("low",)
    assert final.tension("low") == 0.0
    assert final.tension("high") == pytest.approx(0.1)
    assert final.to_dict()["slack"] == ["low"]


def test_a_critical_point_is_a_sentence():
    point = CriticalPoint("load", 0.25, "limit point", 1e-3, ("7",), snap=2.0)
    assert str(point) == "limit point at 25 % of stage 'load', snap of 2"


def test_history_as_a_table(bent):
    table = bent.to_dataframe()
    assert len(table) == len(bent.history)
    assert table["stage"].unique().tolist() == ["prestress", "actuation"]
    last = table.iloc[-1]
    assert last["parameter"] == 1.0
    assert last["z_23"] == bent.final.node("23")[2]
    assert last["T_K1"] == pytest.approx(bent.final.tension("K1"), rel=1e-12)


def test_history_as_a_dataset(bent):
    pytest.importorskip("xarray")
    data = bent.to_xarray()
    assert data.sizes == {"step": len(bent.history), "node": 24, "axis": 3, "member": 48}
    assert data["nodes"].attrs["units"] == "cm"
    last = data["nodes"].isel(step=-1).sel(node="23", axis="z")
    assert float(last) == bent.final.node("23")[2]


ROPE = {
    "nodes": {"a": [0, 0, 0], "b": [1, 0, 0], "c": [2, 0, 0]},
    "members": {
        "r": {"kind": "cable", "nodes": ["a", "b"], "stiffness": 1e5},
        "q": {"kind": "cable", "nodes": ["b", "c"], "stiffness": 1e5},
    },
    "supports": {"a": "xyz", "c": "xyz"},
    "stages": [{"name": "prestress", "rest_length_changes": {"r": -0.01}}],
}


def test_a_stage_found_in_one_go_has_its_end_in_the_history():
    found = solve_path(parse_structure(ROPE))
    last = found.to_dataframe().iloc[-1]
    assert (last["stage"], last["parameter"]) == ("prestress", 1.0)
    # Two springs in series: rest lengths of 0.99 and 1 under a total length of 2.
    tension = 1e5 * (2 / 1.99 - 1)
    assert [last["T_r"], last["T_q"]] == pytest.approx([tension, tension], rel=1e-9)
    assert last["x_b"] == pytest.approx(2 * 0.99 / 1.99, rel=1e-9)


@pytest.mark.parametrize("name", [name for name in library.__all__ if name != "gripper"])
def test_every_history_ends_where_the_path_does(name):
    found = solve_path(getattr(library, name)())
    last = found.to_dataframe().iloc[-1]
    nodes = last[[f"{axis}_{node}" for node in found.structure.nodes for axis in "xyz"]]
    np.testing.assert_allclose(nodes.to_numpy(dtype=float), found.final.nodes.ravel(), rtol=0, atol=0)


def test_a_history_without_a_step_is_a_table_of_all_columns(bent):
    empty, full = replace(bent, history=()).to_dataframe(), bent.to_dataframe()
    assert len(empty) == 0
    assert list(empty) == list(full)
    assert empty.dtypes.tolist() == full.dtypes.tolist()


def test_a_history_without_a_step_is_a_dataset_of_all_names(bent):
    pytest.importorskip("xarray")
    data = replace(bent, history=()).to_xarray()
    assert data.sizes == {"step": 0, "node": 24, "axis": 3, "member": 48}


def test_a_path_draws_itself(bent, tmp_path):
    file = tmp_path / "beam.png"
    bent.plot().savefig(file)
    assert file.stat().st_size > 10_000


def test_utilisation_is_the_share_of_euler_s_load_and_of_the_strength():
    modulus, inertia, length, load = 7e10, 1e-8, 2.0, 500.0
    column = parse_structure(
        {
            "nodes": {"1": [0, 0, 0], "2": [0, 0, length], "3": [0, 0, 2 * length]},
            "materials": {"aluminium": {"youngs_modulus": modulus}},
            "members": {
                "s": {
                    "kind": "strut",
                    "nodes": [1, 2],
                    "material": "aluminium",
                    "area": 1e-4,
                    "section_inertia": inertia,
                },
                "c": {"kind": "cable", "nodes": [2, 3], "stiffness": 1e6, "strength": 1000.0},
            },
            "supports": {"1": "xyz", "2": "xy", "3": "xyz"},
            "stages": [{"name": "load", "loads": {"2": [0, 0, -load]}}],
        }
    )
    found = solve_path(column).final
    euler = np.pi**2 * modulus * inertia / length**2
    assert found.utilisation["s"] == pytest.approx(-found.tension("s") / euler)
    assert found.utilisation["c"] == pytest.approx(found.tension("c") / 1000.0)
    assert found.utilisation["c"] > 0.05
