"""The address of a Dask scheduler: its form, and whether a scheduler answers there within a patience.

Dask itself waits for minutes for an answer of something that is no scheduler, and tells of it in the
tracebacks of its tasks.
"""

import asyncio
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager

from tensegra.errors import StudyError

__all__ = ["quiet_logs", "require_address", "require_scheduler"]

EXAMPLE = "the address of a Dask scheduler, such as tcp://node7:8786"

_ADDRESS = re.compile(
    r"(?:(?P<protocol>\w+)://)?(?P<host>\[[0-9a-fA-F:.%]+\]|[\w.-]+)(?::(?P<port>\d{1,5}))?/?"
)

PROTOCOLS = ("tcp", "tls", "ws", "wss", "ucx", "inproc")

NOISY = ("distributed", "tornado", "asyncio", "bokeh")
"""Loggers of other libraries that tell of a broken connection in tracebacks."""


def require_address(address: str) -> None:
    """Refuse what cannot be the address of a scheduler.

    Raises
    ------
    StudyError
        Naming what is missing.

    Examples
    --------
    >>> require_address("tcp://node7:8786")
    >>> require_address("http://node7:8787/status")
    Traceback (most recent call last):
    tensegra.errors.StudyError: scheduler: found 'http://node7:8787/status', expected the address of ...
    """
    if address.startswith("inproc://"):
        return
    parts = _ADDRESS.fullmatch(address.strip())
    if parts is None or (parts["protocol"] or "tcp") not in PROTOCOLS:
        raise StudyError.at("scheduler", address, EXAMPLE)
    if parts["port"] is None or not 0 < int(parts["port"]) < 2**16:
        raise StudyError.at("scheduler", address, f"{EXAMPLE}: a port from 1 to 65535 at its end")


def require_scheduler(address: str, patience: float) -> None:
    """Refuse an address at which no scheduler answers within so many seconds.

    Raises
    ------
    StudyError
        With the reason in one line.
    """
    try:
        identity = asyncio.run(asyncio.wait_for(_identity(address, patience), patience))
    except TimeoutError:
        reason = f"nothing there answers as one within {patience:g} s"
    # Whatever a foreign server sends is unpacked as if Dask had sent it, with any error that this may give.
    except Exception as error:  # noqa: BLE001 - see above
        text = " ".join(str(error.__cause__ or error).split())
        reason = f"{type(error.__cause__ or error).__name__}: {text}"[:200]
    else:
        if identity == "Scheduler":
            return
        reason = f"what answers there is a {identity}"
    raise StudyError(f"{address}: no Dask scheduler answers ({reason})")


async def _identity(address: str, patience: float) -> str:
    """Return what the other side calls itself."""
    from distributed.comm import connect
    from distributed.core import send_recv

    comm = await connect(_with_protocol(address), timeout=patience, **_security())
    try:
        answer = await send_recv(comm, op="identity", reply=True)
        return str(answer.get("type", "?")) if isinstance(answer, dict) else "?"
    finally:
        comm.abort()


def _with_protocol(address: str) -> str:
    return address if "://" in address else f"tcp://{address}"


def _security() -> dict[str, object]:
    """Return the arguments of a connection that Dask's own settings ask for, certificates among them."""
    from distributed.security import Security

    arguments: dict[str, object] = dict(Security().get_connection_args("client"))
    return arguments


@contextmanager
def quiet_logs() -> Iterator[None]:
    """Let other libraries be silent about a broken connection, unless our own logger is to tell all."""
    if logging.getLogger("tensegra").isEnabledFor(logging.DEBUG):
        yield
        return
    known = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in NOISY]
    loggers = [logging.getLogger(name) for name in (*NOISY, *known)]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
