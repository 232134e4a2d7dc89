from math import pi

import numpy as np
import pytest
from drawn_statics import nodal_forces, tensions
from hypothesis import given
from hypothesis import strategies as st

from tensegra.errors import ModelError
from tensegra.structure import Units, library

# A tension is a stiffness times a strain that is known to a few units in the last place.
STRAIN_ROUNDING = 1e-14


@pytest.mark.parametrize(
    ("beam", "strut_area"),
    [
        (library.paper_beam(), 255.0),
        (library.paper_beam_slender(), 2.55),
        (library.paper_beam_identified(), 255.0),
    ],
)
def test_the_beams_have_the_printed_counts(beam, strut_area):
    kinds = [(member.kind, len(member.nodes)) for member in beam.members.values()]
    assert kinds.count(("strut", 2)) == 12
    assert kinds.count(("cable", 2)) == 32
    assert kinds.count(("cable", 6)) == 4
    assert (beam.n_nodes, beam.n_free) == (24, 60)
    assert beam.members["s1"].area == strut_area
    assert beam.units == Units("cm", "kN", "degC")
    assert beam.stages[0].rest_length_changes == {"K1": -0.0255, "K4": -0.0255}
    assert beam.actuators["A14"].members == ("K1", "K4")


@given(
    n_struts=st.integers(3, 12),
    radius=st.floats(0.1, 10.0),
    top_radius=st.none() | st.floats(0.1, 10.0),
    height=st.floats(0.1, 10.0),
    clustered=st.booleans(),
)
def test_a_prism_is_in_equilibrium_whatever_its_proportions(n_struts, radius, top_radius, height, clustered):
    prism = library.prism(
        n_struts,
        radius,
        height,
        top_radius=top_radius,
        prestress=1.0,
        strut_stiffness=1e6,
        cable_stiffness=1e6,
        clustered=clustered,
    )
    carried = tensions(prism)
    assert np.abs(nodal_forces(prism)).max() <= STRAIN_ROUNDING * 1e6
    assert carried["v0"] == pytest.approx(1.0, abs=STRAIN_ROUNDING * 1e6)
    assert all((tension > 0) == prism.members[name].is_cable for name, tension in carried.items())


@pytest.mark.parametrize("n_struts", [3, 4, 7])
def test_a_prism_has_the_closed_form_twist(n_struts):
    prism = library.prism(n_struts, radius=2.0, top_radius=0.5, height=3.0)
    bottom, top = np.array(prism.nodes["b0"]), np.array(prism.nodes["t0"])
    twist = np.arctan2(top[1], top[0]) - np.arctan2(bottom[1], bottom[0])
    assert twist % (2 * pi) == pytest.approx(pi / 2 - pi / n_struts)
    assert np.hypot(*bottom[:2]) == pytest.approx(2.0)
    assert np.hypot(*top[:2]) == pytest.approx(0.5)
    assert top[2] - bottom[2] == 3.0


def test_the_top_of_a_clustered_prism_is_one_closed_loop():
    prism = library.prism(3, clustered=True)
    assert prism.members["loop"].nodes == ("t0", "t1", "t2", "t0")
    assert prism.actuators["top"].members == prism.groups["top"] == ("loop",)
    open_prism = library.prism(3)
    assert prism.members["loop"].rest_length == pytest.approx(3 * open_prism.members["h0"].rest_length)


def test_the_supports_hold_a_prism_without_reactions():
    prism = library.prism(5)
    coordinates = prism.coordinates
    rigid = []
    for axis in np.eye(3):
        rigid += [np.broadcast_to(axis, coordinates.shape), np.cross(axis, coordinates)]
    held = [
        (prism.node_ids.index(node), "xyz".index(axis))
        for node, axes in prism.supports.items()
        for axis in axes
    ]
    motions = np.array([[motion[dof] for dof in held] for motion in rigid])
    assert motions.shape == (6, 6)
    assert np.linalg.matrix_rank(motions) == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_struts": 2}, "prism: n_struts: found 2, expected at least 3"),
        ({"radius": -1.0}, "prism: radius: found -1.0, expected a finite number greater than 0"),
        ({"height": float("nan")}, "prism: height: found nan, expected a finite number greater than 0"),
        ({"prestress": 1e8}, "prestress from b0 to t1: found -[0-9.]*, expected more than -1e.07"),
    ],
)
def test_an_impossible_prism_is_refused(arguments, message):
    with pytest.raises(ModelError, match=message):
        library.prism(**arguments)


def test_a_gripper_of_a_beam_that_is_held_in_part_is_refused():
    beam = library.paper_beam()
    loose = beam.replace(supports={**beam.supports, "1": "xy"})
    with pytest.raises(ModelError, match="xyz, which a rotation keeps"):
        library.gripper(4, beam=loose)
