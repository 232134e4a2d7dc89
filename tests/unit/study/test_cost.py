import numpy as np
import pytest

from tensegra.study import probe
from tensegra.study.cost import SIZES, Probe
from tensegra.study.driver import BLOCKS_PER_CAMPAIGN


class Clock:
    """A clock that only solving moves on: so much for a call, so much for a run."""

    def __init__(self, solver, per_call, per_run):
        self.solver, self.per_call, self.per_run = solver, per_call, per_run
        self.now, self.sizes = 0.0, []

    def __call__(self, structure, **inputs):
        runs = self.solver(structure, **inputs)
        self.sizes.append(runs.n_runs)
        self.now += self.per_call + self.per_run * runs.n_runs
        return runs

    def read(self):
        return self.now


@pytest.fixture
def timed(study, solver, monkeypatch):
    def run(per_call, per_run, **options):
        clock = Clock(solver, per_call, per_run)
        monkeypatch.setattr("tensegra.study.cost.perf_counter", clock.read)
        return probe(study, solver=clock, **options), clock

    return run


def test_quick_runs_are_tried_in_numbers_and_their_time_is_told(timed):
    found, clock = timed(0.01, 1e-4)
    # The first call, which compiles, does not count.
    assert clock.sizes == [1, 1, 8, 64]
    assert found.n_runs == found.n_pending == 64
    assert found.seconds_per_run == pytest.approx(1e-4)
    assert found.seconds_per_block == pytest.approx(0.01)
    assert found.expected_seconds == pytest.approx(64e-4 + BLOCKS_PER_CAMPAIGN * 0.01)
    assert sum(found.statuses.values()) == 64
    assert found.statuses["failed"] > 0


def test_slow_runs_are_few(timed):
    found, clock = timed(0.0, 30.0)
    assert clock.sizes == [1, 1]
    assert found.n_runs == 1
    assert found.expected_seconds == pytest.approx(64 * 30)


def test_only_what_is_pending_is_counted(timed):
    found, _ = timed(0.0, 1e-3, points=np.arange(50, 60))
    assert found.n_pending == found.n_runs == 10
    assert found.expected_seconds == pytest.approx(0.01)
    shared, _ = timed(0.0, 1e-3, points=np.arange(50, 60), workers=2)
    assert shared.expected_seconds == pytest.approx(0.005)


def test_a_finished_campaign_takes_no_time(timed):
    found, clock = timed(1.0, 1.0, points=np.arange(0))
    assert found == Probe(0, 0, {}, 0.0, 0.0)
    assert found.expected_seconds == 0
    assert clock.sizes == []


def test_a_probe_of_the_real_solver(study):
    found = probe(study)
    assert found.n_runs <= max(SIZES)
    assert found.expected_seconds > 0
