"""The contract of a sampler: in the cube, seeded, reproducible to the bit, extendable without loss."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydantic import TypeAdapter
from scipy.stats import qmc

from tensegra.study.sampling import Design, FileDesign, n_design_points, sampling_advice, unit_points

NAMES = ("a", "b", "c")


def entry(**written):
    return TypeAdapter(Design).validate_python(written)


def product(sizes):
    factors = [
        {"variables": ["c", "a"], "design": {"sampler": "sobol", "sizes": sizes}},
        {"variables": ["b"], "design": {"sampler": "sobol", "sizes": 4}},
    ]
    return entry(sampler="product", factors=factors)


# Name → the design, and what it is extended to.
SAMPLERS = {
    "sobol": (entry(sampler="sobol", sizes=20), entry(sampler="sobol", sizes=64)),
    "plain sobol": (
        entry(sampler="sobol", sizes=20, scramble=False),
        entry(sampler="sobol", sizes=[20, 44], scramble=False),
    ),
    "halton": (entry(sampler="halton", sizes=20), entry(sampler="halton", sizes=64)),
    "plain halton": (
        entry(sampler="halton", sizes=20, scramble=False),
        entry(sampler="halton", sizes=64, scramble=False),
    ),
    "latin hypercube": (
        entry(sampler="latin_hypercube", sizes=20),
        entry(sampler="latin_hypercube", sizes=[20, 30]),
    ),
    "optimised latin hypercube": (
        entry(sampler="latin_hypercube", sizes=12, optimised=True),
        entry(sampler="latin_hypercube", sizes=[12, 1], optimised=True),
    ),
    "saltelli": (entry(sampler="saltelli", sizes=8), entry(sampler="saltelli", sizes=16)),
    "saltelli of second order": (
        entry(sampler="saltelli", sizes=8, second_order=True),
        entry(sampler="saltelli", sizes=[8, 8], second_order=True),
    ),
    "full factorial": (
        entry(sampler="full_factorial", levels={"a": 3, "b": 4, "c": 2}),
        entry(sampler="full_factorial", levels={"a": 5, "b": 7, "c": 3}),
    ),
    "product": (product(8), product(16)),
}
IN_ORDER = set(SAMPLERS) - {"full factorial", "product"}


@pytest.fixture(params=SAMPLERS, ids=lambda name: name.replace(" ", "_"))
def name(request):
    return request.param


@pytest.fixture
def design(name):
    return SAMPLERS[name][0]


def rows(U):
    return {row.tobytes() for row in U}


def test_points_fill_the_cube_in_the_number_promised(design):
    U = unit_points(design, NAMES, seed=3)
    assert U.shape == (n_design_points(design, 3), 3)
    assert U.dtype == np.float64
    assert ((U >= 0) & (U <= 1)).all()


def test_the_seed_decides_every_bit(design):
    assert_array_equal(unit_points(design, NAMES, seed=3), unit_points(design, NAMES, seed=3))


def test_another_seed_is_another_design_unless_nothing_is_random(name, design):
    same = np.array_equal(unit_points(design, NAMES, seed=3), unit_points(design, NAMES, seed=4))
    assert same == (name in {"plain sobol", "plain halton", "full factorial"})


def test_an_extended_design_keeps_every_point(name, design):
    short = unit_points(design, NAMES, seed=3)
    long = unit_points(SAMPLERS[name][1], NAMES, seed=3)
    assert len(long) > len(short)
    if name in IN_ORDER:
        assert_array_equal(long[: len(short)], short)
    else:
        assert rows(short) <= rows(long)


def test_no_point_is_repeated(design):
    U = unit_points(design, NAMES, seed=3)
    assert len(rows(U)) == len(U)


def test_the_global_generator_is_left_alone(design):
    state = np.random.get_state()[1].copy()  # noqa: NPY002 - it is the one that must not be touched
    unit_points(design, NAMES, seed=3)
    assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_every_sampler_of_the_file_is_under_contract():
    from typing import get_args

    members = set(get_args(get_args(Design)[0])) - {FileDesign}
    assert {type(design) for pair in SAMPLERS.values() for design in pair} == members


def test_a_sobol_sequence_is_scipys():
    U = unit_points(entry(sampler="sobol", sizes=16), NAMES, seed=3)
    assert_array_equal(U, qmc.Sobol(3, rng=np.random.default_rng(3)).random(16))


def test_a_latin_hypercube_has_one_point_in_each_slice():
    U = unit_points(entry(sampler="latin_hypercube", sizes=[10, 15]), NAMES, seed=3)
    for part, n in ((U[:10], 10), (U[10:], 15)):
        for column in part.T:
            assert sorted(np.floor(column * n)) == list(range(n))


def test_an_optimised_hypercube_is_more_even_than_a_plain_one():
    plain = unit_points(entry(sampler="latin_hypercube", sizes=20), NAMES, seed=3)
    optimised = unit_points(entry(sampler="latin_hypercube", sizes=20, optimised=True), NAMES, seed=3)
    assert qmc.discrepancy(optimised) < qmc.discrepancy(plain)


def test_a_full_factorial_is_the_grid_and_centred_avoids_the_faces():
    U = unit_points(entry(sampler="full_factorial", levels=3), ("a", "b"), seed=0)
    assert_array_equal(U[:4], [[0, 0], [0, 0.5], [0, 1], [0.5, 0]])
    U = unit_points(entry(sampler="full_factorial", levels=2, centred=True), ("a", "b"), seed=0)
    assert_array_equal(U[:2], [[0.25, 0.25], [0.25, 0.75]])


def test_a_product_joins_every_point_with_every_other_in_the_variables_own_columns():
    U = unit_points(product(8), NAMES, seed=3)
    first, second = U[:, [2, 0]], U[:, 1]
    assert len(rows(first.copy())) == 8
    assert len(set(second)) == 4
    assert_array_equal(second[:4], second[4:8])
    assert_array_equal(first[0], first[3])


def test_factors_of_the_same_kind_are_different_points():
    same = {"sampler": "sobol", "sizes": 8}
    design = entry(
        sampler="product",
        factors=[{"variables": ["a"], "design": same}, {"variables": ["b"], "design": same}],
    )
    U = unit_points(design, ("a", "b"), seed=3)
    assert set(U[:, 0]) != set(U[:, 1])


@pytest.mark.parametrize("second_order", [False, True])
def test_saltelli_blocks_are_salibs(second_order):
    from SALib.sample import sobol

    design = entry(sampler="saltelli", sizes=8, second_order=second_order, scramble=False)
    problem = {"num_vars": 3, "names": list(NAMES), "bounds": [[0, 1]] * 3}
    expected = sobol.sample(problem, 8, calc_second_order=second_order, scramble=False, skip_values=0)
    assert_array_equal(unit_points(design, NAMES, seed=0), expected)


def test_advice_is_given_where_a_sequence_loses_its_balance():
    assert sampling_advice(entry(sampler="sobol", sizes=1024)) == ()
    assert "512 would keep it" in sampling_advice(entry(sampler="sobol", sizes=600))[0]
    assert "128 would keep it" in sampling_advice(entry(sampler="sobol", sizes=100))[0]
    assert "corner" in sampling_advice(entry(sampler="sobol", sizes=8, scramble=False))[0]
    assert sampling_advice(entry(sampler="halton", sizes=100)) == ()
    assert len(sampling_advice(product(9))) == 1
