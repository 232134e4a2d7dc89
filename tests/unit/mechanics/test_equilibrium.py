from dataclasses import replace

import numpy as np

from tensegra.mechanics import solve_path
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.equilibrium import Load, descend
from tensegra.mechanics.tangent import Tangent
from tensegra.structure import library


def test_a_descent_ends_where_two_nodes_have_met():
    arrays = structure_arrays(library.prism())
    nodes = arrays.coordinates.copy()
    nodes[arrays.segment_nodes[0]] = nodes[arrays.segment_nodes[0, 0]]  # a segment without a direction
    load = Load(arrays.rest_length, arrays.stiffness, np.zeros_like(nodes))
    attempt = descend(Tangent(arrays), nodes, load, reference_tension=1e3, largest_move=0.1)
    assert not attempt.converged
    assert not attempt.flat


def test_steps_of_the_stepped_procedure_tell_their_own_iterations():
    path = solve_path(library.paper_beam(), {"A14": 0.05, "A23": 0.05}, path="stepped")
    steps = [point for point in path.history if point.stage == "actuation"]
    assert len(steps) == path.final.steps == 5
    assert sum(point.iterations for point in steps) == path.final.iterations


def test_rounding_of_the_energy_does_not_hold_a_descent_up():
    # Stiff members that are hardly stretched: their energy is known to fewer digits than it has.
    prism = library.prism()
    lengths = {"s0": 2.1722551700137487, "s1": 2.170985637264897, "s2": 2.1844250981335693}
    varied = {name: replace(prism.members[name], rest_length=length) for name, length in lengths.items()}
    path = solve_path(prism.replace(members={**prism.members, **varied}), {"top": 0.029756508939168175})
    assert path.status == "stable", path.reason
