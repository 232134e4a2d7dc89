"""The compiled kernels against plain NumPy and finite differences, on structures without any order."""

import numpy as np
import pytest

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import build_pattern, dense_matrix
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Member

SEEDS = range(10)

STEP = 1e-6
"""Of central differences over lengths of about one: truncation 1e-12, rounding 1e-10 of the values."""

DIFFERENCE = 2e-8
"""Of the largest value: what central differences with `STEP` leave, with a margin for short segments."""

ROUNDING = 1e-12
"""Of the largest value: sums and products over a dozen members."""

SOLVE = 1e-9
"""Relative, for matrices with condition numbers up to about 1e5."""


def plain_energy(structure, x, rest_length):
    """Σ ½ (EA/l₀) (ℓ − l₀)², cables without compression, in the words of the definition."""
    energy = 0.0
    index = {node: i for i, node in enumerate(structure.nodes)}
    for member, l0 in zip(structure.members.values(), rest_length, strict=True):
        length = sum(np.linalg.norm(x[index[j]] - x[index[i]]) for i, j in member.segments)
        stretch = length - l0
        if member.kind == "cable":
            stretch = max(0.0, stretch)
        energy += 0.5 * member.stiffness / l0 * stretch**2
    return energy


@pytest.fixture(params=SEEDS)
def case(request, random_structure):
    structure = random_structure(request.param)
    arrays = structure_arrays(structure)
    tangent = Tangent(arrays)
    tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
    return structure, arrays, tangent


def force_at(arrays, x, rest_length=None):
    rest_length = arrays.rest_length if rest_length is None else rest_length
    return Tangent(arrays).measure(x, rest_length, arrays.stiffness)


def full_matrix(tangent):
    """K over all free coordinates in the order of the nodes, by the blocks."""
    arrays, pattern = tangent.arrays, tangent.pattern
    flat = (3 * pattern.block_node[:, None] + np.arange(3)).ravel()[tangent.free_index]
    matrix = np.zeros((3 * arrays.n_nodes, 3 * arrays.n_nodes))
    matrix[np.ix_(flat, flat)] = tangent.matrix()
    free = arrays.free.ravel()
    return matrix[np.ix_(free, free)]


def test_energy_is_that_of_the_definition(case):
    structure, arrays, tangent = case
    expected = plain_energy(structure, arrays.coordinates, arrays.rest_length)
    assert tangent.energy(arrays.rest_length) == pytest.approx(expected, rel=ROUNDING)


def test_some_cables_are_slack_and_carry_nothing(random_structure):
    slack_cables = 0
    for seed in SEEDS:
        arrays = structure_arrays(random_structure(seed))
        tangent = Tangent(arrays)
        tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
        slack = arrays.is_cable & (tangent.length <= arrays.rest_length)
        assert not tangent.tension[slack].any()
        assert not tangent.axial[slack].any()
        np.testing.assert_array_equal(tangent.taut, ~slack)
        slack_cables += slack.sum()
    assert slack_cables > len(SEEDS)


def test_force_is_the_gradient_of_the_energy(case):
    structure, arrays, _ = case
    force = force_at(arrays, arrays.coordinates)
    gradient = np.zeros_like(force)
    for place in np.ndindex(*force.shape):
        shift = np.zeros_like(force)
        shift[place] = STEP
        up = plain_energy(structure, arrays.coordinates + shift, arrays.rest_length)
        down = plain_energy(structure, arrays.coordinates - shift, arrays.rest_length)
        gradient[place] = (up - down) / (2 * STEP)
    np.testing.assert_allclose(force, gradient, atol=DIFFERENCE * np.abs(force).max())


def test_internal_force_is_in_balance_with_itself(case):
    _, arrays, _ = case
    force = force_at(arrays, arrays.coordinates)
    scale = np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(np.cross(arrays.coordinates, force).sum(axis=0), 0.0, atol=ROUNDING * scale)


