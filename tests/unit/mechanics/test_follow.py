"""Runs in lanes: whatever else is solved with a run, its result is that of the run alone."""

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest

from tensegra.mechanics import Status, solve_batch, solve_path, solver, tangent
from tensegra.mechanics import batch as batch_module
from tensegra.mechanics.solver import Solver
from tensegra.structure import library

SAME = 1e-8
"""Of the structure's size: residuals of 1e-9 over the lowest eigenvalues of these runs."""

EIGENVALUE = 1e-6
"""Relative: what three sweeps of inverse iteration leave."""

DERIVATIVE = 1e-8
"""Of the largest derivative: both come from one factor of K at positions that agree to `SAME`."""

RESIDUAL = 1e-9
"""What is promised of every result."""

ROUNDING = 1e-10
"""How far a residual measured by other sums may be from the one that is told: rounding of EA·ℓ/l₀."""

BEAMS = {"printed": library.paper_beam, "slender": library.paper_beam_slender}
FIVE = {
    "actuation": {"A14": (0.09, 0.10), "A23": (0.09, 0.10)},
    "temperature": {"top": (0.0, 150.0), "middle": (0.0, 150.0), "bottom": (0.0, 150.0)},
}
STRONG = {"actuation": {"A1": (0.0, 0.3), "A23": (0.0, 0.3), "A4": (0.0, 0.3)}}
COLUMNS = ("nodes", "tensions", "slack", "residual", "lowest_eigenvalue", "steps", "iterations", "status")


def drawn(bounds, n_runs, seed=0):
    rng = np.random.default_rng(seed)
    return {
        kind: {name: rng.uniform(*limits, n_runs) for name, limits in group.items()}
        for kind, group in bounds.items()
    }


def taken(inputs, runs):
    return {kind: {name: values[runs] for name, values in group.items()} for kind, group in inputs.items()}


def single(structure, inputs, run):
    return solve_path(structure, **taken(inputs, run))


def strong_design(n_runs):
    beam = library.paper_beam().replace(gravity=(0.0, 0.0, 0.0))
    return beam, drawn(STRONG, n_runs)


def assert_identical(one, other):
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(one, column), getattr(other, column), err_msg=column)


@pytest.fixture(scope="module", params=BEAMS)
def beam(request):
    return BEAMS[request.param]()


@pytest.fixture(scope="module")
def five(beam):
    inputs = drawn(FIVE, 50)
    return inputs, solve_batch(beam, **inputs)


@pytest.mark.parametrize("threads", [2, 3])
def test_results_do_not_depend_on_the_threads(threads):
    beam, inputs = strong_design(37)
    assert_identical(solve_batch(beam, **inputs, threads=threads), solve_batch(beam, **inputs, threads=1))


def test_results_do_not_depend_on_the_order(five, beam):
    inputs, batch = five
    order = np.random.default_rng(1).permutation(batch.n_runs)
    shuffled = solve_batch(beam, **taken(inputs, order), threads=1)
    for column in COLUMNS:
        np.testing.assert_array_equal(getattr(shuffled, column), getattr(batch, column)[order])


@pytest.mark.parametrize("size", [1, 7, 16])
def test_results_do_not_depend_on_the_blocks(monkeypatch, size):
    beam, inputs = strong_design(33)
    whole = solve_batch(beam, **inputs, threads=1)
    monkeypatch.setattr(batch_module, "BLOCK", size)
    assert_identical(solve_batch(beam, **inputs, threads=1), whole)


def test_a_run_among_others_is_the_run_alone(five, beam):
    inputs, batch = five
    size = np.ptp(beam.coordinates, axis=0).max()
    for run in range(batch.n_runs):
        path = single(beam, inputs, run)
        assert batch.status[run] == path.status == Status.STABLE
        np.testing.assert_allclose(batch.nodes[run], path.final.nodes, rtol=0, atol=SAME * size)
        largest = np.abs(path.final.tensions).max()
        np.testing.assert_allclose(batch.tensions[run], path.final.tensions, rtol=0, atol=SAME * largest)


def test_no_run_of_a_hard_design_is_lost():
    beam, inputs = strong_design(48)
    batch = solve_batch(beam, **inputs)
    paths = [single(beam, inputs, run) for run in range(batch.n_runs)]
    assert [str(path.status) for path in paths] == batch.status.tolist()
    assert {"stable", "collapsed"} <= set(batch.status.tolist())
    assert "failed" not in batch.status
    assert np.isfinite(batch.nodes).all()
    size = np.ptp(beam.coordinates, axis=0).max()
    # Where the prestress is lost the position is not unique.
    for run in np.flatnonzero(batch.status == "stable"):
        np.testing.assert_allclose(batch.nodes[run], paths[run].final.nodes, rtol=0, atol=SAME * size)


