import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pandas.testing import assert_frame_equal
from study_contents import set_at

from tensegra.errors import StudyError
from tensegra.study import InProcess, design_points, open_campaign, parse_study
from tensegra.study.campaign import block_size

COLUMNS = [
    "A14", "A23", "w", "T_K1",
    "status", "reason", "residual", "lowest_eigenvalue", "steps", "iterations", "seconds",
]  # fmt: skip

# What a test waits for another process, at most; it fails sooner or not at all on a sound machine.
PATIENCE = 60


class Counting:
    """A solver that counts the runs it is asked for."""

    def __init__(self, solver):
        self.solver, self.n_runs = solver, 0

    def __call__(self, structure, **inputs):
        runs = self.solver(structure, **inputs)
        self.n_runs += runs.n_runs
        return runs


@pytest.fixture
def counting(solver):
    return Counting(solver)


def test_a_campaign_has_a_row_for_every_point(tmp_path, study, solver):
    campaign = study.run(tmp_path / "runs", workers=1, solver=solver)
    frame = campaign.frame()
    assert list(frame.columns) == COLUMNS
    X = design_points(study)
    assert_array_equal(frame[["A14", "A23"]].to_numpy(), X)
    failed = X[:, 0] > 0.098
    assert 0 < failed.sum() < len(X)
    assert_array_equal(frame["status"] == "failed", failed)
    assert_array_equal(frame["w"].isna(), failed)
    assert set(frame["reason"][failed]) == {"no equilibrium was found"}
    assert_allclose(frame["w"][~failed], 100 * X[~failed].sum(axis=1))


def test_shards_are_read_by_plain_pandas_with_stable_types(tmp_path, study, solver):
    study.run(tmp_path / "runs", workers=1, solver=solver)
    shards = sorted((tmp_path / "runs" / "shards").glob("*.parquet"))
    assert len(shards) == 4
    for shard in shards:
        frame = pd.read_parquet(shard)
        types = [str(kind) for kind in frame.dtypes]
        assert types[:4] == ["float64"] * 4
        assert types[6:] == ["float64", "float64", "int32", "int32", "float64"]
        assert frame["reason"].notna().all()
    whole = pd.read_parquet(tmp_path / "runs" / "shards")
    assert len(whole) == 64


def test_running_again_computes_nothing(tmp_path, study, counting):
    first = study.run(tmp_path, workers=1, solver=counting).frame()
    again = study.run(tmp_path, workers=1, solver=counting).frame()
    assert counting.n_runs == 64
    assert_frame_equal(first, again)


@pytest.mark.parametrize(
    ("design", "extended"),
    [
        ({"sampler": "sobol", "sizes": 40}, {"sampler": "sobol", "sizes": 100}),
        ({"sampler": "latin_hypercube", "sizes": 30}, {"sampler": "latin_hypercube", "sizes": [30, 10]}),
        ({"sampler": "full_factorial", "levels": 5}, {"sampler": "full_factorial", "levels": 9}),
    ],
    ids=["sobol", "latin_hypercube", "full_factorial"],
)
def test_a_larger_design_computes_the_new_points_only(tmp_path, content, counting, design, extended):
    content["design"] = design
    parse_study(content).run(tmp_path, workers=1, solver=counting)
    content["design"] = extended
    study = parse_study(content)
    frame = study.run(tmp_path, workers=1, solver=counting).frame()
    assert counting.n_runs == study.n_points == len(frame)
    assert_array_equal(frame[["A14", "A23"]].to_numpy(), design_points(study))


def test_a_point_that_the_design_repeats_is_run_once_and_shown_as_often(tmp_path, content, counting):
    content["variables"]["A14"]["distribution"] = {"discrete": {"values": [0.09, 0.095]}}
    content["variables"]["A23"]["distribution"] = {"discrete": {"values": [0.07, 0.08, 0.09]}}
    seen = []
    study = parse_study(content)
    campaign = study.run(tmp_path, workers=1, solver=counting, progress=lambda *counts: seen.append(counts))
    assert counting.n_runs == 6
    assert len(campaign.frame()) == 64
    assert seen[-1] == (64, 64, 0)


def test_progress_counts_up_to_the_end(tmp_path, study, solver):
    seen = []
    campaign = study.run(tmp_path, workers=1, solver=solver, progress=lambda *counts: seen.append(counts))
    n_failed = campaign.state().n_failed
    assert [done for done, _, _ in seen] == [0, 16, 32, 48, 64]
    assert {total for _, total, _ in seen} == {64}
    assert seen[-1] == (64, 64, n_failed)
    assert n_failed > 0


