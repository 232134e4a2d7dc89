"""Structures from the side and from above, as the publication draws them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import labelled
from tensegra.report.figures import BLACK, BLUE, GREEN, VERMILION, WIDTH, figure, styled
from tensegra.structure import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["GripperShape", "gripper_figure", "views_figure"]

Array: TypeAlias = NDArray[np.float64]

LOOKS: Mapping[str, dict[str, Any]] = {
    "cable": {"color": BLUE, "linewidth": 0.6},
    "clustered cable": {"color": VERMILION, "linewidth": 1.1},
    "strut": {"color": BLACK, "linewidth": 1.6},
}
"""From the back to the front."""

PALE = {"color": "#c9c9c9", "linewidth": 0.6}

VIEWS = {"from the side": (0, 2), "from above": (0, 1)}
"""Axes across and up."""


@styled
def views_figure(
    structure: Structure, shapes: Mapping[str, Array], *, reference: Array | None = None
) -> "Figure":
    """Draw a row for each shape: from the side on the left, from above on the right.

    Parameters
    ----------
    structure
        What to draw.
    shapes
        Positions by title, each (n_nodes, 3).
    reference
        Positions drawn behind them in grey, (n_nodes, 3).
    """
    behind = [] if reference is None else [reference]
    everything = np.concatenate([*behind, *shapes.values()])
    low, high = _limits(everything)
    # Both views share their width; a row is as high as the higher of them, with room for its title.
    tall = float((high - low)[1:].max() / (high - low)[0])
    made = figure(len(shapes) * (0.44 * WIDTH * tall + 0.3) + 0.45)
    for row, (title, nodes) in enumerate(shapes.items()):
        for column, (view, (across, up)) in enumerate(VIEWS.items()):
            axes = made.add_subplot(len(shapes), 2, 2 * row + column + 1)
            if reference is not None:
                _draw(axes, structure, reference[:, (across, up)], PALE)
            _draw(axes, structure, nodes[:, (across, up)])
            _show(axes, low[[across, up]], high[[across, up]])
            axes.set_title(title if title and column == 0 else view, fontsize=8.5)
            axes.set_ylabel(labelled("xyz"[up], structure.units.length))
            if row == len(shapes) - 1:
                axes.set_xlabel(labelled("xyz"[across], structure.units.length))
            else:
                axes.tick_params(labelbottom=False)
    return made


@dataclass(frozen=True, eq=False)
class GripperShape:
    """A gripper and the opening between its fingertips.

    Attributes
    ----------
    nodes
        Positions, (n_nodes, 3).
    edges
        Ends of the fingertips' edges in the plane across the axis, (n_beams, 2, 2).
    corners
        Of the opening, (n_corners, 2).
    """

    nodes: Array
    edges: Array
    corners: Array


@styled
def gripper_figure(structure: Structure, shapes: Mapping[str, GripperShape]) -> "Figure":
    """Draw a gripper: a column for each shape, from the side on top, along its axis in the middle.

    Below, the surroundings of the opening are drawn larger.

    Parameters
    ----------
    structure
        The gripper.
    shapes
        By title.
    """
    low, high = _limits(np.concatenate([shape.nodes for shape in shapes.values()]))
    columns = len(shapes)
    near = 1.15 * max(float(np.abs(shape.edges).max()) for shape in shapes.values())
    rows = ((VIEWS["from the side"], None), (VIEWS["from above"], None), (VIEWS["from above"], near))
    heights = [float((high - low)[2] / (high - low)[0]), 1.0, 1.0]
    made = figure(WIDTH / columns * sum(heights) + 0.8)
    cells = made.add_gridspec(len(rows), columns, height_ratios=heights)
    for column, (title, shape) in enumerate(shapes.items()):
        for row, ((across, up), window) in enumerate(rows):
            axes = made.add_subplot(cells[row, column])
            _draw(axes, structure, shape.nodes[:, (across, up)], thin=row < len(rows) - 1)
            if up == 1:
                axes.fill(*shape.corners.T, facecolor=GREEN, alpha=0.35, linewidth=0, zorder=3)
                for edge in shape.edges:
                    axes.plot(*edge.T, color=GREEN, linewidth=2.2, zorder=4, solid_capstyle="round")
            if window is None:
                _show(axes, low[[across, up]], high[[across, up]])
            else:
                _show(axes, np.full(2, -window), np.full(2, window))
            axes.set_title(_VIEW_NAMES[row].format(title))
            axes.set_xlabel(labelled("xyz"[across], structure.units.length))
            axes.set_ylabel(labelled("xyz"[up], structure.units.length) if column == 0 else "")
    return made


_VIEW_NAMES = ("{}", "along the axis", "the fingertips")


def _draw(
    axes: "Axes",
    structure: Structure,
    points: Array,
    look: dict[str, Any] | None = None,
    *,
    thin: bool = False,
) -> None:
    from matplotlib.collections import LineCollection

    index = {node: i for i, node in enumerate(structure.node_ids)}
    lines: dict[str, list[Array]] = {kind: [] for kind in LOOKS}
    for member in structure.members.values():
        kind = "clustered cable" if member.is_clustered else str(member.kind)
        lines[kind].append(points[[index[node] for node in member.nodes]])
    for order, (kind, own) in enumerate(LOOKS.items()):
        drawn = dict(look or own)
        drawn["linewidth"] *= 0.5 if thin else 1.0
        axes.add_collection(LineCollection(lines[kind], zorder=1.0 + 0.1 * order, **drawn))


def _limits(nodes: Array) -> tuple[Array, Array]:
    """Return the lowest and the highest coordinates with a margin, each (3,)."""
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    pad = 0.03 * float((high - low).max())
    return low - pad, high + pad


def _show(axes: "Axes", low: Sequence[float] | Array, high: Sequence[float] | Array) -> None:
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.locator_params(nbins=6)
