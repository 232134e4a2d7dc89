"""One driver for a folder, and looks that do not disturb it."""

import errno
import json
import os
import platform
import sys
import threading

import pytest

from tensegra.errors import StudyError
from tensegra.study import lock
from tensegra.study.lock import driver_of, lock_folder


def written(folder, **changes):
    """Write what a driver that could not clean up has left behind."""
    mine = {"pid": os.getpid(), "host": platform.node(), "birth": lock._birth(os.getpid())}
    (folder / "lock").write_text(json.dumps({**mine, "rows": 10, "seconds": 2.0, **changes}))


def test_a_driver_says_who_and_how_fast_it_is(tmp_path):
    with lock_folder(tmp_path) as held:
        held.tell(32)
        driver = driver_of(tmp_path)
        assert (driver["pid"], driver["host"], driver["rows"]) == (os.getpid(), platform.node(), 32)
        assert driver["seconds"] >= 0.0
    assert driver_of(tmp_path) is None


def test_a_look_never_refuses_a_driver(tmp_path):
    looks, stop = [], threading.Event()

    def look():
        while not stop.is_set():
            looks.append(driver_of(tmp_path))

    looker = threading.Thread(target=look)
    looker.start()
    try:
        for _ in range(300):
            with lock_folder(tmp_path):
                pass
    finally:
        stop.set()
        looker.join()
    assert looks


def test_a_look_takes_no_lock(tmp_path, monkeypatch):
    written(tmp_path)
    monkeypatch.setattr(lock, "_try_lock", None)
    assert driver_of(tmp_path)["pid"] == os.getpid()


def test_a_driver_that_died_is_not_running(tmp_path):
    written(tmp_path, pid=2**22 + 1)
    assert driver_of(tmp_path) is None


@pytest.mark.skipif(sys.platform != "linux", reason="only /proc tells when a process was born")
def test_another_process_with_the_number_of_a_dead_driver_is_not_taken_for_it(tmp_path):
    written(tmp_path, birth="1")
    assert driver_of(tmp_path) is None


def test_a_driver_elsewhere_is_taken_at_its_word(tmp_path):
    written(tmp_path, pid=2**22 + 1, host="node7")
    assert driver_of(tmp_path)["host"] == "node7"


NONSENSE = ["", "{", "[]", "3", "{}", "\xff", *(json.dumps({"pid": pid}) for pid in ("a", True, -5, None))]


@pytest.mark.parametrize("text", NONSENSE)
def test_a_lock_that_says_nothing_sensible_is_nobodys(tmp_path, text):
    (tmp_path / "lock").write_text(text, encoding="latin-1")
    assert driver_of(tmp_path) is None


def test_a_file_system_without_locks_can_be_read_but_not_written(tmp_path, monkeypatch):
    def refuse(_):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    monkeypatch.setattr(lock, "_try_lock", refuse)
    told = r"cannot be locked \(function not implemented\).*another file system"
    with pytest.raises(StudyError, match=told), lock_folder(tmp_path):
        pass
    assert driver_of(tmp_path) is None


def test_two_holders_cannot_be(tmp_path):
    told = f"process {os.getpid()} on .* is running"
    with lock_folder(tmp_path), pytest.raises(StudyError, match=told), lock_folder(tmp_path):
        pass
