"""Helpers of the fuzzers are modules beside them; every example has a limit of time."""

import faulthandler
import signal
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session", autouse=True)
def _kernels():
    """Compile before any limit of time runs, which is meant for a file."""
    from tensegra.mechanics import solve_path
    from tensegra.report.check import check_structure
    from tensegra.structure import library

    check_structure(library.von_mises_truss())
    solve_path(library.prism(), {"top": 0.01})


@pytest.fixture(autouse=True)
def _last_resort():
    """Let nothing hang for ever: compiled code does not look at signals."""
    before = signal.getsignal(signal.SIGALRM)
    yield
    signal.signal(signal.SIGALRM, before)
    faulthandler.cancel_dump_traceback_later()
