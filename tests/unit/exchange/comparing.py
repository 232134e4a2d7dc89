"""What two structures, one of which has been through a file, have in common."""

import numpy as np

DIGITS = 1e-12
"""Relative difference of numbers that went through a file: rounding of a product, never of a text."""


def assert_same(found, given, *, nodes=None, rest_length=None, groups=True):
    """Assert that a structure is another one but for what its format does not hold."""
    nodes = given.coordinates if nodes is None else nodes
    assert set(found.nodes) == set(given.nodes)
    size = np.ptp(nodes, axis=0).max()
    for node, place in zip(given.nodes, nodes, strict=True):
        assert np.abs(np.array(found.nodes[node]) - place).max() <= DIGITS * size
    assert dict(found.supports) == dict(given.supports)
    assert set(found.members) == set(given.members)
    for e, (name, member) in enumerate(given.members.items()):
        other = found.members[name]
        assert (other.kind, other.nodes) == (member.kind, member.nodes)
        length = member.rest_length if rest_length is None else rest_length[e]
        assert abs(other.rest_length - length) <= DIGITS * length
        stiffness = given.axial_stiffness(name)
        assert abs(found.axial_stiffness(name) - stiffness) <= DIGITS * stiffness
        if groups:
            assert other.groups == member.groups
