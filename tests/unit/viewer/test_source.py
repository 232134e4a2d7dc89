"""The viewer's files are joined to one script, and what a page holds cannot break out of it."""

import re

from tensegra.structure import library
from tensegra.viewer import panel, scene
from tensegra.viewer.source import MODULES, part, script

DECLARED = re.compile(r"^(?:export )?(?:const|let|class|function|async function) (\w+)", re.MULTILINE)


def test_the_script_imports_and_exports_nothing():
    assert not re.search(r"^(import|export)\b", script(), re.MULTILINE)
    assert "function mount(" in script()
    # It stands within a script element of a report.
    assert "</script" not in script()
    assert "<!--" not in script()


def test_each_file_stands_after_those_that_it_imports():
    for place, name in enumerate(MODULES):
        imported = re.findall(r'from "\./([a-z]+)\.js"', part(name))
        assert all(MODULES.index(other) < place for other in imported), name


def test_no_name_stands_in_two_files():
    names = [
        name
        for module in MODULES
        for name in re.findall(
            r"^(?:export )?(?:const|let|class|function|async function) (\w+)", part(module), re.MULTILINE
        )
    ]
    assert len(names) == len(set(names))


def test_nothing_is_loaded_from_elsewhere():
    addresses = set(re.findall(r"https?://[^\s\"'`]+", script()))
    assert addresses == {"http://www.w3.org/2000/svg"}  # a name of a language, which nothing asks for


def test_a_name_cannot_end_the_script():
    structure = library.prism().replace(name="</script><script>alert(1)</script>")
    html = panel(scene(structure), "x")
    assert html.count("</script>") == 1
