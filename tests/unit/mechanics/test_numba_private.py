"""What we lean on inside Numba: each test names a part, and fails where a new version has changed it."""

import ast
import re
import tomllib
from pathlib import Path

import numba as nb
import numpy as np
import pytest
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from packaging.requirements import Requirement

from tensegra.mechanics import compiled, lanes, numba_private

ROOT = Path(__file__).parents[3]
INSIDE = re.compile(r"^(numba\.(?!extending$|types$)|llvmlite(?!\.ir$))")
"""Modules that Numba and llvmlite do not promise to keep; `llvmlite.ir` is the public builder of code."""


def imported(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            # `from llvmlite import ir` imports llvmlite.ir.
            whole = node.module in {"llvmlite", "numba"}
            yield from (f"{node.module}.{alias.name}" if whole else node.module for alias in node.names)


def test_no_other_file_takes_anything_from_inside():
    leaning = {
        file.name
        for file in (ROOT / "src").rglob("*.py")
        if any(INSIDE.match(name) for name in imported(ast.parse(file.read_text(encoding="utf-8"))))
    }
    assert leaning == {"numba_private.py"}


@pytest.mark.parametrize("part", ["make_array", "get_dummy_value", "_cache", "_source_stamp", "cgutils"])
def test_no_other_file_uses_these_by_name(part):
    used = {
        file.name
        for file in (ROOT / "src/tensegra/mechanics").glob("*.py")
        if re.search(rf"\b{part}\b", file.read_text(encoding="utf-8"))
    }
    assert used == {"numba_private.py"}


def test_the_version_is_one_that_has_been_tried():
    content = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (numba,) = (r for r in map(Requirement, content["project"]["dependencies"]) if r.name == "numba")
    assert any(bound.operator == "<" for bound in numba.specifier)
    assert nb.__version__ in numba.specifier


def test_a_cache_on_disk_compares_a_stamp_that_can_be_set():
    kernel = nb.njit(cache=True)(_one_more)
    saved = []
    assert numba_private.watch_cache(kernel, "stamp", lambda save: lambda *what: saved.append(save(*what)))
    index = kernel._cache._cache_file
    assert index._source_stamp == "stamp"
    kernel(1.0)
    assert len(saved) == kernel.stats.cache_misses[kernel.signatures[0]] == 1
    assert b"stamp" in Path(index._index_path).read_bytes()
    again = nb.njit(cache=True)(_one_more)
    assert numba_private.watch_cache(again, "another", lambda save: save)
    again(1.0)
    assert not again.stats.cache_hits
    Path(index._index_path).unlink()


def _one_more(x):
    return x + 1.0


@pytest.mark.parametrize("missing", ["_cache", "_cache_file", "_source_stamp", "save_overload"])
def test_a_cache_that_cannot_be_watched_is_not_used(missing, monkeypatch, caplog):
    class Other:
        """A dispatcher of a Numba that has renamed one of its parts."""

        def __init__(self):
            self._cache = self if missing != "_cache" else None
            for name in {"_cache_file", "save_overload"} - {missing}:
                setattr(self, name, self)
            if missing != "_source_stamp":
                self._source_stamp = ""

    other = object() if missing == "_cache" else Other()
    assert not numba_private.watch_cache(other, "stamp", lambda save: save)

    monkeypatch.setattr(compiled, "watch_cache", lambda *_: False)
    compiled._say_uncached.cache_clear()
    kernel = compiled.njit(_one_more)
    compiled._say_uncached.cache_clear()
    assert kernel(1.0) == 2.0
    assert not kernel.stats.cache_path
    assert "keeps them in a way" in caplog.text


def test_an_array_gives_its_first_element():
    @intrinsic
    def first(_typing, array):
        def generate(context, builder, signature, arguments):
            return builder.load(numba_private.first_element(context, builder, signature.args[0], *arguments))

        return types.float64(array), generate

    assert nb.njit(lambda array: 1.0 * first(array))(np.array([3.0, 4.0])[1:]) == 4.0


def test_a_function_of_llvm_is_called_by_name():
    @intrinsic
    def truncated(_typing, value):
        def generate(_context, builder, _signature, arguments):
            kind = ir.DoubleType()
            return numba_private.call_function(
                builder, ir.FunctionType(kind, [kind]), "llvm.trunc.f64", arguments
            )

        return types.float64(value), generate

    assert nb.njit(lambda value: 1.0 * truncated(value))(-2.75) == -2.0


def test_what_returns_nothing_returns_none():
    @intrinsic
    def idle(_typing):
        return types.void(), lambda context, *_: numba_private.nothing(context)

    def work():
        return idle()

    assert nb.njit(work)() is None


@pytest.mark.parametrize("operator", ["+", "-", "*", "/"])
def test_operators_are_typed_for_packs_and_for_floats_beside_them(operator):
    width = lanes.WIDTH
    load, store = lanes.load, lanes.store
    scope = {"load": load, "store": store}
    text = f"def work(a, b, c):\n    store(c, 0, (load(a, 0) {operator} load(b, 0)) {operator} 0.5)\n"
    exec(text, scope)  # noqa: S102 - one source, four operators
    a, b, c = np.arange(1.0, width + 1)[None], np.full((1, width), 3.0), np.zeros((1, width))
    nb.njit(scope["work"])(a, b, c)
    expected = eval(f"(a {operator} b) {operator} 0.5")  # noqa: S307 - as above
    assert np.array_equal(c, expected)


def test_a_pack_beside_what_it_does_not_know_is_refused():
    with pytest.raises(nb.TypingError, match="No implementation of function"):
        nb.njit(lambda array: lanes.load(array, 0) + "text")(np.zeros((1, lanes.WIDTH)))
