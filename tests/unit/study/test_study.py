import json

import numpy as np
import pytest
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from study_contents import set_at

from tensegra.errors import StudyError
from tensegra.structure import library, write_structure
from tensegra.study import design_points, parse_study, read_study


def test_a_file_is_read_with_its_structure_beside_it(tmp_path, content):
    write_structure(library.prism(), tmp_path / "prism.yaml")
    content |= {
        "schema": "tensegra/study/1",
        "structure": "prism.yaml",
        "changes": {"actuators": {"pull": {"members": ["v0"], "effect": "shorten"}}},
        "variables": {"a": {"actuator": "pull", "distribution": {"uniform": [0.0, 0.01]}}},
        "outputs": {"w": {"displacement": "z", "nodes": ["t0"]}},
    }
    path = tmp_path / "pulling.yaml"
    path.write_text(yaml.safe_dump(content))
    study = read_study(path)
    assert study.name == "pulling"
    assert "pull" in study.structure.actuators
    assert repr(study) == "Study('pulling': a → w; 64 points)"


def test_variables_and_outputs_know_their_units(content):
    content["variables"]["T_top"] = {"temperature": "top", "distribution": {"uniform": [0, 150]}}
    content["outputs"]["stiffness"] = {"lowest_eigenvalue": True}
    study = parse_study(content)
    assert study.space.units == ("", "", "degC")
    assert [output.unit for output in study.outputs] == ["cm", "kN", "kN/cm"]


def test_quantities_with_units_are_converted_once(content):
    content["variables"]["E"] = {
        "youngs_modulus": "steel",
        "distribution": {"normal": {"mean": "115 GPa", "std": "2 GPa"}},
    }
    content["analyses"] = [
        {"propagation": {"model": "truth", "inputs": {"E": {"uniform": ["110 GPa", "120 GPa"]}}}}
    ]
    study = parse_study(content)
    assert study.variables[2].distribution.mean == 11500
    assert study.analyses[0].value.inputs["E"].law().box == (11000.0, 12000.0)


def test_a_resolved_study_needs_no_other_file_and_is_the_same(tmp_path, content):
    (tmp_path / "measured.csv").write_text("day,change\n1,0.02\n2,0.03\n3,0.05\n")
    content["changes"] = {"gravity": [0, 0, 0]}
    content["variables"]["A23"]["distribution"] = {
        "empirical": {"file": "measured.csv", "column": "change", "method": "kde"}
    }
    content["correlation"] = [[1, 0.5], [0.5, 1]]
    content["selection"] = {"method": "hdbscan"}
    content["surrogates"] = {"gp": {"kind": "gpr", "restarts": 3}}
    content["analyses"] = [{"sensitivity": {"model": "gp"}}]
    study = parse_study(content, tmp_path)
    again = parse_study(json.loads(json.dumps(study.to_mapping())))
    assert again.to_mapping() == study.to_mapping()
    assert again.fingerprint == study.fingerprint
    assert again.structure.gravity == (0.0, 0.0, 0.0)
    assert again.surrogates["gp"].options == {"restarts": 3}
    assert_array_equal(design_points(again), design_points(study))


def test_the_fingerprint_is_of_what_the_rows_depend_on(content):
    fingerprint = parse_study(content).fingerprint
    for path, value in {
        "seed": 2,
        "design.sizes": 128,
        "name": "another",
        "variables.A14.label": "top",
        "selection": {"method": "both"},
    }.items():
        set_at(content, path, value)
        assert parse_study(content).fingerprint == fingerprint, path
    for path, value in {
        "changes": {"gravity": [0, 0, 0]},
        "outputs.w.nodes": [18],
        "variables.A14.distribution": {"uniform": [0.08, 0.1]},
        "correlation": [[1, 0.5], [0.5, 1]],
    }.items():
        set_at(content, path, value)
        assert parse_study(content).fingerprint != fingerprint, path
        fingerprint = parse_study(content).fingerprint


