import pytest

from tensegra.errors import SolverError
from tensegra_paper.chapter import Agreement, Row


def row(published, ours, agreement=Agreement.VALUE, holds=None, why="a fit"):
    return Row("Fig. 1", "w", published, ours, "cm", agreement, holds, why)


def test_the_difference_is_ours_less_the_published():
    assert row(144.0, 146.5).difference == 2.5


@pytest.mark.parametrize(("published", "ours"), [(None, 1.0), ("large", 1.0), (1.0, "1 to 2")])
def test_there_is_no_difference_without_two_numbers(published, ours):
    assert row(published, ours).difference is None


def test_a_row_of_method_says_whether_it_holds():
    with pytest.raises(ValueError, match="are judged"):
        row(1.0, 1.0, Agreement.METHOD)


@pytest.mark.parametrize("agreement", [Agreement.VALUE, Agreement.INPUT])
def test_what_is_not_judged_has_no_verdict(agreement):
    with pytest.raises(ValueError, match="are judged, no others"):
        row(1.0, 1.0, agreement, holds=True)


def test_a_finding_has_its_claim():
    with pytest.raises(ValueError, match="has its claim"):
        row(1.0, 1.0, Agreement.FINDING, holds=True)


@pytest.mark.parametrize("changes", [{"why": ""}, {"ours": ""}])
def test_a_row_is_filled(changes):
    with pytest.raises(ValueError, match="filled"):
        row(**{"published": 1.0, "ours": 1.0} | changes)


def test_what_could_not_be_computed_is_a_numerical_failure():
    with pytest.raises(SolverError, match="w: no number could be found"):
        row(1.0, float("nan"))
