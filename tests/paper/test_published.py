import pytest

from tensegra_paper.published import published, published_number


def test_printed_numbers_are_read():
    assert published("propagation", "table_2_displacement_z_cm", "mean") == [52.6, 52.6, 50.1, 50.11]
    assert published_number("optimisation", "optimum", "w") == 146.85
    assert published("doe", "variables") == ["A14", "A23", "T_top", "T_middle", "T_bottom"]


def test_the_printed_columns_have_all_statistics():
    table = published("propagation", "table_2_displacement_z_cm")
    assert {len(column) for column in table.values()} == {4}


def test_what_is_not_printed_is_no_number():
    with pytest.raises(KeyError):
        published("optimisation", "radius")