def test_the_papers_design_is_a_product_of_two(content):
    temperatures = {f"T_{group}": group for group in ("top", "middle", "bottom")}
    for name, group in temperatures.items():
        content["variables"][name] = {"temperature": group, "distribution": {"uniform": [0, 150]}}
    content["design"] = {
        "sampler": "product",
        "factors": [
            {"variables": ["A14", "A23"], "design": {"sampler": "sobol", "sizes": 100}},
            {"variables": list(temperatures), "design": {"sampler": "sobol", "sizes": 125}},
        ],
    }
    study = parse_study(content)
    X = design_points(study)
    assert (study.n_points, X.shape) == (12_500, (12_500, 5))
    assert len(np.unique(X[:, :2], axis=0)) == 100
    assert len(np.unique(X[:, 2:], axis=0)) == 125
    assert len(study.advice) == 2


def test_a_design_stays_in_the_box(content):
    content["variables"]["A14"]["distribution"] = {
        "exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}
    }
    content["design"] = {"sampler": "sobol", "sizes": 8, "scramble": False}
    study = parse_study(content)
    X = design_points(study)
    assert X[0, 0] == study.space.bounds[0, 0]
    assert np.isfinite(X).all()


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_points_come_from_a_file(tmp_path, content, suffix):
    from tensegra.study import write_points

    X = np.array([[0.095, 0.08], [0.1, 0.07], [0.09, 0.1]])
    write_points(tmp_path / f"points{suffix}", ["A14", "A23"], X)
    content["design"] = {"sampler": "file", "file": f"points{suffix}"}
    study = parse_study(content, tmp_path)
    assert study.n_points == 3
    assert_allclose(design_points(study), X)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "A14,A23\n0.095,0.08\n0.2,0.08\n",
            "column 'A14', row 2: found 0.2, expected a number from 0.09 to 0.1",
        ),
        ("A14,A23\n0.095,x\n", "column 'A23', row 1: found nan"),
        ("A14,B\n0.095,0.08\n", "expected a column 'A23' in points.csv"),
        ("A14,A23\n", "points.csv has no row"),
        ("", "expected a CSV file"),
    ],
)
def test_a_file_of_points_that_cannot_be_is_refused(tmp_path, content, text, message):
    (tmp_path / "points.csv").write_text(text)
    content["design"] = {"sampler": "file", "file": "points.csv"}
    with pytest.raises(StudyError) as caught:
        parse_study(content, tmp_path)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.yaml", "structure: x", "a.yaml: the key 'schema' is missing"),
        (
            "a.yaml",
            "schema: tensegra/study/2\nstructure: library:paper_beam",
            "expected one of tensegra/study/1",
        ),
        ("a.yaml", "seed: 1\nseed: 2", "a.yaml: found 'seed', expected each key once"),
        ("a.yaml", "seed: [1", "a.yaml: line 2"),
        ("a.json", "{", "a.json: line 1"),
        ("a.yaml", "- 1", "a.yaml: found [1], expected a mapping"),
        ("a.txt", "", "a.txt: found '.txt', expected a file named"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(StudyError) as caught:
        read_study(tmp_path / name)
    assert message in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(StudyError, match="no such file"):
        read_study(tmp_path / "none.yaml")


def test_the_shared_error_of_the_paper_can_be_written(content):
    content["analyses"] = [
        {
            "propagation": {
                "model": "truth",
                "inputs": {
                    "A14": {"exponential": {"mean": 0.001, "shift": 0.1, "reflected": True}},
                    "A23": {"same_as": "A14"},
                },
            }
        },
        {"propagation": {"model": "truth", "inputs": {"A14": 0.1}}},
    ]
    first, second = (entry.value for entry in parse_study(content).analyses)
    assert first.inputs["A14"].law().mean == pytest.approx(0.099)
    assert first.inputs["A23"].law() == {"same_as": "A14"}
    assert second.inputs["A14"].law() == 0.1
