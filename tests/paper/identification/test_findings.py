"""The list of what is printed: no finding is vacuous, enough are held out, values are measured as defined."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tensegra as tg
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.local import ABSENT
from tensegra_paper.identification.measured import measure
from tensegra_paper.identification.records import misses
from tensegra_paper.identification.responses import (
    Edge,
    Effort,
    quadratic_terms,
    respond,
    saltelli,
    sobol_points,
    total_indices,
)
from tensegra_paper.identification.tally import CHAPTERS, Tally, markdown

FEW = Effort(design=48, samples=2048, outcomes=32, blocks=8)


@pytest.fixture(scope="module")
def measured():
    found = respond(tg.library.paper_beam(), FEW)
    return measure(found, FEW)


@pytest.mark.parametrize("finding", FINDINGS, ids=lambda f: f.key)
def test_no_finding_is_vacuous(finding):
    assert finding.agrees(finding.target)
    wrong = finding.target + (-1.0 if finding.least else 1.0) * (finding.tolerance + finding.scale)
    assert not finding.agrees(wrong)
    assert not finding.agrees(np.nan)


def test_a_third_is_held_out_and_names_are_unique():
    assert len({finding.key for finding in FINDINGS}) == len(FINDINGS)
    assert sum(not finding.fitted for finding in FINDINGS) >= len(FINDINGS) / 3


def test_a_beam_answers_every_finding(measured):
    assert {finding.key for finding in FINDINGS} <= set(measured)
    assert np.all(np.isfinite([measured[finding.key] for finding in FINDINGS]))


def test_numbers_that_the_studies_of_the_paper_have_for_the_same_beam(measured):
    # The gripper's chapter measures 3600 cm² on four solved beams, the optimum's the edge by bisection.
    assert measured["area before"] == pytest.approx(3600, abs=2)
    assert measured["w at v = 1.00"] == pytest.approx(146.47, abs=0.05)
    assert measured["A4 at v = 1.00"] == pytest.approx(0.1607, abs=5e-4)


def test_the_quadratic_is_as_good_as_the_table_s_means():
    # Cables that go slack bend the response; 0.02 cm is the tolerance of the means.
    beam = tg.library.paper_beam()
    found = respond(beam, Effort(), stages=("near",))
    rng = np.random.default_rng(4)
    few = {name: rng.uniform(0.09, 0.10, 16) for name in ("A14", "A23")}
    hot = {name: rng.uniform(0.0, 150.0, 16) for name in ("top", "middle", "bottom")}
    runs = tg.solve_batch(beam, actuation=few, temperature=hot)
    by = found.polynomial["23"][:, 1]
    predicted = quadratic_terms(np.column_stack([*few.values(), *hot.values()])) @ by
    np.testing.assert_allclose(predicted, runs.displacement("z", "23"), atol=0.02)


@given(a=st.floats(0.5, 2.0), b=st.floats(0.5, 2.0))
def test_jansen_s_estimate_of_an_additive_function(a, b):
    unit = sobol_points(4, 512, 0)
    blocks = saltelli(unit[:, :2], unit[:, 2:])
    found = total_indices(blocks @ np.array([a, b]))
    np.testing.assert_allclose(found, np.array([a**2, b**2]) / (a**2 + b**2), atol=0.02)


def test_an_edge_is_read_between_its_points():
    a4 = np.linspace(0.0, 0.30, 31)
    edge = Edge(v=100.0 * (a4 - 0.123), w=150.0 - 10.0 * a4, tip=np.zeros((31, 2, 3)))
    assert edge.at(1.0) == pytest.approx((0.133, 150.0 - 1.33))
    assert np.isnan(edge.at(50.0)).all()


def test_what_has_no_answer_misses_by_as_much_as_nothing_else():
    n = sum(finding.fitted for finding in FINDINGS)
    assert misses(None).tolist() == [ABSENT] * n
    nothing = {finding.key: np.nan for finding in FINDINGS}
    assert misses(nothing).tolist() == [ABSENT] * n
    agreed = {finding.key: finding.target for finding in FINDINGS}
    assert misses(agreed).tolist() == [0.0] * n


def test_the_counts_of_chapters_add_up():
    exact = Tally("exact", {finding.key: finding.target for finding in FINDINGS})
    assert exact.count() == (len(FINDINGS), len(FINDINGS))
    parts = [exact.count(chapter=chapter)[1] for chapter in CHAPTERS]
    assert sum(parts) == exact.count(fitted=True)[1] + exact.count(fitted=False)[1] == len(FINDINGS)
    assert f"| all | {len(FINDINGS)} of {len(FINDINGS)} |" in markdown([exact])
