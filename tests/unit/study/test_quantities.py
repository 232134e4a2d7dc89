"""Quantities with units wherever numbers stand, groups wherever members are named, other tools' words."""

import numpy as np
import pytest

from tensegra.errors import StudyError, nearest
from tensegra.study import parse_study

STRUCTURE = {
    "units": {"length": "cm", "force": "kN"},
    "nodes": {1: [0, 0, 0], 2: [0, 0, -100], 3: [0, 0, -200]},
    "materials": {"m": {"youngs_modulus": 20000}},
    "members": {
        "a": {"kind": "cable", "nodes": [1, 2], "material": "m", "area": 1, "groups": ["all cables"]},
        "b": {"kind": "cable", "nodes": [2, 3], "material": "m", "area": 1, "groups": ["all cables"]},
    },
    "supports": {1: "xyz", 2: "xy", 3: "xy"},
    "stages": [
        {
            "name": "load",
            "loads": {2: [0, 0, -1], 3: [0, 0, -2]},
            "rest_length_changes": {"all cables": -0.001},
        }
    ],
}
STUDY = {
    "structure": STRUCTURE,
    "variables": {
        "L": {"rest_length": "a", "distribution": {"uniform": ["0.99 m", "101 cm"]}},
        "E": {"youngs_modulus": "m", "distribution": {"normal": ["200 GPa", "2 GPa"]}},
    },
    "outputs": {"w": {"displacement": "z", "nodes": [3]}, "T": {"tension": "all cables"}},
    "design": {"sampler": "sobol", "sizes": 8},
}


def study(*analyses, **changes):
    return parse_study({**STUDY, "analyses": list(analyses), **changes})


def test_quantities_stand_in_every_analysis():
    search, reach, scatter, robust = (
        entry.value
        for entry in study(
            {"optimisation": {"model": "truth", "objective": "w", "bounds": {"L": ["995 mm", 100]}}},
            {"inverse": {"model": "truth", "targets": {"w": ["10 mm", 2]}, "tolerance": {"w": "0.1 mm"}}},
            {
                "propagation": {
                    "model": "truth",
                    "limits": {"w": "1 in", "T": ["2000 N", 3]},
                    "inputs": {"L": "1 m", "E": {"fixed": "210 GPa"}},
                }
            },
            {"robust": {"model": "truth", "objective": "w", "errors": {"L": {"normal": [0, "1 mm"]}}}},
        ).analyses
    )
    assert search.bounds == {"L": (99.5, 100.0)}
    assert (reach.targets, reach.tolerance) == ({"w": (1.0, 2.0)}, {"w": 0.01})
    assert scatter.limits == {"w": 2.54, "T": (2.0, 3.0)}
    assert (scatter.inputs["L"].fixed, scatter.inputs["E"].fixed) == (100.0, 21000.0)
    assert robust.errors["L"].normal.std == 0.1


@pytest.mark.parametrize(
    ("analysis", "told"),
    [
        (
            {"optimisation": {"model": "truth", "objective": "w", "bounds": {"L": ["1 kN", 2]}}},
            "analyses[0].optimisation.bounds.L[0]: found '1 kN', expected a number (in cm)",
        ),
        (
            {"inverse": {"model": "truth", "targets": {"w": "1 cmm"}}},
            "found '1 cmm', expected a number (in cm) or a quantity of length such as '1 cm'; did you",
        ),
    ],
)
def test_a_quantity_of_something_else_is_refused(analysis, told):
    with pytest.raises(StudyError) as refusal:
        study(analysis)
    assert told in str(refusal.value)


def test_the_tension_of_a_group_is_the_mean_over_it():
    asked = study(derivatives=True)
    runs = asked.evaluate([[100.0, 20000.0], [100.5, 20000.0]], derivatives=True)
    # The upper cable carries both loads.
    assert runs.Y[:, 1] == pytest.approx([2.5, 2.5])
    assert np.isfinite(runs.dY[:, 1]).all()


def test_a_prestress_acts_on_the_members_of_a_group():
    prestress = {"stage": "load", "members": ["all cables"]}
    variables = {"p": {"prestress": prestress, "distribution": {"uniform": [-0.002, -0.001]}}}
    assert study(variables=variables).variables[0].target.members == ("a", "b")


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        ("lhs", ["sobol", "halton", "latin_hypercube"], "latin_hypercube"),
        ("random", ["sobol", "halton", "latin_hypercube"], "sobol"),
        ("Kriging", ["gpr", "nn", "pce"], "gpr"),
        ("polynomial chaos", ["gpr", "nn", "pce"], "pce"),
        ("monte-carlo", ["propagation", "sensitivity"], "propagation"),
        ("monte_carlo", ["sobol", "halton"], "sobol"),
        ("gaussian", ["uniform", "normal"], "normal"),
        ("tendon", ["strut", "cable"], "cable"),
        ("elements", ["nodes", "members"], "members"),
        ("E", ["youngs_modulus", "weight"], "youngs_modulus"),
        ("lhs", ["strut"], None),
    ],
)
def test_words_of_other_programs_are_understood(word, known, meant):
    assert nearest(word, known) == meant


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"design": {"sampler": "lhs", "sizes": 8}}, "did you mean 'latin_hypercube'"),
        ({"surrogates": {"s": {"kind": "kriging"}}}, "did you mean 'gpr'"),
        ({"analyses": [{"monte_carlo": {"model": "truth"}}]}, "did you mean 'propagation'"),
        ({"structure": "library:towr"}, "von_mises_truss; did you mean 'tower'"),
    ],
)
def test_they_are_understood_in_a_file(changes, told):
    with pytest.raises(StudyError) as refusal:
        parse_study({**STUDY, **changes})
    assert told in str(refusal.value)
