"""Bad input: one line that says place, found, expected and the nearest known name."""

import pytest
from numpy.testing import assert_allclose
from study_contents import set_at

from tensegra.errors import StudyError
from tensegra.study import parse_study

ROUNDING = 1e-9
"""Relative: the solver's tolerance, by which two ways of writing one area may differ."""


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("sedd", 1, "study: found 'sedd', expected one of schema, name"),
        (
            "variables.A14.actuator",
            "A41",
            "A14.actuator: found 'A41', expected an actuator; did you",
        ),
        (
            "variables.A14.distribution",
            {"uniform": [0.5, 1.0]},
            "found values from 0.5 to 1, expected values below 1",
        ),
        (
            "variables.A23.distribution",
            {"uniform": [-1.2, 0]},
            "expected values above -1 that leave a rest length",
        ),
        (
            "variables.A14.distribution",
            {"normal": ["1 kN", 1]},
            "variables.A14.distribution.normal.mean: found '1 kN'",
        ),
        (
            "variables.E",
            {"youngs_modulus": "stel", "distribution": {"uniform": [1, 2]}},
            "did you mean 'steel'?",
        ),
        (
            "variables.E",
            {"youngs_modulus": "steel", "distribution": {"normal": [11500, 3000]}},
            "E.distribution: found values from -2760.27 to 25760.3, expected a positive youngs_modulus",
        ),
        ("variables.T", {"temperature": "topp", "distribution": {"uniform": [0, 9]}}, "did you mean 'top'?"),
        ("variables.a", {"area": "K1", "distribution": {"uniform": [-1, 1]}}, "expected a positive area"),
        (
            "variables.l",
            {"rest_length": "K9", "distribution": {"uniform": [1, 2]}},
            "found 'K9', expected a member",
        ),
        (
            "variables.p",
            {"load": {"node": 99, "axis": "z"}, "distribution": {"uniform": [0, 1]}},
            "variables.p.load.node: found '99', expected a node",
        ),
        (
            "variables.p",
            {"load": {"node": 18, "axis": "w"}, "distribution": {"uniform": [0, 1]}},
            "variables.p.load.axis: found 'w', expected one of x, y, z",
        ),
        (
            "variables.p",
            {"position": {"node": 18, "axis": "z"}, "distribution": {"uniform": [0, 1]}},
            "expected an axis that supports node 18 (none does)",
        ),
        (
            "variables.p",
            {
                "prestress": {"stage": "prestres", "members": ["K1"]},
                "distribution": {"uniform": [-0.03, -0.02]},
            },
            "variables.p.prestress.stage: found 'prestres', expected a stage of the structure; did you mean",
        ),
        (
            "variables.p",
            {
                "prestress": {"stage": "prestress", "members": ["K2"]},
                "distribution": {"uniform": [-0.03, -0.02]},
            },
            "expected a member that stage 'prestress' changes",
        ),
        (
            "variables.B",
            {"distribution": {"uniform": [0, 1]}},
            "variables.B: found 'none of them', expected exactly one",
        ),
        (
            "variables.B",
            {"actuator": "A14", "distribution": {"uniform": [0, 0.1]}},
            "variables.B: found 'A14', expected one actuator of 'A14', which 'A14' sets too",
        ),
        (
            "variables.1a",
            {"actuator": "A1", "distribution": {"uniform": [0, 0.1]}},
            "found '1a', expected a name",
        ),
        (
            "variables.lambda",
            {"actuator": "A1", "distribution": {"uniform": [0, 0.1]}},
            "found 'lambda', expected",
        ),
        ("outputs.status", {"tension": "K1"}, "found 'status', expected another name"),
        ("outputs.A14", {"tension": "K1"}, "found 'A14', expected another name: a variable has this one"),
        ("outputs.w.nodes", [18, 32], "outputs.w.nodes[1]: found '32', expected a node; did you mean '3'?"),
        ("outputs.w.displacement", "up", "outputs.w.displacement: found 'up', expected one of x, y, z"),
        ("outputs.x", {"displacement": "z"}, "outputs.x.nodes: the key is missing"),
        (
            "outputs.x",
            {"tension": "K1", "nodes": [1]},
            "outputs.x.nodes: found nodes, which tension does not take",
        ),
        ("outputs.x", {"distance": True, "nodes": [1]}, "expected two nodes"),
        ("outputs.x", {"max_tension": "clusterd"}, "did you mean 'clustered'?"),
        ("outputs", {}, "study: outputs: found {}"),
        ("design.sampler", "sobel", "design.sampler: found 'sobel', expected one of sobol"),
        ("design", {"sizes": 4}, "design: the key 'sampler' is missing"),
        ("design.sizes", 0, "design.sizes"),
        ("design.sizes", 1.5, "design.sizes"),
        (
            "design.size",
            8,
            "design: found 'size', expected one of sampler, sizes, scramble; did you mean 'sizes'?",
        ),
        (
            "design",
            {"sampler": "full_factorial", "levels": {"A14": 2}},
            "expected every variable, 'A23' is missing",
        ),
        ("design", {"sampler": "full_factorial", "levels": 10**6}, "expected at most"),
        ("design", {"sampler": "file", "file": "none.csv"}, "design.file: found 'none.csv'"),
        ("correlation", [[1, 2], [2, 1]], "correlation: expected a symmetric matrix"),
        ("correlation", [[1, 0], [1]], "correlation"),
        (
            "structure",
            "library:paper_baem",
            "did you mean 'paper_beam'",
        ),
        ("structure", "none.yaml", "none.yaml"),
        ("structure", 3, "structure"),
        ("changes", {"gravty": [0, 0, 0]}, "study: changes"),
        ("changes", 3, "changes: found 3, expected a mapping"),
        ("surrogates", {"truth": {"kind": "gpr"}}, "choose another"),
        ("surrogates", {"g": {"kind": "gp"}}, "surrogates.g.kind: found 'gp', expected one of gpr, nn, pce"),
        (
            "surrogates",
            {"g": {"kind": "gpr", "outputs": ["ww"]}},
            "surrogates.g.outputs: found 'ww', expected an output",
        ),
        ("analyses", [{"propagation": {"model": "gpr"}}], "found 'gpr', expected a surrogate or 'truth'"),
        (
            "analyses",
            [{"sensitivity": {"model": "truth", "samples": 1000}}],
            "expected a power of two such as 512 or 1024",
        ),
        (
            "analyses",
            [{"optimisation": {"model": "truth"}}],
            "analyses[0].optimisation.objective: the key is missing",
        ),
        (
            "analyses",
            [{"optimisation": {"model": "truth", "objective": "w", "bounds": {"A41": [0, 1]}}}],
            "analyses[0].optimisation.bounds: found 'A41', expected a variable; did you mean 'A14'?",
        ),
        (
            "analyses",
            [{"propagation": {"model": "truth", "inputs": {"A14": {"same_as": "A14"}}}}],
            "inputs.A14.same_as: found 'A14', expected another variable",
        ),
        ("analyses", [{"regression": {}}], "analyses[0]: found 'regression', expected one of propagation"),
    ],
)
def test_bad_input_is_refused_with_one_message(content, path, value, message):
    set_at(content, path, value)
    with pytest.raises(StudyError) as caught:
        parse_study(content)
    text = str(caught.value)
    assert message in text
    assert text.startswith("study: ")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([1, 18], r"R.nodes\[1\]: found '18', expected a node held along z"),
        ([1, 1], r"R.nodes\[1\]: found '1', expected each node once"),
        ([99], r"R.nodes\[0\]: found '99', expected a node"),
        (None, r"R.nodes: the key is missing"),
    ],
)
def test_a_reaction_that_there_is_not_is_refused(content, nodes, message):
    content["outputs"]["R"] = {"reaction": "z"} | ({"nodes": nodes} if nodes else {})
    with pytest.raises(StudyError, match=message):
        parse_study(content)


