"""Numba's decorator for all kernels, with a cache on disk that knows what a kernel is made of.

Numba keeps a compiled function as long as the file that defines it does not change. A kernel takes in
functions of other files, so here a cache is fresh only as long as none of the kernels' files changes.
"""

import logging
from collections.abc import Callable, Iterable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba as nb

from tensegra.mechanics.numba_private import watch_cache

logger = logging.getLogger(__name__)

KERNEL_FILES = tuple(
    Path(__file__).with_name(f"{name}.py")
    for name in (
        *("compiled", "numba_private", "law", "lanes", "state", "kernels", "step"),
        *("branch", "follow", "descend", "stepped", "certify"),
    )
)
"""What kernels are made of, the constants that are compiled into them included."""


def digest_of(files: Iterable[Path]) -> str:
    """Return a digest of the contents of files."""
    digest = sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


DIGEST = digest_of(KERNEL_FILES)


def njit(function: Callable[..., Any]) -> Any:  # noqa: ANN401 - a Dispatcher
    """Compile a kernel: once for one run, once for eight."""
    return _compiled(function)


def _compiled(function: Callable[..., Any]) -> Any:  # noqa: ANN401 - a Dispatcher
    """Let Numba compile a function, and its cache watch all kernels."""
    options: Any = {"error_model": "numpy", "nogil": True, "boundscheck": False}
    try:
        dispatcher: Any = nb.njit(cache=True, **options)(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        _say_uncached("no folder for it can be written")
        return nb.njit(**options)(function)
    if watch_cache(dispatcher, DIGEST, _forgiving):
        return dispatcher
    _say_uncached(f"Numba {nb.__version__} keeps them in a way that is not known here")
    return nb.njit(**options)(function)


def _forgiving(save: Callable[..., None]) -> Callable[..., None]:
    """Let a kernel that was compiled be used, though the disk it would be kept on is full."""

    def save_if_possible(*compiled: object) -> None:
        try:
            save(*compiled)
        except OSError as error:
            _say_uncached((error.strerror or str(error)).lower())

    return save_if_possible


@cache
def _say_uncached(reason: str) -> None:
    """Say once why every start compiles anew."""
    logger.warning(
        "compiled kernels are not kept (%s), so that every start takes half a minute longer; "
        "the variable NUMBA_CACHE_DIR names another folder",
        reason,
    )
