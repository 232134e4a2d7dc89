"""A browser and the studio's server. Debian's Chromium is installed where it is missing and can be had."""

import os
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

ARGUMENTS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")
"""WebGL without a graphics card; the sandbox needs rights that a container does not give."""

SCREENSHOTS = "TENSEGRA_SCREENSHOTS"
"""Folder to which the pictures of the documentation go, if it is set: docs/images."""

PATIENCE = 60_000
"""Milliseconds for what a busy machine does late; nothing waits so long that is well."""

START = "from tensegra.cli import main; main()"


@pytest.fixture(scope="session")
def chromium():
    """Return Debian's Chromium, installed by apt if need be; skip where there is none to be had."""
    found = shutil.which("chromium") or _installed()
    if found is None:
        pytest.skip("there is no Chromium, and apt-get cannot install it here")
    return found


def _installed():
    """Install Chromium, one process at a time: several workers ask at once."""
    apt = shutil.which("apt-get")
    if apt is None or not hasattr(os, "geteuid") or os.geteuid() != 0:
        return None
    import fcntl

    with (Path(tempfile.gettempdir()) / "tensegra-tests-apt.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if shutil.which("chromium") is None:
            quiet = {"env": {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}, "capture_output": True}
            subprocess.run([apt, "update", "-q"], check=False, **quiet)  # noqa: S603
            command = [apt, "install", "-q", "-y", "--no-install-recommends", "chromium", "fonts-dejavu-core"]
            subprocess.run(command, check=False, **quiet)  # noqa: S603
    return shutil.which("chromium")


@pytest.fixture(scope="module")
def browser(chromium):
    """Return a browser, while the tests of a file run: its driver keeps a loop of events that others need."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield opened
        opened.close()


class Watched:
    """A page that is listened to: what it asks for, and what goes wrong in it."""

    def __init__(self, page):
        self.page, self.requests, self.faults = page, [], []
        page.set_default_timeout(PATIENCE)
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("websocket", lambda socket: self.requests.append(socket.url))
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("console", lambda said: self.faults.append(said.text) if said.type == "error" else None)

    def strangers(self, host):
        """Return what was asked of other hosts; data and blobs are of the page itself."""
        return [
            url
            for url in self.requests
            if urlsplit(url).scheme not in {"data", "blob"} and urlsplit(url).netloc != host
        ]

    def picture(self, name, **options):
        """Keep a screenshot for the documentation, where it is asked for."""
        folder = os.environ.get(SCREENSHOTS)
        if folder:
            self.page.screenshot(path=Path(folder) / f"{name}.png", **options)


@pytest.fixture
def opened(browser):
    """Return a function that opens an address in a page of its own; the page has to stay without fault."""
    contexts, pages = [], []

    def open_page(address, **options):
        context = browser.new_context(viewport={"width": 1400, "height": 860}, **options)
        contexts.append(context)
        watched = Watched(context.new_page())
        pages.append(watched)
        watched.page.goto(address)
        return watched

    yield open_page
    faults = [fault for watched in pages for fault in watched.faults]
    for context in contexts:
        context.close()
    assert faults == []


@pytest.fixture(scope="session")
def command_line():
    """Return a function that runs a command and returns what it prints."""

    def run(*arguments):
        command = [sys.executable, "-c", START, *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout  # noqa: S603

    return run


@pytest.fixture(scope="session")
def running():
    """Return a context that runs the studio's command and gives its address."""
    return _running


@contextmanager
def _running(*arguments):
    command = [sys.executable, "-c", START, "studio", *arguments, "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:  # noqa: S603
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
            process.wait()


@pytest.fixture(scope="module")
def beam_studio():
    with _running("library:paper_beam") as address:
        yield address


@pytest.fixture
def studio(opened):
    """Return a function that opens a studio's page and waits for its structure."""

    def open_studio(address, **options):
        watched = opened(address, **options)
        watched.page.wait_for_selector("body[data-ready]")
        return watched

    return open_studio
