"""A campaign of 100,000 runs on a cluster, killed twice, beside one that nothing happens to."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from pandas.testing import assert_frame_equal

from tensegra.study import open_campaign, parse_study

N_POINTS = 100_000
WORKERS = 2

ROOT = str(Path(__file__).parents[2])
"""Where the package `benchmarks` lies, which measures the driver's memory."""

KILLS = (20_000, 60_000)
"""Rows at which the driver is killed."""

# The driver's peak that the project promises for so many runs.
MOST_MEMORY = 2**30

# What the test waits for a driver, at most; it fails sooner or not at all on a sound machine.
PATIENCE = 300

UNIFORM_ERROR, UNIFORM_HEAT = {"uniform": [0.09, 0.10]}, {"uniform": [0, 150]}
CONTENT = {
    "structure": "library:paper_beam",
    "seed": 1,
    "variables": {
        "A14": {"actuator": "A14", "distribution": UNIFORM_ERROR},
        "A23": {"actuator": "A23", "distribution": UNIFORM_ERROR},
        "T_top": {"temperature": "top", "distribution": UNIFORM_HEAT},
        "T_middle": {"temperature": "middle", "distribution": UNIFORM_HEAT},
        "T_bottom": {"temperature": "bottom", "distribution": UNIFORM_HEAT},
    },
    "outputs": {axis: {"displacement": axis, "nodes": [18, 23]} for axis in "xyz"},
    "design": {"sampler": "sobol", "sizes": N_POINTS},
}

DRIVER = """
import json, sys
from benchmarks.solver.fresh import peak_bytes
from tensegra.study import parse_study

if __name__ == "__main__":
    parse_study(json.loads(sys.argv[1])).run(sys.argv[2], workers=int(sys.argv[3]))
    print(peak_bytes())
"""


def start(script, folder):
    command = [sys.executable, str(script), json.dumps(CONTENT), str(folder), str(WORKERS)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (ROOT, os.getenv("PYTHONPATH"))))}
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)  # noqa: S603 - our own script


def shards(folder):
    return [path for path in (folder / "shards").glob("*.parquet") if not path.name.startswith(".")]


def n_rows(folder):
    return sum(pq.read_metadata(path).num_rows for path in shards(folder))


def kill_at(driver, folder, n_wanted):
    """Kill a driver when the campaign has so many rows."""
    for _ in range(PATIENCE * 100):
        if n_rows(folder) >= n_wanted or driver.poll() is not None:
            break
        time.sleep(0.01)
    os.kill(driver.pid, signal.SIGKILL)
    driver.communicate()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_a_campaign_killed_twice_has_the_rows_of_an_undisturbed_one(tmp_path):
    pytest.importorskip("distributed")
    script, folder = tmp_path / "driver.py", tmp_path / "killed"
    script.write_text(DRIVER)
    done = [0]
    for n_wanted in KILLS:
        kill_at(start(script, folder), folder, n_wanted)
        done.append(open_campaign(folder).state().n_done)
    assert 0 < done[1] < done[2] < N_POINTS
    driver = start(script, folder)
    out, _ = driver.communicate(timeout=PATIENCE)
    assert driver.returncode == 0
    assert int(out) < MOST_MEMORY

    rows = open_campaign(folder).frame()
    assert len(rows) == n_rows(folder) == N_POINTS
    undisturbed = parse_study(CONTENT).run(tmp_path / "undisturbed").frame()
    # All but the time that each run took, to the bit.
    assert_frame_equal(rows.drop(columns="seconds"), undisturbed.drop(columns="seconds"), check_exact=True)
    assert (rows["status"] == "stable").all()
    record = {"done at the kills": done[1:], "memory of the driver in MiB": int(out) / 2**20}
    Path(tmp_path / "record.json").write_text(json.dumps(record))
