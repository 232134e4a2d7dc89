import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from tensegra.analysis import FunctionModel, SameAs, sobol_indices
from tensegra.errors import StudyError
from tensegra.study import Space, Variable, as_distribution

BOX = np.array([[0.0, 1.0]] * 3)


def model(function=lambda X: X @ [3.0, 2.0, 1.0], **changes):
    return FunctionModel(function, ("a", "b", "c"), ("y",), **{"bounds": BOX, **changes})


def test_the_blocks_with_a_failed_run_are_dropped_whole_and_the_share_is_told():
    def function(X):
        return np.where(X[:, 0] > 0.98, np.nan, X @ [3.0, 2.0, 1.0])

    result = sobol_indices(model(function), samples=256, second_order=False)
    assert result.n_runs == 256 * 5
    # A block holds a twice over (in A and the blocks of b and c; in B and the block of a): it survives at
    # 0.98².
    assert_allclose(result.share_dropped, 1 - 0.98**2, atol=0.02)
    assert result.statuses == {"evaluated": result.n_runs - result.n_failed, "failed": result.n_failed}
    found = result.indices["y"]
    assert np.isfinite(found.first).all()
    assert_allclose(found.total, np.array([9, 4, 1]) / 14, atol=0.1)


def test_a_model_that_mostly_fails_gives_a_reason_and_no_indices():
    result = sobol_indices(model(lambda X: np.where(X[:, 0] > 0.1, np.nan, X[:, 0])), samples=64)
    found = result.indices["y"]
    assert "blocks without a failed run" in found.reason
    assert np.isnan(found.total).all()
    assert json.loads(json.dumps(result.to_dict(), allow_nan=False))["indices"]["y"]["total"] == [None] * 3


def test_an_output_that_does_not_vary_has_no_indices():
    found = sobol_indices(model(lambda X: np.full(len(X), 7.0)), samples=64).indices["y"]
    assert found.reason == "the output does not vary"
    assert found.variance == 0.0
    assert np.isnan(found.first).all()


def test_the_same_seed_gives_the_same_numbers_even_seed_zero():
    results = [sobol_indices(model(), samples=64, seed=seed).table() for seed in (0, 0, 1)]
    assert results[0] == results[1] != results[2]


def test_convergence_is_the_analysis_of_the_first_blocks():
    result = sobol_indices(model(), samples=512, seed=2)
    assert result.sizes == (64, 128, 256, 512)
    alone = sobol_indices(model(), samples=128, seed=2, second_order=False).indices["y"]
    series = result.convergence["y"]
    assert series[-1] is result.indices["y"]
    assert series[0].second is None
    halves = [found.first_half.max() for found in series]
    assert halves[-1] < halves[0]
    assert_allclose(series[1].first, alone.first, rtol=1e-12)
    assert_allclose(series[1].total_half, alone.total_half, rtol=1e-12)


def test_tied_inputs_count_with_the_one_they_follow():
    result = sobol_indices(model(), {"b": SameAs("a"), "c": 0.5}, samples=64)
    assert result.input_names == ("a",)
    assert_allclose(result.indices["y"].total, [1.0], atol=0.05)


def test_laws_enter_by_their_quantiles():
    narrow = sobol_indices(model(), {"a": stats.norm(0, 1e-3)}, samples=256).indices["y"]
    assert narrow.total[0] < 1e-4 < narrow.total[1]


def test_correlated_inputs_are_refused():
    variables = tuple(Variable(n, "actuator", n, as_distribution({"normal": [0, 1]})) for n in "abc")
    space = Space(variables, np.eye(3) + 0.5 * (np.eye(3)[[1, 0, 2]] - np.diag([0, 0, 1])))
    with pytest.raises(StudyError, match="independent inputs"):
        sobol_indices(model(space=space), samples=64)


@pytest.mark.parametrize("samples", [0, 8, 100])
def test_other_numbers_than_powers_of_two_are_refused(samples):
    with pytest.raises(StudyError, match="a power of two, 16 or more"):
        sobol_indices(model(), samples=samples)


def test_the_table_has_every_order_with_its_interval():
    result = sobol_indices(model(), samples=64)
    rows = result.table()
    assert [row["order"] for row in rows] == ["first"] * 3 + ["total"] * 3 + ["second"] * 3
    assert rows[6]["input"] == "a × b"
    assert all(row["low"] <= row["value"] <= row["high"] for row in rows)
    assert "0.0% of the blocks dropped" in str(result)


def test_progress_is_told_to_the_end():
    told = []
    sobol_indices(model(), samples=64, chunk=300, progress=lambda *now: told.append(now))
    assert told == [(300, 512), (512, 512)]
