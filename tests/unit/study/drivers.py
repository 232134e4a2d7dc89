"""Drivers of campaigns in processes of their own, to be killed."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# What a test waits for another process, at most; it fails sooner or not at all on a sound machine.
PATIENCE = 120

SCRIPT = """
import json, sys
sys.path.insert(0, {folder!r})

if __name__ == "__main__":
    import fake_solver
    from tensegra.errors import StudyError
    from tensegra.study import parse_study

    content = json.loads(sys.argv[1])
    try:
        parse_study(content).run(sys.argv[2], workers=int(sys.argv[3]), solver=fake_solver.solve_slowly)
    except StudyError as error:
        sys.exit(str(error))
"""


class Drivers:
    """Starts drivers, and ends those that a test has left."""

    def __init__(self, script):
        self.script, self.started = script, []
        script.write_text(SCRIPT.format(folder=str(Path(__file__).parent)))

    def start(self, content, folder, workers=1, before=()):
        """Start a driver of the study with this content; `before` is what the command begins with."""
        command = [*before, sys.executable, str(self.script), json.dumps(content), str(folder), str(workers)]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)  # noqa: S603 - our own script
        self.started.append(process)
        return process

    def close(self):
        for process in self.started:
            process.kill()
            process.wait()
            process.stderr.close()


def wait_until(condition):
    for _ in range(PATIENCE * 50):
        if condition():
            return
        time.sleep(0.02)
    pytest.fail("waited too long for another process")


def kill(process):
    """Kill a driver, and wait until whomever it started is gone, too; return how many these were."""
    family = descendants_of(process.pid)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    wait_until(lambda: not any(is_running(member) for member in family))
    return len(family)


def shards(folder):
    return [path for path in (folder / "shards").glob("*.parquet") if not path.name.startswith(".")]


def descendants_of(pid):
    """Return the processes that a process has started, and those that these have."""
    try:
        children = [
            int(child)
            for task in Path(f"/proc/{pid}/task").iterdir()
            for child in (task / "children").read_text().split()
        ]
    except (FileNotFoundError, ProcessLookupError):
        return []
    return [*children, *(grandchild for child in children for grandchild in descendants_of(child))]


def is_running(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"
