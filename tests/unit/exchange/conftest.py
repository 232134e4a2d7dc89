"""Helpers of these tests are modules beside them."""

import sys
from pathlib import Path

import pytest

from tensegra.mechanics import solve_batch, solve_path
from tensegra.structure import library

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def beam_path():
    """Return the beam, bent: clustered cables, supports, weights, units of its own."""
    return solve_path(library.paper_beam(), {"A14": 0.10, "A23": 0.10})


@pytest.fixture(scope="session")
def beam_runs():
    return solve_batch(library.paper_beam(), actuation={"A14": [0.05, 0.10], "A23": [0.05, 0.10]})
