import re
from pathlib import Path

import pytest

from tensegra.cli import main

ROOT = Path(__file__).parents[2]


def blocks(language, page="README.md"):
    """Return the code blocks of a page in a language."""
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)


def test_the_python_example_prints_what_it_says(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    (code,) = blocks("python")
    exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - our own
    printed = capsys.readouterr().out.splitlines()
    promised = [line.partition("  # ")[2] for line in code.splitlines() if line.startswith("print(")]
    for said, found in zip(promised, printed, strict=True):
        assert not said or said == found
    assert printed[-1] == "Study('beam': A14, A23, T_top, T_middle, T_bottom → u, v, w; 1024 points)"


def test_the_page_on_mechanics_prints_what_it_says(capsys):
    (code,) = blocks("python", "docs/mechanics.md")
    exec(compile(code, "docs/mechanics.md", "exec"), {})  # noqa: S102 - our own
    printed = capsys.readouterr().out.splitlines()
    promised = [line.partition("  # ")[2] for line in code.splitlines() if line.startswith("print(")]
    assert printed == promised


def test_files_and_commands_that_are_named_exist(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / link).is_file(), link
    for script in re.findall(r"^    (scripts/\w+)", text, re.MULTILINE):
        assert (ROOT / script).stat().st_mode & 0o111, script
    for command in set(re.findall(r"^    tensegra (\w+)", text, re.MULTILINE)):
        with pytest.raises(SystemExit) as left:
            main([command, "--help"])
        assert not left.value.code
        capsys.readouterr()
