"""The cache on disk: a compiled kernel is fresh as long as nothing that it takes in has changed."""

import ast
import re
import subprocess
import sys

import pytest

from tensegra.mechanics import certify, compiled, descend, follow, kernels, stepped

KERNELS = [
    kernels.factorise,
    follow.follow_runs,
    stepped.step_runs,
    descend.fall_runs,
    certify.certify_runs,
]


@pytest.mark.parametrize("kernel", KERNELS, ids=lambda kernel: kernel.__name__)
def test_every_kernel_is_stamped_with_all_sources(kernel):
    assert compiled.DIGEST in kernel._cache._cache_file._source_stamp


def test_every_file_of_kernels_is_watched():
    folder = compiled.KERNEL_FILES[0].parent
    uses = {
        file
        for file in folder.glob("*.py")
        if re.search(r"^@(njit|intrinsic)", file.read_text(), re.MULTILINE)
    }
    assert uses <= set(compiled.KERNEL_FILES)
    assert all(file.is_file() for file in compiled.KERNEL_FILES)


def test_what_is_compiled_in_from_other_files_is_watched_too():
    # Constants and tuples that a kernel takes in are as fixed in it as its own lines.
    watched = {file.stem for file in compiled.KERNEL_FILES}
    for file in compiled.KERNEL_FILES:
        tree = ast.parse(file.read_text())
        compiled_lines = [
            node for node in tree.body if isinstance(node, ast.FunctionDef) and node.decorator_list
        ]
        used = {name.id for node in compiled_lines for name in ast.walk(node) if isinstance(name, ast.Name)}
        for node in tree.body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tensegra.mechanics"):
                for alias in node.names:
                    if (alias.asname or alias.name) in used:
                        module = node.module.removeprefix("tensegra.mechanics").lstrip(".") or alias.name
                        assert module in watched, f"{file.stem} compiles {alias.name} of {module} in"


def test_the_digest_changes_with_any_file(tmp_path):
    files = [tmp_path / name for name in ("a.py", "b.py")]
    for file in files:
        file.write_text("x = 1\n")
    before = compiled.digest_of(files)
    assert compiled.digest_of(files) == before
    files[1].write_text("x = 2\n")
    assert compiled.digest_of(files) != before


SCRIPT = """
import sys
from tensegra.mechanics import compiled
compiled.DIGEST = sys.argv[1]
from pathlib import Path
sys.path.insert(0, sys.argv[2])
import kernel
kernel.twice(1.0)
print(sum(kernel.twice.stats.cache_hits.values()))
"""


def test_a_kernel_is_compiled_again_once_the_digest_differs(tmp_path):
    source = "from tensegra.mechanics.compiled import njit\n\n@njit\ndef twice(x):\n    return 2.0 * x\n"
    (tmp_path / "kernel.py").write_text(source)

    def hits(digest):
        command = [sys.executable, "-c", SCRIPT, digest, str(tmp_path)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - our own script
        return int(done.stdout)

    assert [hits("one"), hits("one"), hits("two"), hits("two")] == [0, 1, 0, 1]


@pytest.fixture
def _said_anew():
    """Let what is said once be said again."""
    compiled._say_uncached.cache_clear()
    yield
    compiled._say_uncached.cache_clear()


@pytest.mark.usefixtures("_said_anew")
def test_without_a_folder_to_write_kernels_are_compiled_and_not_kept(monkeypatch, caplog):
    # What Numba does for a user without a home, where the package cannot be written either.
    monkeypatch.setattr("numba.core.caching.CacheImpl._locator_classes", [])
    doubled = compiled.njit(lambda x: 2 * x)
    tripled = compiled.njit(lambda x: 3 * x)
    assert (doubled(2.0), tripled(2.0)) == (4.0, 6.0)
    assert [record.message.count("not kept") for record in caplog.records] == [1]


@pytest.mark.usefixtures("_said_anew")
def test_a_full_disk_keeps_no_kernel_and_stops_nothing(monkeypatch, caplog):
    def full(*_):
        raise OSError(28, "No space left on device")

    doubled = compiled.njit(_doubled)
    monkeypatch.setattr(doubled._cache, "save_overload", compiled._forgiving(full))
    monkeypatch.setattr(doubled._cache, "load_overload", lambda *_: None)
    assert doubled(2.0) == 4.0
    assert "no space left on device" in caplog.text


def _doubled(x):
    return 2 * x
