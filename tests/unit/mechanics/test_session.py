"""A structure under one's hand: where it is moved to, it stands as if it had been led there at once."""

import numpy as np
import pytest

from tensegra.errors import ModelError, SolverError
from tensegra.mechanics import Session, Status, solve_path
from tensegra.structure import library

SAME = 1e-9
"""Of the structure's size: both ways end in the same equilibrium, polished to rounding."""


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


def assert_same(found, expected, size):
    assert found.status is expected.status
    np.testing.assert_allclose(found.nodes, expected.nodes, rtol=0.0, atol=SAME * size)
    assert found.lowest_eigenvalue == pytest.approx(expected.lowest_eigenvalue, rel=1e-5)


def test_moves_in_turn_end_where_one_path_does(beam):
    session, size = Session(beam), np.ptp(beam.coordinates, axis=0).max()
    for move in ({"A14": 0.03}, {"A23": 0.06}, {"A14": 0.08}):
        session.move(move)
    found = session.move(temperature={"top": 40.0}, loads={("23", "z"): -0.2})
    # What a move does not name stays as it is.
    expected = solve_path(beam, {"A14": 0.08, "A23": 0.06}, {"top": 40.0}, loads={("23", "z"): -0.2})
    assert_same(found, expected.final, size)
    path = session.path()
    np.testing.assert_allclose(path.displacements, expected.displacements, rtol=0.0, atol=SAME * size)
    np.testing.assert_allclose(
        path.derivative("A14").nodes, expected.derivative("A14").nodes, rtol=0.0, atol=1e-5 * size
    )
    session.reset()
    assert_same(session.equilibrium, solve_path(beam).final, size)


def test_a_move_back_is_the_way_back(beam):
    session = Session(beam)
    session.move({"A14": 0.1, "A23": 0.1})
    back = session.move({"A14": 0.0, "A23": 0.0})
    assert_same(back, solve_path(beam).final, np.ptp(beam.coordinates, axis=0).max())


def test_a_move_that_cannot_be_leaves_the_structure_where_it_was(beam):
    session = Session(beam)
    there = session.move({"A14": 0.05})
    with pytest.raises(ModelError, match="did you mean 'A4'"):
        session.move({"A41": 0.05})
    with pytest.raises(ModelError, match="rest length"):
        session.move({"A14": 1.5})
    np.testing.assert_array_equal(session.equilibrium.nodes, there.nodes)
    ball = library.prism().replace(supports={})
    free = Session(ball)
    before = free.equilibrium.nodes
    failed = free.move(loads={(next(iter(ball.nodes)), "x"): 1.0})
    assert failed.status is Status.FAILED
    assert "translation along x" in failed.reason
    np.testing.assert_array_equal(free.equilibrium.nodes, before)


def test_a_structure_that_does_not_stand_is_no_session(beam):
    slack = {
        name: 2.0 * member.rest_length for name, member in beam.members.items() if member.kind == "cable"
    }
    from dataclasses import replace

    loose = beam.replace(
        members={**beam.members, **{n: replace(beam.members[n], rest_length=v) for n, v in slack.items()}},
        gravity=(0, 0, 0),
    )
    with pytest.raises(SolverError):
        Session(loose)
