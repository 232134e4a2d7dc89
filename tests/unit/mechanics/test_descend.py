"""Falls: down in energy, to a stable equilibrium, or to where it is told why there is none."""

from dataclasses import replace

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.descend import FLAT, LOST, SADDLE, STANDS
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.kernels import ZERO_EIGENVALUE
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Member, Structure, library

RESIDUAL = 1e-9
"""What is promised of every result."""

SAME = 1e-9
"""Of the size: residuals of 1e-14 over the lowest eigenvalues of these structures."""


def at_rest(arrays, rest_length, force):
    """Return a stage along which nothing changes."""
    return StageInputs(rest_length[..., None], force, force, arrays.coordinates, arrays.coordinates)


def let_fall(structure, nodes, *, force=None, rest_length=None, flat_below=0.0, which=None, threads=1):
    """Let a structure fall from positions ``(n, n_nodes, 3)``; one run each where nothing else is said."""
    arrays = structure_arrays(structure)
    nodes = np.asarray(nodes, dtype=float).reshape(-1, arrays.n_nodes, 3)
    force = np.zeros((arrays.n_nodes, 3)) if force is None else force
    rest_length = arrays.rest_length if rest_length is None else rest_length
    solver = Solver(arrays, PathSettings(), threads)
    which = np.zeros(len(nodes), dtype=int) if which is None else np.asarray(which)
    n_runs = int(which.max()) + 1
    runs = solver.runs(
        at_rest(arrays, rest_length, force), arrays.stiffness, arrays.coordinates[None], n_runs
    )
    outcome = solver.outcome(nodes, len(nodes))
    solver.fall(runs, which, outcome, np.full(len(nodes), flat_below))
    return arrays, outcome


def measured(arrays, nodes, force=None, rest_length=None):
    force = np.zeros((arrays.n_nodes, 3)) if force is None else force
    tangent, load = (
        Tangent(arrays),
        Load(arrays.rest_length if rest_length is None else rest_length, arrays.stiffness, force),
    )
    _, residual = tangent.measure(nodes.reshape(-1, 3), load)
    return tangent, load, residual


def near(structure, n, size, seed=0):
    arrays = structure_arrays(structure)
    rng = np.random.default_rng(seed)
    return arrays.coordinates + size * rng.uniform(-1.0, 1.0, (n, arrays.n_nodes, 3)) * arrays.free


def test_falls_go_down_and_end_where_the_structure_stands():
    prism = library.prism()
    start = near(prism, 12, 0.2)
    arrays, fallen = let_fall(prism, start)
    np.testing.assert_array_equal(fallen.end, STANDS)
    for before, after, tensions in zip(start, fallen.nodes, fallen.tensions, strict=True):
        tangent, load, _ = measured(arrays, before)
        above = tangent.potential(load)
        tangent, load, residual = measured(arrays, after)
        assert residual <= RESIDUAL
        assert tangent.potential(load) < above
        np.testing.assert_array_equal(tensions, tangent.tension)
        assert np.linalg.eigvalsh(tangent.matrix())[0] > ZERO_EIGENVALUE * tangent.stiffness_scale
    assert np.all(fallen.steps > 1)
    assert np.all(fallen.iterations >= fallen.steps)


def test_a_fall_among_others_is_the_fall_alone():
    prism = library.prism()
    start = near(prism, 41, 0.3, seed=1)
    _, together = let_fall(prism, start, threads=2)
    order = np.random.default_rng(2).permutation(len(start))
    _, shuffled = let_fall(prism, start[order])
    for one, other in zip(together, shuffled, strict=True):
        np.testing.assert_array_equal(one[order], other)
    for row in (0, 7, 40):
        _, alone = let_fall(prism, start[row])
        for one, other in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one[0], other[row])


def test_each_fall_has_the_inputs_of_its_run():
    rope = hung_rope()
    arrays = structure_arrays(rope)
    rest_length = np.array([[0.8, 0.8], [0.9, 0.7]])
    which = [1, 0, 1]
    force = np.zeros((3, 3))
    start = np.repeat(arrays.coordinates[None], 3, axis=0)
    _, fallen = let_fall(rope, start, force=force, rest_length=rest_length, which=which)
    np.testing.assert_array_equal(fallen.end, STANDS)
    # Two springs of one stiffness between two points a length of two apart: equal tensions.
    for row, run in enumerate(which):
        tension = 100.0 * (2.0 / rest_length[run].sum() - 1.0)
        np.testing.assert_allclose(fallen.tensions[row], tension, rtol=1e-12)


def hung_rope():
    nodes = {"a": (0.0, 0.0, 0.0), "b": (1.2, 0.4, 0.1), "c": (2.0, 0.0, 0.0)}
    members = {
        name: Member("cable", tuple(pair), 0.8, stiffness=100.0)
        for name, pair in {"k": "ab", "l": "bc"}.items()
    }
    return Structure(name="rope", nodes=nodes, members=members, supports={"a": "xyz", "c": "xyz"})


