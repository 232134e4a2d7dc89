import numpy as np
import pytest

from tensegra.surrogate import fit
from tensegra_paper.chapter import Agreement
from tensegra_paper.chapters.uncertainty import chapter
from tensegra_paper.chapters.uncertainty.readings import (
    distance,
    nearest,
    printed_column,
    readings,
    slope_ratio,
    statistics,
)
from tensegra_paper.setting import Setting

# Both laws of φ in percent: means 0.5 and 0.1, variances 1/12 and 1/100, and a scatter by the temperatures.
SLOPES, TEMPERATURES = (4.0, 2.0), 0.3


def moments(*, shared):
    squares = sum(SLOPES) ** 2 if shared else sum(slope**2 for slope in SLOPES)
    means = {law: 53.0 - sum(SLOPES) * mean for law, mean in (("uniform", 0.5), ("exponential", 0.1))}
    variances = {"uniform": 1 / 12, "exponential": 1 / 100}
    return means, {law: np.sqrt(squares * v + TEMPERATURES**2) for law, v in variances.items()}


def test_the_ratio_of_slopes_tells_a_shared_error_from_independent_ones():
    assert slope_ratio(*moments(shared=True)) == pytest.approx(1.0)
    assert slope_ratio(*moments(shared=False)) == pytest.approx((4**2 + 2**2) / 6**2)


def test_the_printed_columns_are_found_under_the_other_heading():
    assert printed_column("uniform", "fem")[0] == 50.1
    assert printed_column("uniform", "fem", exchanged=False)[0] == 52.6
    assert printed_column("exponential", "nn")[3] == 54.01


def test_the_distance_from_the_print_is_a_root_mean_square():
    found = {law: printed_column(law, "fem") + 0.5 for law in ("uniform", "exponential")}
    assert distance(found, exchanged=True) == pytest.approx(0.5)
    assert distance(found, exchanged=False) > 1.0


def test_statistics_are_those_of_the_sample():
    values = np.random.default_rng(1).normal(size=1000)
    found = statistics(values)
    assert found[1] == pytest.approx(values.std(ddof=1))
    assert (np.diff(found[[2, 4, 5, 6, 3]]) > 0).all()


def test_the_exchanged_reading_with_temperatures_is_the_nearest(tmp_path):
    options = readings(Setting(tmp_path, scale=0.01))
    assert len(options) == 16
    assert [r.distance for r in options] == sorted(r.distance for r in options)
    assert options[0].exchanged
    assert options[0].temperatures
    assert nearest(options, exchanged=False).distance > 1.5


def test_every_row_of_table_2_is_filled(tmp_path, monkeypatch):
    def quick(_setting, _name, data, _kind, **_options):
        return fit(data, "pce", validation=None)

    monkeypatch.setattr(chapter, "trained", quick)
    monkeypatch.setattr(chapter, "LEAST_REFERENCE", 2000)
    told = []
    made = chapter.uncertainty(Setting(tmp_path, scale=0.001, tell=told.append))
    method = [row for row in made.rows if row.agreement is Agreement.METHOD]
    assert len(method) == 2 * 8
    assert all(row.holds for row in method)
    assert all(isinstance(row.ours, str) or np.isfinite(row.ours) for row in made.rows)
    assert next(row for row in made.rows if row.quantity.startswith("heading")).ours == "the other's"
    assert len(told) == 2
    for figure in made.figures:
        assert figure.draw().axes
