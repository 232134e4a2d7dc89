import numpy as np
import pytest

from tensegra.errors import ModelError
from tensegra.mechanics import solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.inputs import (
    Actuation,
    actuation_inputs,
    effective_rest_length,
    initial_inputs,
    inputs_after_stage,
    nodal_forces,
    stage_inputs,
)
from tensegra.structure import Actuator, Material, Member, Stage, Structure

ROUNDING = 1e-14
"""A handful of multiplications."""

ALPHA = 1e-3
"""Thermal expansion of the ropes, large enough that products of small changes are seen."""


@pytest.fixture(scope="module")
def structure():
    return Structure(
        name="three ropes",
        nodes={"top": (0, 0, 0), "1": (1, 0, -1), "2": (-1, 0, -1), "3": (0, 1, -1)},
        materials={"rope": Material(youngs_modulus=100.0, weight=2.0, thermal_expansion=ALPHA)},
        members={
            "K1": Member("cable", ("top", "1"), 1.4, material="rope", area=1.0, groups=("warm",)),
            "K2": Member("cable", ("top", "2"), 1.3, material="rope", area=1.0, groups=("warm",)),
            "K3": Member("cable", ("top", "3"), 1.2, stiffness=100.0),
        },
        supports={"1": "xyz", "2": "xyz", "3": "xyz"},
        gravity=(0, 0, -1),
        actuators={
            "pull": Actuator(("K1", "K2"), "shorten"),
            "pull1": Actuator(("K1",), "shorten"),
            "release": Actuator(("K1", "K3"), "lengthen"),
        },
    )


@pytest.fixture(scope="module")
def arrays(structure):
    return structure_arrays(structure)


def run(actuation=None, temperature=None, loads=None, positions=None):
    return Actuation(actuation or {}, temperature or {}, loads or {}, positions or {})


def test_before_the_stages_only_the_rest_lengths_act(arrays):
    inputs = initial_inputs(arrays)
    np.testing.assert_array_equal(inputs.rest_length, [1.4, 1.3, 1.2])
    assert not nodal_forces(arrays, inputs).any()
    np.testing.assert_array_equal(inputs.positions, arrays.coordinates)


