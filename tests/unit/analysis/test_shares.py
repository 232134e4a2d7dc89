"""Intervals of a probability, by enumeration of every outcome."""

import numpy as np
import pytest
from scipy import stats

from tensegra.analysis.shares import HARDLY_SEEN, replicated_interval, share_interval, wide_interval

N = 2000


@pytest.mark.parametrize("events", [0.5, 1, 2, 3, 3.5, 4, 5, 6, 8, 10, 15, 20, 25, 40, 100, 1000, 1995, 1999])
def test_an_exact_interval_holds_what_it_says_and_not_much_more(events):
    share = events / N
    k = np.arange(N + 1)
    mass = stats.binom.pmf(k, N, share)
    some = k[mass > 1e-9]
    held = [mass[i] for i in some if (ends := share_interval(i, i, N, 0.95))[0] <= share <= ends[1]]
    assert sum(held) + mass[mass <= 1e-9].sum() >= 0.95 - 1e-6
    if 3 <= events <= N - 3:
        assert sum(held) <= 0.98  # Clopper and Pearson's hold 0.99 of three expected events


@pytest.mark.parametrize(("k", "n"), [(0, 10), (1, 10), (3, 10), (5, 10), (10, 10), (2, 1000), (19, 5000)])
@pytest.mark.parametrize("confidence", [0.8, 0.95, 0.999])
def test_it_lies_within_clopper_and_pearsons(k, n, confidence):
    low, high = share_interval(k, k, n, confidence)
    theirs = stats.binomtest(k, n).proportion_ci(confidence, method="exact")
    assert theirs.low - 1e-9 <= low <= k / n <= high <= theirs.high + 1e-9
    wide = wide_interval(k, n, confidence)
    if k in (0, n) or min(k, n - k) >= HARDLY_SEEN:
        assert wide == pytest.approx((theirs.low, theirs.high))
    else:  # hardly seen: those who did not see it have no interval, so this one reaches further
        assert wide[0] <= theirs.low + 1e-9
        assert wide[1] >= theirs.high - 1e-9
        assert wide[0] < theirs.low or wide[1] > theirs.high
    mirrored = share_interval(n - k, n - k, n, confidence)
    assert (1 - mirrored[1], 1 - mirrored[0]) == pytest.approx((low, high), abs=1e-9)


def test_replicates_that_all_count_alike_still_have_a_width():
    shares = np.full(16, 4 / 64)
    low, high = replicated_interval(shares, 64, 0.95)
    assert low < 4 / 64 < high
    assert high - low < 0.01  # independent samples would know it to 0.03


@pytest.mark.parametrize("more", [0.0, 0.05, 0.3, 0.5, 0.9])
def test_even_replicates_hold_a_share_between_their_counts(more):
    # In one dimension each of 32 replicates of 64 points counts 5 or 6: the number of sixes is binomial.
    rng, truth, held = np.random.default_rng(1), (5 + more) / 64, []
    for _ in range(400):
        shares = (5 + (rng.random(32) < more)) / 64
        low, high = replicated_interval(shares, 64, 0.95)
        held.append(low <= truth <= high)
    assert np.mean(held) >= 0.93
