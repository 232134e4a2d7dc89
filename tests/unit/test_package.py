import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tensegra as tg

HEAVY = (
    "scipy",
    "numba",
    "pandas",
    "pyarrow",
    "jax",
    "sklearn",
    "hdbscan",
    "SALib",
    "matplotlib",
    "pint",
    "rich",
)


@pytest.mark.parametrize("name", tg.__all__)
def test_every_name_is_there(name):
    assert getattr(tg, name) is not None
    assert name in dir(tg)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'solve_paths'"):
        _ = tg.solve_paths


def test_import_loads_nothing_heavy():
    code = f"import sys, tensegra; print([name for name in {HEAVY} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603
    assert ran.stdout.strip() == "[]"


def test_parsing_a_command_loads_nothing_heavy():
    code = (
        "import sys, tensegra.cli\n"
        "try: tensegra.cli.main(['--version'])\n"
        "except SystemExit: pass\n"
        f"print([name for name in {HEAVY[:-1]} if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603
    assert ran.stdout.splitlines()[-1] == "[]"


def test_reading_a_structure_file_loads_nothing_heavy(tmp_path):
    tg.library.prism().save(tmp_path / "a.yaml")
    code = (
        "import sys, tensegra as tg\n"
        f"tg.read_structure({str(tmp_path / 'a.yaml')!r})\n"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603
    assert ran.stdout.strip() == "[]"


def test_the_package_lists_what_it_offers_and_nothing_else():
    assert dir(tg) == sorted(tg.__all__)
    assert not {"Any", "TYPE_CHECKING", "present_by", "presented"} & set(dir(tg))


def test_names_are_the_same_objects_as_at_home():
    from tensegra.mechanics import self_stress
    from tensegra.structure import Member
    from tensegra.surrogate import load

    assert (tg.self_stress, tg.Member, tg.load_surrogate) == (self_stress, Member, load)


def test_the_names_of_pages_and_examples_are_offered():
    root = Path(__file__).parents[2]
    pages = [root / "README.md", *(root / "docs").glob("*.md"), *(root / "examples").glob("*.py")]
    used = {name for page in pages for name in re.findall(r"\btg\.(\w+)", page.read_text(encoding="utf-8"))}
    for example in (root / "examples").glob("*.py"):
        for node in ast.walk(ast.parse(example.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tensegra"):
                used |= {alias.name for alias in node.names}
    assert used
    assert used <= set(tg.__all__)
