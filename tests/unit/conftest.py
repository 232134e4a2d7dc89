"""What tests of the command line share."""

import pytest

from tensegra.cli import main


@pytest.fixture
def tensegra(capsys):
    """Run a command; return its exit code, stdout and stderr."""

    def run(*arguments):
        with pytest.raises(SystemExit) as left:
            main(list(map(str, arguments)))
        captured = capsys.readouterr()
        return left.value.code or 0, captured.out, captured.err

    return run
