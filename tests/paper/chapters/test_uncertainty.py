from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from tensegra.surrogate import fit
from tensegra_paper.chapter import Agreement
from tensegra_paper.chapters.uncertainty import chapter
from tensegra_paper.chapters.uncertainty.headings import BOUND, RANGE, REACH
from tensegra_paper.chapters.uncertainty.readings import (
    distance,
    nearest,
    printed_column,
    readings,
    slope_ratio,
    statistics,
)
from tensegra_paper.models import five_inputs
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


def test_the_distance_from_the_print_is_a_root_mean_square_without_the_extremes():
    found = {law: printed_column(law, "fem") + 0.5 for law in ("uniform", "exponential")}
    for column in found.values():
        column[[2, 3]] += 10.0
    assert distance(found, exchanged=True) == pytest.approx(0.5)
    assert distance(found, exchanged=False) > 1.0


def test_statistics_are_those_of_the_sample():
    values = np.random.default_rng(1).normal(size=1000)
    found = statistics(values)
    assert found[1] == pytest.approx(values.std(ddof=1))
    assert (np.diff(found[[2, 4, 5, 6, 3]]) > 0).all()


@pytest.fixture(scope="module")
def network():
    """Return a surrogate of v and w of node 23 that is exact enough."""
    data = five_inputs(Setting(Path(mkdtemp())))
    return fit(data.training.rows(np.arange(500)), "pce", validation=None)


def test_the_exchanged_reading_with_temperatures_is_the_nearest(tmp_path, network):
    options = readings(Setting(tmp_path, scale=0.01), network)
    assert len(options) == 8
    assert [r.distance for r in options] == sorted(r.distance for r in options)
    assert options[0].exchanged
    assert options[0].temperatures
    assert nearest(options, exchanged=False).distance > 1.5
    # One sample by FEM, the others by the surrogate: they have the same law.
    assert max(options[0].distances) - min(options[0].distances) < 0.1


def test_a_bounded_sum_stays_within_its_bound():
    # The extreme of five equal uniform inputs, in deviations of their sum.
    assert 5 * 0.5 / np.sqrt(5 / 12) == pytest.approx(BOUND)
    assert REACH["low"] == pytest.approx(6.44, abs=0.01)
    assert pytest.approx(5.57, abs=0.01) == RANGE


def test_every_row_of_table_2_is_filled(tmp_path, monkeypatch):
    def quick(_setting, _name, data, _kind, **_options):
        return fit(data, "pce", validation=None)

    monkeypatch.setattr(chapter, "trained", quick)
    monkeypatch.setattr(chapter, "LEAST_REFERENCE", 2000)
    told = []
    made = chapter.uncertainty(Setting(tmp_path, scale=0.001, tell=told.append))
    method = [row for row in made.rows if row.agreement is Agreement.METHOD]
    assert len(method) == 1 + 2
    assert all(row.holds for row in method)
    assert all(isinstance(row.ours, str) or np.isfinite(row.ours) for row in made.rows)
    assert [row.ours for row in made.rows if row.quantity.startswith("heading")] == 2 * ["the other's"]
    findings = {row.claim: row.holds for row in made.rows if row.claim}
    assert not findings["normal"]
    assert not findings["exponential"]
    assert findings["FEM and network"]
    assert len(told) == 2
    for figure in made.figures:
        assert figure.draw().axes
