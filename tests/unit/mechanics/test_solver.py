"""What goes into the kernels and comes out of them: records, rows of runs, threads and workspaces."""

import logging
import time

import numpy as np
import pytest

from tensegra.mechanics import PathSettings, Status, solve_path, solver
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.follow import ARRIVED, PAUSED
from tensegra.mechanics.inputs import StageInputs
from tensegra.mechanics.lanes import WIDTH
from tensegra.mechanics.pattern import build_pattern
from tensegra.mechanics.solver import Solver
from tensegra.mechanics.state import CACHE_LINE, Lanes, Outcome, Workspace, share
from tensegra.structure import library

SAME = 1e-9
"""Of the size: a path that is taken up again has other steps, and the same ends."""


@pytest.fixture(scope="module")
def beam():
    return library.paper_beam()


@pytest.fixture(scope="module")
def way(beam):
    """Return the arrays, the stage from the prestressed beam along A14, and where it starts."""
    arrays = structure_arrays(beam)
    start, end = (solve_path(beam, {"A14": value}) for value in (0.0, 0.1))
    before, after = start.load.rest_length, end.load.rest_length
    stage = StageInputs(
        np.stack([before, after - before], axis=1),
        start.load.force,
        end.load.force,
        arrays.coordinates,
        arrays.coordinates,
    )
    return arrays, stage, start.final.nodes[None], end.final.nodes


def test_a_record_that_is_full_pauses_the_run_and_it_is_taken_up_again(way):
    arrays, stage, start, end = way
    one = Solver(arrays, PathSettings(largest_move=0.005))
    runs, outcome = one.runs(stage, arrays.stiffness, start, 1), one.outcome(start, 1)
    whole = one.outcome(start, 1)
    one.follow(runs, whole)
    seen, rounds = [], 0
    while outcome.end[0] != ARRIVED:
        record = one.record(3)
        one.follow(runs, outcome, record)
        assert outcome.end[0] in (ARRIVED, PAUSED)
        assert 0 < record.counts[0] <= 3
        seen.extend(record.parameter[: record.counts[0]])
        rounds += 1
        assert rounds < 100
    assert rounds > 2
    assert np.all(np.diff(seen) >= 0.0)
    assert (seen[0], seen[-1]) == (0.0, 1.0)
    size = arrays.size
    np.testing.assert_allclose(outcome.nodes, whole.nodes, rtol=0, atol=SAME * size)
    np.testing.assert_allclose(outcome.nodes[0], end.ravel(), rtol=0, atol=SAME * size)


def test_the_history_is_whole_whatever_the_room_of_a_record(beam, monkeypatch):
    settings = PathSettings(largest_move=0.005)
    expected = solve_path(beam, {"A14": 0.1}, settings=settings)
    monkeypatch.setattr(solver, "RECORDED_BYTES", 1)
    found = solve_path(beam, {"A14": 0.1}, settings=settings)
    points = [point for point in found.history if point.stage == "actuation"]
    assert len(points) > 8  # the least room of a record
    assert np.all(np.diff([point.parameter for point in points]) > 0.0)  # and none of them twice
    assert (found.status, expected.status) == (Status.STABLE, Status.STABLE)
    np.testing.assert_allclose(found.final.nodes, expected.final.nodes, rtol=0, atol=SAME * 240.0)


def test_one_row_holds_for_all_runs(way):
    arrays, stage, start, _ = way
    one, n = Solver(arrays, PathSettings()), 5
    shared = one.runs(stage, arrays.stiffness, start, n)
    each = one.runs(
        StageInputs(*(np.repeat(column[None], n, axis=0) for column in vars(stage).values())),
        np.repeat(arrays.stiffness[None], n, axis=0),
        np.repeat(start, n, axis=0),
        n,
    )
    assert len(shared.start) == len(shared.stiffness) == len(shared.loads_rate) == 1
    assert len(each.start) == len(each.stiffness) == len(each.loads_rate) == n
    outcomes = []
    for runs in (shared, each, each.take(np.array([3, 1]))):
        outcomes.append(one.outcome(start, len(runs.rest_length)))
        one.follow(runs, outcomes[-1])
    for columns in zip(*outcomes, strict=True):
        np.testing.assert_array_equal(columns[0], columns[1])
        np.testing.assert_array_equal(columns[0][:2], columns[2])


def test_rows_of_an_outcome_are_taken_as_copies_and_put_back(way):
    arrays, _, start, _ = way
    whole = Solver(arrays, PathSettings()).outcome(start, 6)
    some = np.array([4, 1])
    part = whole.take(some)
    part.nodes[:] = 7.0
    part.steps[:] = (40, 10)
    assert not np.any(whole.nodes == 7.0)
    whole.put(some, part)
    assert np.all(whole.nodes[some] == 7.0)
    np.testing.assert_array_equal(whole.steps, [0, 10, 0, 0, 40, 0])
    assert isinstance(part, Outcome)


def test_no_runs_are_no_work(way):
    arrays, stage, start, _ = way
    one = Solver(arrays, PathSettings())
    runs, outcome = one.runs(stage, arrays.stiffness, start, 0), one.outcome(start, 0)
    one.follow(runs, outcome)
    assert outcome.nodes.shape == (0, 3 * arrays.n_nodes)


@pytest.mark.parametrize("threads", [2, 5])
def test_threads_share_all_runs(way, threads):
    arrays, stage, start, _ = way
    n = 3 * solver.FEWEST_RUNS_A_THREAD + 1
    shares = np.linspace(0.0, 1.0, n)[:, None]
    rest_length = np.repeat(stage.rest_length[None], n, axis=0)
    rest_length[:, :, 1] *= shares
    many = StageInputs(rest_length, stage.loads_start, stage.loads_end, *(arrays.coordinates,) * 2)
    outcomes = []
    for count in (1, threads):
        one = Solver(arrays, PathSettings(), count)
        outcomes.append(one.outcome(start, n))
        one.follow(one.runs(many, arrays.stiffness, start, n), outcomes[-1])
    np.testing.assert_array_equal(outcomes[0].end, ARRIVED)
    for one, other in zip(*outcomes, strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(np.unique(outcomes[0].nodes, axis=0)) == n


@pytest.mark.parametrize("single", [False, True])
def test_fields_of_a_workspace_lie_apart_and_on_cache_lines(way, single):
    arrays, *_ = way
    work = Workspace(share(arrays, build_pattern(arrays)), 2, single=single)
    for number, name in enumerate(Lanes._fields[1:], start=1):
        field = getattr(work, name)
        assert field.ctypes.data == work.lanes[number]
        assert field.shape[1:] == (() if single else (WIDTH,))
        assert single or field.ctypes.data % CACHE_LINE == 0
        field[:] = number
    for number, name in enumerate(Lanes._fields[1:], start=1):
        assert np.all(getattr(work, name) == number)  # no other field was written over it
    assert work.lanes.n_powers == 3


def test_who_waits_for_the_compiler_is_told(caplog, monkeypatch):
    class Slow:
        signatures = ()

    monkeypatch.setattr(solver, "COMPILING_AFTER", 0.0)
    told = []
    monkeypatch.setattr(solver._logger, "warning", lambda *words: told.append(words))
    with caplog.at_level(logging.WARNING), solver._told_while_compiling(Slow):
        for _ in range(1000):
            if told:
                break
            time.sleep(0.001)
    assert "compiling" in told[0][0]
    Slow.signatures = ("known",)
    told.clear()
    with solver._told_while_compiling(Slow):
        pass
    assert told == []
