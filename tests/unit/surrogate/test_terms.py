import tracemalloc
from math import comb

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tensegra.surrogate import fit
from tensegra.surrogate.pursuit import hyperbolic
from tensegra.surrogate.terms import largest, margin, n_total_degree, total_degree


@given(st.lists(st.integers(0, 4), min_size=1, max_size=4), st.integers(0, 6))
def test_terms_are_counted_without_listing_them(highest, degree):
    assert n_total_degree(highest, degree) == len(total_degree(len(highest), degree, highest))


def test_a_count_that_no_list_could_hold():
    assert n_total_degree([12] * 100, 12) == comb(112, 12)


@given(st.integers(1, 3), st.integers(1, 4), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_the_largest_products_are_the_largest(n_inputs, n_degrees, n_terms, seed):
    weights = np.random.default_rng(seed).uniform(0.01, 1, size=(n_inputs, n_degrees))
    found = largest(weights, n_terms)
    whole = np.column_stack([np.ones(n_inputs), weights])
    every = np.stack(np.meshgrid(*[np.arange(n_degrees + 1)] * n_inputs), axis=-1).reshape(-1, n_inputs)
    sizes = [whole[np.arange(n_inputs), terms].prod(axis=1) for terms in (found, every)]
    assert len(set(map(tuple, found.tolist()))) == len(found) == min(n_terms, len(every))
    np.testing.assert_allclose(sizes[0], np.sort(sizes[1])[::-1][: len(found)])


def test_a_hyperbolic_set_of_many_inputs_is_as_large_as_asked():
    found = hyperbolic(np.full(200, 30), 0.5, 1000)
    assert len(found) == 1000
    assert found[0].sum() == 0
    assert np.count_nonzero(found, axis=1).max() <= 2


def test_degrees_that_a_law_has_not_are_left_out():
    highest = np.array([2, 5])
    assert hyperbolic(highest, 1.0, 1000).max(axis=0).tolist() == [2, 5]
    assert total_degree(2, 5, highest).max(axis=0).tolist() == [2, 5]
    assert margin(np.array([[0, 0], [1, 0], [2, 0]]), highest).tolist() == [[0, 1]]


def test_many_inputs_and_few_runs_are_learnt_in_bounded_memory():
    """Listing the terms of degree 12 took 2.9 GB for 14 inputs."""
    X = np.random.default_rng(1).random((200, 30))
    Y = X.sum(axis=1) + X[:, 0] * X[:, 1]
    tracemalloc.start()
    surrogate = fit((X, Y), "pce", validation=None)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 300e6
    assert surrogate.model.loo_error[0] < 1e-3