def test_a_stage_changes_what_it_names_and_nothing_else(structure, arrays):
    first = Stage(
        "first",
        rest_length_changes={"K1": -0.1},
        rest_lengths={"K2": 1.25},
        loads={"top": (1, 2, 3)},
        temperatures={"warm": 20.0},
        positions={"1": (1, 0, -2)},
        gravity=(0, 0, 5),
    )
    after = inputs_after_stage(structure, arrays, initial_inputs(arrays), first)
    np.testing.assert_allclose(after.rest_length, [1.26, 1.25, 1.2], rtol=ROUNDING)
    np.testing.assert_array_equal(after.loads, [[1, 2, 3], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    np.testing.assert_array_equal(after.temperature, [20.0, 20.0, 0.0])
    np.testing.assert_array_equal(after.positions[1], [1, 0, -2])
    np.testing.assert_array_equal(after.positions[2], arrays.coordinates[2])
    np.testing.assert_array_equal(after.gravity, [0, 0, 5])

    second = inputs_after_stage(structure, arrays, after, Stage("second", rest_length_changes={"K1": 0.5}))
    np.testing.assert_allclose(second.rest_length, [1.26 * 1.5, 1.25, 1.2], rtol=ROUNDING)
    for kept in ("loads", "temperature", "positions", "gravity"):
        np.testing.assert_array_equal(getattr(second, kept), getattr(after, kept))


def test_a_stage_replaces_a_load_and_a_temperature(structure, arrays):
    before = inputs_after_stage(
        structure,
        arrays,
        initial_inputs(arrays),
        Stage("a", loads={"top": (1, 1, 1)}, temperatures={"warm": 20.0}),
    )
    after = inputs_after_stage(
        structure, arrays, before, Stage("b", loads={"top": (5, 0, 0)}, temperatures={"K1": 7.0})
    )
    np.testing.assert_array_equal(after.loads[0], [5, 0, 0])
    np.testing.assert_array_equal(after.temperature, [7.0, 20.0, 0.0])


def test_a_stage_takes_its_inputs_in_proportion(structure, arrays):
    before = initial_inputs(arrays)
    after = inputs_after_stage(
        structure,
        arrays,
        before,
        Stage(
            "all at once",
            rest_lengths={"K1": 1.0},
            loads={"top": (4, 0, 0)},
            temperatures={"warm": 50.0},
            positions={"1": (1, 0, -2)},
            gravity=(0, 0, -1),
        ),
    )
    way = stage_inputs(arrays, before, after)
    for t in (0.0, 0.25, 0.7, 1.0):
        expected = [(1.4 - 0.4 * t) * (1 + ALPHA * 50 * t), 1.3 * (1 + ALPHA * 50 * t), 1.2]
        np.testing.assert_allclose(way.rest_length_at(t), expected, rtol=ROUNDING)
        weight = np.zeros((4, 3))
        weight[:, 2] = -arrays.nodal_weight * t
        weight[0, 0] = 4 * t
        np.testing.assert_allclose(way.loads_at(t), weight, atol=ROUNDING)
        np.testing.assert_allclose(way.positions_at(t)[1], [1, 0, -1 - t], rtol=ROUNDING)
    np.testing.assert_allclose(way.rest_length_at(1.0), effective_rest_length(arrays, after), rtol=ROUNDING)
    np.testing.assert_allclose(way.loads_at(1.0), nodal_forces(arrays, after), atol=ROUNDING)


def test_rate_of_the_rest_lengths_is_their_derivative(structure, arrays):
    way, _ = actuation_inputs(
        structure,
        arrays,
        initial_inputs(arrays),
        run({"pull": 0.2, "pull1": 0.3, "release": 0.4}, {"warm": 90.0}),
    )
    step = 1e-6
    for t in (0.0, 0.3, 1.0):
        difference = (way.rest_length_at(t + step) - way.rest_length_at(t - step)) / (2 * step)
        np.testing.assert_allclose(way.rest_length_rate(t), difference, rtol=1e-8)  # (1e-6)² and rounding


def test_actuators_that_share_a_member_multiply(structure, arrays):
    way, after = actuation_inputs(
        structure, arrays, initial_inputs(arrays), run({"pull": 0.1, "pull1": 0.2, "release": 0.5})
    )
    np.testing.assert_allclose(
        after.rest_length, [1.4 * 0.9 * 0.8 * 1.5, 1.3 * 0.9, 1.2 * 1.5], rtol=ROUNDING
    )
    half = [1.4 * 0.95 * 0.9 * 1.25, 1.3 * 0.95, 1.2 * 1.25]
    np.testing.assert_allclose(way.rest_length_at(0.5), half, rtol=ROUNDING)


def test_actuation_starts_where_the_stages_ended(structure, arrays):
    before = inputs_after_stage(
        structure,
        arrays,
        initial_inputs(arrays),
        Stage("a", rest_lengths={"K1": 2.0}, temperatures={"warm": 10.0}, loads={"top": (0, 0, 1)}),
    )
    way, after = actuation_inputs(
        structure,
        arrays,
        before,
        run({"pull1": 0.5}, {"K1": 30.0}, {("top", "z"): 2.0, ("top", "x"): 1.0}, {("2", "z"): -0.5}),
    )
    np.testing.assert_allclose(way.rest_length_at(0.0), effective_rest_length(arrays, before), rtol=ROUNDING)
    np.testing.assert_allclose(way.rest_length_at(1.0), effective_rest_length(arrays, after), rtol=ROUNDING)
    assert way.rest_length_at(1.0)[0] == pytest.approx(1.0 * (1 + ALPHA * 40.0), rel=ROUNDING)
    np.testing.assert_array_equal(after.temperature, [40.0, 10.0, 0.0])
    np.testing.assert_array_equal(after.loads[0], [1, 0, 3])
    np.testing.assert_array_equal(after.positions[2], [-1, 0, -1.5])


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"actuation": {"pul": 0.1}}, "did you mean 'pull'"),
        ({"actuation": {"pull": 1.0}}, "rest length"),
        ({"actuation": {"release": -1.0}}, "rest length"),
        ({"actuation": {"pull": np.nan}}, "pull"),
        ({"actuation": {"release": np.inf}}, "release"),
        ({"temperature": {"wram": 1.0}}, "did you mean 'warm'"),
        ({"temperature": {"warm": np.inf}}, "finite"),
        ({"temperature": {"warm": -2.0 / ALPHA}}, "rest length"),
        ({"loads": {("tpo", "z"): 1.0}}, "did you mean 'top'"),
        ({"loads": {("top", "w"): 1.0}}, "x, y or z"),
        ({"loads": {("top", "xy"): 1.0}}, "x, y or z"),
        ({"loads": {("top", "z"): np.nan}}, "finite"),
        ({"positions": {("top", "z"): 1.0}}, "supported"),
    ],
)
def test_an_impossible_input_is_refused(structure, inputs, message):
    with pytest.raises(ModelError, match=message):
        solve_path(structure, **inputs)


def test_integer_ids_are_accepted(structure):
    by_integer = solve_path(structure, positions={(1, "z"): -0.1})
    by_text = solve_path(structure, positions={("1", "z"): -0.1})
    np.testing.assert_array_equal(by_integer.final.nodes, by_text.final.nodes)
    assert by_integer.final.node(1)[2] == -1.1
