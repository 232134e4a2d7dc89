from dataclasses import replace

import numpy as np
import pytest

from tensegra.errors import ModelError
from tensegra.mechanics import PathSettings, solve_batch, solve_path
from tensegra.mechanics import solver as solver_module
from tensegra.structure import Member, Structure, apply_changes, library, parse_structure

SAME = 1e-9
"""Of the structure's size: both solve the same equations, perhaps in other steps."""


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


def single_runs(structure, n_runs, **inputs):
    return [
        solve_path(
            structure,
            **{
                what: {name: values[run] for name, values in mapping.items()}
                for what, mapping in inputs.items()
            },
        )
        for run in range(n_runs)
    ]


def assert_equal_to(batch, paths):
    size = np.ptp(batch.structure.coordinates)
    assert batch.n_runs == len(paths)
    assert batch.status.tolist() == [str(path.status) for path in paths]
    assert batch.reason.tolist() == [path.reason for path in paths]
    nodes = np.array([path.final.nodes for path in paths])
    tensions = np.array([path.final.tensions for path in paths])
    np.testing.assert_allclose(batch.nodes, nodes, atol=SAME * size)
    np.testing.assert_allclose(
        batch.displacements, [path.displacements for path in paths], atol=2 * SAME * size
    )
    np.testing.assert_allclose(batch.tensions, tensions, atol=1e-8 * np.nanmax(np.abs(tensions)))
    np.testing.assert_array_equal(batch.slack, [path.final.slack for path in paths])
    # The lowest eigenvalue is 1e-6 of the largest: it is the first to see a change of the positions.
    np.testing.assert_allclose(
        batch.lowest_eigenvalue, [path.final.lowest_eigenvalue for path in paths], rtol=1e-5, atol=1e-9
    )
    ended = batch.status != "failed"
    assert np.all(batch.residual[ended] <= 1e-9)


def test_batch_equals_single_runs_of_all_that_acts_after_the_stages(beam):
    rng = np.random.default_rng(0)
    inputs = {
        "actuation": {"A14": rng.uniform(0, 0.1, 5), "A23": rng.uniform(0, 0.1, 5)},
        "temperature": {"top": rng.uniform(-50, 150, 5), "c1": rng.uniform(0, 50, 5)},
        "loads": {("23", "z"): rng.uniform(-1, 1, 5)},
        "positions": {("4", "z"): rng.uniform(-1, 1, 5)},
    }
    batch = solve_batch(beam, **inputs)
    assert_equal_to(batch, single_runs(beam, 5, **inputs))
    assert batch.node_ids == beam.node_ids
    assert batch.member_ids == beam.member_ids
    assert np.all(batch.steps > 0)
    assert np.all(batch.iterations >= batch.steps - 1)
    assert np.all(batch.seconds > 0.0)


def test_a_batch_mixes_outcomes(beam):
    # Without gravity; the second run loses its prestress, the others do not.
    weightless = beam.replace(gravity=(0, 0, 0))
    inputs = {"actuation": {"A14": np.array([0.1, 0.0, 0.2]), "A23": np.array([0.1, 0.25, 0.1])}}
    batch = solve_batch(weightless, **inputs)
    assert batch.status.tolist() == ["stable", "collapsed", "stable"]
    alone = solve_path(weightless, {"A14": 0.2, "A23": 0.1})
    np.testing.assert_allclose(batch.nodes[2], alone.final.nodes, atol=SAME * 240)
    assert batch.reason[0] == batch.reason[2] == ""
    assert "prestress lost" in batch.reason[1]


def test_what_changes_the_structure_equals_the_changed_structure(beam):
    batch = solve_batch(
        beam,
        actuation={"A14": [0.05, 0.05]},
        youngs_modulus={"steel": [11500.0, 10000.0]},
        area={"K1": [0.5026, 0.6], "struts": [255.0, 200.0]},
        rest_length={"c1": [beam.members["c1"].rest_length, 1.001 * beam.members["c1"].rest_length]},
    )
    changed = apply_changes(
        beam,
        {
            "materials": {"steel": {"youngs_modulus": 10000.0}},
            "members": {
                "K1": {"area": 0.6},
                "c1": {"rest_length": 1.001 * beam.members["c1"].rest_length},
                **{strut: {"area": 200.0} for strut in beam.groups["struts"]},
            },
        },
    )
    paths = [solve_path(structure, {"A14": 0.05}) for structure in (beam, changed)]
    assert_equal_to(batch, paths)
    assert np.abs(batch.nodes[1] - batch.nodes[0]).max() > 1e-3  # the changes do something


