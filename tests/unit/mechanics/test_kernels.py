"""The compiled kernels against plain NumPy and finite differences, on structures without any order."""

import numpy as np
import pytest

from tensegra.mechanics import kernels, solve_path, step
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import build_pattern, dense_matrix
from tensegra.mechanics.state import Workspace, share
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Member, library

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


def unloaded(arrays, rest_length=None):
    lengths = arrays.rest_length if rest_length is None else rest_length
    return Load(lengths, arrays.stiffness, np.zeros((arrays.n_nodes, 3)))


def measured(arrays, x=None, rest_length=None):
    tangent = Tangent(arrays)
    tangent.measure(arrays.coordinates if x is None else x, unloaded(arrays, rest_length))
    return tangent


@pytest.fixture(params=SEEDS)
def case(request, random_structure):
    structure = random_structure(request.param)
    arrays = structure_arrays(structure)
    return structure, arrays, measured(arrays)


def force_at(arrays, x, rest_length=None):
    """Return the internal force at all nodes, also the supported ones."""
    tangent = measured(arrays, x, rest_length)
    return tangent.work.force[:, 0].reshape(-1, 3).copy()


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
    assert tangent.energy(unloaded(arrays)) == pytest.approx(expected, rel=ROUNDING)


def test_some_cables_are_slack_and_carry_nothing(random_structure):
    slack_cables = 0
    for seed in SEEDS:
        arrays = structure_arrays(random_structure(seed))
        tangent = measured(arrays)
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
    up, down = (measured(arrays, arrays.coordinates + sign * STEP * motion).length for sign in (1, -1))
    difference = (up - down) / (2 * STEP)
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
        tangent = measured(arrays)
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


@pytest.mark.parametrize("share", [1e-4, 1e-6, 1e-8, 1e-10])
def test_inertia_of_what_is_nearly_singular(share):
    # Six eigenvalues are zero within 1e-15 of the largest: an explicit inverse of a pivot block that is
    # nearly singular would leave its rounding times its condition.
    prism = library.prism().replace(supports={})
    arrays = structure_arrays(prism)
    tangent = measured(arrays, solve_path(library.prism()).final.nodes)
    shift = share * np.linalg.eigvalsh(tangent.matrix())[-1]
    assert tangent.factorise(shift) == 0
    assert tangent.factorise(-shift) == 6


SCALE = 1e4  # about the largest EA/l₀ of the structures here; a power of ten keeps lanes comparable


def run_kernels(arrays, x, rest_length, shift):
    """Run all kernels: on a pack where the arrays have an axis of lanes, else in arrays of a single run."""
    shared, pattern = share(arrays, build_pattern(arrays)), build_pattern(arrays)
    work = Workspace(shared, 0, single=x.ndim == 1)
    topology, lanes = shared.topology, work.lanes
    work.x[:], work.rest_length[:], work.shift[:] = x, rest_length, shift
    work.stiffness[:], work.scale[:] = spread(arrays.stiffness, x.shape[1:]), SCALE
    step.measure_by_length(topology, lanes)
    kernels.internal_force(topology, lanes, lanes.tension, lanes.force)
    work.motion[:] = x**2
    kernels.stretch_rate(topology, lanes, lanes.motion, lanes.length_rate)
    work.pull[:] = work.axial * work.length_rate
    kernels.force_rate(topology, lanes, lanes.motion, lanes.pull, lanes.push)
    kernels.assemble(topology, lanes)
    assembled = work.blocks.copy()
    kernels.factorise(topology, lanes)
    work.second[:] = spread(np.cos(np.arange(3.0 * pattern.n_blocks)), x.shape[1:])
    kernels.solve(topology, lanes, lanes.second)
    return {
        "length": work.length.copy(),
        "tension": work.tension.copy(),
        "force": work.force.copy(),
        "rate": work.length_rate.copy(),
        "force_rate": work.push.copy(),
        "assembled": assembled,
        "negative": work.n_negative.copy(),
        "solution": work.second.copy(),
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
    tangent = measured(arrays)
    np.testing.assert_array_equal(alone["force"], tangent.work.force[:, 0])
    found = dense_matrix(tangent.pattern, alone["assembled"], tangent.free_index)
    np.testing.assert_array_equal(found, tangent.matrix())
    assert alone["negative"][0] == tangent.factorise()


def test_held_coordinates_are_rows_of_their_own(random_structure):
    arrays = structure_arrays(random_structure(0))
    tangent = measured(arrays)
    stiffness = tangent.matrix()
    matrix = dense_matrix(tangent.pattern, tangent.work.blocks[:, 0])
    held = np.setdiff1d(np.arange(len(matrix)), tangent.free_index)
    assert len(held) == 3  # two of node 1, one of the last
    assert np.diag(matrix)[held].min() > np.linalg.eigvalsh(stiffness)[-1]
    np.testing.assert_array_equal(matrix[held], np.diag(np.diag(matrix))[held])


def test_what_is_out_of_balance_is_told_of_the_free_coordinates_alone(random_structure):
    arrays = structure_arrays(random_structure(4))
    force = np.random.default_rng(6).standard_normal((arrays.n_nodes, 3))
    tangent = Tangent(arrays)
    load = Load(arrays.rest_length, arrays.stiffness, force)
    out, residual = tangent.measure(arrays.coordinates, load)
    inner = force_at(arrays, arrays.coordinates)
    np.testing.assert_array_equal(out, np.where(arrays.free, inner - force, 0.0))
    scale = max(np.abs(tangent.tension).max(), np.abs(force[arrays.free]).max())
    assert residual == pytest.approx(np.abs(out).max() / scale, rel=ROUNDING)


def test_a_position_that_is_no_number_is_out_of_balance(random_structure):
    arrays = structure_arrays(random_structure(4))
    x = arrays.coordinates.copy()
    x[3, 1] = np.nan
    assert not Tangent(arrays).measure(x, unloaded(arrays))[1] < np.inf


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
        tangent = measured(arrays)
        counts.append(tangent.factorise())
        force = np.cos(np.arange(3.0 * structure.n_nodes)).reshape(-1, 3)
        solutions.append(tangent.solve(np.vstack([force, np.zeros((arrays.n_nodes - len(force), 3))])))
    assert counts[1] == counts[0] + 3  # the loose node's three motions have no stiffness
    expected = solutions[0]
    np.testing.assert_allclose(solutions[1][:-1], expected, atol=SOLVE * np.abs(expected).max())
    np.testing.assert_array_equal(solutions[1][-1], 0.0)  # no force moves it nowhere, and not to NaN
