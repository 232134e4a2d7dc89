import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from tensegra.analysis import Estimate, FunctionModel, SameAs, propagate
from tensegra.analysis.sketch import Sketch
from tensegra.analysis.summary import summarise
from tensegra.errors import StudyError

BOX = np.array([[0.0, 1.0], [0.0, 1.0]])
NORMAL = {"a": stats.norm(1, 2), "b": stats.norm(0, 1)}
METHODS = ("monte_carlo", "quasi_monte_carlo")


def model(function=lambda X: X @ [3.0, -1.0], **changes):
    return FunctionModel(function, ("a", "b"), ("y",), **{"bounds": BOX, "units": {"y": "cm"}, **changes})


def fails_above(limit):
    return lambda X: np.where(X[:, 0] > limit, np.nan, X[:, 0])


@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_gives_the_same_numbers_and_another_gives_others(method):
    tables = [propagate(model(), NORMAL, samples=500, method=method, seed=seed).table() for seed in (3, 3, 4)]
    assert tables[0] == tables[1] != tables[2]


@pytest.mark.parametrize("method", METHODS)
def test_the_chunk_changes_nothing(method):
    results = [propagate(model(), NORMAL, samples=1000, method=method, chunk=n) for n in (64, 4096)]
    for one, two in zip(*(r.outputs["y"].rows().values() for r in results), strict=True):
        assert_allclose([one.value, one.low, one.high], [two.value, two.low, two.high], rtol=1e-12)


def test_the_sample_statistics_are_those_of_the_values():
    seen = []

    def function(X):
        seen.append(X @ [3.0, -1.0])
        return seen[-1]

    summary = propagate(model(function), NORMAL, samples=3000, chunk=700).outputs["y"]
    y = np.concatenate(seen)
    assert y.size == summary.n == 3000
    found = [e.value for e in summary.rows().values()]
    assert_allclose(found, [y.mean(), y.std(ddof=1), y.min(), y.max(), *np.quantile(y, [0.25, 0.5, 0.75])])
    assert_array_equal(summary.histogram.counts, np.histogram(y, summary.histogram.edges)[0])
    assert_allclose(np.trapezoid(summary.density.values, summary.density.grid), 1.0, atol=2e-3)
    exact = stats.gaussian_kde(y, bw_method=summary.density.bandwidth / y.std(ddof=1))
    assert_allclose(
        summary.density.values, exact(summary.density.grid), atol=1e-3 * summary.density.values.max()
    )


def test_quasi_random_samples_are_rounded_up_to_balanced_sets():
    for samples, expected in ((10_000, 10_240), (4096, 4096), (20, 20), (33, 34), (2, 4)):
        result = propagate(model(), NORMAL, samples=samples, method="quasi_monte_carlo")
        assert result.n_samples == expected
        assert samples <= result.n_samples <= max(1.125 * samples, samples + 3)


def test_failed_runs_are_counted_and_never_averaged():
    result = propagate(model(fails_above(0.8)), samples=4000, seed=1)
    y = result.outputs["y"]
    assert result.n_failed == result.n_samples - y.n
    assert result.statuses == {"evaluated": y.n, "failed": result.n_failed}
    assert_allclose(result.n_failed / 4000, 0.2, atol=0.03)
    assert y.maximum <= 0.8
    assert_allclose(y.mean.value, 0.4, atol=0.02)


def test_the_worst_case_of_an_exceedance_holds_what_failed_runs_may_have_done():
    result = propagate(model(fails_above(0.8)), samples=4000, seed=1)
    given = result.exceedance("y", 0.6)
    worst = result.exceedance("y", 0.6, worst_case=True)
    assert given.low <= 0.25 <= given.high  # 0.2 of the 0.8 that succeed
    assert worst.low < 0.2  # none of the failed 0.2 exceeds
    assert worst.high > 0.4  # all of them do
    sound = propagate(model(), samples=100)
    assert sound.exceedance("y", 0.5) == sound.exceedance("y", 0.5, worst_case=True)


def test_a_model_that_always_fails_gives_no_numbers():
    result = propagate(model(lambda X: np.full(len(X), np.nan)), samples=50)
    assert result.n_failed == 50
    assert all(np.isnan(e.value) for e in result.outputs["y"].rows().values())
    assert np.isnan(result.exceedance("y", 0.0).value)
    assert (
        json.loads(json.dumps(result.to_dict(), allow_nan=False))["outputs"]["y"]["statistics"]["mean"][
            "value"
        ]
        is None
    )


def test_samples_outside_the_box_are_counted():
    result = propagate(model(), {"a": stats.norm(1, 1), "b": 0.5}, samples=2000)
    assert_allclose(result.n_outside / 2000, 1 - (stats.norm.cdf(0) - stats.norm.cdf(-1)), atol=0.04)
    assert propagate(model(bounds=None), NORMAL, samples=10).n_outside == 0


