import sys
from pathlib import Path

import pytest

from tensegra.structure import parse_structure

# Helpers of these tests are modules beside them.
sys.path.insert(0, str(Path(__file__).parent))

TRIPOD = """\
schema: tensegra/structure/1
name: tripod
units: {length: cm, force: kN, temperature: degC}
nodes: {1: [0, 0, 0], 2: [100, 0, 0], 3: [0, 100, 0], 9: [0, 0, 100]}
materials:
  steel: {youngs_modulus: 115 GPa, weight: 7.85e-5, thermal_expansion: 1.6e-5 1/K}
members:
  K1: {kind: cable, nodes: [1, 2, 3], material: steel, area: 50 mm^2, rest_length: 2.3 m, groups: [top]}
  s1: {kind: strut, nodes: [1, 9], stiffness: 1e6}
  K2: {kind: cable, nodes: [9, 2], stiffness: 1.0e6}
supports: {1: xyz, 2: zy}
actuators: {A1: {members: [K1, K2], effect: shorten}}
stages:
  - {name: prestress, rest_length_changes: {K1: -0.0255}}
  - name: load
    rest_lengths: {K1: 225}
    loads: {9: [0, 0, -1]}
    temperatures: {top: 20 K}
    positions: {2: [100, 1, 0]}
    gravity: [0, 0, -1]
"""


@pytest.fixture
def tripod_text() -> str:
    """Return a small file that uses every section of the format."""
    return TRIPOD


@pytest.fixture
def tripod_file(tmp_path: Path) -> Path:
    path = tmp_path / "tripod.yaml"
    path.write_text(TRIPOD, encoding="utf-8")
    return path


@pytest.fixture
def rope():
    return parse_structure(
        {
            "name": "rope",
            "nodes": {1: [0, 0, 0], 2: [3, 4, 0]},
            "members": {"K1": {"kind": "cable", "nodes": [1, 2], "stiffness": 1000}},
            "supports": {1: "xyz", 2: "yz"},
        }
    )
