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


def test_files_that_are_named_exist():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (ROOT / link).is_file(), link
    scripts = re.findall(r"^    (scripts/\w+)", text, re.MULTILINE)
    assert len(scripts) == 2
    for script in scripts:
        assert (ROOT / script).stat().st_mode & 0o111, script


def test_the_page_is_two_sentences_a_picture_two_commands_twelve_lines_and_six_links():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    title, sentences, picture, commands, *_ = re.sub(r"```python\n.*?```", "", text, flags=re.DOTALL).split(
        "\n\n"
    )
    assert title == "# tensegra"
    assert len(re.findall(r"\.(?:\s|$)", sentences)) == 2
    assert picture.startswith("![")
    assert len(commands.splitlines()) == 2
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line]) <= 12
    assert len(re.findall(r"(?<!!)\[[^]]+\]\(", text)) == 6


COMMANDS = sorted(
    {
        command
        for page in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
        if "_build" not in page.parts
        for command in re.findall(r"^ *(tensegra [a-z].*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    }
)


def test_commands_and_options_that_pages_show_exist(capsys):
    names = {command.split()[1] for command in COMMANDS}
    assert {"check", "solve", "run", "report", "import", "export", "studio"} <= names
    for name in sorted(names):
        with pytest.raises(SystemExit) as left:
            main([name, "--help"])
        assert not left.value.code, name
        told = capsys.readouterr().out
        for command in COMMANDS:
            if command.split()[1] == name:
                shown = command.partition("#")[0].partition("&&")[0].partition("&gt;")[0]
                for option in re.findall(r"(?<= )--?[a-z][\w-]*", shown):
                    assert option in told, command
