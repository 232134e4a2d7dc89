"""The threads of the linear algebra, limited without searching the libraries each time."""

from functools import lru_cache
from typing import Any

__all__ = ["one_thread"]


@lru_cache(maxsize=1)
def _controller() -> Any:  # noqa: ANN401 - threadpoolctl is not typed
    import scipy.linalg  # noqa: F401 - its library has to be there to be found
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def one_thread(*, wanted: bool = True) -> Any:  # noqa: ANN401
    """Return a context in which the linear algebra uses one thread, if `wanted`."""
    return _controller().limit(limits=1 if wanted else None, user_api="blas")