def test_stiffness_is_the_central_difference_of_the_force(case):
    _, arrays, tangent = case
    columns = []
    for place in np.argwhere(arrays.free):
        shift = np.zeros_like(arrays.coordinates)
        shift[tuple(place)] = STEP
        up, down = (force_at(arrays, arrays.coordinates + sign * shift) for sign in (1, -1))
        columns.append(((up - down) / (2 * STEP))[arrays.free])
    difference = np.array(columns).T
    stiffness = full_matrix(tangent)
    np.testing.assert_allclose(stiffness, difference, atol=DIFFERENCE * np.abs(stiffness).max())


def test_stiffness_is_symmetric_by_its_action(case):
    # `matrix` mirrors one triangle, so symmetry is asked of the action of K, which does not.
    _, arrays, tangent = case
    rng = np.random.default_rng(1)
    u, v = rng.standard_normal((2, arrays.n_nodes, 3))
    ku, kv = tangent.force_rate(u), tangent.force_rate(v)
    assert np.sum(u * kv) == pytest.approx(np.sum(v * ku), abs=ROUNDING * np.abs(u * kv).sum())


def test_action_of_the_stiffness_equals_the_assembled_matrix(case):
    _, arrays, tangent = case
    motion = np.where(arrays.free, np.random.default_rng(2).standard_normal((arrays.n_nodes, 3)), 0.0)
    rate = tangent.force_rate(motion)[arrays.free]
    expected = full_matrix(tangent) @ motion[arrays.free]
    np.testing.assert_allclose(rate, expected, atol=ROUNDING * np.abs(rate).max())


def test_force_rate_is_the_derivative_along_positions_and_rest_lengths(case):
    _, arrays, tangent = case
    rng = np.random.default_rng(3)
    motion = rng.standard_normal((arrays.n_nodes, 3))
    change = rng.standard_normal(arrays.n_members) * 0.1 * arrays.rest_length
    # ∂T/∂l₀ = −EA ℓ / l₀², at rest nodes.
    tension_rate = -tangent.axial * tangent.length / arrays.rest_length * change
    up, down = (
        force_at(arrays, arrays.coordinates + sign * STEP * motion, arrays.rest_length + sign * STEP * change)
        for sign in (1, -1)
    )
    difference = (up - down) / (2 * STEP)
    rate = tangent.force_rate(motion, tension_rate)
    np.testing.assert_allclose(rate, difference, atol=DIFFERENCE * np.abs(rate).max())


def test_length_rate_is_the_derivative_of_the_lengths(case):
    _, arrays, tangent = case
    motion = np.random.default_rng(4).standard_normal((arrays.n_nodes, 3))
    lengths = []
    for sign in (1, -1):
        moved = Tangent(arrays)
        moved.measure(arrays.coordinates + sign * STEP * motion, arrays.rest_length, arrays.stiffness)
        lengths.append(moved.length.copy())
    difference = (lengths[0] - lengths[1]) / (2 * STEP)
    np.testing.assert_allclose(
        tangent.length_rate(motion), difference, atol=DIFFERENCE * np.abs(difference).max()
    )


def test_solve_equals_numpy(case):
    _, arrays, tangent = case
    rhs = np.random.default_rng(5).standard_normal((arrays.n_nodes, 3))
    matrix = full_matrix(tangent)
    tangent.factorise()
    found = tangent.solve(rhs)
    assert not found[~arrays.free].any()
    expected = np.linalg.solve(matrix, rhs[arrays.free])
    np.testing.assert_allclose(found[arrays.free], expected, atol=SOLVE * np.abs(expected).max())


def test_inertia_equals_numpy_also_of_indefinite_matrices(random_structure):
    counts = []
    for seed in range(40):
        arrays = structure_arrays(random_structure(seed))
        tangent = Tangent(arrays)
        tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
        values = np.linalg.eigvalsh(full_matrix(tangent))
        gaps = np.concatenate([[values[0] - 1.0], 0.5 * (values[:-1] + values[1:]), [values[-1] + 1.0]])
        for shift in (0.0, *-gaps[::4]):  # also shifts that leave K as indefinite as can be
            counts.append(tangent.factorise(shift))
            assert counts[-1] == (values + shift < 0.0).sum()
    assert min(counts) == 0
    assert max(counts) > 10  # not all were definite


