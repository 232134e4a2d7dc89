"""Cables over pulleys in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq

from tensegra.mechanics import Status, solve_path
from tensegra.structure import Member, Stage, Structure, library

POSITION = 1e-9
"""Of the size: the residual of 1e-9 of the tension over the geometric stiffness of about one of it."""

TENSION = 1e-9
"""Relative: what the residual allows."""

SAME = 1e-10
"""Of the size and of the largest tension: two models of one structure."""

EA, WEIGHT = 50.0, 4.0


def ring(span, rise, rest_length, weight):
    """Height and position of a ring that slides without friction on a rope between two hooks.

    Both parts lean by the same angle φ against the vertical, sin φ = span/ℓ, or else the ring would
    slide; T = W/(2 cos φ); the lengths of the parts differ by rise/cos φ.
    """

    def out_of_balance(length):
        cosine = np.sqrt(1 - (span / length) ** 2)
        return EA * (length / rest_length - 1) - weight / (2 * cosine)

    shortest = np.hypot(span, rise)
    longest = 100.0  # the shortest, straight between the hooks, would take an infinite tension
    length = brentq(out_of_balance, max(shortest, rest_length) * (1 + 1e-12), longest, xtol=1e-14)
    sine = span / length
    cosine = np.sqrt(1 - sine**2)
    first = 0.5 * (length - rise / cosine)
    return np.array([first * sine, 0.0, -first * cosine]), weight / (2 * cosine)


@pytest.mark.parametrize(
    ("rise", "rest_length"), [(0.0, 5.0), (0.0, 3.9), (1.5, 5.0), (-1.0, 6.0), (2.0, 8.0)]
)
def test_a_ring_on_a_rope(rise, rest_length):
    span = 4.0
    structure = Structure(
        name="ring",
        nodes={"a": (0, 0, 0), "ring": (1.7, 0.3, -2.5), "b": (span, 0, rise)},
        members={"rope": Member("cable", ("a", "ring", "b"), rest_length, stiffness=EA)},
        supports={"a": "xyz", "b": "xyz"},
        stages=[Stage("hang", loads={"ring": (0, 0, -WEIGHT)})],
    )
    final = solve_path(structure).final
    position, tension = ring(span, rise, rest_length, WEIGHT)
    assert final.status is Status.STABLE
    np.testing.assert_allclose(final.node("ring"), position, atol=POSITION * span)
    assert final.tension("rope") == pytest.approx(tension, rel=TENSION)


def test_a_ring_follows_the_load_and_the_hook():
    # A load sideways tilts gravity: the closed form holds in the turned frame, for level hooks apart.
    span, rest_length = 4.0, 5.0
    structure = Structure(
        name="ring",
        nodes={"a": (0, 0, 0), "ring": (2.0, 0.0, -1.5), "b": (span - 1, 0, 0)},
        members={"rope": Member("cable", ("a", "ring", "b"), rest_length, stiffness=EA)},
        supports={"a": "xyz", "b": "xyz"},
        stages=[
            Stage("hang", loads={"ring": (0, 0, -WEIGHT)}),
            Stage("apart", positions={"b": (span, 0, 0)}),
        ],
    )
    path = solve_path(structure, loads={("ring", "y"): WEIGHT})
    position, tension = ring(span, 0.0, rest_length, WEIGHT * np.sqrt(2))
    assert path.status is Status.STABLE
    assert path.final.tension("rope") == pytest.approx(tension, rel=TENSION)
    sag = -position[2] / np.sqrt(2)
    np.testing.assert_allclose(path.final.node("ring"), [span / 2, sag, -sag], atol=POSITION * span)


def beam_like(plain):
    """Build a mast stayed by ropes; each is a plain cable, or a loop there and back of twice the length."""
    anchors = {"1": (2, 0, 0), "2": (-1, 2, 0), "3": (-1, -2, 0)}
    rest_length, stiffness = 3.5, 200.0

    def rope(anchor):
        if plain:
            return Member("cable", (anchor, "top"), rest_length, stiffness=2 * stiffness)
        return Member("cable", (anchor, "top", anchor), 2 * rest_length, stiffness=stiffness)

    return Structure(
        name="mast",
        nodes={"foot": (0, 0, 0), "top": (0, 0, 3), **anchors},
        members={
            "mast": Member("strut", ("foot", "top"), 3.1, stiffness=5000.0),
            **{f"r{anchor}": rope(anchor) for anchor in anchors},
        },
        supports=dict.fromkeys(("foot", *anchors), "xyz"),
        stages=[Stage("wind", loads={"top": (3, 1, 0)}, rest_length_changes={"r1": -0.02})],
    )


def test_a_cluster_there_and_back_equals_a_plain_cable():
    # T = EA (2ℓ − 2l₀)/(2l₀) acts twice on each node: a plain cable of stiffness 2 EA.
    plain, cluster = solve_path(beam_like(plain=True)), solve_path(beam_like(plain=False))
    assert plain.status is cluster.status is Status.STABLE
    assert plain.final.slack_members == cluster.final.slack_members
    np.testing.assert_allclose(cluster.final.nodes, plain.final.nodes, atol=SAME * 4)
    factor = np.array([1.0, 2.0, 2.0, 2.0])
    np.testing.assert_allclose(
        factor * cluster.final.tensions, plain.final.tensions, atol=SAME * np.abs(plain.final.tensions).max()
    )
    assert cluster.final.lowest_eigenvalue == pytest.approx(plain.final.lowest_eigenvalue, rel=1e-8)
    assert cluster.final.strain_energy == pytest.approx(plain.final.strain_energy, rel=1e-8)


def test_a_straight_cluster_equals_a_plain_cable():
    # Rings held on the line between the ends do not bend the rope.
    def rope(*between):
        nodes = {"a": (0, 0, 0), **{f"m{i}": (0, 0, z) for i, z in enumerate(between)}, "b": (0, 0, -3)}
        return Structure(
            name="rope",
            nodes=nodes,
            members={"rope": Member("cable", tuple(nodes), 2.9, stiffness=EA)},
            supports={"a": "xyz", "b": "xy", **{f"m{i}": "xyz" for i in range(len(between))}},
            stages=[Stage("hang", loads={"b": (0, 0, -1)})],
        )

    plain, clustered = solve_path(rope()).final, solve_path(rope(-1.0, -1.2)).final
    np.testing.assert_allclose(clustered.node("b"), plain.node("b"), atol=SAME * 3)
    assert plain.node("b")[2] == pytest.approx(-2.9 * (1 + 1 / EA), rel=TENSION)
    assert clustered.tension("rope") == pytest.approx(1.0, rel=TENSION)


@pytest.mark.parametrize("actuation", [{}, {"A14": 0.1, "A23": 0.1}, {"A1": 0.1, "A4": 0.02}])
def test_every_pulley_is_in_balance_with_equal_tensions(actuation):
    """Take the two parts of a clustered cable at a pulley as unknowns: balance makes them equal."""
    beam = library.paper_beam()
    final = solve_path(beam, actuation).final
    x = dict(zip(beam.nodes, final.nodes, strict=True))
    weight = dict.fromkeys(beam.nodes, 0.0)
    for name, member in beam.members.items():
        for i, j in member.segments:
            length = np.linalg.norm(np.subtract(beam.nodes[i], beam.nodes[j]))
            for node in (i, j):
                weight[node] += 0.5 * beam.weight_per_length(name) * length

    checked = 0
    for name, member in beam.members.items():
        for before, pulley, after in zip(member.nodes, member.nodes[1:], member.nodes[2:], strict=False):
            rest = np.array([0.0, 0.0, -weight[pulley]])
            for other, path in beam.members.items():
                for i, j in path.segments:
                    if other != name and pulley in (i, j):
                        along = x[j if i == pulley else i] - x[pulley]
                        rest += final.tension(other) * along / np.linalg.norm(along)
            parts = np.array([x[before] - x[pulley], x[after] - x[pulley]]).T
            parts /= np.linalg.norm(parts, axis=0)
            tensions, residual, _, singular = np.linalg.lstsq(parts, -rest)
            scale = np.abs(final.tensions).max()
            tolerance = 1e-8 * scale / singular.min()
            np.testing.assert_allclose(tensions, final.tension(name), rtol=0.0, atol=tolerance)
            assert np.sqrt(residual.sum()) < tolerance
            checked += 1
    assert checked == 16  # four clustered cables over four pulleys each
