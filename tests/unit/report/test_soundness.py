"""What a study will need is asked before it is run; what fails leaves the rest answered."""

import pytest

from tensegra.errors import StudyError
from tensegra.report import pipeline
from tensegra.report.check import check_study
from tensegra.report.pipeline import carry_out

CORRELATED = {"correlation": [[1.0, 0.5], [0.5, 1.0]]}
PARTIAL = {"surrogates": {"p": {"kind": "pce", "outputs": ["w"]}, "all": {"kind": "pce"}}}


def analysis(kind, **entry):
    return {"analyses": [{kind: {"model": "p", **entry}}]}


REFUSALS = [
    (
        PARTIAL | analysis("propagation", outputs=["v"]),
        "analyses[0].propagation.outputs: found 'v', expected an",
    ),
    (PARTIAL | analysis("propagation", limits={"v": 1.0}), "analyses[0].propagation.limits: found 'v'"),
    (PARTIAL | analysis("propagation", model="all", compare_with="p"), "a model that has the output 'v'"),
    (
        PARTIAL | analysis("optimisation", objective="v"),
        "found 'v', expected an output or a variable (A14, T, w)",
    ),
    (PARTIAL | analysis("optimisation", objective="w", constraints=["v <= 1"]), "constraints[0]"),
    (PARTIAL | analysis("inverse", targets={"v": 1.0}), "analyses[0].inverse.targets: found 'v'"),
    (PARTIAL | analysis("calibration", measurements={"v": [1.0], "v_std": [0.1]}), "measurements: found 'v'"),
    (PARTIAL | CORRELATED | analysis("sensitivity"), "found 'A14, T', expected independent inputs"),
    (PARTIAL | CORRELATED | analysis("morris"), "found 'A14, T', expected independent inputs"),
    (PARTIAL | CORRELATED | analysis("sensitivity", method="chaos"), "expected independent inputs"),
    (PARTIAL | analysis("sensitivity", method="chaos", model="truth"), "expected a surrogate of kind 'pce'"),
    ({"surrogates": {"p": {"kind": "pce", "degre": 2}}, "analyses": []}, "did you mean 'degree'"),
]


@pytest.mark.parametrize(("changes", "told"), REFUSALS, ids=[told for _, told in REFUSALS])
def test_what_would_fail_after_the_runs_is_refused_before(small_study, changes, told):
    with pytest.raises(StudyError) as refusal:
        check_study(small_study(**changes))
    assert told in str(refusal.value)


def test_correlated_inputs_with_laws_of_their_own_have_indices(small_study):
    law = {"uniform": [0.0, 0.01]}
    check_study(small_study(**PARTIAL, **CORRELATED, **analysis("sensitivity", inputs={"A14": law})))


@pytest.fixture
def two_analyses(small_study):
    analyses = [
        {"propagation": {"name": "first", "model": "all", "samples": 16}},
        {"propagation": {"name": "second", "model": "p", "samples": 16}},
    ]
    return small_study(**PARTIAL, analyses=analyses)


@pytest.mark.parametrize("error", [StudyError("no way"), ValueError("no way"), ZeroDivisionError("no way")])
def test_an_analysis_that_fails_leaves_the_others_answered(two_analyses, tmp_path, monkeypatch, error):
    analyse = pipeline._analyse

    def fail_first(campaign, number, *rest):
        if number == 0:
            raise error
        return analyse(campaign, number, *rest)

    monkeypatch.setattr(pipeline, "_analyse", fail_first)
    results = carry_out(two_analyses, tmp_path / "c")
    assert [analysis.name for analysis in results.analyses] == ["second"]
    (failure,) = results.index.failures
    assert failure.startswith("analyses[0]: ")
    assert "no way" in failure
    assert not results.succeeded
    # What failed is tried again, and what was answered is kept.
    monkeypatch.setattr(pipeline, "_analyse", analyse)
    again = carry_out(two_analyses, tmp_path / "c")
    assert [analysis.name for analysis in again.analyses] == ["first", "second"]
    assert again.succeeded


def test_a_surrogate_that_fails_leaves_the_others_fitted(two_analyses, tmp_path, monkeypatch):
    fit = pipeline._fit

    def fail_one(runs, entry, seed, stem):
        if stem.name == "p":
            raise FloatingPointError("overflow")
        return fit(runs, entry, seed, stem)

    monkeypatch.setattr(pipeline, "_fit", fail_one)
    results = carry_out(two_analyses, tmp_path / "c")
    assert list(results.surrogates) == ["all"]
    assert [analysis.name for analysis in results.analyses] == ["first"]
    assert results.index.failures == [
        "surrogates.p: FloatingPointError overflow",
        "analyses[1]: there is no surrogate 'p' to ask",
    ]


def test_only_what_is_named_is_made(two_analyses, tmp_path):
    results = carry_out(two_analyses, tmp_path / "c", only=["second"])
    assert list(results.surrogates) == ["p"]
    assert [analysis.name for analysis in results.analyses] == ["second"]
    assert results.succeeded
    # A kind stands for all its analyses; what is there is kept.
    both = carry_out(two_analyses, tmp_path / "c", only=["propagation"])
    assert [analysis.name for analysis in both.analyses] == ["first", "second"]
    one = carry_out(two_analyses, tmp_path / "c", only=["all"])
    assert [analysis.name for analysis in one.analyses] == ["first", "second"]


def test_a_name_that_nothing_has_is_refused(two_analyses, tmp_path):
    with pytest.raises(StudyError, match=r"--only: found 'secnd', .*did you mean 'second'"):
        carry_out(two_analyses, tmp_path / "c", only=["secnd"])
    assert not (tmp_path / "c").exists()
