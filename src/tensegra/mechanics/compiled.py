"""Numba's decorator for all kernels, with a cache on disk that knows what a kernel is made of.

Numba keeps a compiled function as long as the file that defines it does not change. A kernel takes in
functions of other files, so here a cache is fresh only as long as none of the kernels' files changes.
"""

from collections.abc import Callable, Iterable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba as nb

KERNEL_FILES = tuple(
    Path(__file__).with_name(f"{name}.py")
    for name in (
        *("compiled", "law", "lanes", "state", "kernels", "step"),
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
    dispatcher: Any = nb.njit(cache=True, **options)(function)
    # Numba has no public way to say what a cache depends on; without this one it watches one file.
    index: Any = getattr(dispatcher._cache, "_cache_file", None)  # noqa: SLF001 - see above
    if hasattr(index, "_source_stamp"):
        index._source_stamp = (index._source_stamp, DIGEST)  # noqa: SLF001 - see above
    return dispatcher
