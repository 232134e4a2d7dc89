"""K by its definition in NumPy against both patterns: long cables filled in, and with transports."""

import numpy as np
import pytest

from tensegra.mechanics import solve_path, tangent
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.inputs import Load
from tensegra.mechanics.pattern import LONGEST_FILLED_PATH, build_pattern
from tensegra.mechanics.rigid import rigid_motions
from tensegra.mechanics.tangent import Tangent, lowest_of
from tensegra.structure import Member, Structure, library
from tensegra.structure.structure import path_length

ROUNDING = 1e-12
"""Of the largest entry of K: sums over the members, in another order; of lengths, with square roots."""

COMPLEMENT = 1e-10
"""Of the largest entry: transports have been eliminated by a dense solve, m times as stiff as their cable."""

SOLVE = 1e-8
"""Relative, for condition numbers up to about 1e6."""

INDEFINITE = 1e-6
"""The same where K is indefinite: pivots are not chosen, some are small, and rounding grows with them."""

LANCZOS = 1e-8
"""Relative: the error of an eigenvalue is the square of ARPACK's residual of 1e-5, times the spread of K."""

MODE = 1e-4
"""Of modes: their error is ARPACK's residual over the gap to the next eigenvalue."""

NO_PRESTRESS = 1e-13
"""Tension with which a cable counts as taut, and which stiffens nothing beside EA/l₀ of ten and more."""


def unloaded(arrays, rest_length=None):
    lengths = arrays.rest_length if rest_length is None else rest_length
    return Load(lengths, arrays.stiffness, np.zeros((arrays.n_nodes, 3)))


def dense_stiffness(arrays, x, rest_length, stress=None):
    """Sum K = Σ k b bᵀ + T ∂²ℓ over the free coordinates; tensions are those of the lengths, or given."""
    n = 3 * arrays.n_nodes
    K = np.zeros((n, n))
    for e in range(arrays.n_members):
        pairs = arrays.segment_nodes[arrays.segment_start[e] : arrays.segment_start[e + 1]]
        along = x[pairs[:, 1]] - x[pairs[:, 0]]
        lengths = np.linalg.norm(along, axis=1)
        tension = arrays.stiffness[e] * (lengths.sum() / rest_length[e] - 1.0)
        tension = tension if stress is None else stress[e]
        if arrays.is_cable[e] and tension <= 0.0:
            continue
        b = np.zeros(n)
        for (i, j), length, unit in zip(pairs, lengths, along / lengths[:, None], strict=True):
            rows = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            np.add.at(b, rows, np.r_[-unit, unit])
            across = tension / length * (np.eye(3) - np.outer(unit, unit))
            K[np.ix_(rows, rows)] += np.block([[across, -across], [-across, across]])
        K += arrays.stiffness[e] / rest_length[e] * np.outer(b, b)
    free = arrays.free.ravel()
    return K[np.ix_(free, free)]


def in_node_order(one):
    flat = (3 * one.pattern.block_node[:, None] + np.arange(3)).ravel()[one.free_index]
    order = np.argsort(flat)
    return one.matrix()[np.ix_(order, order)]


def patterns(arrays):
    """Return the pattern that fills everything in, and the one with transports for every clustered cable."""
    filled, slid = (build_pattern(arrays, longest_filled_path=longest) for longest in (10**6, 1))
    assert slid.transports.any()
    assert not filled.transports.any()
    return {"filled": filled, "transports": slid}


def between(values):
    """Shifts that lie between eigenvalues, and beyond both ends, never near to one of them."""
    gaps = np.diff(values)
    inner = 0.5 * (values[:-1] + values[1:])[gaps > 1e-3 * np.abs(values).max()]
    return np.concatenate([[0.0, values[0] - 1.0], inner, [values[-1] + 1.0]])


def assert_is_that_of_the_definition(arrays, x, rest_length, stress=None, shifts=None):
    K = dense_stiffness(arrays, x, rest_length, stress)
    values = np.linalg.eigvalsh(K)
    scale = np.abs(K).max()
    force = np.random.default_rng(0).standard_normal((arrays.n_nodes, 3))
    for name, pattern in patterns(arrays).items():
        one = Tangent(arrays, pattern)
        one.measure(x, unloaded(arrays, rest_length), stress)
        np.testing.assert_allclose(in_node_order(one), K, rtol=0, atol=COMPLEMENT * scale, err_msg=name)
        n = min(3, len(K))
        np.testing.assert_allclose(one.spectrum(n).values, values[:n], rtol=0, atol=COMPLEMENT * scale)
        for shift in between(values) if shifts is None else shifts:
            assert one.factorise(-shift) == one.n_negative == np.sum(values < shift)
            found = one.solve(force)
            assert not found[~arrays.free].any()
            expected = np.linalg.solve(K - shift * np.eye(len(K)), force[arrays.free])
            within = np.abs(expected).max() * (INDEFINITE if one.n_negative else SOLVE)
            np.testing.assert_allclose(found[arrays.free], expected, rtol=0, atol=within, err_msg=name)