@pytest.mark.parametrize(
    ("first", "second", "shared"),
    [
        ({"temperature": "top"}, {"temperature": "top"}, "one temperature of 'top'"),
        ({"area": "K1"}, {"area": "clustered"}, "one area of member 'K1'"),
        ({"youngs_modulus": "steel"}, {"youngs_modulus": "steel"}, "one youngs_modulus of 'steel'"),
        ({"rest_length": "K1"}, {"rest_length": "K1"}, "one rest_length of 'K1'"),
        (
            {"rest_length_error": "K1"},
            {"rest_length_error": "clustered"},
            "one rest_length_error of member 'K1'",
        ),
        (
            {"load": {"node": 18, "axis": "z"}},
            {"load": {"node": "18", "axis": "z"}},
            "one load of node 18 along z",
        ),
        (
            {"prestress": {"stage": "prestress", "members": ["K1", "K4"]}},
            {"prestress": {"stage": "prestress", "members": ["K4"]}},
            "one prestress of member 'K4' in stage 'prestress'",
        ),
    ],
)
def test_two_variables_that_change_one_thing_are_refused_with_both_names(content, first, second, shared):
    quantity = next(iter(first))
    low = {"prestress": -0.03, "area": 0.4, "youngs_modulus": 1e4, "rest_length": 299}.get(quantity, 1.0)
    law = {"distribution": {"uniform": [low, low + 0.01]}}
    content["variables"] = {"one": {**first, **law}, "two": {**second, **law}}
    with pytest.raises(
        StudyError, match=rf"variables\.two: found .* expected {shared}, which 'one' sets too"
    ):
        parse_study(content)


@pytest.mark.parametrize(
    ("quantity", "values"), [("rest_length", [299, 300]), ("rest_length_error", [-0.01, 0.01])]
)
def test_a_length_that_a_stage_sets_anew_is_refused(content, quantity, values):
    content["changes"] = {"stages": [{"name": "cut", "rest_lengths": {"K1": 298}}]}
    content["variables"] = {"l": {quantity: "K1", "distribution": {"uniform": values}}}
    with pytest.raises(StudyError, match=rf"variables.l.{quantity}: stage 'cut' sets .*'K1' anew"):
        parse_study(content)


@pytest.mark.parametrize(("low", "told"), [(-1.0, "above -1 that leave"), (-2e9, "above -1")])
def test_an_error_that_leaves_no_length_is_refused(content, low, told):
    content["variables"]["e"] = {"rest_length_error": "K2", "distribution": {"uniform": [low, 0.1]}}
    with pytest.raises(StudyError, match=rf"variables.e.distribution: found values from .*{told}"):
        parse_study(content)


def test_a_prestress_that_names_a_member_twice_is_refused(content):
    content["variables"]["p"] = {
        "prestress": {"stage": "prestress", "members": ["K1", "K1"]},
        "distribution": {"uniform": [-0.03, -0.02]},
    }
    with pytest.raises(StudyError, match="one prestress of member 'K1' in stage 'prestress', which 'p'"):
        parse_study(content)


def test_a_variable_takes_the_place_of_what_changes_say(content):
    content["variables"] = {"a": {"area": "clustered", "distribution": {"uniform": [0.4, 0.6]}}}
    plain = parse_study(content)
    content["changes"] = {"members": {"K1": {"area": 0.9}}}
    changed = parse_study(content)
    # One quantity, set last by the variable: the same run, to what a relative factor rounds.
    expected = plain.evaluate([[0.5]]).Y
    assert_allclose(changed.evaluate([[0.5]]).Y, expected, rtol=ROUNDING, atol=ROUNDING)