def segments(structure, nodes):
    """Yield each member's index and its segments: end nodes, lengths and unit vectors."""
    index = {node: i for i, node in enumerate(structure.nodes)}
    for e, member in enumerate(structure.members.values()):
        path = [index[node] for node in member.nodes]
        pairs = list(pairwise(path))
        along = np.array([nodes[j] - nodes[i] for i, j in pairs])
        lengths = np.linalg.norm(along, axis=1)
        yield e, pairs, lengths, along / lengths[:, None]


def free_coordinates(structure):
    return np.array(
        [axis not in structure.supports.get(node, "") for node in structure.nodes for axis in "xyz"]
    )


@pytest.mark.parametrize("design", ["five", "strong"])
def test_every_residual_is_within_its_promise_by_other_sums(design):
    if design == "five":
        beam, inputs = library.paper_beam(), drawn(FIVE, 24, seed=2)
    else:
        beam, inputs = strong_design(24)
    batch = solve_batch(beam, **inputs)
    free = free_coordinates(beam)
    weight = np.concatenate([solve_path(beam).load.force[i] for i in range(len(beam.nodes))])
    for run in np.flatnonzero(batch.status == "stable"):
        force = np.zeros((len(beam.nodes), 3))
        for e, pairs, _, units in segments(beam, batch.nodes[run]):
            for (i, j), unit in zip(pairs, units, strict=True):
                force[i] -= batch.tensions[run, e] * unit
                force[j] += batch.tensions[run, e] * unit
        scale = max(np.abs(batch.tensions[run]).max(), np.abs(weight).max())
        found = np.abs(force.reshape(-1) - weight)[free].max() / scale
        assert batch.residual[run] <= RESIDUAL
        assert found <= RESIDUAL + ROUNDING


def dense_stiffness(structure, nodes, tensions, rest_length):
    """Sum K = Σ (EA/l₀) b bᵀ + T ∂²ℓ/∂x² as a full matrix of the free coordinates."""
    n = len(structure.nodes)
    K = np.zeros((3 * n, 3 * n))
    for e, pairs, lengths, units in segments(structure, nodes):
        if tensions[e] == 0.0:
            continue
        b = np.zeros((n, 3))
        for (i, j), length, unit in zip(pairs, lengths, units, strict=True):
            b[i] -= unit
            b[j] += unit
            across = tensions[e] / length * (np.eye(3) - np.outer(unit, unit))
            for p, sign_p in ((i, -1), (j, 1)):
                for q, sign_q in ((i, -1), (j, 1)):
                    K[3 * p : 3 * p + 3, 3 * q : 3 * q + 3] += sign_p * sign_q * across
        member = list(structure.members)[e]
        K += structure.axial_stiffness(member) / rest_length[e] * np.outer(b, b)
    free = free_coordinates(structure)
    return K[np.ix_(free, free)]


def test_the_lowest_eigenvalue_is_that_of_the_dense_matrix(five, beam):
    inputs, batch = five
    for run in range(0, batch.n_runs, 5):
        rest_length = single(beam, inputs, run).load.rest_length
        K = dense_stiffness(beam, batch.nodes[run], batch.tensions[run], rest_length)
        np.testing.assert_allclose(batch.lowest_eigenvalue[run], np.linalg.eigvalsh(K)[0], rtol=EIGENVALUE)


PARAMETERS = [
    ("actuation", "A14"),
    ("actuation", "A23"),
    ("temperature", "top"),
    ("stiffness", "K2"),
    ("rest_length", "K1"),
    ("load", ("23", "z")),
]


@pytest.fixture(scope="module")
def differentiated(five, beam):
    """Return the runs solved once more, with all derivatives asked for at once."""
    return solve_batch(beam, **five[0], derivatives=PARAMETERS, threads=2)