def test_the_inputs_are_summarised_as_they_were_drawn():
    result = propagate(model(), {"a": stats.norm(1, 2), "b": SameAs("a")}, samples=2000)
    assert result.inputs["a"].rows() == result.inputs["b"].rows()
    assert_allclose(result.inputs["a"].mean.value, 1.0, atol=0.2)
    assert result.laws == {"a": "norm(1, 2)", "b": "same as a"}


@pytest.mark.parametrize("method", METHODS)
def test_two_models_are_compared_on_the_same_samples(method):
    other = model(lambda X: X @ [3.0, -1.0] + 0.5 + 0.1 * X[:, 1], name="other")
    result = propagate(model(), NORMAL, samples=2000, method=method, compare_with=other)
    found = result.differences["y"]
    assert found.mean.low <= 0.5 <= found.mean.high
    assert found.mean.high - found.mean.low < 0.02  # paired: far narrower than the outputs' own scatter
    assert_allclose(found.rms, np.hypot(0.5, 0.1), rtol=0.02)
    assert found.largest >= found.rms
    assert 0.0 < found.ks_distance < 0.2
    assert {row["model"] for row in result.table()} == {"function", "other"}
    same = propagate(model(), NORMAL, samples=500, compare_with=model()).differences["y"]
    assert (same.largest, same.ks_distance) == (0.0, 0.0)


def test_pairs_need_both_models():
    result = propagate(model(lambda X: X[:, 0]), samples=1000, compare_with=model(fails_above(0.5)))
    assert result.n_failed == 0
    assert result.other.n_failed > 0
    assert result.differences["y"].largest == 0.0


def test_a_quantile_has_no_lower_end_where_the_sample_is_too_small():
    summary = propagate(model(), NORMAL, samples=20).outputs["y"]
    assert summary.quantile(0.01).low == -np.inf  # nothing bounds it on that side
    assert np.isfinite(summary.quantile(0.5).low)
    # Wilks: 20 samples leave less than 1 − 0.05^(1/20) above their maximum, with 95 % confidence.
    assert_allclose(summary.beyond, 1 - 0.05 ** (1 / 20))


def test_a_rare_event_that_nobody_saw_still_has_an_upper_end():
    for method in METHODS:
        estimate = propagate(model(), NORMAL, samples=1600, method=method).exceedance("y", 1e9)
        assert estimate.value == estimate.low == 0.0
        assert 1e-3 < estimate.high < 4e-3  # the rule of three, two-sided: 3.7 / n


def test_constant_outputs_have_a_point_for_an_interval():
    summary = propagate(model(lambda X: np.ones(len(X))), samples=100).outputs["y"]
    assert summary.mean == Estimate(1.0, 1.0, 1.0)
    assert summary.std.value == 0.0
    assert summary.density.grid.size == 0
    assert summary.histogram.counts.sum() == 100


def test_progress_is_told_to_the_end():
    told = []
    propagate(model(), NORMAL, samples=1000, chunk=300, progress=lambda *now: told.append(now))
    assert told == [(300, 1000), (600, 1000), (900, 1000), (1000, 1000)]


def test_millions_of_samples_keep_no_more_than_the_bins():
    result = propagate(model(), NORMAL, samples=400_000, chunk=2**15, confidence=0.999)
    pooled = result.outputs["y"]._pooled
    assert sum(part.size for part in pooled.kept) <= pooled.n_bins
    assert pooled.bins.counts.size <= pooled.n_bins
    exact = stats.norm(3, np.sqrt(37))
    for p in (0.001, 0.5, 0.999):
        estimate = result.quantile("y", p)
        assert estimate.low <= exact.ppf(p) <= estimate.high


def test_the_result_is_json_and_prints():
    result = propagate(model(), NORMAL, samples=100, compare_with=model())
    content = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert content["kind"] == "propagation"
    assert content["outputs"]["y"]["unit"] == "cm"
    assert content["other"]["outputs"]["y"] == content["outputs"]["y"]
    assert "100 samples of function" in str(result)
    assert str(Estimate(1.0)) == "1"


def test_replicates_of_too_few_values_have_no_interval():
    sketches = [Sketch(), Sketch()]
    sketches[0].add([1.0, 2.0])
    summary = summarise("y", sketches)
    assert (summary.q50.low, summary.q50.high) == (-np.inf, np.inf)
    assert (summary.mean.value, summary.q50.value) == (1.5, 1.5)
    assert np.isnan(summary.mean.low)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"method": "quasi_monte_carl"}, "did you mean 'quasi_monte_carlo'"),
        ({"samples": 1}, "at least 2"),
        ({"confidence": 1.0}, "between 0 and 1"),
        ({"outputs": ["Y"]}, "did you mean 'y'"),
        ({"inputs": {"c": 1.0}}, "a variable of the model"),
    ],
)
def test_nonsense_is_refused(arguments, told):
    with pytest.raises(StudyError, match=told):
        propagate(model(), **arguments)


def test_unknown_outputs_and_levels_are_refused_after_the_fact():
    result = propagate(model(), samples=10)
    with pytest.raises(StudyError, match="did you mean 'y'"):
        result.quantile("Y", 0.5)
    with pytest.raises(StudyError, match="between 0 and 1"):
        result.quantile("y", 1.5)
