"""Certificates of many runs against dense NumPy: what is proved is true, and nearly all of it is proved."""

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.certify import NOT_DEFINITE, PROVED, UNKNOWN
from tensegra.mechanics.derivatives import Direction, differentiate
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.rigid import rigid_motions
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import Member, Structure, library
from tensegra.structure.structure import path_length

EIGENVALUE = 1e-6
"""Relative: iterations end where the value changes by 1e-7, and its proof is a shift 1e-6 below."""

ROUNDING = 1e-12
"""Of sums over the members."""

DERIVATIVE = 1e-9
"""Of the largest: one solve each, one of them corrected once more, with condition numbers up to 1e4."""

N_RUNS = 11
"""More than a pack, and no multiple of it."""


def certified(arrays, nodes, rest_length, modes="any", directions=(), motions=None, place=None):
    """Certify a structure at ``(n_runs, n_nodes, 3)`` with rest lengths ``(n_runs, n_members)``."""
    solver = Solver(arrays, PathSettings(), motions=motions, nodes=place)
    force = np.zeros((arrays.n_nodes, 3))
    stage = StageInputs(rest_length[..., None], force, force, arrays.coordinates, arrays.coordinates)
    runs = solver.runs(stage, arrays.stiffness, arrays.coordinates[None], len(nodes))
    outcome = solver.outcome(nodes, len(nodes))
    begin = solver.any_modes if isinstance(modes, str) else modes
    certificate, by = solver.certify(runs, outcome, begin, directions)
    return solver, outcome, certificate, by


def measured(arrays, nodes, rest_length, force=None):
    tangent = Tangent(arrays)
    load = Load(rest_length, arrays.stiffness, np.zeros((arrays.n_nodes, 3)) if force is None else force)
    _, residual = tangent.measure(nodes, load)
    return tangent, load, residual


def runs_of(arrays, stretch, seed=0):
    """Return positions near to those given, and rest lengths with which everything is stretched."""
    rng = np.random.default_rng(seed)
    nodes = arrays.coordinates + 0.02 * rng.standard_normal((N_RUNS, arrays.n_nodes, 3)) * arrays.free
    lengths = np.array([measured(arrays, x, arrays.rest_length)[0].length for x in nodes])
    return nodes, lengths / stretch


def assert_the_certificate_is_true(arrays, nodes, rest_length, certificate):
    for run in range(len(nodes)):
        tangent, load, _ = measured(arrays, nodes[run], rest_length[run])
        values = np.linalg.eigvalsh(tangent.matrix())
        assert certificate.n_negative[run] == np.sum(values < 0.0)
        assert certificate.strain_energy[run] == pytest.approx(tangent.energy(load), rel=ROUNDING)
        if values[0] < 0.0:
            assert certificate.proof[run] == NOT_DEFINITE
        elif certificate.proof[run] == PROVED:
            assert certificate.lowest_eigenvalue[run] == pytest.approx(values[0], rel=EIGENVALUE)
        else:
            assert certificate.proof[run] == UNKNOWN


@pytest.mark.parametrize("stretch", [1.02, 0.98])
@pytest.mark.parametrize("seed", range(6))
def test_random_structures(random_structure, seed, stretch):
    arrays = structure_arrays(random_structure(seed))
    nodes, rest_length = runs_of(arrays, stretch, seed)
    _, outcome, certificate, _ = certified(arrays, nodes, rest_length)
    assert_the_certificate_is_true(arrays, nodes, rest_length, certificate)
    if stretch > 1.0:
        assert np.mean(certificate.proof == PROVED) > 0.8
    for run in range(N_RUNS):
        tangent, _, residual = measured(arrays, nodes[run], rest_length[run])
        np.testing.assert_array_equal(outcome.tensions[run], tangent.tension)
        assert outcome.residual[run] == residual


