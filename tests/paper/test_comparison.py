from tensegra_paper.chapter import Agreement, Row
from tensegra_paper.comparison import HEADER, comparison_table, markdown_rows, to_markdown, verdict

ROWS = [
    Row("Fig. 14", "w for |v| <= 1", 146.85, 146.587123, "cm", Agreement.VALUE, None, "the beam | a fit"),
    Row("Fig. 5", "shapes", "two", "two", "", Agreement.FINDING, holds=True, why="as printed", claim="a"),
    Row("Eq. 12", "gap", None, 1.25e-7, "", Agreement.METHOD, holds=False, why="holds below 1e-8"),
]


def test_rows_go_to_markdown_and_back():
    text = "# Title\n\n" + to_markdown(comparison_table("All", ROWS)) + "\nmore text\n"
    back = markdown_rows(text)
    assert [tuple(cells) for cells in back] == [HEADER] * 3
    assert [cells["Quantity"] for cells in back] == ["w for |v| <= 1", "shapes", "gap"]
    assert [cells["Ours"] for cells in back] == ["146.59", "two", "1.25e-07"]
    assert [cells["Why"] for cells in back] == [row.why for row in ROWS]


def test_every_line_has_as_many_cells_as_the_header():
    lines = to_markdown(comparison_table("All", ROWS)).splitlines()[2:]
    assert {line.replace("\\|", "").count("|") for line in lines} == {len(HEADER) + 1}


def test_differences_carry_their_sign():
    table = comparison_table("All", [*ROWS, Row("a", "b", 1.0, 3.0, "", Agreement.VALUE, None, "c")])
    assert [cells[5] for cells in table.rows] == ["-0.263", "–", "–", "+2"]


def test_the_verdict_is_a_word():
    assert [verdict(row) for row in ROWS] == ["–", "yes", "no"]


def test_a_difference_by_rounding_is_none():
    table = comparison_table("All", [Row("a", "b", 18.22, 18.22 + 4e-13, "", Agreement.VALUE, None, "c")])
    assert table.rows[0][5] == "0"
