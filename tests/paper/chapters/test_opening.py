import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tensegra_paper.chapters.gripper.opening import corners, edge_distance, opening, radius_for


def turned(edge, n_beams=4):
    """Return an edge of (inward distance from the axis, sideways) turned around the axis."""
    angles = 2.0 * np.pi * np.arange(n_beams) / n_beams
    turns = np.array([[[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]] for a in angles])
    return np.einsum("bij,ej->bei", turns, np.asarray(edge, dtype=float))


def test_four_upright_edges_enclose_a_square():
    edges = turned([[10.0, -3.0], [10.0, 5.0]])
    assert opening(edges) == pytest.approx(400.0)
    assert len(corners(edges)) == 4


@given(
    distance=st.floats(1.0, 100.0),
    angle=st.floats(-1.2, 1.2),
    n_beams=st.integers(3, 8),
    far=st.floats(1.0, 30.0),
)
def test_turned_edges_enclose_a_regular_polygon(distance, angle, n_beams, far):
    """Area of the regular polygon around a circle: n r² tan(π/n), however the edges lie along its sides."""
    normal = np.array([np.cos(angle), np.sin(angle)])
    along = np.array([-normal[1], normal[0]])
    edges = turned([distance * normal - far * along, distance * normal + 2 * far * along], n_beams)
    assert edge_distance(edges[0]) == pytest.approx(distance)
    assert opening(edges) == pytest.approx(n_beams * distance**2 * np.tan(np.pi / n_beams))


@given(gap=st.floats(1.0, 60.0), slope=st.floats(-1.0, 1.0), inward=st.floats(50.0, 180.0))
def test_the_radius_gives_the_gap(gap, slope, inward):
    """With the radius found, the line through the tip's edge passes the axis at half the gap."""
    edge = np.array([[inward, 12.0], [inward - 30.0 * slope, -18.0]])
    radius = radius_for(gap, edge)
    placed = np.column_stack([radius - edge[:, 0], edge[:, 1]])
    assert 2.0 * edge_distance(placed) == pytest.approx(gap, rel=1e-9)
