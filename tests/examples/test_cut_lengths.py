"""The example of members that are not cut to their exact lengths."""

from pathlib import Path

import numpy as np
import pytest

from tensegra.report.pipeline import carry_out
from tensegra.report.results import open_results
from tensegra.study import read_study

FILE = Path(__file__).parents[2] / "examples" / "cut_lengths.yaml"


def test_the_tension_scatters_as_its_derivatives_tell(tmp_path):
    study = read_study(FILE)
    done = carry_out(study, tmp_path, workers=1)
    scatter, indices = (stored.content for stored in open_results(done.campaign).analyses)
    slopes = study.evaluate(np.zeros((1, 3)), derivatives=True).dY[0, 0]
    linear = np.linalg.norm([s * v.distribution.std for s, v in zip(slopes, study.variables, strict=True)])
    found = scatter["outputs"]["T"]["statistics"]["std"]["value"]
    assert found == pytest.approx(linear, rel=0.02)  # 10,000 samples: 0.7 %
    total = indices["indices"]["T"]["total"]
    assert list(np.argsort(total)) == [2, 1, 0]
