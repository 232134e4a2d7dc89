"""A small study of the beam, carried out once for all tests of the report."""

import pytest

from tensegra.report.pipeline import carry_out
from tensegra.report.results import Results
from tensegra.study import Study, parse_study

CONTENT = {
    "name": "small",
    "structure": "library:paper_beam",
    "seed": 3,
    "variables": {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.0, 0.02]}},
        "T": {"temperature": "top", "distribution": {"uniform": [0, 50]}},
    },
    "outputs": {
        "v": {"displacement": "y", "nodes": [18, 23]},
        "w": {"displacement": "z", "nodes": [18, 23]},
    },
    "design": {"sampler": "sobol", "sizes": 32},
    "selection": {"method": "certificate"},
    "surrogates": {"pce": {"kind": "pce"}, "gpr": {"kind": "gpr", "outputs": ["w"]}},
    "analyses": [
        {"propagation": {"name": "Scatter", "model": "pce", "compare_with": "truth", "samples": 40}},
        {"sensitivity": {"name": "Shares", "model": "pce", "samples": 64}},
        {
            "optimisation": {
                "name": "Lift",
                "model": "pce",
                "objective": "w",
                "search": ["A14", "T"],
                "constraints": ["T <= 40"],
                "methods": ["slsqp", "bfgs"],
                "starts": 3,
            }
        },
    ],
}


@pytest.fixture(scope="session")
def small_study():
    """Return a function that gives the study with some of its keys exchanged."""

    def study(**changes: object) -> Study:
        return parse_study({**CONTENT, **changes})

    return study


@pytest.fixture(scope="session")
def sensitivity_alone():
    """Return the study's second analysis."""
    return CONTENT["analyses"][1:2]


@pytest.fixture(scope="session")
def results(small_study, tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Carry the study out in a folder."""
    return carry_out(small_study(), tmp_path_factory.mktemp("campaign"), workers=1)
