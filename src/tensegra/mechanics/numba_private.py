"""What the kernels need of Numba beyond what it promises to keep.

Numba's extension interface (`numba.extending`) has no word for three things: what a cache on disk depends on,
how an operator is typed for a type of one's own, and where an array's first element is. They are taken from
its inside here and nowhere else; a test tells which of them a new version has changed, and `pyproject.toml`
bounds the version until it has been tried.
"""

from collections.abc import Callable
from typing import Any

from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

__all__ = [
    "AbstractTemplate",
    "call_function",
    "first_element",
    "infer_global",
    "nothing",
    "signature",
    "watch_cache",
]


def watch_cache(
    dispatcher: Any,  # noqa: ANN401 - a Dispatcher, which has no annotations
    stamp: str,
    save_by: Callable[[Callable[..., None]], Callable[..., None]],
) -> bool:
    """Let a function's cache on disk be fresh as long as `stamp` is the same, whatever its file says.

    Parameters
    ----------
    dispatcher
        A function that Numba compiles with ``cache=True``.
    stamp
        What is compared with that of the compiled function on disk.
    save_by
        Given the method that saves a compiled function, returns what is called in its place.

    Returns
    -------
    bool
        False where this version of Numba keeps its cache otherwise. Its cache then watches one file and would
        offer functions that are out of date: it must not be used.
    """
    kept: Any = getattr(dispatcher, "_cache", None)
    index: Any = getattr(kept, "_cache_file", None)
    if not (hasattr(index, "_source_stamp") and hasattr(kept, "save_overload")):
        return False
    # The stamp alone, without the time of a file: a cache may be carried with a copy of the package.
    index._source_stamp = stamp  # noqa: SLF001 - the reason for this file
    kept.save_overload = save_by(kept.save_overload)
    return True


def first_element(context: Any, builder: Any, array_type: Any, array: Any) -> Any:  # noqa: ANN401 - as in `lanes`
    """Return a pointer to the first element of an array within a kernel."""
    return context.make_array(array_type)(context, builder, array).data


def nothing(context: Any) -> Any:  # noqa: ANN401 - as in `lanes`
    """Return what a function gives back that returns None."""
    return context.get_dummy_value()


def call_function(builder: Any, function_type: Any, name: str, arguments: Any) -> Any:  # noqa: ANN401 - as in `lanes`
    """Call a function that LLVM knows by its name."""
    declare: Any = cgutils.get_or_insert_function
    return builder.call(declare(builder.module, function_type, name), arguments)
