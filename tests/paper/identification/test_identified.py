"""The identified beam of the library against what is printed, and beside the two reconstructions."""

import numpy as np
import pytest

import tensegra as tg
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.measured import measure
from tensegra_paper.identification.responses import Effort, respond
from tensegra_paper.identification.tally import CHAPTERS, tally


@pytest.fixture(scope="module")
def beam():
    return tg.library.paper_beam_identified()


def test_it_is_drawn_where_it_stands_by_its_self_stress_alone(beam):
    alone = tg.solve_path(beam.replace(stages=(), gravity=(0, 0, 0))).raise_for_status().final
    np.testing.assert_allclose(alone.nodes, list(beam.nodes.values()), atol=1e-4)


def test_no_cable_is_slack_at_rest(beam):
    rest = tg.solve_path(beam).stages[-1]
    assert not rest.slack.any()


def test_means_of_table_2_and_the_optimum(beam):
    effort = Effort()
    measured = measure(respond(beam, effort, stages=("near", "edge")), effort)
    by_key = {finding.key: finding for finding in FINDINGS}
    for key in ("uniform mean", "exponential mean", "w at v = 1.00", "A4 at v = 1.00", "area before"):
        # Few runs and their quadratic: twice the tolerance of the full measurement.
        assert abs(by_key[key].off(measured[key])) <= 2.0 * by_key[key].tolerance, key


@pytest.mark.slow
def test_it_agrees_with_more_of_what_is_printed_than_the_reconstructions(beam):
    found = tally("identified", beam)
    for name in ("paper_beam", "paper_beam_slender"):
        other = tally(name, getattr(tg.library, name)())
        assert found.count()[0] > other.count()[0]
        assert found.count(fitted=False)[0] > other.count(fitted=False)[0]
        for chapter in CHAPTERS:
            assert found.count(chapter=chapter)[0] >= other.count(chapter=chapter)[0], chapter
