"""Tables on a terminal: numbers are whole, whatever the width."""

import pytest

from tensegra import terminal
from tensegra.report.tables import Table

COLUMNS = 9
TABLE = Table.of(
    "Wide",
    ("Output", *(f"Quantity {i}" for i in range(COLUMNS))),
    [(f"output_{row}", *(f"-{row}.{i}23456e-{i}7" for i in range(COLUMNS))) for row in range(3)],
    "s" + "r" * COLUMNS,
    "a note",
)


@pytest.mark.parametrize("width", ["40", "80", "200", "0", "-3", "x"])
def test_no_number_is_cut(monkeypatch, capsys, width):
    monkeypatch.setenv("COLUMNS", width)
    terminal.print_table(TABLE)
    out = capsys.readouterr().out
    for row in TABLE.rows:
        assert all(cell in out for cell in row)
    assert "…" not in out
    assert out.count("Wide") == out.count("a note") == 1
    if width in {"40", "80", "200"}:
        assert max(map(len, out.splitlines())) <= int(width)


def test_the_first_column_stands_in_every_part():
    parts = terminal.fitting_parts(TABLE, 60)
    assert len(parts) > 1
    assert all(part.header[0] == "Output" for part in parts)
    assert [name for part in parts for name in part.header[1:]] == list(TABLE.header[1:])
    assert terminal.fitting_parts(TABLE, 500) == [TABLE]
