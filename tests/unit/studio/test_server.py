"""The server: who is let in, what waits, and that nothing a page says breaks it."""

import asyncio
import json
import struct
import threading
import urllib.error
import urllib.request
from contextlib import contextmanager

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tensegra.errors import TensegraError
from tensegra.structure import library
from tensegra.studio.page import Page, packed
from tensegra.studio.server import MOST_WAITING, Line, application, is_loopback, serve
from tensegra.studio.source import Source, open_source

uvicorn = pytest.importorskip("uvicorn")
client = pytest.importorskip("websockets.sync.client")
InvalidStatus = pytest.importorskip("websockets.exceptions").InvalidStatus

SOURCE = Source("library:prism", library.prism())


@contextmanager
def serving(source=SOURCE, **options):
    """Run the application in a thread of its own, on a free port."""
    server = uvicorn.Server(
        uvicorn.Config(
            application(source, **options), port=0, log_level="error", lifespan="off", ws="websockets-sansio"
        )
    )
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        assert thread.is_alive()
        threading.Event().wait(0.01)
    try:
        yield server.servers[0].sockets[0].getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()


def status(port, path="/", host=None):
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}")
    if host:
        request.add_header("Host", host)
    try:
        with urllib.request.urlopen(request) as answer:  # noqa: S310
            return answer.status, dict(answer.headers)
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code, dict(refused.headers)


def talk(port, query="", origin=None):
    origin = f"http://127.0.0.1:{port}" if origin is None else origin
    return client.connect(f"ws://127.0.0.1:{port}/talk{query}", origin=origin, proxy=None)


def heard(message):
    length = struct.unpack("<I", message[:4])[0]
    return json.loads(message[4 : 4 + length])


def test_a_page_is_served_and_asks_for_nothing_else():
    with serving() as port:
        code, headers = status(port)
        assert code == 200
        assert "default-src 'none'" in headers["content-security-policy"]
        assert status(port, "/studio.js")[0] == status(port, "/studio.css")[0] == 200
        for path in ("/etc/passwd", "/../pyproject.toml", "/%2e%2e/x", "/browser/studio.js"):
            assert status(port, path)[0] == 404
        assert status(port, host="evil.example")[0] == 403


def test_a_socket_of_another_page_is_refused():
    with serving() as port:
        for origin in ("http://evil.example", "null", "http://127.0.0.1:1"):
            with pytest.raises(InvalidStatus), talk(port, origin=origin):
                pass


def test_a_token_is_asked_for_at_the_page_and_at_its_socket():
    with serving(token="secret-ä", hosts=lambda _: True) as port:  # noqa: S106 - of this test
        assert status(port)[0] == status(port, "/?token=wrong")[0] == 403
        assert status(port, "/?token=secret-%C3%A4")[0] == 200
        with pytest.raises(InvalidStatus), talk(port):
            pass
        with talk(port, "?token=secret-%C3%A4") as socket:
            socket.send('{"type": "open"}')
            assert heard(socket.recv())["type"] == "opened"


def test_whatever_a_page_says_is_answered_and_the_next_page_goes_on():
    nonsense = [
        "",
        "[]",
        "null",
        "{",
        '{"type": []}',
        '{"type": "open", "x": ' + "[" * 100_000 + "]" * 100_000 + "}",
    ]
    wrong = {"values": 1, "nodes": 2, "search": 3, "free": 4, "change": 5}
    kinds = ("move", "undo", "watch", "load", "spread", "optimise", "edit", "unedit", "nothing")
    nonsense += [json.dumps({"type": kind, **wrong}) for kind in kinds]
    with serving() as port, talk(port) as socket:
        for text in nonsense:
            socket.send(text)
            assert heard(socket.recv())["type"] in {"fault", "opened"}
        socket.send('{"type": "open"}')
        assert heard(socket.recv())["type"] == "opened"


json_values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
kinds = st.sampled_from(
    ["open", "move", "undo", "load", "watch", "export", "file", "spread", "optimise", "edit", "unedit"]
)
fields = st.dictionaries(
    st.sampled_from(["values", "node", "nodes", "axis", "change", "given", "search", "free", "limits", "n"]),
    json_values,
)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.builds(lambda kind, said: {**said, "type": kind}, kinds, fields), max_size=4))
def test_no_message_breaks_a_page(messages):
    page = Page(SOURCE)
    for message in messages:
        assert heard(page.answer(message))["type"] != ""
    assert heard(page.answer({"type": "open"}))["type"] == "opened"


def test_moves_take_each_other_s_place_and_all_else_keeps_its_order():
    async def said():
        line = Line()
        for message in (
            {"type": "move", "values": {"a": 1}},
            {"type": "move", "values": {"a": 2, "b": 1}},
            {"type": "move", "values": {"b": 3}},
            {"type": "undo"},
            {"type": "move", "values": {"a": 9}},
        ):
            assert line.put(message)
        return [await line.take() for _ in range(3)]

    first, second, third = asyncio.run(said())
    assert first["values"] == {"a": 2, "b": 3}
    assert second == {"type": "undo"}
    assert third["values"] == {"a": 9}


def test_a_thousand_moves_wait_as_one_and_others_are_bounded():
    async def said():
        line = Line()
        assert all(line.put({"type": "move", "values": {"a": i}}) for i in range(1000))
        taken = await line.take()
        kept = [line.put({"type": "undo"}) for _ in range(MOST_WAITING + 1)]
        return taken, kept

    taken, kept = asyncio.run(said())
    assert taken["values"] == {"a": 999}
    assert kept == [True] * MOST_WAITING + [False]


def test_a_message_is_aligned_whatever_its_text():
    for name in ("", "a", "ä", "日本"):
        message = packed({"name": name}, {"x": library.prism().coordinates})
        length = struct.unpack("<I", message[:4])[0]
        assert length % 4 == 0
        assert heard(message)["name"] == name
        assert len(message) == 4 + length + 4 * library.prism().coordinates.size


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("localhost", True),
        ("::1", True),
        ("[::1]", True),
        ("0.0.0.0", False),  # noqa: S104 - a name to be judged
        ("192.168.1.2", False),
        ("localhost.evil.example", False),
        ("", False),
    ],
)
def test_only_this_machine_is_loopback(host, expected):
    assert is_loopback(host) is expected


def test_a_port_that_is_taken_is_told():
    with serving() as port, pytest.raises(TensegraError, match="an address to be had"):
        serve(SOURCE, port=port, opened=lambda _: None)


def test_what_is_no_structure_is_refused(tmp_path):
    with pytest.raises(TensegraError, match="no such file"):
        open_source(str(tmp_path / "none.yaml"))
    with pytest.raises(TensegraError):
        open_source(str(tmp_path))
