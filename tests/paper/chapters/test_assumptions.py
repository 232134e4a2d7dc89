import numpy as np
import pytest

from tensegra.structure import library
from tensegra_paper.chapters.assumptions.chapter import TAKEN, Variant, _expanding, _verdict, assumptions
from tensegra_paper.setting import Setting


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return assumptions(Setting(tmp_path_factory.mktemp("assumptions")))


def test_every_assumption_says_what_why_and_what_it_touches(made):
    taken = made.tables[0]
    assert len(taken.rows) == len(TAKEN)
    assert all(cell for row in taken.rows for cell in row)


def test_the_effect_of_temperature_goes_with_the_square_of_the_expansion(made):
    rows = {row[0]: [float(cell) for cell in row[1:]] for row in made.tables[1].rows}
    own, low = rows["as taken"], rows["expansion 1.2e-05 per kelvin"]
    # Quartiles are proportional; the odds of the share go with the square.
    assert low[2] / own[2] == pytest.approx(0.75, abs=0.02)
    odds = [share / (100 - share) for share in (low[4], own[4])]
    assert odds[0] / odds[1] == pytest.approx(0.75**2, abs=0.02)
    assert low[0] == own[0]


def test_gravity_changes_the_lift_and_not_the_structure(made):
    rows = {row[0]: [float(cell) for cell in row[1:]] for row in made.tables[1].rows}
    assert rows["gravity exchanged"][0] != rows["as taken"][0]
    assert np.isfinite(rows["gravity exchanged"][0])


def test_an_expansion_is_given_to_what_expands_alone():
    materials = _expanding(library.paper_beam(), 3e-5).materials
    before = library.paper_beam().materials
    for name, material in materials.items():
        assert material.thermal_expansion == (3e-5 if before[name].thermal_expansion else 0.0)


def test_a_verdict_that_changes_is_told():
    calm = Variant(53.0, (0.1, 0.5), (0.02, 0.2), 0.7, (1.0, 146.0))
    assert "with: calm" in _verdict({"calm": calm})
