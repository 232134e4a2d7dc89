"""Functions that executors carry out; in a module of their own, so that workers can import them."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


def wait_a_little(number):
    """Return the number after a while."""
    time.sleep(0.02)
    return number


def leave_a_mark(folder, number):
    """Leave a file of its own in a folder, and take a while."""
    (Path(folder) / uuid4().hex).touch()
    time.sleep(0.02)
    return number


def process(_):
    """Return the number of this process."""
    time.sleep(0.02)
    return os.getpid()


def double_but_die_once(mark, number):
    """Kill this process on the first task ever, given a path that does not exist yet."""
    try:
        Path(mark).touch(exist_ok=False)
    except FileExistsError:
        return 2 * number
    os.kill(os.getpid(), signal.SIGKILL)
    return None


def die(_):
    """Kill this process."""
    os.kill(os.getpid(), signal.SIGKILL)


def is_running(pid):
    """Return whether a process is there and no zombie."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@contextmanager
def scheduler_and_worker(folder):
    """Start a scheduler and a worker from the command line, as a cluster's administrator would."""
    file = Path(folder) / "scheduler.json"
    where = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
    tail = [
        "--scheduler-file",
        str(file),
        "--nthreads",
        "1",
        "--no-dashboard",
        "--local-directory",
        str(folder),
    ]
    # Beside what this process finds its own code by: the workers have to have the same.
    paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    started = []
    try:
        for command in (["scheduler", "--port", "0", *where], ["worker", *tail, "--death-timeout", "60"]):
            started.append(
                subprocess.Popen(  # noqa: S603 - our own command
                    [sys.executable, "-m", "distributed.cli.dask_" + command[0], *command[1:]],
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env=environment,
                )
            )
            while not file.exists():
                time.sleep(0.02)
        import json

        yield json.loads(file.read_text())["address"], started[0]
    finally:
        for process_ in started:
            process_.kill()
            process_.wait()
