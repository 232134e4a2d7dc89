from tensegra.progress import SECONDS_BETWEEN_LINES, _lines


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
    assert told(calls) == [f"runs: {i} of 100, 1 failed\n" for i in (0, 2, 4)]


def test_a_task_of_unknown_length_is_counted():
    assert told([(0.0, "search", 7, 0, "")]) == ["search: 7\n"]
