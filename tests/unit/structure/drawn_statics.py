"""The statics of a structure as it is drawn, without the solver."""

import numpy as np


def tensions(structure):
    """Return the tension of each member at the given coordinates, from T = EA (ℓ − l₀) / l₀."""
    index = {node: i for i, node in enumerate(structure.node_ids)}
    x = structure.coordinates
    result = {}
    for name, member in structure.members.items():
        length = sum(np.linalg.norm(x[index[b]] - x[index[a]]) for a, b in member.segments)
        result[name] = structure.axial_stiffness(name) * (length / member.rest_length - 1.0)
    return result


def nodal_forces(structure):
    """Return the sum of the members' pulls at each node, (n_nodes, 3)."""
    index = {node: i for i, node in enumerate(structure.node_ids)}
    x = structure.coordinates
    forces = np.zeros_like(x)
    for name, tension in tensions(structure).items():
        for a, b in structure.members[name].segments:
            axis = x[index[b]] - x[index[a]]
            pull = tension * axis / np.linalg.norm(axis)
            forces[index[a]] += pull
            forces[index[b]] -= pull
    return forces
