import numpy as np
import pytest

from tensegra.mechanics import solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.stability import (
    equilibrium_matrix,
    prestress_stiffness,
    self_stress,
)
from tensegra.structure import Member, Structure, library


@pytest.mark.parametrize("n_struts", [3, 4, 5, 6])
def test_a_prism_has_one_state_of_self_stress_and_its_known_mechanisms(n_struts):
    # 2n nodes, 4n members and one state of self-stress: 6n - 6 = 4n - 1 + m (Maxwell's rule, Calladine 1978).
    found = self_stress(library.prism(n_struts))
    assert found.n_self_stress == 1
    assert found.n_mechanisms == 2 * n_struts - 5


def test_members_between_supports_are_left_out():
    beam = self_stress(library.paper_beam())
    assert (beam.n_free, beam.n_columns, beam.rank) == (60, 44, 43)


def test_a_clustered_cable_is_one_column_and_frees_mechanisms():
    plain, clustered = self_stress(library.prism(4)), self_stress(library.prism(4, clustered=True))
    assert plain.n_columns - clustered.n_columns == 3
    assert clustered.n_mechanisms == plain.n_mechanisms + 3


def test_the_matrix_is_the_gradient_of_the_lengths():
    loop = library.prism(3, clustered=True)
    nodes = loop.coordinates
    free = np.ones((loop.n_nodes, 3), dtype=bool)
    for node, axes in loop.supports.items():
        free[loop.node_ids.index(node), ["xyz".index(axis) for axis in axes]] = False
    move = np.random.default_rng(0).standard_normal(nodes.shape) * free
    step = 1e-6  # central differences: truncation 1e-12, rounding 1e-10
    change = lengths(loop, nodes + step * move) - lengths(loop, nodes - step * move)
    matrix = equilibrium_matrix(structure_arrays(loop), nodes)
    np.testing.assert_allclose(matrix.T @ move[free], change / (2 * step), atol=1e-8)


def test_the_beam_has_17_mechanisms_clustered_and_3_locked():
    beam = library.paper_beam()
    clustered, locked = self_stress(beam), self_stress(beam, clustered=False)
    assert (clustered.n_mechanisms, clustered.n_self_stress) == (17, 1)
    assert (locked.n_mechanisms, locked.n_self_stress) == (3, 3)


def test_self_stress_balances_and_mechanisms_change_no_length():
    beam = library.paper_beam()
    found, matrix = self_stress(beam), equilibrium_matrix(structure_arrays(beam))
    rounding = 1e-7 * np.abs(matrix).max()  # the coordinates have seven digits
    np.testing.assert_allclose(matrix @ found.states.T, 0.0, atol=rounding)
    free = structure_arrays(beam).free
    np.testing.assert_allclose(matrix.T @ found.mechanisms[:, free].T, 0.0, atol=rounding)


def test_prestress_holds_the_mechanisms_of_the_beam():
    path = solve_path(library.paper_beam())
    stiffness = prestress_stiffness(path)
    # On the mechanisms alone: an upper bound of the lowest eigenvalue of K, by Courant and Fischer.
    assert path.final.lowest_eigenvalue <= stiffness < 1.1 * path.final.lowest_eigenvalue


def lengths(structure: Structure, nodes):
    """Return the members' lengths at other positions."""
    place = dict(zip(structure.node_ids, nodes, strict=True))
    return np.array(
        [
            sum(np.linalg.norm(place[end] - place[start]) for start, end in member.segments)
            for member in structure.members.values()
        ]
    )


def linkage(nodes, members, supports):
    """Return struts of their nodes' distances, which carry nothing."""
    return Structure(
        name="linkage",
        nodes=nodes,
        members={
            name: Member(
                "strut", ends, float(np.linalg.norm(np.subtract(*(nodes[e] for e in ends)))), stiffness=1e4
            )
            for name, ends in members.items()
        },
        supports=supports,
    )


def test_what_is_rigid_to_second_order_is_told_from_what_is_not():
    line = {"a": (-1.0, 0.0, 0.0), "b": (0.0, 0.0, 0.0), "c": (1.0, 0.0, 0.0)}
    held = {"a": "xyz", "c": "xyz"}
    for supports in ({**held, "b": "z"}, held):  # one mechanism, and two
        path = solve_path(linkage(line, {"l": ("a", "b"), "r": ("b", "c")}, supports))
        assert path.status == "collapsed"
        assert "rigid to second order" in path.reason
    # A parallelogram goes all the way round.
    square = {"a": (0.0, 0.0, 0.0), "b": (0.0, 1.0, 0.0), "c": (1.0, 1.0, 0.0), "d": (1.0, 0.0, 0.0)}
    bars = {"l": ("a", "b"), "m": ("b", "c"), "r": ("c", "d")}
    free = solve_path(linkage(square, bars, {"a": "xyz", "b": "z", "c": "z", "d": "xyz"}))
    assert free.status == "collapsed"
    assert "second order" not in free.reason
    # A cable longer than its way resists nothing.
    cables = linkage(line, {"l": ("a", "b"), "r": ("b", "c")}, {**held, "b": "z"})
    loose = cables.replace(
        members={n: Member("cable", m.nodes, 1.1, stiffness=1e4) for n, m in cables.members.items()}
    )
    assert "second order" not in solve_path(loose).reason