def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path, study, counting):
    def interrupt(done, *_):
        if done == 32:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study.run(tmp_path / "a", workers=1, solver=counting, progress=interrupt)
    state = open_campaign(tmp_path / "a").state()
    assert (state.n_done, state.n_pending, state.driver) == (32, 32, None)
    resumed = study.run(tmp_path / "a", workers=1, solver=counting)
    assert counting.n_runs == 64
    undisturbed = study.run(tmp_path / "b", workers=1, solver=counting)
    assert_frame_equal(resumed.frame(), undisturbed.frame(), check_exact=True)
    names = [[path.name for path in campaign.store.paths()] for campaign in (resumed, undisturbed)]
    assert names[0] == names[1]


def test_a_shard_cut_short_is_set_aside_and_computed_again(tmp_path, study, counting, caplog):
    campaign = study.run(tmp_path, workers=1, solver=counting)
    expected = campaign.frame()
    victim = campaign.store.paths()[1]
    victim.write_bytes(victim.read_bytes()[:-100])
    left_over = victim.with_name("00000000-x.parquet.writing")
    left_over.write_bytes(b"half")
    assert_frame_equal(study.run(tmp_path, workers=1, solver=counting).frame(), expected)
    assert counting.n_runs == 64 + 16
    assert "cannot be read; set aside" in caplog.text
    assert not left_over.exists()


def test_a_full_disk_is_told_and_costs_nothing(tmp_path, study, solver, monkeypatch):
    import pyarrow.parquet as pq

    write = pq.write_table
    calls = []

    def fail_on_the_third(table, file):
        calls.append(table)
        if len(calls) == 3:
            raise OSError(28, "No space left on device")
        write(table, file)

    monkeypatch.setattr(pq, "write_table", fail_on_the_third)
    with pytest.raises(StudyError, match=r"cannot write .no space left on device.; the shards"):
        study.run(tmp_path, workers=1, solver=solver)
    assert open_campaign(tmp_path).state().n_done == 32
    assert [path.name for path in (tmp_path / "shards").iterdir() if path.suffix != ".parquet"] == []
    assert study.run(tmp_path, workers=1, solver=solver).state().n_pending == 0


def test_the_folder_of_another_study_is_refused(tmp_path, content, solver):
    parse_study(content).run(tmp_path, workers=1, solver=solver)
    content["changes"] = {"gravity": [0, 0, 0]}
    with pytest.raises(
        StudyError, match="holds the campaign of another study, 'study', of which structure differ"
    ):
        parse_study(content).run(tmp_path, workers=1, solver=solver)


def test_a_folder_with_something_else_is_refused(tmp_path, study, solver):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(StudyError, match=r"found 'thesis.tex' and no campaign"):
        study.run(tmp_path, workers=1, solver=solver)


def test_a_campaign_is_opened_without_the_original_files(tmp_path, content, solver):
    points = "A14,A23\n0.0951,0.08\n0.09,0.1\n"
    (tmp_path / "points.csv").write_text(points)
    content["design"] = {"sampler": "file", "file": "points.csv"}
    study = parse_study(content, tmp_path)
    frame = study.run(tmp_path / "runs", workers=1, solver=solver).frame()
    (tmp_path / "points.csv").unlink()
    (tmp_path / "runs").rename(tmp_path / "moved")
    campaign = open_campaign(tmp_path / "moved")
    assert campaign.study.fingerprint == study.fingerprint
    assert_frame_equal(campaign.frame(), frame)
    manifest = json.loads((tmp_path / "moved" / "manifest.json").read_text())
    assert manifest["units"] == {"A14": "", "A23": "", "w": "cm", "T_K1": "kN"}
    assert manifest["seed"] == 1
    assert {"tensegra", "numpy"} <= set(manifest["versions"])


def test_what_is_no_campaign_is_not_opened(tmp_path):
    with pytest.raises(StudyError, match="no campaign is here"):
        open_campaign(tmp_path)
    (tmp_path / "manifest.json").write_text('{"schema": "tensegra/campaign/0"}')
    with pytest.raises(StudyError, match="found 'tensegra/campaign/0', expected tensegra/campaign/1"):
        open_campaign(tmp_path)


def test_a_tampered_study_is_noticed(tmp_path, study, solver):
    study.run(tmp_path, workers=1, solver=solver)
    resolved = json.loads((tmp_path / "study.json").read_text())
    set_at(resolved, "variables.A14.distribution.uniform.low", 0.08)
    (tmp_path / "study.json").write_text(json.dumps(resolved))
    with pytest.raises(StudyError, match="not the study that the rows belong to"):
        open_campaign(tmp_path)


def test_training_data_are_the_certified_rows(tmp_path, study, solver):
    campaign = study.run(tmp_path, workers=1, solver=solver)
    data = campaign.training_data()
    X = design_points(study)
    assert_array_equal(data.X, X[X[:, 0] <= 0.098])
    assert data.input_names == ("A14", "A23")
    assert data.output_units == ("cm", "kN")
    assert_allclose(data.bounds, [[0.09, 0.10], [0.07, 0.10]])
    assert data.study_fingerprint == study.fingerprint
    assert data.distributions == study.space.distributions
    assert campaign.training_data(["T_K1"]).output_names == ("T_K1",)
    with pytest.raises(StudyError, match="did you mean 'w'"):
        campaign.training_data(["W"])


