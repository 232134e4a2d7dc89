"""Addresses of schedulers, what answers there, and whether the workers have the driver's code."""

import logging
import socket
import threading

import pytest

from tensegra.errors import StudyError
from tensegra.study.code import digest_of_code
from tensegra.study.executors import executor_for
from tensegra.study.scheduler import quiet_logs, require_address, require_scheduler

distributed = pytest.importorskip("distributed")

PATIENCE = 1.0
"""Seconds; enough for an answer from this machine."""


@pytest.fixture
def serve():
    """Return a function that opens a port which answers everybody with the same bytes."""
    sockets = []

    def start(answer):
        listener = socket.create_server(("127.0.0.1", 0))
        sockets.append(listener)

        def answer_all():
            while True:
                try:
                    connection, _ = listener.accept()
                except OSError:
                    return
                sockets.append(connection)
                connection.sendall(answer)

        threading.Thread(target=answer_all, daemon=True).start()
        return listener.getsockname()[1]

    yield start
    for each in sockets:
        each.close()


@pytest.mark.parametrize(
    "address", ["tcp://node7:8786", "node7:8786", "tls://10.0.0.1:1", "tcp://[::1]:8786"]
)
def test_an_address_has_a_host_and_a_port(address):
    require_address(address)
    assert executor_for(scheduler=address).scheduler == address


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("", "found '', expected the address of a Dask scheduler, such as tcp://node7:8786"),
        ("tcp://node7", "a port from 1 to 65535"),
        ("node7", "a port from 1 to 65535"),
        ("tcp://node7:0", "a port from 1 to 65535"),
        ("tcp://node7:99999", "a port from 1 to 65535"),
        ("http://node7:8787", "expected the address of a Dask scheduler"),
        ("tcp://node7:8786/status", "expected the address of a Dask scheduler"),
        ("tcp://no de:8786", "expected the address of a Dask scheduler"),
    ],
)
def test_what_cannot_be_an_address_is_refused_at_once(address, told):
    with pytest.raises(StudyError) as refusal:
        executor_for(scheduler=address)
    assert told in str(refusal.value)


@pytest.mark.parametrize(
    "answer", [b"", b"SSH-2.0-OpenSSH_9.0\r\n", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(64), b"\xff" * 64]
)
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_port_that_serves_something_else_is_refused_with_patience(serve, answer):
    with pytest.raises(StudyError, match="no Dask scheduler answers") as refusal:
        require_scheduler(f"tcp://127.0.0.1:{serve(answer)}", PATIENCE)
    assert "\n" not in str(refusal.value)


def test_a_tls_address_without_certificates_is_refused(serve):
    with pytest.raises(StudyError, match=r"no Dask scheduler answers .*TLS"):
        require_scheduler(f"tls://127.0.0.1:{serve(b'')}", PATIENCE)


class Client:
    """Answers what each worker is asked with the same."""

    def __init__(self, answer):
        self.answer, self.asked = answer, []

    def nthreads(self):
        return {"tcp://a": 2, "tcp://b": 1}

    def run(self, function, text, *, workers, on_error):
        assert (function, on_error) == (eval, "return")
        self.asked += workers
        return dict.fromkeys(workers, self.answer if self.answer != "same" else function(text))


def test_workers_with_the_same_code_are_asked_once():
    client, known = Client("same"), set()
    dask = executor_for(scheduler="tcp://node7:8786")
    assert [dask._slots(client, known) for _ in range(3)] == [3, 3, 3]
    assert client.asked == ["tcp://a", "tcp://b"]


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (
            ModuleNotFoundError("No module named 'tensegra'"),
            "worker tcp://a: cannot import .*No module named",
        ),
        ("0" * 64, "worker tcp://a: has another code of tensegra than the driver"),
    ],
)
def test_a_worker_that_would_do_otherwise_is_named(answer, told):
    with pytest.raises(StudyError, match=told):
        executor_for(scheduler="tcp://node7:8786")._slots(Client(answer), set())


def test_a_worker_that_is_gone_is_no_matter():
    assert executor_for(scheduler="tcp://node7:8786")._slots(Client(OSError("gone")), set()) == 3


def test_a_task_on_other_code_is_not_done():
    from tensegra.study.cluster import _carry_out

    assert _carry_out(abs, -1, digest_of_code()) == 1
    with pytest.raises(StudyError, match="another code"):
        _carry_out(abs, -1, "0" * 64)


def test_other_libraries_are_silent_unless_all_is_asked_for(caplog):
    ours = logging.getLogger("tensegra")
    with quiet_logs():
        logging.getLogger("distributed.core").error("a traceback")
    assert not caplog.records
    caplog.set_level(logging.DEBUG, "tensegra")
    with quiet_logs():
        assert logging.getLogger("distributed.core").getEffectiveLevel() <= logging.CRITICAL
    assert ours.isEnabledFor(logging.DEBUG)
