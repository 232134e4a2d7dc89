"""What holds for every structure of the library: it is drawn in equilibrium, stands and can be written."""

import numpy as np
import pytest
from drawn_statics import nodal_forces, tensions

from tensegra.mechanics import Status, solve_path
from tensegra.structure import library, parse_structure, structure_to_mapping

# Relative to the largest tension: a strain of 1e-3 known to 1e-16 leaves 1e-13, lengths of long paths
# and tall towers a few digits less.
DRAWN_BALANCE = 1e-9

DRAWN_IN_EQUILIBRIUM = {
    "prism": library.prism(),
    "prism, closed loop": library.prism(clustered=True),
    "tower": library.tower(),
    "tower of triangles": library.tower(4, 3),
    "tower, one long cable": library.tower(7, 5, clustered="one"),
    "tower, long cables": library.tower(30, clustered="full"),
    "tower, guided": library.tower(40, 3, clustered="full", guided_every=10),
    "d_bar": library.d_bar(),
    "d_bar, two upper cables": library.d_bar(1.5, 0.8, 1.1, clustered=False),
    "levy_dome": library.levy_dome(),
    "levy_dome, three hoops": library.levy_dome(12, 3, 30.0, 5.0, 6.0),
    "levy_dome, open hoops": library.levy_dome(6, 1, clustered=False),
    "grid": library.grid(),
    "grid, lines over pulleys": library.grid(5, 9, clustered=True),
    "grid, saddle": library.grid(9, 6, rise=1.5),
    "von_mises_truss": library.von_mises_truss(),
}
LOADED_OR_STAGED = {
    "hanging_chain": library.hanging_chain(),
    "hanging_chain, taut": library.hanging_chain(13, span=8.0, length=7.9),
    "paper_beam": library.paper_beam(),
    "paper_beam_slender": library.paper_beam_slender(),
    "paper_beam_identified": library.paper_beam_identified(),
    "gripper": library.gripper(),
    "gripper, three slender beams": library.gripper(3, beam=library.paper_beam_slender()),
}
ALL = DRAWN_IN_EQUILIBRIUM | LOADED_OR_STAGED


@pytest.mark.parametrize("structure", DRAWN_IN_EQUILIBRIUM.values(), ids=DRAWN_IN_EQUILIBRIUM)
def test_the_drawn_coordinates_are_an_equilibrium_under_the_rest_lengths(structure):
    held = np.array([["xyz"[a] in structure.supports.get(n, "") for a in range(3)] for n in structure.nodes])
    unbalanced = np.where(held, 0.0, nodal_forces(structure))
    carried = np.array(list(tensions(structure).values()))
    assert np.abs(unbalanced).max() <= DRAWN_BALANCE * np.abs(carried).max()


@pytest.mark.parametrize("structure", DRAWN_IN_EQUILIBRIUM.values(), ids=DRAWN_IN_EQUILIBRIUM)
def test_cables_are_drawn_in_tension_and_struts_are_not(structure):
    if structure.name == "von_mises_truss":
        assert set(tensions(structure).values()) == {0.0}
        return
    assert all((t > 0.0) == structure.members[name].is_cable for name, t in tensions(structure).items())


@pytest.mark.parametrize("structure", ALL.values(), ids=ALL)
def test_every_structure_stands(structure):
    path = solve_path(structure)
    assert [stage.status for stage in path.stages] == [Status.STABLE] * max(1, len(structure.stages))
    assert path.final.lowest_eigenvalue > 0.0
    assert path.final.n_negative == 0
    assert not path.final.slack.any()


@pytest.mark.parametrize("structure", DRAWN_IN_EQUILIBRIUM.values(), ids=DRAWN_IN_EQUILIBRIUM)
def test_the_solver_stays_where_the_structure_is_drawn(structure):
    size = np.ptp(structure.coordinates, axis=0).max()
    np.testing.assert_allclose(
        solve_path(structure).final.nodes, structure.coordinates, rtol=0, atol=DRAWN_BALANCE * size
    )


@pytest.mark.parametrize("structure", ALL.values(), ids=ALL)
def test_every_actuator_moves_the_structure_along_a_stable_path(structure):
    for actuator in structure.actuators:
        path = solve_path(structure, {actuator: 0.003})
        assert path.status is Status.STABLE, actuator
        # A flat net that is tightened evenly stays where it is.
        assert np.abs(path.displacements).max() > 0.0 or structure.name.startswith("grid"), actuator


@pytest.mark.parametrize("structure", ALL.values(), ids=ALL)
def test_every_structure_survives_its_file(structure):
    assert parse_structure(structure_to_mapping(structure)) == structure