def test_spectrum_equals_numpy(case):
    _, arrays, tangent = case
    values, modes = tangent.spectrum(4)
    matrix = full_matrix(tangent)
    np.testing.assert_allclose(values, np.linalg.eigvalsh(matrix)[:4], atol=ROUNDING * np.abs(matrix).max())
    for value, mode in zip(values, modes, strict=True):
        assert not mode[~arrays.free].any()
        assert np.linalg.norm(mode) == pytest.approx(1.0)
        np.testing.assert_allclose(
            tangent.force_rate(mode)[arrays.free],
            value * mode[arrays.free],
            atol=10 * ROUNDING * np.abs(matrix).max(),
        )


SCALE = 1e4  # about the largest EA/l₀ of the structures here; a power of ten keeps lanes comparable


def run_kernels(arrays, x, rest_length, shift):
    """Run all kernels: on one run with arrays of shape ``(n,)``, on a pack with ``(n, WIDTH)``."""
    pattern = build_pattern(arrays)
    lanes = x.shape[1:]
    segments, members, nodes = len(arrays.segment_nodes), arrays.n_members, arrays.n_nodes
    unit, inverse_length = np.zeros((3 * segments, *lanes)), np.zeros((segments, *lanes))
    length, tension, axial, rate = (np.zeros((members, *lanes)) for _ in range(4))
    stiffness = spread(arrays.stiffness, lanes)
    taut = np.ones((members, *lanes))
    topology = arrays.segment_nodes, arrays.segment_start
    for _ in range(2):  # once to learn which cables are slack, once more with them slack
        kernels.measure(
            x, rest_length, stiffness, taut, *topology, unit, inverse_length, length, tension, axial
        )
        taut = np.where(spread(arrays.is_cable, lanes) & (length <= rest_length), 0.0, 1.0)
    force, force_rate = np.zeros((3 * nodes, *lanes)), np.zeros((3 * nodes, *lanes))
    kernels.internal_force(unit, tension, *topology, force)
    motion = x**2
    kernels.stretch_rate(unit, *topology, motion, rate)
    kernels.force_rate(unit, inverse_length, tension, axial * rate, *topology, motion, force_rate)
    blocks = np.zeros((9 * pattern.n_entries, *lanes))
    kernels.assemble(
        unit,
        inverse_length,
        tension,
        axial,
        *topology,
        pattern.node_block,
        pattern.column_start,
        pattern.segment_entry,
        pattern.path_start,
        pattern.segment_local,
        pattern.pair_start,
        pattern.pair_local,
        pattern.pair_entry,
        pattern.held_entry,
        pattern.held_diagonal,
        np.full((1, *lanes), SCALE),
        np.zeros((3 * int(np.diff(pattern.path_start).max()), *lanes)),
        blocks,
    )
    assembled = blocks.copy()
    pivots, negative = np.zeros((6 * pattern.n_blocks, *lanes)), np.zeros((1, *lanes))
    kernels.factorise(
        pattern.column_start,
        pattern.row,
        pattern.left_start,
        pattern.left_column,
        pattern.left_entry,
        shift,
        np.full((1, *lanes), SCALE),
        np.zeros(pattern.n_blocks, dtype=np.int64),
        blocks,
        pivots,
        negative,
    )
    solution = spread(np.cos(np.arange(3.0 * pattern.n_blocks)), lanes)
    kernels.solve(pattern.column_start, pattern.row, blocks, pivots, solution)
    return {
        "length": length,
        "tension": tension,
        "force": force,
        "rate": rate,
        "force_rate": force_rate,
        "assembled": assembled,
        "negative": negative,
        "solution": solution,
    }


def spread(values, lanes):
    return np.ascontiguousarray(np.broadcast_to(values.reshape(-1, *[1] * len(lanes)), (len(values), *lanes)))


def pack_of_runs(arrays, seed):
    """Positions, rest lengths and shifts that differ from lane to lane, some K definite, some not."""
    rng = np.random.default_rng(seed)
    x = arrays.coordinates.reshape(-1, 1) + 0.02 * rng.standard_normal((3 * arrays.n_nodes, WIDTH))
    rest_length = arrays.rest_length[:, None] * rng.uniform(0.9, 1.1, (arrays.n_members, WIDTH))
    return x, rest_length, np.linspace(0.0, 200.0, WIDTH)[None].copy()


