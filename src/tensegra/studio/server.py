"""The studio's server: one page, one socket a page, nothing else."""

import asyncio
import json
import logging
import secrets
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from importlib.resources import files
from ipaddress import ip_address
from typing import Any

from tensegra.errors import TensegraError
from tensegra.studio.page import Page, packed
from tensegra.studio.source import Source
from tensegra.viewer.source import script, stylesheet

__all__ = ["application", "is_loopback", "serve"]

logger = logging.getLogger(__name__)

MOST_WAITING = 32
"""Messages other than moves that may wait for their answer; a page that sends more is cut off."""

LONGEST_MESSAGE = 1 << 20
"""Bytes of a message from a page."""

MOST_PAGES = 16
"""Pages at once: each keeps a structure and its solvers."""

PARTS = ("talk", "inputs", "told", "campaign", "edit", "studio")
"""The files of ``browser/`` that are joined with the viewer."""

HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
}
"""Nothing from elsewhere is loaded or asked, and no other page frames this one."""


def is_loopback(host: str) -> bool:
    """Tell whether an address is this machine's own, so that only its users reach it."""
    if host == "localhost":
        return True
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


class Line:
    """What a page has said and not been answered yet, in order.

    A move that follows a move takes its place: nothing queues behind a hand.
    """

    def __init__(self) -> None:
        self._waiting: deque[dict[str, Any]] = deque()
        self._wakes = asyncio.Event()

    def put(self, message: dict[str, Any]) -> bool:
        """Add a message; False where too many wait."""
        last = self._waiting[-1] if self._waiting else {}
        if message.get("type") == last.get("type") == "move":
            older, newer = last.get("values"), message.get("values")
            if isinstance(older, dict) and isinstance(newer, dict):
                message = message | {"values": older | newer}
            self._waiting[-1] = message
        elif len(self._waiting) >= MOST_WAITING:
            return False
        else:
            self._waiting.append(message)
        self._wakes.set()
        return True

    async def take(self) -> dict[str, Any]:
        """Return the next message to answer."""
        while not self._waiting:
            self._wakes.clear()
            await self._wakes.wait()
        return self._waiting.popleft()


async def _talk(socket: Any, source: Source) -> None:  # noqa: ANN401 - a WebSocket of an optional library
    """Answer a page until it leaves."""
    line, loop = Line(), asyncio.get_running_loop()
    # One thread a page: a solver keeps its workspace with the thread, and answers come in order.
    thread = ThreadPoolExecutor(1, thread_name_prefix="page")
    page = await loop.run_in_executor(thread, Page, source)

    async def answer() -> None:
        while True:
            message = await line.take()
            try:
                reply = await loop.run_in_executor(thread, page.answer, message)
            except Exception:  # told in the page; the server and the other pages go on
                logger.exception("a page's message could not be answered")
                reply = packed({"type": "fault", "text": "the server failed at this; its log says why"})
            await socket.send_bytes(reply)

    answering = asyncio.create_task(answer())
    try:
        async for text in socket.iter_text():
            try:
                message = json.loads(text)
            except (ValueError, RecursionError):  # no JSON, or lists within lists without end
                message = None
            if not isinstance(message, dict):
                await socket.send_bytes(packed({"type": "fault", "text": "the page sent no message"}))
            elif not line.put(message):
                break
    finally:
        answering.cancel()
        await asyncio.gather(answering, return_exceptions=True)
        thread.shutdown(wait=False, cancel_futures=True)


def application(source: Source, token: str = "", hosts: Callable[[str], bool] = is_loopback) -> Any:  # noqa: ANN401 - a Starlette
    """Return the studio as an ASGI application.

    Parameters
    ----------
    source
        What is shown.
    token
        What the page's address has to end with; none for the loopback.
    hosts
        Tells of the host that a browser names whether it is this server: another page that makes its own
        name point here is refused.
    """
    from starlette.applications import Starlette
    from starlette.requests import HTTPConnection, Request
    from starlette.responses import PlainTextResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket

    pages = 0

    def refused(asked: HTTPConnection) -> str:
        host = asked.headers.get("host", "")
        if not hosts(host.rsplit(":", 1)[0] if not host.endswith("]") else host):
            return "this server does not go by that name"
        if not secrets.compare_digest(asked.query_params.get("token", "").encode(), token.encode()):
            return "the address lacks the token that the server printed"
        return ""

    def served(kind: str, content: Callable[[], str], *, free: bool, asked: Request) -> Response:
        fault = "" if free else refused(asked)
        if fault:
            return PlainTextResponse(fault, status_code=403, headers=HEADERS)
        return Response(content(), media_type=kind, headers=HEADERS)

    async def talk(socket: WebSocket) -> None:
        nonlocal pages
        origin = socket.headers.get("origin", "").partition("//")[2]
        if refused(socket) or origin != socket.headers.get("host") or pages >= MOST_PAGES:
            await socket.close(1008)
            return
        pages += 1
        try:
            await socket.accept()
            await _talk(socket, source)
        finally:
            pages -= 1

    def route(path: str, kind: str, content: Callable[[], str], *, free: bool = True) -> Route:
        async def endpoint(asked: Request) -> Response:
            return served(kind, content, free=free, asked=asked)

        return Route(path, endpoint)

    # Scripts and styles are the same for everyone and tell nothing; the page and its socket need the token.
    return Starlette(
        routes=[
            route("/", "text/html", partial(_file, "studio.html"), free=False),
            route("/studio.js", "text/javascript", _script),
            route("/studio.css", "text/css", lambda: stylesheet() + _file("studio.css")),
            WebSocketRoute("/talk", talk),
        ]
    )


def _script() -> str:
    """Return the viewer and the page's own files as one script, each after those that it uses."""
    return "\n".join((script(), *(_file(f"{name}.js") for name in PARTS)))


def _file(name: str) -> str:
    return files("tensegra.studio").joinpath("browser", name).read_text("utf-8")


def serve(source: Source, *, host: str = "127.0.0.1", port: int = 0, opened: Callable[[str], None]) -> None:
    """Serve until interrupted.

    Parameters
    ----------
    source
        What is shown.
    host, port
        Where; any free port for 0. An address that others reach needs a token, which is made anew each time.
    opened
        Called with the page's address when it can be opened.

    Raises
    ------
    TensegraError
        Where the libraries of the extra ``studio`` are not installed, or the port is not to be had.
    """
    try:
        import starlette  # noqa: F401 - needed by `application`
        import uvicorn
        import websockets  # noqa: F401 - needed by uvicorn for the pages' sockets
    except ImportError as error:
        raise TensegraError(
            f"the studio needs {error.name}, which is not installed: pip install tensegra[studio]"
        ) from None
    import socket

    local = is_loopback(host)
    token = "" if local else secrets.token_urlsafe(24)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
    except (OSError, OverflowError) as error:
        listening.close()
        raise TensegraError.at(
            "--host, --port", f"{host}:{port}", f"an address to be had ({error})"
        ) from None
    config = uvicorn.Config(
        application(source, token, is_loopback if local else lambda _: True),
        log_level="warning",
        lifespan="off",
        ws="websockets-sansio",
        ws_max_size=LONGEST_MESSAGE,
    )
    name = f"[{host}]" if ":" in host else host
    address = f"http://{name}:{listening.getsockname()[1]}/{f'?token={token}' if token else ''}"

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            opened(address)

    try:
        Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        listening.close()
