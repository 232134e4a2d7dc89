"""Helpers of the fuzzers are modules beside them; every example has a limit of time."""

import contextlib
import faulthandler
import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session", autouse=True)
def _warm(tmp_path_factory):
    """Compile and import what the sound files need before any limit of time runs, which is meant for a file.

    A limit that ended an import in its middle would leave a broken module to all files after it.
    """
    import test_fuzz

    with contextlib.chdir(tmp_path_factory.mktemp("warm")):
        test_fuzz.warm()


@pytest.fixture(autouse=True)
def _last_resort():
    """Let nothing hang for ever: compiled code does not look at signals."""
    before = signal.getsignal(signal.SIGPROF)
    yield
    signal.signal(signal.SIGPROF, before)
    faulthandler.cancel_dump_traceback_later()
