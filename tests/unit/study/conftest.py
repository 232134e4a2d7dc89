"""Fixtures of the study tests: a small study, and a solver that needs no mechanics."""

import copy
import sys
from pathlib import Path

import pytest

# Spawned workers inherit the path, so that they can import the stand-in by its name too.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def content():
    import study_contents

    return copy.deepcopy(study_contents.CONTENT)


@pytest.fixture
def study(content):
    from tensegra.study import parse_study

    return parse_study(content)


@pytest.fixture
def solver():
    import fake_solver

    return fake_solver.solve
