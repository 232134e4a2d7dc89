"""Whatever a file holds, a command ends in exit 0, 1 or 2, with one line where it is refused, and in time."""

import contextlib
import faulthandler
import io
import json
import os
import signal
import tempfile
from collections import Counter
from pathlib import Path

import hostile
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tensegra import cli

LIMIT = 30.0
"""Seconds of the processor for one file, which other programs on the machine do not make longer."""

LAST_RESORT = 600.0
"""Seconds on the clock after which a call that no signal can interrupt ends the process, with a traceback."""

FEW, MANY = 60, 10_000
"""Examples in the plain suite and in the slow one, for each way to spoil a file."""


class TooSlowError(BaseException):
    """Not caught by anything that looks for errors of a file."""


def _stop(*_):
    raise TooSlowError


def answer(*arguments):
    """Run a command within the limit of time; return its exit code, stdout and stderr."""
    out, err = io.StringIO(), io.StringIO()
    faulthandler.dump_traceback_later(LAST_RESORT, exit=True)
    signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            cli.main([*map(str, arguments)])
    except TooSlowError:
        raise AssertionError(f"more than {LIMIT} s") from None
    except SystemExit as left:
        return left.code or 0, out.getvalue(), err.getvalue()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    raise AssertionError("it has not left")


def ends_well(code, out, err):
    """Whether a command ended as it should."""
    if code == 2:
        return out == "" and err.startswith("tensegra: error: ") and err.count("\n") == 1
    return code in {0, 1} and "Traceback" not in err


def try_file(name, text, *commands):
    """Run commands on a file, alone in a folder; nothing may appear outside it. Return the exit codes."""
    codes = []
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        os.mkdir("inner")  # noqa: PTH102 - as short as its neighbours
        with contextlib.chdir("inner"):
            Path(name).write_text(text, encoding="utf-8", errors="surrogatepass")
            for command, *options in commands:
                ended = answer(command, name, *options)
                assert ends_well(*ended), (command, ended, text)
                codes.append(ended[0])
        assert os.listdir(".") == ["inner"]  # noqa: PTH208 - names, as they are
    return codes


def fuzzed(n_examples):
    """Return the settings of a fuzzer; the limit of time is ours, for the machine may be busy."""
    return settings(
        max_examples=n_examples,
        deadline=None,
        suppress_health_check=[*HealthCheck],
        derandomize=n_examples == FEW,
        database=None,
    )


STRUCTURE = (["check", "--json"], ["solve", "-a", "A=0.02"])
STUDY = (["check", "--json"], ["design", "-o", "x.csv"])
RUN = (["check"], ["run", "-o", "c", "--json"], ["status", "--json"])

CASES = {
    "structures by their schema": (hostile.structures, STRUCTURE),
    "studies by their schema": (hostile.studies, STUDY),
    "structures with some values spoilt": (hostile.spoilt(hostile.STRUCTURE), STRUCTURE),
    "studies with some values spoilt": (hostile.spoilt(hostile.STUDY), STUDY),
}
TEXTS = {
    "texts of structures": (hostile.spoilt_texts(hostile.STRUCTURE), STRUCTURE[:1]),
    "texts of studies": (hostile.spoilt_texts(hostile.STUDY), STUDY[:1]),
}


def warm():
    """Run every command once on the sound files, in this folder and without a limit."""
    for content, commands in ((hostile.STRUCTURE, STRUCTURE), (hostile.STUDY, (*STUDY, RUN[1]))):
        Path("file.json").write_text(json.dumps(content), encoding="utf-8")
        for command, *options in commands:
            with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
                cli.main([command, "file.json", *options])


def as_text(content):
    return content if isinstance(content, str) else json.dumps(content)


def fuzz(case, n_examples):
    """Try so many files of a case; return how many commands answered, and how many refused."""
    strategy, commands = (CASES | TEXTS)[case]
    tally = Counter()

    @fuzzed(n_examples)
    @given(strategy, st.sampled_from([".json", ".yaml"]))
    def every_file_ends_well(content, suffix):
        tally.update(try_file(f"file{suffix}", as_text(content), *commands))

    every_file_ends_well()
    return tally[0] + tally[1], tally[2]


def test_the_files_that_are_spoilt_are_sound_themselves():
    try_file("a.json", json.dumps(hostile.STRUCTURE), *STRUCTURE)
    for content, commands in ((hostile.STRUCTURE, STRUCTURE), (hostile.STUDY, STUDY)):
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            Path("a.json").write_text(json.dumps(content), encoding="utf-8")
            assert [answer(command, "a.json", *options)[0] for command, *options in commands] == [0, 0]


@pytest.mark.parametrize("case", [*CASES, *TEXTS])
def test_some_files_end_well(case):
    answered, refused = fuzz(case, FEW)
    assert answered + refused >= FEW
    assert refused > 0
    # What is drawn from a schema alone fits together by chance only; what is spoilt is often sound still.
    assert answered > 0 or "schema" in case


@pytest.mark.slow
@pytest.mark.parametrize("case", [*CASES, *TEXTS])
def test_many_files_end_well(case):
    answered, refused = fuzz(case, MANY)
    assert answered + refused >= MANY
    assert answered > 0 or "schema" in case


@pytest.mark.slow
def test_runs_of_spoilt_studies_end_well():
    @fuzzed(300)
    @given(hostile.spoilt(hostile.STUDY))
    def every_run_ends_well(content):
        try_file("study.json", json.dumps(content), RUN[0])
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            Path("study.json").write_text(json.dumps(content), encoding="utf-8")
            code, _, err = answer("run", "study.json", "-o", "c", "--json")
            assert code in {0, 1} or err.splitlines()[-1].startswith("tensegra: error: "), content
            if Path("c/manifest.json").exists():
                assert answer("status", "c", "--json")[0] == 0
                assert answer("report", "c")[0] in {0, 2}

    every_run_ends_well()