def arch(height=0.0):
    """Build two struts that are longer than the way between their feet."""
    nodes = {"a": (-1.0, 0.0, 0.0), "top": (0.0, 0.0, height), "b": (1.0, 0.0, 0.0)}
    members = {
        name: Member("strut", (name, "top"), np.hypot(1.0, 0.3), stiffness=100.0) for name in ("a", "b")
    }
    return Structure(
        name="arch", nodes=nodes, members=members, supports={"a": "xyz", "b": "xyz", "top": "xy"}
    )


def test_a_saddle_is_told_and_what_is_beside_it_falls_off():
    arrays, fallen = let_fall(arch(), [arch().coordinates])
    assert fallen.end[0] == SADDLE
    np.testing.assert_array_equal(fallen.nodes[0], arrays.coordinates.ravel())
    beside = arch().coordinates + np.array([[0, 0, 0], [0, 0, 1e-4], [0, 0, 0]])
    for side in (1.0, -1.0):
        _, fallen = let_fall(arch(), [beside * [1, 1, side]])
        assert fallen.end[0] == STANDS
        assert fallen.nodes[0, 5] == pytest.approx(0.3 * side, abs=SAME)


def test_what_nothing_loads_and_nothing_tightens_is_flat():
    slack = hung_rope()
    arrays = structure_arrays(slack)
    long = np.full(2, 3.0)
    _, fallen = let_fall(slack, [arrays.coordinates], rest_length=long)
    assert fallen.end[0] == FLAT
    assert not fallen.tensions.any()
    np.testing.assert_array_equal(fallen.nodes[0], arrays.coordinates.ravel())


@pytest.mark.parametrize("tight", [True, False])
def test_tension_below_what_counts_is_none(tight):
    # A prism that nothing holds in space: it lies anywhere, and is flat where its tension is none.
    prism = library.prism().replace(supports={})
    largest = np.abs(solve_path(library.prism()).final.tensions).max()
    flat_below = (0.1 if tight else 10.0) * largest
    arrays, fallen = let_fall(prism, near(prism, 3, 0.02), flat_below=flat_below)
    np.testing.assert_array_equal(fallen.end == FLAT, not tight)
    if tight:
        assert max(measured(arrays, nodes)[2] for nodes in fallen.nodes) <= RESIDUAL


def test_a_load_that_nothing_bears_finds_no_equilibrium():
    nodes = {"a": (0.0, 0.0, 0.0), "b": (1.0, 0.0, 0.0)}
    rope = Structure(
        name="rope",
        nodes=nodes,
        members={"k": Member("cable", ("a", "b"), 5.0, stiffness=100.0)},
        supports={"a": "yz", "b": "yz"},
    )
    force = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    _, fallen = let_fall(rope, [rope.coordinates], force=force)
    assert fallen.end[0] == LOST


def test_under_a_load_a_slack_rope_is_pulled_tight_and_stands():
    rope = hung_rope()
    force = np.zeros((3, 3))
    force[1, 2] = -1.0
    arrays, fallen = let_fall(rope, [rope.coordinates], force=force, rest_length=np.full(2, 1.5))
    assert fallen.end[0] == STANDS
    b = fallen.nodes[0].reshape(-1, 3)[1]
    # It hangs in the middle: T cos of either rope bears half of the load.
    assert b[0] == pytest.approx(1.0, abs=SAME)
    assert b[1] == pytest.approx(0.0, abs=SAME)
    length = np.hypot(1.0, b[2])
    assert 2.0 * 100.0 * (length / 1.5 - 1.0) * -b[2] / length == pytest.approx(1.0, rel=1e-9)
    _, _, residual = measured(arrays, fallen.nodes[0], force, np.full(2, 1.5))
    assert residual <= RESIDUAL


def test_a_fall_ends_where_two_nodes_have_met():
    prism = library.prism()
    arrays = structure_arrays(prism)
    nodes = arrays.coordinates.copy()
    nodes[arrays.segment_nodes[0]] = nodes[arrays.segment_nodes[0, 0]]  # a segment without a direction
    _, fallen = let_fall(prism, nodes)
    assert fallen.end[0] == LOST


def test_one_that_is_lost_spoils_no_other():
    prism = library.prism()
    arrays = structure_arrays(prism)
    start = near(prism, 8, 0.2)
    _, expected = let_fall(prism, start)
    start[3, arrays.segment_nodes[0]] = start[3, arrays.segment_nodes[0, 0]]
    _, fallen = let_fall(prism, start)
    assert fallen.end[3] == LOST
    others = np.arange(8) != 3
    np.testing.assert_array_equal(fallen.nodes[others], expected.nodes[others])


def test_rounding_of_the_energy_does_not_hold_a_descent_up():
    # Stiff members that are hardly stretched: their energy is known to fewer digits than it has.
    prism = library.prism()
    lengths = {"s0": 2.1722551700137487, "s1": 2.170985637264897, "s2": 2.1844250981335693}
    varied = {name: replace(prism.members[name], rest_length=length) for name, length in lengths.items()}
    path = solve_path(prism.replace(members={**prism.members, **varied}), {"top": 0.029756508939168175})
    assert path.status == "stable", path.reason