def test_a_campaign_without_a_certified_row_teaches_nothing(tmp_path, content, solver):
    content["variables"]["A14"]["distribution"] = {"uniform": [0.0985, 0.1]}
    campaign = parse_study(content).run(tmp_path, workers=1, solver=solver)
    with pytest.raises(StudyError, match="found none of 64 runs to learn from"):
        campaign.training_data()


def test_the_state_counts_statuses_and_reasons(tmp_path, study, solver):
    state = study.run(tmp_path, workers=1, solver=solver).state()
    assert (state.n_points, state.n_done, state.n_pending) == (64, 64, 0)
    assert sum(state.statuses.values()) == 64
    assert state.reasons["no equilibrium was found"] == state.n_failed
    assert state.seconds_per_run == pytest.approx(1e-3)
    assert state.driver is None
    assert np.isnan(state.seconds_left)


def test_any_executor_gives_the_same_rows(tmp_path, study):
    class Backwards:
        def map(self, function, tasks):
            return InProcess().map(function, reversed(list(tasks)))

    import fake_solver

    one = study.run(tmp_path / "a", executor=Backwards(), solver=fake_solver.solve)
    two = study.run(tmp_path / "b", workers=2, solver=fake_solver.solve)
    assert_frame_equal(one.frame(), two.frame(), check_exact=True)


@pytest.mark.slow
def test_processes_solve_the_real_structure_as_one_process_does(tmp_path, content):
    set_at(content, "design.sizes", 24)
    study = parse_study(content)
    one, two = (study.run(tmp_path / str(n), workers=n).frame() for n in (1, 2))
    assert_frame_equal(one.drop(columns="seconds"), two.drop(columns="seconds"), check_exact=True)
    assert (one["status"] == "stable").all()


@pytest.mark.parametrize(("n_points", "size"), [(1, 16), (1024, 16), (100_000, 1024), (10**7, 2048)])
def test_blocks_are_a_power_of_two_within_limits(n_points, size):
    assert block_size(n_points) == size


DRIVER = """
import json, sys
sys.path.insert(0, {folder!r})
import fake_solver
from tensegra.study import parse_study

if __name__ == "__main__":
    content = json.loads(sys.argv[1])
    parse_study(content).run(sys.argv[2], workers=int(sys.argv[3]), solver=fake_solver.solve_slowly)
"""


@pytest.fixture
def start_driver(tmp_path, content):
    """Start a campaign in a process of its own, as a session of the command line would."""
    set_at(content, "design.sizes", 2048)
    script = tmp_path / "driver.py"
    script.write_text(DRIVER.format(folder=str(Path(__file__).parent)))
    started = []

    def start(folder, workers):
        command = [sys.executable, str(script), json.dumps(content), str(folder), str(workers)]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))  # noqa: S603
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def wait_until(condition):
    for _ in range(PATIENCE * 50):
        if condition():
            return
        time.sleep(0.02)
    pytest.fail("waited too long for another process")


def n_shards(folder):
    return len(list((folder / "shards").glob("*.parquet")))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_killed_driver_loses_nothing_and_leaves_nobody(tmp_path, content, counting, start_driver, workers):
    folder = tmp_path / "runs"
    driver = start_driver(folder, workers)
    wait_until(lambda: n_shards(folder) >= 3)
    children = children_of(driver.pid)
    os.kill(driver.pid, signal.SIGKILL)
    driver.wait()
    wait_until(lambda: not any(is_running(child) for child in children))
    assert len(children) >= (workers if workers > 1 else 0)

    study = parse_study(content)
    n_done = open_campaign(folder).state().n_done
    assert 0 < n_done < 2048
    resumed = study.run(folder, workers=1, solver=counting).frame()
    assert counting.n_runs == 2048 - n_done
    undisturbed = study.run(tmp_path / "undisturbed", workers=1, solver=counting).frame()
    assert_frame_equal(resumed, undisturbed, check_exact=True)


def test_a_second_driver_is_sent_away_while_the_first_lives(tmp_path, content, solver, start_driver):
    folder = tmp_path / "runs"
    driver = start_driver(folder, 1)
    wait_until(lambda: n_shards(folder) >= 1)
    study = parse_study(content)
    with pytest.raises(StudyError, match=rf"process {driver.pid} on .* is running this campaign"):
        study.run(folder, workers=1, solver=solver)
    state = open_campaign(folder).state()
    assert state.driver == driver.pid
    assert state.rate > 0
    os.kill(driver.pid, signal.SIGKILL)
    driver.wait()
    assert study.run(folder, workers=1, solver=solver).state().n_pending == 0


def children_of(pid):
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(child) for child in text.split()]


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"
