import json

from tensegra.report.check import check_structure, check_study
from tensegra.structure import library, read_structure


def test_the_beam_stands_with_its_mechanisms():
    result = check_structure(library.paper_beam())
    assert result.stands
    content = result.to_dict()
    # Counts that the reconstruction of the beam states.
    assert (content["n_free"], content["n_mechanisms"], content["n_self_stress"]) == (60, 17, 1)
    assert content["n_struts"] == 12
    assert content["n_clustered"] == 4
    assert content["actuators"]["A14"] == {"members": ["K1", "K4"], "effect": "shorten"}
    json.dumps(content, allow_nan=False)


def test_a_start_that_does_not_stand_is_told_of(request):
    cases = request.config.rootpath / "tests" / "validation" / "cases"
    result = check_structure(read_structure(cases / "cts_dbar_planar.structure.json"))
    assert result.stands
    assert "its first stage" in result.verdict
    assert "unstable" in result.verdict


def test_a_study_is_described(request):
    from tensegra.study import read_study

    study = read_study(request.config.rootpath / "examples" / "beam.yaml")
    content = check_study(study).to_dict()
    assert content["n_points"] == 1024
    assert content["variables"]["T_top"]["unit"] == "degC"
    assert content["outputs"]["w"] == {"displacement": "z", "nodes": ["18", "23"], "unit": "cm"}
    json.dumps(content, allow_nan=False)
