"""The parts of a step against differences of equilibria that Newton's method finds at other λ."""

from itertools import pairwise

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, kernels, step
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.inputs import Load, StageInputs
from tensegra.mechanics.law import plain
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import Workspace
from tensegra.mechanics.tangent import Tangent

SEEDS = range(5)

STEP = 1e-3
"""Of λ, for central differences of equilibria known to 1e-14: truncation 1e-6, rounding 1e-8."""

DIFFERENCE = 2e-5
"""Of the largest derivative: what they leave, with a margin for soft structures that bend much."""

QUADRATIC = 1e5
"""Of a correction over the square of the one before: the stiffest of K over the softest, over a length."""

NEAR = 1e-6
"""Corrections from which on this is asked: before, cables still go slack and taut."""

AT = 0.4
"""λ at which it is looked."""


class Way:
    """A random structure on its way: rest lengths bend, loads and supports move."""

    def __init__(self, structure, seed):
        self.arrays = arrays = structure_arrays(structure)
        rng = np.random.default_rng(seed)
        # Everything is stretched at the start, so that it stands; some cables go slack on the way.
        tangent = Tangent(arrays)
        tangent.measure(arrays.coordinates, self.load_of(arrays.rest_length, np.zeros((arrays.n_nodes, 3))))
        start = tangent.length / 1.05
        change = start[:, None] * 0.02 * rng.uniform(-1.0, 1.0, (arrays.n_members, 2))
        loads = 0.1 * rng.standard_normal((2, arrays.n_nodes, 3))
        shift = np.where(arrays.free, 0.0, 0.05 * rng.standard_normal((arrays.n_nodes, 3)))
        self.stage = StageInputs(
            np.hstack([start[:, None], change]), *loads, arrays.coordinates, arrays.coordinates + shift
        )
        self.solver = Solver(arrays, PathSettings())
        self.runs = self.solver.runs(self.stage, arrays.stiffness, arrays.coordinates[None], 1)
        self.work = Workspace(self.solver.shared, 2)

    def load_of(self, rest_length, force):
        return Load(rest_length, self.arrays.stiffness, force)

    def equilibrium(self, parameter, x):
        """Return positions, tensions were all members taut, and which are, by Newton's method."""
        x = np.where(self.arrays.free, x, self.stage.positions_at(parameter))
        load = self.load_of(self.stage.rest_length_at(parameter), self.stage.loads_at(parameter))
        tangent = Tangent(self.arrays)
        for _ in range(30):
            out, residual = tangent.measure(x, load)
            tangent.factorise()
            x = x - tangent.solve(out)
        assert residual < 1e-12
        tangent.measure(x, load)
        return x, plain.tension(tangent.length, load.rest_length, load.stiffness), tangent.taut

    def stand(self, parameter, x):
        """Put all lanes at a point, measured and factorised."""
        outcome = self.solver.outcome(x[None], 1, parameter)
        topology, lanes = self.solver.topology, self.work.lanes
        for lane in range(self.work.x.shape[1]):
            step.enter(topology, self.runs, outcome, lanes, lane, 0, 0)
        step.prescribe(topology, lanes)
        step.measure_by_length(topology, lanes)
        step.balance(topology, lanes, 1e-6)
        step.factorise(topology, lanes)
        return topology, lanes


@pytest.fixture(params=SEEDS)
def way(request, random_structure):
    return Way(random_structure(request.param), request.param)


@pytest.fixture
def standing(way):
    """Return the way, its equilibria around `AT`, and the lanes there."""
    middle, *_ = way.equilibrium(AT, way.arrays.coordinates)
    around = [way.equilibrium(AT + h, middle) for h in (-STEP, 0.0, STEP)]
    return way, around, way.stand(AT, around[1][0])


def test_rest_lengths_and_their_derivatives_are_those_of_the_stage(way):
    way.stand(AT, way.arrays.coordinates)
    coefficients = way.stage.rest_length
    expected = (
        (way.work.rest_length, way.stage.rest_length_at(AT)),
        (way.work.rest_length_rate, coefficients[:, 1] + 2.0 * AT * coefficients[:, 2]),
        (way.work.rest_length_bend, 2.0 * coefficients[:, 2]),
    )
    for found, true in expected:
        np.testing.assert_allclose(
            found, np.repeat(true[:, None], found.shape[1], axis=1), rtol=0, atol=1e-15
        )


def test_supports_stand_where_they_are_at_their_time(way):
    way.stand(AT, way.arrays.coordinates)
    held = ~way.arrays.free
    found = way.work.x[:, 0].reshape(-1, 3)
    np.testing.assert_allclose(found[held], way.stage.positions_at(AT)[held], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found[~held], way.arrays.coordinates[~held])


def assert_near(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=DIFFERENCE * np.abs(expected).max())
    assert np.abs(expected).max() > 1e-6


def test_derivatives_by_the_way_are_differences_of_equilibria(standing):
    way, around, (topology, lanes) = standing
    step.differentiate(topology, lanes)
    (x0, t0, before), (x1, t1, _), (x2, t2, after) = around
    np.testing.assert_array_equal(before, after)  # no kink in between
    assert_near(way.work.velocity[:, 3].reshape(-1, 3), (x2 - x0) / (2.0 * STEP))
    assert_near(way.work.bend[:, 3].reshape(-1, 3), (x2 - 2.0 * x1 + x0) / STEP**2)
    assert_near(way.work.stress_rate[:, 3], (t2 - t0) / (2.0 * STEP))
    assert_near(way.work.stress_bend[:, 3], (t2 - 2.0 * t1 + t0) / STEP**2)


def test_corrections_converge_quadratically(way):
    middle, *_ = way.equilibrium(AT, way.arrays.coordinates)
    start = middle + 1e-4 * np.random.default_rng(0).standard_normal(middle.shape)
    topology, lanes = way.stand(AT, start)
    way.work.active[:] = 1.0
    moves = []
    for _ in range(12):
        step.correct(topology, lanes)
        moves.append(float(way.work.measure_of[0, 0]))
        step.taut_by_stress(topology, lanes)
        step.carried_by(topology, lanes)
        kernels.measure(topology, lanes)
        step.balance(topology, lanes, 1e-6)
        step.factorise(topology, lanes)
    np.testing.assert_allclose(way.work.x[:, 0].reshape(-1, 3), middle, rtol=0, atol=1e-10)
    assert way.work.residual.max() < 1e-12
    near = [(before, after) for before, after in pairwise(moves) if before < NEAR]
    assert near
    assert all(after <= max(QUADRATIC * before**2, 1e-12) for before, after in near)


def test_lanes_that_are_not_active_stay_where_they_are(way):
    start = way.arrays.coordinates + 0.01
    topology, lanes = way.stand(AT, start)
    before = way.work.x.copy()
    way.work.active[:] = 0.0
    way.work.active[0, 5] = 1.0
    step.correct(topology, lanes)
    moved = np.abs(way.work.x - before).max(axis=0) > 0.0
    np.testing.assert_array_equal(np.flatnonzero(moved), [5])


def test_a_cable_on_the_wrong_side_of_slack_is_out_of_balance(way):
    middle, tension, taut = way.equilibrium(AT, way.arrays.coordinates)
    topology, lanes = way.stand(AT, middle)
    assert way.work.residual.max() < 1e-12
    cable = int(np.flatnonzero(way.arrays.is_cable & taut)[0])
    way.work.taut[cable] = 0.0
    kernels.measure(topology, lanes)
    step.balance(topology, lanes, 1e-6)
    assert way.work.residual.min() >= 0.9 * tension[cable] / np.abs(tension).max()