@pytest.mark.parametrize("seed", range(20))
def test_both_patterns_of_random_structures(random_structure, seed):
    arrays = structure_arrays(random_structure(seed, n_nodes=10, n_clustered=6))
    assert_is_that_of_the_definition(arrays, arrays.coordinates, arrays.rest_length)


@pytest.mark.parametrize("value", [0.0, 0.05, 0.10])
def test_both_patterns_of_the_beam_in_equilibrium(value):
    beam = library.paper_beam()
    arrays = structure_arrays(beam)
    path = solve_path(beam, {"A14": value, "A23": value})
    assert_is_that_of_the_definition(arrays, path.final.nodes, path.load.rest_length)


@pytest.mark.parametrize("seed", range(5))
def test_slack_long_cables_add_nothing(random_structure, seed):
    arrays = structure_arrays(random_structure(seed, n_nodes=10, n_clustered=6))
    clustered = arrays.n_segments > 1
    rest_length = np.where(clustered, 10.0 * arrays.rest_length, arrays.rest_length)
    without = dense_stiffness(arrays, arrays.coordinates, rest_length, np.where(clustered, 0.0, 1.0))
    taut = Tangent(arrays, patterns(arrays)["transports"])
    taut.measure(arrays.coordinates, unloaded(arrays, rest_length), np.where(clustered, 0.0, 1.0))
    assert not taut.taut[clustered].any()
    np.testing.assert_allclose(in_node_order(taut), without, rtol=0, atol=ROUNDING * np.abs(without).max())
    assert_is_that_of_the_definition(arrays, arrays.coordinates, rest_length)


@pytest.mark.parametrize("seed", range(5))
def test_without_prestress_everything_is_in_the_stretch(random_structure, seed):
    arrays = structure_arrays(random_structure(seed, n_nodes=10, n_clustered=6))
    stress = np.full(arrays.n_members, NO_PRESTRESS)
    assert_is_that_of_the_definition(arrays, arrays.coordinates, arrays.rest_length, stress)


