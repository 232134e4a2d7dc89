import itertools
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra.mechanics import solve_batch, solve_path
from tensegra.mechanics.strains import beyond_law, strain_warning
from tensegra.report.tables import stage_table
from tensegra.structure import library, parse_structure, structure_to_mapping
from tensegra.study import parse_study

STUDY = {
    "structure": "library:paper_beam",
    "changes": {"gravity": [0, 0, 0]},
    "variables": {"A1": {"actuator": "A1", "distribution": {"uniform": [0.0, 0.3]}}},
    "outputs": {"strain": {"largest_strain": "all"}, "of_K1": {"largest_strain": "K1"}},
    "design": {"sampler": "sobol", "sizes": 4},
}


def limited(limit):
    """Return the beam with a limit of strain of its cables."""
    content = structure_to_mapping(library.paper_beam())
    content["materials"]["steel_rope"]["strain_limit"] = limit
    return parse_structure(content)


def test_the_strain_is_that_of_the_lengths():
    # T/EA = ℓ/ℓ₀ − 1 with the rest length as actuated: another way to the same number.
    beam = library.paper_beam()
    path = solve_path(beam, {"A14": 0.1, "A23": 0.1})
    nodes = [path.final.node(node) for node in beam.members["K1"].nodes]
    length = sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(nodes))
    rest = beam.members["K1"].rest_length * (1 - 0.0255) * 0.9
    k1 = list(beam.members).index("K1")
    assert path.final.strains[k1] == pytest.approx(length / rest - 1, abs=1e-12)
    assert path.final.largest_strain == np.abs(path.final.strains).max()


def test_many_runs_have_the_strains_of_one():
    beam = library.paper_beam()
    runs = solve_batch(beam, actuation={"A14": [0.05, 0.1], "A23": [0.05, 0.1]})
    alone = solve_path(beam, {"A14": 0.1, "A23": 0.1}).final
    np.testing.assert_allclose(runs.strains[1], alone.strains, rtol=0.0, atol=1e-12)
    assert runs.largest_strain[1] == pytest.approx(alone.largest_strain, abs=1e-12)


def test_a_modulus_of_a_run_is_its_own():
    runs = solve_batch(library.paper_beam(), youngs_modulus={"steel_rope": [11500.0, 5750.0]})
    arrays = np.array([library.paper_beam().axial_stiffness(m) for m in runs.member_ids])
    cable = runs.member_ids.index("K1")
    assert runs.strains[1, cable] == pytest.approx(2 * runs.tensions[1, cable] / arrays[cable])


def test_beyond_the_limit_every_answer_warns():
    beam = limited(1e-4)
    path = solve_path(beam, {"A14": 0.1, "A23": 0.1})
    assert path.final.succeeded
    assert "limit 0.01 %" in path.final.warnings[0]
    assert json.loads(json.dumps(path.to_dict()))["actuation"]["warnings"] == list(path.final.warnings)
    assert solve_batch(beam, actuation={"A14": [0.1]}).beyond_law.tolist() == [True]
    assert "Largest\nstrain [%]" in stage_table(path).header


def test_within_the_limit_none_does():
    path = solve_path(limited(0.2), {"A14": 0.1, "A23": 0.1})
    assert path.final.warnings == ()
    assert path.final.to_dict()["warnings"] == []


def test_a_limit_survives_the_file_and_a_bad_one_is_refused():
    assert structure_to_mapping(limited(0.002))["materials"]["steel_rope"]["strain_limit"] == 0.002
    with pytest.raises(Exception, match="strain_limit"):
        limited(-0.1)


def test_a_study_has_it_as_an_output():
    study = parse_study(STUDY)
    X = np.array([[0.0], [0.3]])
    Y = study.evaluate(X).Y
    runs = solve_batch(study.structure, actuation={"A1": X[:, 0]})
    np.testing.assert_allclose(Y[:, 0], runs.largest_strain)
    k1 = runs.member_ids.index("K1")
    np.testing.assert_allclose(Y[:, 1], np.abs(runs.strains[:, k1]))


@given(st.lists(st.floats(-1.0, 1.0), min_size=48, max_size=48))
def test_the_warning_names_a_member_beyond_and_only_then(strains):
    beam = library.paper_beam()
    beyond = beyond_law(beam, np.array(strains))
    assert set(beyond) == {m for m, e in zip(beam.members, strains, strict=True) if abs(e) > 0.05}
    said = strain_warning(beam, np.array(strains))
    assert bool(said) == bool(beyond)
    assert not beyond or any(f"of all {name} (" in said for name in beyond)


def test_runs_of_a_study_beyond_it_are_told(tmp_path):
    content = STUDY | {"design": {"sampler": "sobol", "sizes": 4}, "seed": 1}
    study = parse_study({**content, "structure": structure_to_mapping(limited(0.037))})
    campaign = study.run(tmp_path / "runs")
    frame = campaign.frame()
    beyond = frame["strain"] > 0.037
    assert 0 < beyond.sum() < len(frame)
    assert ((frame["reason"] == "strained beyond what the linear law holds for") == beyond).all()
    assert sum(campaign.state().reasons.values()) == beyond.sum()
