import pytest

from tensegra.errors import ModelError, SolverError, StudyError, TensegraError, nearest


@pytest.mark.parametrize("kind", [ModelError, SolverError, StudyError])
def test_one_clause_catches_every_error_of_ours(kind):
    with pytest.raises(TensegraError):
        raise kind("message")


def test_an_error_says_place_found_expected_and_nearest_name():
    error = StudyError.at("study.yaml: outputs.w.nodes[1]", "123", "the id of a node", candidates=["1", "23"])
    assert str(error) == (
        "study.yaml: outputs.w.nodes[1]: found '123', expected the id of a node; did you mean '23'?"
    )


def test_an_error_keeps_the_class_it_was_asked_for():
    assert type(SolverError.at("stage", 1, "something else")) is SolverError


def test_no_correction_is_offered_where_nothing_is_near():
    assert str(ModelError.at("kind", 7, "a kind", candidates=["cable", "strut"])) == (
        "kind: found 7, expected a kind"
    )


@pytest.mark.parametrize(
    ("name", "candidates", "match"),
    [
        ("STRUT", ["strut", "cable"], "strut"),
        ("restlength", ["rest_length", "rest_lengths", "length"], "rest_length"),
        (12, [1, 121, 3], "121"),
        ("x", [], None),
        ("wood", ["steel"], None),
    ],
)
def test_nearest_ignores_case_and_accepts_numbers(name, candidates, match):
    assert nearest(name, candidates) == match