def test_the_order_of_the_runs_does_not_matter(beam):
    values = np.linspace(0.0, 0.1, 7)
    forwards = solve_batch(beam, actuation={"A14": values, "A23": values})
    backwards = solve_batch(beam, actuation={"A14": values[::-1], "A23": values[::-1]})
    np.testing.assert_array_equal(backwards.nodes[::-1], forwards.nodes)
    np.testing.assert_array_equal(backwards.lowest_eigenvalue[::-1], forwards.lowest_eigenvalue)


def test_failed_runs_are_nan_among_the_others(beam):
    # The plain procedure of the source does not converge on the first run.
    settings = PathSettings(path="stepped")
    batch = solve_batch(beam, actuation={"A14": [0.01, 0.1], "A23": [0.1, 0.1]}, settings=settings)
    assert batch.status.tolist() == ["failed", "stable"]
    for values in (batch.nodes, batch.displacements, batch.tensions, batch.displacement("z", ["18"])):
        assert np.isnan(values[0]).all()
        assert np.isfinite(values[1]).all()
    assert "did not converge" in batch.reason[0]
    assert batch.reason[1] == ""


def test_outputs_are_means_over_nodes(beam):
    batch = solve_batch(beam, actuation={"A14": [0.02, 0.04]})
    row18, row23 = (beam.node_ids.index(node) for node in ("18", "23"))
    expected = 0.5 * (batch.displacements[:, row18, 2] + batch.displacements[:, row23, 2])
    np.testing.assert_allclose(batch.displacement("z", [18, "23"]), expected, rtol=1e-13)
    np.testing.assert_array_equal(batch.coordinate("x", ["18"]), batch.nodes[:, row18, 0])
    np.testing.assert_array_equal(batch.tension("K1"), batch.tensions[:, list(beam.members).index("K1")])


def test_nodes_given_as_one_text_are_one_node_or_refused(beam):
    batch = solve_batch(beam, actuation={"A14": [0.02]})
    for output in (batch.displacement, batch.coordinate):
        try:
            found = output("z", "18")
        except ModelError:
            continue
        np.testing.assert_array_equal(found, output("z", ["18"]))


def test_integer_ids_are_accepted_as_inputs(beam):
    by_integer = solve_batch(beam, loads={(23, "z"): [-0.5]}, positions={(4, "z"): [0.5]})
    by_text = solve_batch(beam, loads={("23", "z"): [-0.5]}, positions={("4", "z"): [0.5]})
    np.testing.assert_array_equal(by_integer.nodes, by_text.nodes)


def test_no_input_is_one_run_of_the_stages(beam):
    batch = solve_batch(beam)
    assert batch.n_runs == 1
    np.testing.assert_array_equal(batch.nodes[0], solve_path(beam).final.nodes)
    assert not batch.displacements.any()


def test_no_runs_are_a_batch_of_nothing(beam):
    batch = solve_batch(beam, actuation={"A14": []})
    assert batch.n_runs == 0
    assert batch.nodes.shape == batch.displacements.shape == (0, 24, 3)
    assert batch.tensions.shape == batch.slack.shape == (0, 48)
    assert batch.displacement("z", [18]).shape == (0,)


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"actuation": {"A14": [0.1, 0.1], "A23": [0.1]}}, "2 runs"),
        ({"actuation": {"A14": [[0.1]]}}, "1 run"),
        ({"actuation": {"A15": [0.1]}}, "did you mean 'A1"),
        ({"actuation": {"A14": [0.1, 1.0]}}, "rest length"),
        ({"actuation": {"A14": [0.1, np.nan]}}, "A14"),
        ({"temperature": {"topp": [1.0]}}, "did you mean 'top'"),
        ({"temperature": {"top": [np.nan]}}, "finite"),
        ({"loads": {("231", "z"): [1.0]}}, "did you mean '23"),
        ({"loads": {("23", "w"): [1.0]}}, "x, y or z"),
        ({"positions": {("23", "z"): [1.0]}}, "supported"),
        ({"youngs_modulus": {"steal": [1.0]}}, "did you mean 'steel'"),
        ({"youngs_modulus": {"steel": [-1.0]}}, "youngs_modulus"),
        ({"area": {"strut": [1.0]}}, "did you mean 'struts'"),
        ({"area": {"struts": [0.0]}}, "area"),
        ({"rest_length": {"K11": [1.0]}}, "did you mean 'K1'"),
        ({"rest_length": {"K1": [np.inf]}}, "rest_length"),
    ],
)
def test_an_impossible_input_is_refused(beam, inputs, message):
    with pytest.raises(ModelError, match=message):
        solve_batch(beam, **inputs)


