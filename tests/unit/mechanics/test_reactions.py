import numpy as np
import pytest

from tensegra.mechanics import solve_batch, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.reactions import internal_forces, reaction_rates, reactions
from tensegra.mechanics.stability import equilibrium_matrix
from tensegra.structure import Stage, library, parse_structure
from tensegra.structure.structure import path_length

ROUNDING = 1e-12
"""Of the largest force: sums of some dozens of terms in double precision."""

SOLVED = 1e-8
"""Of the largest force: ten times the residual at which an equilibrium is accepted."""

TRUNCATION = 1e-7
"""Relative error of central differences with a step of 1e-5 over lengths of order one."""


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


@pytest.fixture
def state(random_structure):
    """Return arrays, positions, tensions and loads of five runs, all at random."""
    arrays = structure_arrays(random_structure(3))
    rng = np.random.default_rng(0)
    nodes = arrays.coordinates + 0.1 * rng.standard_normal((5, arrays.n_nodes, 3))
    tensions = rng.standard_normal((5, arrays.n_members))
    return arrays, nodes, tensions, rng.standard_normal((5, arrays.n_nodes, 3))


def test_a_support_pushes_up_what_hangs_on_it():
    rope = parse_structure(
        {
            "nodes": {"a": [0, 0, 0], "b": [0, 0, -1]},
            "materials": {"m": {"youngs_modulus": 1e6, "weight": 2.0}},
            "members": {"k": {"kind": "cable", "nodes": ["a", "b"], "material": "m", "area": 1.0}},
            "supports": {"a": "xyz", "b": "xy"},
            "gravity": [0, 0, -1],
            "stages": [{"name": "load", "loads": {"a": [0, 3, 0], "b": [4, 0, -5]}}],
        }
    )
    final = solve_path(rope).final
    # Half of the weight of 2 acts at the support itself; a load on a support goes straight into it.
    np.testing.assert_allclose(final.reactions, [[0, -3, 7], [-4, 0, 0]], atol=SOLVED * 7)
    assert final.reactions[1, 2] == 0.0
    assert list(final.to_dict()["reactions"]) == ["a", "b"]
    assert final.to_dict()["reactions"]["a"] == final.reactions[0].tolist()


def test_runs_together_are_runs_one_by_one(state):
    arrays, nodes, tensions, loads = state
    together = reactions(arrays, nodes, tensions, loads)
    for run in range(len(nodes)):
        np.testing.assert_array_equal(reactions(arrays, nodes[run], tensions[run], loads[run]), together[run])


def test_what_members_pull_with_is_the_gradient_of_their_lengths(state):
    arrays, nodes, tensions, _ = state
    expected = equilibrium_matrix(arrays, nodes[0]) @ tensions[0]
    np.testing.assert_allclose(
        internal_forces(arrays, nodes[0], tensions[0])[arrays.free], expected, atol=ROUNDING * 10
    )


def test_rates_are_central_differences(state):
    arrays, nodes, tensions, loads = state
    rng = np.random.default_rng(1)
    rates = [rng.standard_normal(values.shape) for values in (nodes, tensions, loads)]
    ahead, behind = (
        reactions(
            arrays, *(v + sign * 1e-5 * r for v, r in zip((nodes, tensions, loads), rates, strict=True))
        )
        for sign in (1, -1)
    )
    found = reaction_rates(
        arrays, nodes, tensions, node_rates=rates[0], tension_rates=rates[1], load_rates=rates[2]
    )
    expected = (ahead - behind) / 2e-5
    np.testing.assert_allclose(found, expected, atol=TRUNCATION * np.abs(expected).max())


def test_a_failed_run_has_no_reactions(state):
    arrays, nodes, tensions, loads = state
    assert np.isnan(reactions(arrays, np.full_like(nodes[0], np.nan), tensions[0], loads[0])).all()


def test_a_batch_has_the_reactions_of_single_runs(beam):
    rng = np.random.default_rng(0)
    inputs = {
        "actuation": {"A14": rng.uniform(0, 0.1, 4)},
        "temperature": {"top": rng.uniform(-50, 150, 4)},
        "loads": {("23", "z"): rng.uniform(-1, 1, 4), ("1", "y"): rng.uniform(-1, 1, 4)},
        "positions": {("4", "z"): rng.uniform(-1, 1, 4)},
    }
    batch = solve_batch(beam, **inputs)
    for run in range(4):
        alone = solve_path(
            beam, **{what: {name: v[run] for name, v in named.items()} for what, named in inputs.items()}
        )
        scale = np.abs(alone.final.reactions).max()
        np.testing.assert_allclose(batch.reactions[run], alone.final.reactions, atol=SOLVED * scale)
    total = batch.reactions[:, [0, 3], 2].sum(axis=1)
    np.testing.assert_allclose(batch.reaction("z", [1, 4]), total, rtol=ROUNDING)


def test_areas_that_vary_take_their_weight_to_the_supports(beam):
    runs = solve_batch(beam, area={"clustered": [0.5, 1.0]})
    heavier = sum(
        beam.materials[member.material].weight * 0.5 * path_length(beam.nodes, member.nodes)
        for member in (beam.members[name] for name in beam.groups["clustered"])
    )
    weight = runs.reactions[1, :, 2].sum() - runs.reactions[0, :, 2].sum()
    assert weight == pytest.approx(heavier, rel=1e-6)  # a small difference of tensions of 100 kN


@pytest.mark.parametrize("acts", [True, False])
def test_a_run_that_stopped_half_way_has_the_reactions_of_the_loads_there(acts):
    load = -50.0
    truss = library.von_mises_truss()
    top = next(node for node in truss.nodes if truss.supports.get(node, "") != "xyz")
    if acts:
        truss = truss.replace(stages=())
        batch = solve_batch(truss, loads={(top, "z"): [load * 1e4]}, policy="stop")
        alone = solve_path(truss, loads={(top, "z"): load * 1e4}, policy="stop").final
    else:
        truss = truss.replace(stages=[Stage("push", loads={top: (0, 0, load * 1e4)})])
        batch = solve_batch(truss, policy="stop")
        alone = solve_path(truss, policy="stop").final
    assert batch.status[0] == alone.status == "unstable"
    assert 0.0 < alone.parameter < 1.0
    pushed = -alone.parameter * load * 1e4
    assert alone.reactions[:, 2].sum() == pytest.approx(pushed, rel=SOLVED)
    np.testing.assert_allclose(batch.reactions[0], alone.reactions, atol=SOLVED * pushed)


def test_a_collapse_has_reactions(beam):
    runs = solve_batch(beam.replace(gravity=(0, 0, 0)), actuation={"A23": [0.25]})
    assert runs.status[0] == "collapsed"
    assert np.isfinite(runs.reactions).all()