@pytest.mark.parametrize(("of", "name"), PARAMETERS)
@pytest.mark.parametrize("along", [True, False], ids=["along", "afterwards"])
def test_a_derivative_of_many_runs_is_that_of_the_run_alone(five, differentiated, beam, name, of, along):
    inputs, batch = five
    derivative = (differentiated if along else batch).derivative(name, of)
    for run in range(0, batch.n_runs, 9):
        alone = single(beam, inputs, run).derivative(name, of)
        for found, expected in ((derivative.nodes, alone.nodes), (derivative.tensions, alone.tensions)):
            largest = np.abs(expected).max()
            assert largest > 0.0
            np.testing.assert_allclose(found[run], expected, rtol=0, atol=DERIVATIVE * largest)


def test_derivatives_change_nothing_else(five, differentiated):
    assert_identical(differentiated, five[1])


def test_only_runs_that_stand_have_derivatives():
    beam, inputs = strong_design(24)
    batch = solve_batch(beam, **inputs, derivatives=["A1", "A23"])
    stands = batch.status == "stable"
    assert 0 < stands.sum() < batch.n_runs
    for name in ("A1", "A23"):
        derivative = batch.derivative(name)
        for values in (derivative.nodes, derivative.tensions):
            assert np.isfinite(values[stands]).all()
            assert np.isnan(values[~stands]).all()


def test_no_more_than_a_block_is_in_work_at_a_time(monkeypatch):
    asked = {"follow": [], "certify": []}

    def recording(kernel, seen):
        def recorded(self, runs, outcome, *others):
            seen.append(len(outcome.end))
            return kernel(self, runs, outcome, *others)

        return recorded

    for name, seen in asked.items():
        monkeypatch.setattr(Solver, name, recording(getattr(Solver, name), seen))
    monkeypatch.setattr(batch_module, "BLOCK", 8)
    batch = solve_batch(library.paper_beam(), actuation={"A14": np.linspace(0.0, 0.05, 20)}, threads=1)
    assert asked["follow"][-3:] == [8, 8, 4]
    assert set(asked["follow"][:-3]) <= {1}  # the stages, once for all
    before = len(asked["certify"])
    batch.derivative("A14")
    assert asked["certify"][before:] == [8, 8, 4]
    assert asked["certify"][before - 3 : before] == [8, 8, 4]


@pytest.mark.parametrize("name", ["A14", "top"])
def test_lanes_are_what_a_single_run_is(monkeypatch, name):
    # A structure that is large enough is solved in arrays of its own, by kernels compiled for one run.
    beam = library.paper_beam()
    inputs = {"actuation": {"A14": 0.06}, "temperature": {"top": 80.0}}
    lanes = solve_path(beam, **inputs)
    monkeypatch.setattr(solver, "LARGEST_IN_LANES", 0)
    monkeypatch.setattr(tangent, "LARGEST_IN_LANES", 0)
    single = solve_path(beam, **inputs)
    for column in ("nodes", "tensions", "residual", "lowest_eigenvalue", "steps", "iterations", "n_negative"):
        np.testing.assert_array_equal(getattr(single.final, column), getattr(lanes.final, column))
    assert len(single.history) == len(lanes.history)
    of = "actuation" if name == "A14" else "temperature"
    found, expected = (path.derivative(name, of).nodes for path in (single, lanes))
    np.testing.assert_array_equal(found, expected)


def test_memory_grows_with_the_results_alone(monkeypatch):
    monkeypatch.setattr(batch_module, "BLOCK", 64)

    def peak_and_results(n_runs):
        inputs = drawn(FIVE, n_runs)
        tracemalloc.start()
        try:
            batch = solve_batch(library.paper_beam(), **inputs, threads=1)
            return tracemalloc.get_traced_memory()[1], sum(getattr(batch, name).nbytes for name in COLUMNS)
        finally:
            tracemalloc.stop()

    (peak_few, few), (peak_many, many) = peak_and_results(256), peak_and_results(1024)
    # The blocks' results and the columns made of them; the workspace is several times as much.
    assert peak_many - peak_few < 2.5 * (many - few)


def test_newton_converges_quadratically_where_supports_move(beam):
    # The corrections once took the motion of the supports along, over and over.
    shift = np.linspace(-1.0, 1.0, 9)
    runs = solve_batch(beam, actuation={"A14": np.full(9, 0.04)}, positions={("1", "z"): shift})
    assert set(runs.status) == {"stable"}
    # What is quadratic takes three or four a point, and one more at the end; what is not takes ten.
    assert np.all(runs.iterations <= 4 * runs.steps + 1)
    assert runs.steps.max() <= 6
    assert runs.residual.max() <= RESIDUAL
