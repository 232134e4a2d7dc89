import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tensegra.analysis.bins import DyadicBins
from tensegra.analysis.sketch import Sketch

# Moments are pooled in another order than NumPy sums: a few hundred roundings.
ROUNDING = 1e-10

FLOATS = st.floats(-1e6, 1e6, allow_nan=False)
PARTS = st.lists(st.lists(FLOATS, max_size=40), min_size=1, max_size=6)


def small(parts):
    """Return a sketch that bins after 8 values, into 32 bins."""
    sketch = Sketch(exact_limit=8, n_bins=32)
    for part in parts:
        sketch.add(part)
    return sketch


@given(PARTS)
def test_moments_and_extremes_do_not_depend_on_the_chunks(parts):
    values = np.concatenate([np.array(part) for part in parts])
    sketch = small(parts)
    assert sketch.count == values.size
    if values.size > 1:
        scale = np.abs(values).max() + 1e-300
        assert_allclose(sketch.mean, values.mean(), atol=ROUNDING * scale)
        assert_allclose(sketch.variance(), values.var(ddof=1), rtol=1e-8, atol=ROUNDING * scale**2)
        assert_allclose(
            sketch.powers[2], ((values - values.mean()) ** 4).sum(), rtol=1e-6, atol=ROUNDING * scale**4
        )
        assert (sketch.minimum, sketch.maximum) == (values.min(), values.max())


@given(PARTS, st.floats(-1e6, 1e6))
def test_bins_bracket_every_rank_and_every_count(parts, limit):
    values = np.sort(np.concatenate([np.array(part) for part in parts]))
    sketch = small(parts)
    for rank in range(1, values.size + 1):
        low, high = sketch.order_statistic(rank)
        assert low <= values[rank - 1] <= high
        assert high - low <= sketch.resolution
    least, most = sketch.count_above(limit)
    assert least <= (values > limit).sum() <= most
    assert sum(sketch.histogram(10)[0]) == values.size


@given(PARTS, PARTS)
def test_merging_is_the_same_as_seeing_all(first, second):
    one, two, both = small(first), small(second), small([*first, *second])
    one.merge(two)
    assert one.count == both.count
    assert (one.minimum, one.maximum) == (both.minimum, both.maximum)
    values = np.sort(np.concatenate([np.array(part) for part in [*first, *second]]))
    for rank in range(1, values.size + 1):
        low, high = one.order_statistic(rank)
        assert low <= values[rank - 1] <= high


def test_kept_values_give_exact_quantiles():
    values = np.random.default_rng(0).normal(size=1001)
    sketch = Sketch()
    sketch.add(values[:500])
    sketch.add(values[500:])
    assert sketch.resolution == 0.0
    for p in (0.0, 0.1, 0.5, 1.0):
        assert sketch.quantile(p) == np.quantile(values, p)
    assert sketch.count_above(0.3) == ((values > 0.3).sum(),) * 2


def test_binned_quantiles_are_within_a_bin():
    values = np.random.default_rng(0).normal(size=300_000)
    sketch = Sketch(exact_limit=1000)
    for part in np.array_split(values, 40):
        sketch.add(part)
    assert 0 < sketch.resolution <= np.ptp(values) / 2**15
    for p in (0.001, 0.25, 0.5, 0.9, 0.999):
        rank = int(np.ceil(p * values.size))
        assert abs(sketch.quantile(p) - np.partition(values, rank - 1)[rank - 1]) <= sketch.resolution


def test_memory_is_bounded_whatever_comes():
    sketch = Sketch(exact_limit=100, n_bins=64)
    for scale in (1e-12, 1.0, 1e3, 1e12, 1e300):
        sketch.add(scale * np.random.default_rng(1).standard_cauchy(500))
        sketch.quantile(0.5)
        assert sketch.bins.counts.size <= 64
        assert not sketch.kept
    assert sketch.bins.counts.sum() == 2500


def test_equal_values_have_one_bin():
    sketch = Sketch(exact_limit=2, n_bins=16)
    sketch.add(np.full(10, 3.7))
    assert sketch.order_statistic(5) == (3.7, 3.7)
    assert sketch.quantile(0.3) == 3.7


@pytest.mark.parametrize("start", [-7.3, 0.0, 5.1])
def test_coarsening_adds_neighbours(start):
    bins = DyadicBins(start, start + 1.0, n_bins=16)
    values = start + np.linspace(0, 1, 50)
    bins.add(values)
    before, width, total = bins.edge(0), bins.width, bins.counts.copy()
    bins.coarsen()
    assert bins.width == 2 * width
    assert bins.counts.sum() == total.sum()
    assert bins.edge(0) <= before
    assert_array_equal(bins.counts, np.histogram(values, bins.edge(np.arange(bins.counts.size + 1)))[0])


def test_an_empty_sketch_has_no_numbers():
    sketch = Sketch()
    assert np.isnan(sketch.quantile(0.5))
    assert np.isnan(sketch.variance())
    assert sketch.count_above(0.0) == (0, 0)
    assert sketch.histogram(5)[0].size == 0