def with_long_cable(structure, n_nodes, seed):
    """Add a cable over the nodes of a structure in any order, some of them twice."""
    rng = np.random.default_rng(seed)
    path = rng.permutation(list(structure.nodes))[:n_nodes].tolist()
    path += [node for node in rng.permutation(path[:-1])[:4].tolist() if node != path[-1]][:1]
    rest_length = 0.97 * path_length(structure.nodes, path)
    return structure.replace(
        members={**structure.members, "long": Member("cable", tuple(path), rest_length, stiffness=500.0)}
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_nodes", [31, 32, 33])  # transports that fill their last block, and that do not
def test_cables_over_more_than_thirty_nodes(random_structure, n_nodes, seed):
    structure = with_long_cable(random_structure(seed, n_nodes=36), n_nodes, seed)
    arrays = structure_arrays(structure)
    assert len(set(structure.members["long"].nodes)) > LONGEST_FILLED_PATH
    n_transports = arrays.n_segments[-1] - 1
    assert build_pattern(arrays).transports.sum() == -(-n_transports // 3)
    K = dense_stiffness(arrays, arrays.coordinates, arrays.rest_length)
    values = np.linalg.eigvalsh(K)
    assert_is_that_of_the_definition(
        arrays, arrays.coordinates, arrays.rest_length, shifts=between(values)[::8]
    )


def test_cables_along_a_whole_tower_in_equilibrium():
    tower = library.tower(30, 3, clustered="full")
    arrays = structure_arrays(tower)
    path = solve_path(tower)
    x, rest_length = path.final.nodes, path.load.rest_length
    K = dense_stiffness(arrays, x, rest_length)
    one = Tangent(arrays)
    assert one.pattern.transports.any()
    one.measure(x, path.load)
    scale = np.abs(K).max()
    np.testing.assert_allclose(in_node_order(one), K, rtol=0, atol=COMPLEMENT * scale)
    values = np.linalg.eigvalsh(K)
    assert one.factorise() == 0
    assert one.lowest_eigenvalue() == pytest.approx(values[0], rel=1e-6)
    assert path.final.lowest_eigenvalue == pytest.approx(values[0], rel=1e-6)


def held_by_a_cable(n_pulleys, free_axes="x"):
    """Build a slider that one cable alone holds, which runs over pulleys on a frame of struts."""
    nodes = {"slider": (0.0, 0.0, 0.0), "end": (2.0, 0.3, 0.1)}
    members, supports = {}, {"end": "xyz"}
    if free_axes != "xyz":
        supports["slider"] = "".join(sorted(set("xyz") - set(free_axes)))
    rng = np.random.default_rng(n_pulleys)
    for i in range(n_pulleys):
        nodes[f"p{i}"] = tuple(np.array([1.0 + 0.5 * (i % 2), 0.2 * i, 0.1]) + rng.uniform(-0.05, 0.05, 3))
        for foot in range(3):
            name = f"f{i}{foot}"
            nodes[name] = tuple(np.array(nodes[f"p{i}"]) + rng.standard_normal(3))
            supports[name] = "xyz"
            length = path_length(nodes, (name, f"p{i}"))
            members[name] = Member("strut", (name, f"p{i}"), length, stiffness=300.0)
    path = ("slider", *(f"p{i}" for i in range(n_pulleys)), "end")
    members["cable"] = Member("cable", path, path_length(nodes, path) / 1.01, stiffness=100.0)
    return Structure(name="slider", nodes=nodes, members=members, supports=supports)


@pytest.mark.parametrize("prestressed", [True, False])
@pytest.mark.parametrize("n_pulleys", [1, 2, 3, 30])
def test_a_direction_that_a_long_cable_alone_holds(n_pulleys, prestressed):
    arrays = structure_arrays(held_by_a_cable(n_pulleys))
    stress = None if prestressed else np.full(arrays.n_members, NO_PRESTRESS)
    K = dense_stiffness(arrays, arrays.coordinates, arrays.rest_length, stress)
    values = np.linalg.eigvalsh(K)
    assert values[0] > 0.0
    shifts = between(values)[:: 1 + len(values) // 12]
    assert_is_that_of_the_definition(arrays, arrays.coordinates, arrays.rest_length, stress, shifts)


def test_a_direction_that_nothing_holds_is_counted_by_both_patterns():
    # Three directions of the slider, one cable without prestress: two of them have no stiffness.
    arrays = structure_arrays(held_by_a_cable(4, free_axes="xyz"))
    for pattern in patterns(arrays).values():
        one = Tangent(arrays, pattern)
        one.measure(arrays.coordinates, unloaded(arrays), np.full(arrays.n_members, 1e-30))
        assert one.factorise() == 2


def test_measures_by_a_stress_take_the_cables_that_it_says(random_structure):
    arrays = structure_arrays(random_structure(0))
    rng = np.random.default_rng(0)
    stress = rng.standard_normal(arrays.n_members)
    one = Tangent(arrays)
    one.measure(arrays.coordinates, unloaded(arrays), stress)
    np.testing.assert_array_equal(one.taut, ~arrays.is_cable | (stress > 0.0))
    assert one.taut[arrays.is_cable].any()
    assert not one.taut[arrays.is_cable].all()
    K = dense_stiffness(arrays, arrays.coordinates, arrays.rest_length, stress)
    np.testing.assert_allclose(in_node_order(one), K, rtol=0, atol=ROUNDING * np.abs(K).max())


def test_potential_is_energy_less_the_work_of_the_loads(random_structure):
    arrays = structure_arrays(random_structure(2))
    force = np.random.default_rng(3).standard_normal((arrays.n_nodes, 3))
    load = Load(arrays.rest_length, arrays.stiffness, force)
    one = Tangent(arrays)
    step = 1e-6
    out, _ = one.measure(arrays.coordinates, load)
    for place in np.argwhere(arrays.free)[::4]:
        moved = []
        for sign in (1.0, -1.0):
            x = arrays.coordinates.copy()
            x[tuple(place)] += sign * step
            one.measure(x, load)
            moved.append(one.potential(load))
        slope = (moved[0] - moved[1]) / (2.0 * step)
        assert slope == pytest.approx(out[tuple(place)], abs=1e-7 * np.abs(out).max())


@pytest.mark.parametrize("slid", [False, True])
@pytest.mark.parametrize("single", [False, True])
def test_lanczos_equals_the_dense_eigenvalues(random_structure, monkeypatch, single, slid):
    arrays = structure_arrays(random_structure(1, n_nodes=30))
    if single:
        monkeypatch.setattr(tangent, "LARGEST_IN_LANES", 0)
    one = Tangent(arrays, build_pattern(arrays, longest_filled_path=1 if slid else 24))
    assert one.work.x.ndim == (1 if single else 2)
    one.measure(arrays.coordinates, unloaded(arrays))
    dense = one.spectrum(3)
    assert dense.values[0] < 0.0  # the harder case: the shift has to be found first
    monkeypatch.setattr(tangent, "LARGEST_DENSE", 0)
    sparse = one.spectrum(3)
    scale = np.abs(dense.values[0])
    np.testing.assert_allclose(sparse.values, dense.values, rtol=0, atol=LANCZOS * scale)
    for mode, expected in zip(sparse.vectors, dense.vectors, strict=True):
        assert abs(np.sum(mode * expected)) == pytest.approx(1.0, abs=MODE)


def test_what_lanczos_misses_is_found_when_it_is_not_proved(random_structure, monkeypatch):
    arrays = structure_arrays(random_structure(1, n_nodes=30))
    one = Tangent(arrays)
    one.measure(arrays.coordinates, unloaded(arrays))
    expected = one.spectrum(2).values
    monkeypatch.setattr(tangent, "LARGEST_DENSE", 0)
    import scipy.sparse.linalg

    eigsh, calls = scipy.sparse.linalg.eigsh, []

    def blind(*arguments, k, **keywords):
        """Leave the lowest out, the first time."""
        calls.append(k)
        values, vectors = eigsh(*arguments, k=k, **keywords)
        if len(calls) > 1:
            return values, vectors
        some = np.argsort(values)[1:]
        more = np.array([values.max() + 1.0])
        return np.concatenate([values[some], more]), np.hstack([vectors[:, some], vectors[:, :1]])

    monkeypatch.setattr(scipy.sparse.linalg, "eigsh", blind)
    found = one.spectrum(2).values
    assert len(calls) == 2
    np.testing.assert_allclose(found, expected, rtol=0, atol=LANCZOS * np.abs(expected).max())


def free_prism():
    """Return a prism that no support holds, in balance with itself."""
    prism = library.prism().replace(supports={}, gravity=(0.0, 0.0, 0.0))
    path = solve_path(prism)
    assert path.status == "stable"
    return structure_arrays(prism), path


@pytest.mark.parametrize("largest_dense", [400, 0])
def test_rigid_motions_are_no_part_of_the_spectrum(monkeypatch, largest_dense):
    arrays, path = free_prism()
    monkeypatch.setattr(tangent, "LARGEST_DENSE", largest_dense)
    x, motions = path.final.nodes, rigid_motions(arrays)
    assert len(motions) == 6
    one = Tangent(arrays, motions=motions, nodes=x)
    one.measure(x, path.load)
    values, vectors = one.spectrum(3)
    K = dense_stiffness(arrays, x, path.load.rest_length)
    all_values = np.linalg.eigvalsh(K)
    assert np.abs(all_values[:6]).max() < 1e-9 * all_values[-1]
    np.testing.assert_allclose(values, all_values[6:9], rtol=0, atol=1e-9 * all_values[-1])
    rigid = motions.fields(x).reshape(6, -1)
    np.testing.assert_allclose(
        rigid @ vectors.reshape(3, -1).T, 0.0, atol=1e-6 * np.abs(rigid).sum(axis=1).max()
    )
    for value, mode in zip(values, vectors.reshape(3, -1), strict=True):
        assert np.linalg.norm(mode) == pytest.approx(1.0, abs=1e-6)
        np.testing.assert_allclose(K @ mode, value * mode, rtol=0, atol=1e-5 * all_values[-1])
    assert one.factorise() == 0  # with the coordinates held that stand for them


def test_with_every_coordinate_held_there_is_no_spectrum():
    prism = library.prism()
    arrays = structure_arrays(prism.replace(supports=dict.fromkeys(prism.nodes, "xyz")))
    one = Tangent(arrays)
    one.measure(arrays.coordinates, unloaded(arrays))
    values, vectors = one.spectrum(3)
    assert values.shape == (0,)
    assert vectors.shape == (0, arrays.n_nodes, 3)
    assert one.lowest_eigenvalue() == lowest_of(one.spectrum()) == np.inf
    assert one.factorise() == 0


def test_with_every_coordinate_held_nothing_moves():
    # FAILS: a vector of no rows is written into a field of the workspace, which has at least one.
    prism = library.prism()
    arrays = structure_arrays(prism.replace(supports=dict.fromkeys(prism.nodes, "xyz")))
    one = Tangent(arrays)
    one.measure(arrays.coordinates, unloaded(arrays))
    one.factorise()
    assert not one.solve(np.ones((arrays.n_nodes, 3))).any()
