"""What a table of so many rows needs of memory, asked before it is made."""

import importlib.util
import os
from contextlib import suppress
from pathlib import Path

from tensegra.errors import StudyError

__all__ = ["available_bytes", "campaign_bytes", "require_room", "size_text"]

SHARE = 0.8
"""Of the memory there is, what one table may take: the rest is for the program and its neighbours."""

COPIES = 4
"""Of every number of a table that is being made: drawn, transformed, sorted and returned."""

ROW_BYTES = 300
"""Of each run, beside its numbers: its key, its place in the dictionary of them, its status and reason."""

_UNITS = ("B", "kB", "MB", "GB", "TB", "PB", "EB")

_CGROUP = Path("/sys/fs/cgroup/memory.max")


def campaign_bytes(n_points: int, n_inputs: int, n_outputs: int, *, derivatives: bool = False) -> float:
    """Estimate the memory that the rows of a campaign take.

    Examples
    --------
    >>> size_text(campaign_bytes(10**9, 3, 3))
    '620 GB'
    """
    n_numbers = n_inputs + n_outputs + (n_inputs * n_outputs if derivatives else 0) + 4
    return float(n_points) * (8.0 * n_numbers * COPIES + ROW_BYTES)


def available_bytes() -> float:
    """Return the memory that this process may have: the machine's, or what a limit leaves of it.

    Examples
    --------
    >>> available_bytes() > 0
    True
    """
    limits = [float("inf")]
    with suppress(AttributeError, ValueError, OSError):  # there is no such question on Windows
        limits.append(float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError):  # "max" where a container has no limit
        limits.append(float(int(_CGROUP.read_text(encoding="ascii"))))
    if importlib.util.find_spec("resource") is not None:
        import resource

        soft = resource.getrlimit(resource.RLIMIT_AS)[0]
        limits += [float(soft)] if soft != resource.RLIM_INFINITY else []
    return min(limits)


def require_room(place: str, found: object, n_bytes: float) -> None:
    """Refuse what needs more memory than there is.

    Parameters
    ----------
    place, found
        Where the number stands, and the number: the parts of the message.
    n_bytes
        What it would take.

    Raises
    ------
    StudyError
        With both sizes.
    """
    there = available_bytes()
    if n_bytes > SHARE * there:
        needed, has = size_text(n_bytes), size_text(there)
        expected = f"fewer: they would need about {needed} of memory, of {has} that there are"
        raise StudyError.at(place, found, expected)


def size_text(n_bytes: float) -> str:
    """Return a size in a unit that a person would use.

    Examples
    --------
    >>> size_text(1.5e9), size_text(640e9), size_text(3e25)
    ('1.5 GB', '640 GB', '30000000 EB')
    """
    unit = 0
    while n_bytes >= 1000.0 and unit < len(_UNITS) - 1:
        n_bytes, unit = n_bytes / 1000.0, unit + 1
    return f"{n_bytes:.2g} {_UNITS[unit]}" if n_bytes < 100.0 else f"{n_bytes:.0f} {_UNITS[unit]}"