def sliders_of(stiffness):
    """Build sliders that nothing couples, each on a spring of its own."""
    nodes, members, supports = {}, {}, {}
    for i, k in enumerate(stiffness):
        nodes |= {f"a{i}": (0.0, float(i), 0.0), f"b{i}": (1.0, float(i), 0.0)}
        supports |= {f"a{i}": "xyz", f"b{i}": "yz"}
        members[f"s{i}"] = Member("strut", (f"a{i}", f"b{i}"), 1.0, stiffness=float(k))
    return Structure(name="sliders", nodes=nodes, members=members, supports=supports)


STIFFNESS = {
    "one": [3.0],
    "two": [5.0, 2.0],
    "apart": [7.0, 5.0, 2.0, 11.0, 13.0],
    "equal": [2.0] * 6,
    "the lowest thrice": [2.0, 2.0, 2.0, 5.0, 7.0],
    "crowded": [*np.linspace(2.0, 2.00001, 7), 9.0],
    "far apart": [1e6, 1.0, 1e3, 1e-2],
}

LEFT_TO_LANCZOS = ("crowded", "far apart")


@pytest.mark.parametrize("blind", [False, True])
@pytest.mark.parametrize("case", STIFFNESS)
def test_uncoupled_and_crowded_modes(case, blind):
    stiffness = STIFFNESS[case]
    arrays = structure_arrays(sliders_of(stiffness))
    nodes, rest_length = arrays.coordinates[None], arrays.rest_length[None]
    modes = "any"
    if blind:
        # Begin with motions that are no part of the softest mode at all: the random part has to find it.
        solver = Solver(arrays, PathSettings())
        modes = np.zeros((3, 3 * solver.pattern.n_blocks))
        for k, i in enumerate(np.argsort(stiffness)[::-1][:3]):
            modes[k, 3 * solver.pattern.node_block[arrays.node_index[f"b{i}"]]] = 1.0
    _, _, certificate, _ = certified(arrays, nodes, rest_length, modes)
    if case in LEFT_TO_LANCZOS:
        # What three vectors do not settle, or what rounding beside the stiffest hides, is not called proved.
        assert certificate.proof[0] == UNKNOWN
        return
    assert certificate.proof[0] == PROVED
    assert certificate.lowest_eigenvalue[0] == pytest.approx(min(stiffness), rel=EIGENVALUE)


@pytest.mark.parametrize("case", STIFFNESS)
def test_the_lowest_eigenvalue_that_is_told_is_right_whoever_found_it(case):
    path = solve_path(sliders_of(STIFFNESS[case]))
    assert path.final.lowest_eigenvalue == pytest.approx(min(STIFFNESS[case]), rel=EIGENVALUE)


@pytest.mark.parametrize("n", [3, 6, 12])
def test_modes_of_symmetric_structures(n):
    # The spokes of a wheel: every mode but two is one of a pair with the same eigenvalue.
    angle = 2.0 * np.pi * np.arange(n) / n
    nodes = {f"r{i}": (np.cos(a), np.sin(a), 0.0) for i, a in enumerate(angle)} | {"hub": (0.0, 0.0, 0.5)}
    pairs = [(f"r{i}", f"r{(i + 1) % n}") for i in range(n)] + [(f"r{i}", "hub") for i in range(n)]
    members = {
        f"m{e}": Member("cable", pair, path_length(nodes, pair) / 1.05, stiffness=10.0)
        for e, pair in enumerate(pairs)
    }
    supports = {"hub": "xyz"} | {f"r{i}": "z" for i in range(n)}
    arrays = structure_arrays(Structure(name="wheel", nodes=nodes, members=members, supports=supports))
    rest_length = np.repeat(arrays.rest_length[None], 3, axis=0)
    at = np.repeat(arrays.coordinates[None], 3, axis=0)
    _, _, certificate, _ = certified(arrays, at, rest_length)
    assert_the_certificate_is_true(arrays, at, rest_length, certificate)
    assert np.all(certificate.proof == PROVED)