def test_area_of_a_member_given_by_its_stiffness_is_refused():
    rope = Structure(
        name="rope",
        nodes={"1": (0, 0, 0), "2": (2, 0, 0)},
        members={"K": Member("cable", ("1", "2"), 1.9, stiffness=10.0)},
        supports={"1": "xyz", "2": "yz"},
    )
    with pytest.raises(ModelError, match="stiffness"):
        solve_batch(rope, area={"K": [1.0]})


def test_one_varied_run_that_is_followed_alone_starts_where_it_does(beam):
    batch = solve_batch(beam, rest_length={"K1": [300.86]}, actuation={"A14": [0.05]})
    longer = replace(beam.members["K1"], rest_length=300.86)
    path = solve_path(beam.replace(members={**beam.members, "K1": longer}), {"A14": 0.05})
    np.testing.assert_allclose(batch.displacements[0], path.displacements, atol=1e-9)


def test_derivatives_asked_for_are_those_computed_on_demand(beam):
    actuation = {"A14": np.linspace(0.02, 0.1, 5), "A23": np.linspace(0.1, 0.04, 5)}
    asked = solve_batch(beam, actuation=actuation, derivatives=["A14", "top", ("load", ("18", "z"))])
    plain = solve_batch(beam, actuation=actuation)
    for name, kind in (("A14", "actuation"), ("top", "temperature"), (("18", "z"), "load")):
        found, expected = asked.derivative(name, kind), plain.derivative(name, kind)
        scale = np.abs(expected.nodes).max()
        np.testing.assert_allclose(found.nodes, expected.nodes, atol=1e-8 * scale)
        np.testing.assert_allclose(
            found.tensions, expected.tensions, atol=1e-8 * np.abs(expected.tensions).max()
        )


@pytest.mark.parametrize("asked", ["A41", ("colour", "A14"), ("youngs_modulus", "steel")])
def test_a_derivative_that_cannot_be_had_is_refused(beam, asked):
    with pytest.raises(ModelError):
        solve_batch(beam, actuation={"A14": [0.05]}, derivatives=[asked])


def test_a_varied_run_that_does_not_snap_is_not_called_snapped():
    # A shallow tripod under a load that it bears only where it is much stiffer.
    leg = {"kind": "strut", "material": "soft", "area": 1.0}
    feet = {str(i): [np.cos(a), np.sin(a), 0.0] for i, a in enumerate(2 * np.pi * np.arange(3) / 3)}
    tripod = parse_structure(
        {
            "nodes": {**feet, "top": [0.0, 0.0, 0.3]},
            "materials": {"soft": {"youngs_modulus": 1e6}},
            "members": {f"s{foot}": {**leg, "nodes": [foot, "top"]} for foot in feet},
            "supports": dict.fromkeys(feet, "xyz"),
            "stages": [{"name": "load", "loads": {"top": [0, 0, -2e4]}}],
        }
    )
    assert solve_path(tripod).status == "snapped"
    runs = solve_batch(tripod, youngs_modulus={"soft": [1e6, 1e8]}, loads={("top", "z"): [0.0, 0.0]})
    assert runs.status.tolist() == ["snapped", "stable"]
    assert runs.reason[1] == ""
    assert "snap" in runs.reason[0]


@pytest.mark.parametrize("named", ["paper_beam", "paper_beam_slender"])
def test_runs_far_from_the_nominal_moduli_are_those_of_the_varied_structure(named):
    structure = getattr(library, named)()
    share = np.linspace(0.5, 1.5, 11)
    modulus = structure.materials["steel_rope"].youngs_modulus * share
    actuation = np.full(share.size, 0.08)
    runs = solve_batch(
        structure, actuation={"A14": actuation, "A23": actuation}, youngs_modulus={"steel_rope": modulus}
    )
    assert set(runs.status) == {"stable"}
    for run in (0, 10):
        material = replace(structure.materials["steel_rope"], youngs_modulus=modulus[run])
        varied = structure.replace(materials={**structure.materials, "steel_rope": material})
        path = solve_path(varied, {"A14": 0.08, "A23": 0.08})
        size = np.ptp(structure.coordinates, axis=0).max()
        np.testing.assert_allclose(runs.nodes[run], path.final.nodes, atol=SAME * size)
        np.testing.assert_allclose(
            runs.displacement("z", [23])[run], path.displacement("z", [23]), atol=SAME * size
        )


