from importlib.metadata import EntryPoint

import pytest

from tensegra import commands
from tensegra.cli import main

CALLED: list[int] = []


def added(times: int = 1) -> None:
    """Do what another package does."""
    CALLED.append(times)


@pytest.fixture
def offered(monkeypatch):
    """Let the command line see one command of another package."""

    def offer(name, value):
        entry = EntryPoint(name, value, commands.GROUP)
        monkeypatch.setattr(
            commands, "entry_points", lambda name=entry.name, **_: [entry] if name == entry.name else []
        )

    return offer


@pytest.fixture
def run(capsys):
    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main([*arguments])
        return left.value.code, *capsys.readouterr()

    return run


def test_a_command_of_another_package_is_called_with_its_options(offered, run, monkeypatch):
    offered("again", "another:added")
    monkeypatch.setattr(EntryPoint, "load", lambda _: added)
    CALLED.clear()
    code, _, _ = run("again", "--times", "3")
    assert (code, CALLED) == (0, [3])
    assert "Do what another package does." in run("--help")[1]


def test_a_command_that_cannot_be_loaded_says_so_and_spoils_no_other(offered, run):
    offered("again", "no_such_package.command:again")
    code, _, err = run("again")
    assert code == 2
    assert "the command 'again' of 'no_such_package.command:again' cannot be loaded" in err
    assert "No module named 'no_such_package'" in err
    code, out, _ = run("--help")
    assert code == 0
    assert "solve" in out


def test_a_command_of_ours_is_not_replaced(offered, run):
    offered("solve", "no_such_package.command:solve")
    assert "Follow a structure" in run("solve", "--help")[1]


def test_help_of_the_library_loads_no_other_package(offered, run):
    offered("again", "no_such_package.command:again")
    assert run("check", "--help")[0] == 0