@pytest.mark.parametrize(
    "build", [library.prism, lambda: library.prism(4), lambda: library.prism(clustered=True)]
)
def test_free_bodies_have_the_lowest_eigenvalue_that_is_none_of_their_rigid_motions(build):
    free = build().replace(supports={}, gravity=(0.0, 0.0, 0.0))
    path = solve_path(free)
    assert path.status == "stable"
    arrays = structure_arrays(free)
    x = path.final.nodes[None]
    tangent, _, _ = measured(arrays, x[0], path.load.rest_length)
    values = np.linalg.eigvalsh(tangent.matrix())
    solver, _, certificate, _ = certified(
        arrays, x, path.load.rest_length[None], motions=rigid_motions(arrays), place=x[0]
    )
    assert len(solver.motions) == 6
    assert certificate.n_negative[0] == 0
    assert certificate.proof[0] == PROVED
    assert certificate.lowest_eigenvalue[0] == pytest.approx(values[6], rel=10.0 * EIGENVALUE)
    assert path.final.lowest_eigenvalue == pytest.approx(values[6], rel=10.0 * EIGENVALUE)


def test_no_lane_sees_its_neighbours(random_structure):
    arrays = structure_arrays(random_structure(1))
    nodes, rest_length = runs_of(arrays, 1.02)
    _, _, together, _ = certified(arrays, nodes, rest_length)
    nodes[4] = np.nan
    _, _, spoilt, _ = certified(arrays, nodes, rest_length)
    others = np.arange(N_RUNS) != 4
    for name in ("lowest_eigenvalue", "n_negative", "strain_energy", "proof"):
        found, expected = getattr(spoilt, name), getattr(together, name)
        np.testing.assert_array_equal(found[others], expected[others])
    _, _, alone, _ = certified(arrays, nodes[:1], rest_length[:1])
    assert alone.lowest_eigenvalue[0] == together.lowest_eigenvalue[0]


def test_without_modes_no_eigenvalue_is_sought(random_structure):
    arrays = structure_arrays(random_structure(1))
    nodes, rest_length = runs_of(arrays, 1.02)
    _, _, certificate, _ = certified(arrays, nodes, rest_length, None)
    assert np.isnan(certificate.lowest_eigenvalue).all()
    np.testing.assert_array_equal(certificate.proof, UNKNOWN)
    assert not certificate.n_negative.any()


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_are_those_of_each_run(random_structure, seed):
    arrays = structure_arrays(random_structure(seed))
    nodes, rest_length = runs_of(arrays, 1.02, seed)
    rng = np.random.default_rng(seed)
    at_rest = np.zeros((arrays.n_nodes, 3))
    no_members = np.zeros(arrays.n_members)
    directions = [
        Direction(rng.standard_normal(arrays.n_members), no_members, at_rest, at_rest),
        Direction(no_members, arrays.stiffness * rng.standard_normal(arrays.n_members), at_rest, at_rest),
        Direction(no_members, no_members, rng.standard_normal(at_rest.shape), at_rest),
        Direction(rng.standard_normal((N_RUNS, arrays.n_members)), no_members, at_rest, at_rest),
    ]
    *_, by = certified(arrays, nodes, rest_length, None, directions)
    for run in range(N_RUNS):
        tangent, load, _ = measured(arrays, nodes[run], rest_length[run])
        tangent.factorise()
        for q, one in enumerate(directions):
            lengthens = one.rest_length if one.rest_length.ndim == 1 else one.rest_length[run]
            expected = differentiate(
                tangent, load, Direction(lengthens, one.stiffness, one.force, one.positions)
            )
            for found, true in (
                (by.nodes_by[run, q].reshape(-1, 3), expected.nodes),
                (by.tensions_by[run, q], expected.tensions),
            ):
                np.testing.assert_allclose(found, true, rtol=0, atol=DERIVATIVE * np.abs(true).max())
                assert np.abs(true).max() > 0.0
