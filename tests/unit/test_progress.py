from tensegra.progress import SECONDS_BETWEEN_LINES, _bars, _lines


def told(calls):
    """Return the lines that calls (time, task, done, total, note) lead to."""
    written = []
    times = iter([call[0] for call in calls])
    listener = _lines(written.append, lambda: next(times))
    for call in calls:
        listener(*call[1:])
    return written


def test_the_first_and_the_last_state_of_a_task_are_written_and_the_last_only_once():
    calls = [
        (0.0, "runs", 0, 9, ""),
        (1.0, "runs", 5, 9, ""),
        (2.0, "runs", 9, 9, ""),
        (3.0, "runs", 9, 9, ""),
    ]
    assert told(calls) == ["runs: 0 of 9\n", "runs: 9 of 9\n"]


def test_a_long_task_is_told_of_now_and_then():
    step = 0.6 * SECONDS_BETWEEN_LINES
    calls = [(i * step, "runs", i, 100, "1 failed") for i in range(5)]
    lines = told(calls)
    assert lines[0] == "runs: 0 of 100, 1 failed\n"
    # A run in six seconds.
    assert lines[1:] == [f"runs: {i} of 100, 1 failed, 0.167/s, {6 * (100 - i)} s left\n" for i in (2, 4)]


def test_the_pace_is_that_of_this_time_alone():
    calls = [(0.0, "runs", 50_000, 100_000, ""), (20.0, "runs", 90_000, 100_000, "")]
    assert told(calls)[-1] == "runs: 90000 of 100000, 2000/s, 5 s left\n"


def test_few_parts_have_no_pace():
    calls = [(0.0, "surrogates", 0, 3, ""), (20.0, "surrogates", 2, 3, "gpr")]
    assert told(calls)[-1] == "surrogates: 2 of 3, gpr\n"


def test_a_task_of_unknown_length_is_counted():
    assert told([(0.0, "search", 7, 0, "")]) == ["search: 7\n"]


def test_a_terminal_shows_bars_from_the_first_call_on(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # lets what is no terminal be taken for one
    monkeypatch.setenv("COLUMNS", "120")
    with _bars() as listener:
        listener("kernels", 0, 1, "compiled once")
        listener("runs", 0, 9)
        listener("runs", 9, 9, "[1] failed")
    shown = capsys.readouterr().err
    assert "compiled once" in shown
    assert "9/9" in shown
    assert "[1] failed" in shown
