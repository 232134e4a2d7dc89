"""Campaigns whose driver, workers or disk fail: nothing lost, nothing twice, running again finishes."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from drivers import Drivers, descendants_of, kill, shards, wait_until
from pandas.testing import assert_frame_equal
from study_contents import set_at

from tensegra.errors import StudyError
from tensegra.study import open_campaign, parse_study
from tensegra.study.cluster import Dask

N_POINTS = 2048

needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="there is no /proc here")


@pytest.fixture
def drivers(tmp_path):
    drivers = Drivers(tmp_path / "driver.py")
    yield drivers
    drivers.close()


@pytest.fixture
def content(content):
    set_at(content, "design.sizes", N_POINTS)
    return content


@pytest.fixture
def undisturbed(tmp_path, content, solver):
    """Return the rows as they are if nothing happens."""
    return parse_study(content).run(tmp_path / "undisturbed", solver=solver).frame()


def assert_whole(folder, undisturbed):
    """Assert that a campaign has every row, as it should be, and once."""
    assert_frame_equal(open_campaign(folder).frame(), undisturbed, check_exact=True)
    assert sum(pq.read_metadata(path).num_rows for path in shards(folder)) == N_POINTS
    assert not list(folder.rglob("*.writing*"))


def wait_for_more(folder, driver):
    n_before = len(shards(folder))
    wait_until(lambda: len(shards(folder)) > n_before or driver.poll() is not None)


@needs_proc
@pytest.mark.parametrize(
    ("workers", "seed"), [(1, 1), (1, 2), pytest.param(2, 3, marks=pytest.mark.slow)], ids=str
)
def test_a_driver_killed_at_random_moments(tmp_path, content, drivers, solver, undisturbed, workers, seed):
    folder, rng = tmp_path / "runs", np.random.default_rng(seed)
    for _ in range(3):
        driver = drivers.start(content, folder, workers)
        wait_for_more(folder, driver)
        time.sleep(rng.uniform(0.0, 0.1))
        # With two workers there are two processes at least, which do not outlive their driver.
        assert kill(driver) >= (2 if workers > 1 else 0)
    done = open_campaign(folder).state()
    assert 0 < done.n_done < N_POINTS
    assert done.driver is None
    parse_study(content).run(folder, solver=solver)
    assert_whole(folder, undisturbed)


@needs_proc
def test_a_driver_killed_before_its_first_row(tmp_path, content, drivers, solver, undisturbed):
    folder = tmp_path / "runs"
    driver = drivers.start(content, folder)
    wait_until((folder / "lock").exists)
    kill(driver)
    parse_study(content).run(folder, solver=solver)
    assert_whole(folder, undisturbed)


@needs_proc
def test_a_killed_worker_of_a_cluster_loses_nothing(tmp_path, content, undisturbed):
    pytest.importorskip("distributed")
    import fake_solver

    killed = []

    def kill_one(done, *_):
        if done and not killed:
            killed.append(next(pid for pid in descendants_of(os.getpid()) if is_worker(pid)))
            os.kill(killed[0], signal.SIGKILL)

    executor = Dask(workers=2)
    folder = tmp_path / "runs"
    parse_study(content).run(folder, executor=executor, progress=kill_one, solver=fake_solver.solve_slowly)
    assert len(killed) == 1
    assert_whole(folder, undisturbed)


def is_worker(pid):
    return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_two_drivers_started_at_once(tmp_path, content, drivers, undisturbed, workers):
    folder = tmp_path / "runs"
    started = [drivers.start(content, folder, workers) for _ in range(2)]
    messages = [process.communicate()[1] for process in started]
    assert sorted(process.returncode for process in started) == [0, 1]
    first, second = sorted(started, key=lambda process: process.returncode)
    assert f"process {first.pid} on " in messages[started.index(second)]
    assert (
        "is running this campaign; wait for it, or end it, and run again" in messages[started.index(second)]
    )
    assert_whole(folder, undisturbed)


def test_a_second_driver_is_sent_away_while_the_first_lives(tmp_path, content, solver, drivers, undisturbed):
    folder = tmp_path / "runs"
    driver = drivers.start(content, folder)
    wait_until(lambda: len(shards(folder)) >= 1)
    study = parse_study(content)
    with pytest.raises(StudyError, match=rf"process {driver.pid} on .* is running this campaign"):
        study.run(folder, solver=solver)
    state = open_campaign(folder).state()
    assert state.driver == driver.pid
    assert state.rate > 0
    assert state.seconds_left == pytest.approx(state.n_pending / state.rate)
    kill(driver)
    study.run(folder, solver=solver)
    assert_whole(folder, undisturbed)


@needs_proc
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_disk_that_takes_no_more(tmp_path, content, drivers, solver, undisturbed, workers):
    folder = tmp_path / "runs"
    driver = drivers.start(content, folder, workers)
    wait_until(lambda: len(shards(folder)) >= 2)
    # From here on the operating system refuses to let any file of the driver grow beyond this.
    resource.prlimit(driver.pid, resource.RLIMIT_FSIZE, (1000, 1000))
    _, message = driver.communicate()
    assert driver.returncode == 1
    assert "cannot be written (file too large); the shards that are there are whole, run again" in message
    assert 0 < open_campaign(folder).state().n_done < N_POINTS
    parse_study(content).run(folder, solver=solver)
    assert_whole(folder, undisturbed)


FULL_DISK = """
import json, subprocess, sys
sys.path.insert(0, {folder!r})

if __name__ == "__main__":
    import fake_solver
    from tensegra.errors import StudyError
    from tensegra.study import open_campaign, parse_study

    study, disk = parse_study(json.loads(sys.argv[1])), sys.argv[2]
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=128k", "tmpfs", disk], check=True)
    told = []
    try:
        study.run(disk, solver=fake_solver.solve)
    except StudyError as error:
        told.append(str(error))
    n_done = open_campaign(disk).state().n_done
    subprocess.run(["mount", "-o", "remount,size=16m", disk], check=True)
    campaign = study.run(disk, solver=fake_solver.solve)
    campaign.frame().to_parquet(sys.argv[3])
    left = [path.name for path in campaign.store.shards.iterdir()]
    print(json.dumps({{"told": told, "n_done": n_done, "left": left}}))
"""


def test_a_full_disk_is_told_and_running_again_finishes(tmp_path, content, undisturbed):
    """The disk is real, a small one in memory, mounted where only the test's own process sees it."""
    unshare = shutil.which("unshare")
    alone = [str(unshare), "--user", "--map-root-user", "--mount"]
    if unshare is None or subprocess.run([*alone, "true"], check=False, capture_output=True).returncode:  # noqa: S603
        pytest.skip("nothing may be mounted here")
    import pandas as pd

    script, disk, rows = tmp_path / "full.py", tmp_path / "disk", tmp_path / "rows.parquet"
    script.write_text(FULL_DISK.format(folder=str(Path(__file__).parent)))
    disk.mkdir()
    command = [*alone, sys.executable, str(script), json.dumps(content), str(disk), str(rows)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)  # noqa: S603 - our own script
    found = json.loads(done.stdout)
    assert len(found["told"]) == 1
    assert (
        "cannot be written (no space left on device); the shards that are there are whole" in found["told"][0]
    )
    assert 0 < found["n_done"] < N_POINTS
    assert {Path(name).suffix for name in found["left"]} == {".parquet"}
    assert_frame_equal(pd.read_parquet(rows), undisturbed, check_exact=True)
