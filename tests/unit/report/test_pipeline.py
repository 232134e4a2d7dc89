import json

import pytest

from tensegra.errors import StudyError
from tensegra.report.pipeline import carry_out
from tensegra.report.results import Index, open_results
from tensegra.report.study_tables import validation_table


def strict(text):
    """Read JSON that holds no NaN and no infinity."""

    def refuse(name):
        raise AssertionError(name)

    return json.loads(text, parse_constant=refuse)


def test_everything_that_the_study_asks_for_is_in_the_folder(results):
    assert results.succeeded
    assert set(results.surrogates) == {"pce", "gpr"}
    assert [analysis.kind for analysis in results.analyses] == [
        "propagation",
        "sensitivity",
        "optimisation",
        "optimisation",
    ]
    for analysis in results.analyses:
        assert strict(analysis.path.read_text())["kind"] == analysis.kind
        assert len(analysis.table()) > 0


def test_the_held_out_runs_were_not_learned_from(results):
    stored = results.surrogates["gpr"]
    held_out = stored.held_out()
    assert list(held_out) == ["A14", "T", "w", "w_predicted", "w_std"]
    assert len(held_out) + stored.surrogate.n_train == results.campaign.study.n_points


def test_the_trace_of_a_search_holds_its_optimum(results):
    found = results.analyses[-1]
    trace = found.trace()
    best = trace[trace["feasible"]]["objective"].max()
    assert best == pytest.approx(found.content["objective"])
    assert trace["best"].iloc[-1] == pytest.approx(best)


def test_the_optimum_is_solved_again_by_the_true_model(results):
    content = results.analyses[-1].content
    assert content["true_status"] == "stable"
    assert content["gap"] == pytest.approx(content["true_objective"] - content["objective"])


def test_results_that_are_there_are_kept_and_the_others_are_made_anew(
    small_study, sensitivity_alone, tmp_path
):
    short = {"surrogates": {"pce": {"kind": "pce"}}, "analyses": sensitivity_alone}
    first = carry_out(small_study(**short), tmp_path, workers=1)
    files = [first.surrogates["pce"].path, first.analyses[0].path]
    before = [path.stat().st_mtime_ns for path in files]

    again = carry_out(small_study(**short), tmp_path, workers=1)
    assert [path.stat().st_mtime_ns for path in files] == before
    assert again.to_dict()["analyses"] == first.to_dict()["analyses"]

    other = {"surrogates": {"pce": {"kind": "pce", "training_size": 20}}}
    carry_out(small_study(**{**short, **other}), tmp_path, workers=1)
    after = [path.stat().st_mtime_ns for path in files]
    assert all(now > then for now, then in zip(after, before, strict=True))


def test_what_the_study_no_longer_asks_for_is_no_longer_listed(small_study, sensitivity_alone, tmp_path):
    carry_out(small_study(analyses=sensitivity_alone), tmp_path, workers=1)
    fewer = carry_out(small_study(analyses=[], surrogates={}), tmp_path, workers=1)
    assert not fewer.surrogates
    assert not fewer.analyses


def test_results_survive_being_opened_again(results):
    opened = open_results(results.campaign)
    assert opened.to_dict() == results.to_dict()
    strict(json.dumps(opened.to_dict(), allow_nan=False))


def test_an_index_that_cannot_be_read_is_as_none(tmp_path):
    (tmp_path / "results.json").write_text("{")
    assert Index.read(tmp_path) == Index()


def test_a_file_that_is_gone_is_not_listed(small_study, tmp_path):
    done = carry_out(small_study(analyses=[]), tmp_path, workers=1)
    done.surrogates["pce"].path.unlink()
    assert set(open_results(done.campaign).surrogates) == {"gpr"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"surrogates": {"pce": {"kind": "pce", "degre": 3}}, "analyses": []},
            "surrogates.pce: .*'degre'.*did you mean 'degree'",
        ),
        (
            {"analyses": [{"optimisation": {"model": "truth", "objective": "abs(z)"}}]},
            r"analyses\[0\].optimisation.objective .*found 'z'",
        ),
        (
            {"analyses": [{"optimisation": {"model": "truth", "objective": "w", "constraints": ["q <= 1"]}}]},
            r"analyses\[0\].optimisation.constraints\[0\] .*found 'q'",
        ),
    ],
)
def test_what_cannot_be_carried_out_is_refused_before_the_campaign(small_study, tmp_path, changes, message):
    folder = tmp_path / "campaign"
    with pytest.raises(StudyError, match=message):
        carry_out(small_study(**changes), folder, workers=1)
    assert not folder.exists()


def test_without_a_run_to_learn_from_the_rest_is_still_written(
    small_study, sensitivity_alone, tmp_path, monkeypatch
):
    def nothing(*_):
        raise StudyError("no run")

    monkeypatch.setattr("tensegra.study.Campaign.training_data", nothing)
    done = carry_out(small_study(analyses=sensitivity_alone), tmp_path, workers=1)
    assert not done.succeeded
    assert done.index.failures == ["no run", "analyses[0]: there is no surrogate 'pce' to ask"]
    assert len(done.campaign.frame()) == 32


def test_progress_is_told(small_study, tmp_path):
    heard = []
    carry_out(small_study(analyses=[]), tmp_path, workers=1, listener=lambda *told: heard.append(told))
    assert ("runs", 32, 32, "") in heard
    assert heard[-1][:3] == ("surrogates", 2, 2)


def test_a_study_can_ask_for_every_kind_of_surrogate(small_study, tmp_path):
    study = small_study(
        changes={"gravity": [0, 0, 0]},
        variables={
            name: {"actuator": name, "distribution": {"uniform": [0.0, 0.3]}} for name in ("A1", "A23", "A4")
        },
        outputs={"w": {"displacement": "z", "nodes": [18, 23]}, "slack": {"slack_cables": "all"}},
        design={"sampler": "sobol", "sizes": 256},
        surrogates={
            "pieces": {"kind": "piecewise", "outputs": ["w"]},
            "field": {"kind": "field", "outputs": ["w"]},
            "best": {"kind": "auto", "outputs": ["w"], "time_budget": 0.01},
        },
        analyses=[{"propagation": {"model": "pieces", "outputs": ["w"], "samples": 200}}],
    )
    results = carry_out(study, tmp_path, workers=1)
    assert not results.index.failures
    pieces = results.surrogates["pieces"].surrogate
    assert {"taut", "collapsed"} <= set(pieces.regime_names)
    assert pieces.validation.outcome_right > 0.7
    assert "% of the runs right" in validation_table(results).note
    assert results.surrogates["best"].surrogate.kind in ("gpr", "nn", "pce")
    content = results.analyses[0].content
    assert 0 < content["n_failed"] < 100
    assert content["statuses"]["collapsed"] == content["n_failed"]


def test_a_variable_of_few_values_is_learnt_and_propagated(small_study, tmp_path):
    """Polynomials of a density ended in infinities where a law has atoms."""
    variables = {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.02]}},
        "T": {"temperature": "top", "distribution": {"discrete": {"values": [0, 20, 50]}}},
    }
    surrogates = {"polynomial": {"kind": "pce"}, "any": {"kind": "auto", "time_budget": 0.01}}
    spread = {"propagation": {"model": "polynomial", "samples": 200}}
    study = small_study(variables=variables, surrogates=surrogates, analyses=[spread])
    results = carry_out(study, tmp_path, workers=1)
    assert results.succeeded
    surrogate = results.surrogates["polynomial"].surrogate
    assert surrogate.model.indices[:, 1].max() <= 2
    assert max(surrogate.validation.r2) > 0.999
