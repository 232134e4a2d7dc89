"""Functions that executors carry out; in a module of their own, so that workers can import them."""

import os
import signal
from pathlib import Path


def threads(_):
    """Return the numbers of threads that this process computes on."""
    import numba
    import numpy as np  # noqa: F401 - brings its BLAS along
    from threadpoolctl import threadpool_info

    return {numba.get_num_threads(), *(pool["num_threads"] for pool in threadpool_info())}


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
