"""The bootstrap by one matrix product beside SALib's own loop."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from SALib.analyze import sobol as analyze
from SALib.sample import sobol as sample

from tensegra.analysis.bootstrap import half_widths

# Half-widths of 400 resamples are known to 1/√800 = 3.5 %, each; four of both.
SAME_WIDTH = 0.2


@pytest.mark.parametrize("second_order", [True, False])
def test_half_widths_are_those_of_salib(second_order):
    problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[-np.pi, np.pi]] * 3}
    X = sample.sample(problem, 1024, calc_second_order=second_order, seed=1)
    Y = np.sin(X[:, 0]) + 7 * np.sin(X[:, 1]) ** 2 + 0.1 * X[:, 2] ** 4 * np.sin(X[:, 0])
    theirs = analyze.analyze(problem, Y, calc_second_order=second_order, num_resamples=400, seed=2)
    mine = half_widths(
        Y.reshape(1024, -1),
        np.random.default_rng(3),
        resamples=400,
        confidence=0.95,
        second_order=second_order,
    )
    assert_allclose(mine[0], theirs["S1_conf"], rtol=SAME_WIDTH)
    assert_allclose(mine[1], theirs["ST_conf"], rtol=SAME_WIDTH)
    if second_order:
        upper = np.triu_indices(3, 1)
        assert_allclose(mine[2][upper], theirs["S2_conf"][upper], rtol=SAME_WIDTH)
        assert np.isnan(mine[2][np.tril_indices(3)]).all()
    else:
        assert mine[2] is None


def test_many_resamples_in_parts_are_those_in_one(monkeypatch):
    blocks = np.random.default_rng(0).standard_normal((64, 8))
    options = {"resamples": 50, "confidence": 0.9, "second_order": True}
    whole = half_widths(blocks, np.random.default_rng(1), **options)
    monkeypatch.setattr("tensegra.analysis.bootstrap.MOST_NUMBERS", 640)
    for one, other in zip(whole, half_widths(blocks, np.random.default_rng(1), **options), strict=True):
        assert_allclose(one, other)


def test_the_spread_of_repeats_is_the_half_width():
    # Independent base points, as the bootstrap takes them: 1.96 standard deviations over repeats.
    rng, firsts, halves = np.random.default_rng(4), [], []
    for _ in range(200):
        A, B = rng.random((2, 256, 2))
        runs = [A, np.c_[B[:, 0], A[:, 1]], np.c_[A[:, 0], B[:, 1]], B]
        Y = np.stack([2 * X[:, 0] + X[:, 1] + X[:, 0] * X[:, 1] for X in runs], axis=1)
        Y -= Y.mean()
        firsts.append((Y[:, -1:] * (Y[:, 1:3] - Y[:, :1])).mean(axis=0) / Y[:, [0, -1]].var())
        halves.append(half_widths(Y, rng, resamples=100, confidence=0.95, second_order=False)[0])
    assert_allclose(np.mean(halves, axis=0), 1.96 * np.std(firsts, axis=0), rtol=0.2)