@pytest.mark.parametrize("seed", range(5))
def test_a_lane_computes_what_a_single_run_does(random_structure, seed):
    arrays = structure_arrays(random_structure(seed))
    runs = pack_of_runs(arrays, seed)
    pack = run_kernels(arrays, *runs)
    assert np.unique(pack["negative"]).size > 1  # the lanes do differ
    for lane in range(WIDTH):
        alone = run_kernels(arrays, *(np.ascontiguousarray(values[:, lane]) for values in runs))
        for name, values in alone.items():
            np.testing.assert_array_equal(pack[name][:, lane], values, err_msg=name)


def test_lanes_do_not_see_each_other(random_structure):
    arrays = structure_arrays(random_structure(1))
    runs = pack_of_runs(arrays, 1)
    order = np.random.default_rng(0).permutation(WIDTH)
    plain = run_kernels(arrays, *runs)
    turned = run_kernels(arrays, *(np.ascontiguousarray(values[:, order]) for values in runs))
    runs[0][:, 3] = np.nan  # a run that has gone wrong spoils no other
    others = np.arange(WIDTH) != 3
    spoilt = run_kernels(arrays, *runs)
    for name, values in plain.items():
        np.testing.assert_array_equal(turned[name], values[:, order], err_msg=name)
        np.testing.assert_array_equal(spoilt[name][:, others], values[:, others], err_msg=name)
    assert np.isnan(spoilt["force"][:, 3]).all()


def test_the_kernels_are_what_the_tangent_uses(random_structure):
    arrays = structure_arrays(random_structure(0))
    alone = run_kernels(arrays, arrays.coordinates.reshape(-1).copy(), arrays.rest_length, np.zeros(1))
    tangent = Tangent(arrays)
    force = tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
    np.testing.assert_array_equal(alone["force"], force.ravel())
    found = dense_matrix(tangent.pattern, alone["assembled"], tangent.free_index)
    np.testing.assert_array_equal(found, tangent.matrix())
    assert alone["negative"][0] == tangent.factorise()


def test_held_coordinates_are_rows_of_their_own(random_structure):
    arrays = structure_arrays(random_structure(0))
    tangent = Tangent(arrays)
    tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
    tangent.assemble()
    matrix = dense_matrix(tangent.pattern, tangent._blocks)
    held = np.setdiff1d(np.arange(len(matrix)), tangent.free_index)
    assert len(held) == 3  # two of node 1, one of the last
    assert np.diag(matrix)[held].min() > np.linalg.eigvalsh(tangent.matrix())[-1]
    np.testing.assert_array_equal(matrix[held], np.diag(np.diag(matrix))[held])


def test_a_node_that_nothing_holds_spoils_no_other(random_structure):
    # All cables slack and no struts at one node: its block of K is zero, and the rest is as it was.
    structure = random_structure(2)
    loose = Member("cable", ("0", "loose"), 10.0, stiffness=100.0)
    with_loose = structure.replace(
        nodes={**structure.nodes, "loose": (2.0, 0.0, 0.0)}, members={**structure.members, "loose": loose}
    )
    solutions, counts = [], []
    for case in (structure, with_loose):
        arrays = structure_arrays(case)
        tangent = Tangent(arrays)
        tangent.measure(arrays.coordinates, arrays.rest_length, arrays.stiffness)
        counts.append(tangent.factorise())
        force = np.cos(np.arange(3.0 * structure.n_nodes)).reshape(-1, 3)
        solutions.append(tangent.solve(np.vstack([force, np.zeros((arrays.n_nodes - len(force), 3))])))
    assert counts[1] == counts[0] + 3  # the loose node's three motions have no stiffness
    expected = solutions[0]
    np.testing.assert_allclose(solutions[1][:-1], expected, atol=SOLVE * np.abs(expected).max())
    np.testing.assert_array_equal(solutions[1][-1], 0.0)  # no force moves it nowhere, and not to NaN