@pytest.mark.parametrize("path", ["adaptive", "stepped"])
@pytest.mark.parametrize("names", [("clustered", "K1"), ("K1", "clustered")])
def test_two_areas_of_one_member_are_refused_with_both_names(beam, names, path):
    first, second = names
    message = f"area: found '{second}', expected one area of member 'K1', which '{first}' sets too"
    with pytest.raises(ModelError, match=message):
        solve_batch(beam, area={first: [0.5], second: [0.5]}, path=path)


@pytest.mark.parametrize("path", ["adaptive", "stepped"])
def test_temperatures_of_a_run_add_up_by_every_path(path):
    ropes = parse_structure(
        {
            "nodes": {"a": [0, 0, 0], "b": [1, 0, 0], "c": [2, 0, 0]},
            "materials": {"m": {"youngs_modulus": 1000.0, "thermal_expansion": 1e-3}},
            "members": {
                name: {
                    "kind": "cable",
                    "nodes": nodes,
                    "material": "m",
                    "area": 1.0,
                    "rest_length": 0.9,
                    "groups": ["g"],
                }
                for name, nodes in {"k": ["a", "b"], "l": ["b", "c"]}.items()
            },
            "supports": {"a": "xyz", "b": "yz", "c": "xyz"},
            "stages": [
                {"name": "warm", "temperatures": {"g": 10.0}},
                {"name": "more", "temperatures": {"k": 20.0}},
            ],
        }
    )
    alone = solve_path(ropes, temperature={"g": 5.0, "k": 2.0}, path=path).final
    many = solve_batch(ropes, temperature={"k": [2.0, 2.0], "g": [5.0, 5.0]}, path=path)
    rest = 0.9 * (1 + 1e-3 * np.array([20.0 + 5.0 + 2.0, 10.0 + 5.0]))
    # Two springs in series under a total length of 2: one tension T, lengths l₀ (1 + T/EA).
    tension = 1000.0 * (2.0 / rest.sum() - 1.0)
    np.testing.assert_allclose(alone.tensions, tension, rtol=SAME)
    np.testing.assert_allclose(many.tensions, tension, rtol=SAME)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_threads_that_are_asked_for_are_those_that_work(beam, monkeypatch, threads):
    ranges = []
    share = solver_module.Workspace

    def counted(*arguments, **options):
        ranges.append(arguments)
        return share(*arguments, **options)

    solve_batch(beam, actuation={"A14": np.linspace(0.0, 0.05, 96)}, threads=1)  # the stages, once
    monkeypatch.setattr(solver_module, "Workspace", counted)
    runs = solve_batch(beam, actuation={"A14": np.linspace(0.0, 0.05, 96)}, threads=threads)
    assert runs.ground.threads == threads
    # One workspace a thread for the way and for the certificates, beside those of the stages.
    stages = 2 if threads > 1 else 0
    assert len(ranges) >= (2 * threads if threads > 1 else 1)
    assert len(ranges) <= 2 * threads + stages + 1


@pytest.mark.parametrize(
    ("varied", "changes"),
    [
        ({"youngs_modulus": {"steel": [15000.0]}}, {"materials": {"steel": {"youngs_modulus": 15000.0}}}),
        ({"area": {"s1": [200.0]}}, {"members": {"s1": {"area": 200.0}}}),
        ({"rest_length": {"c26": [57.0]}}, {"members": {"c26": {"rest_length": 57.0}}}),
    ],
)
def test_one_run_alone_is_varied_to_its_end(beam, varied, changes):
    runs = solve_batch(beam, actuation={"A14": [0.07]}, **varied)
    assert_equal_to(runs, [solve_path(apply_changes(beam, changes), {"A14": 0.07})])
    beside = solve_batch(
        beam,
        actuation={"A14": [0.07, 0.0]},
        **{what: {name: values * 2 for name, values in group.items()} for what, group in varied.items()},
    )
    np.testing.assert_allclose(runs.nodes[0], beside.nodes[0], atol=1e-8)
