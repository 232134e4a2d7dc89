"""Pictures of structures: as they stand, and as they move."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tensegra.report.figures.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREEN,
    GREY,
    VERMILION,
    figure,
    styled,
)
from tensegra.report.tables import labelled
from tensegra.structure import Structure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["shape_figure", "structure_figure"]

Array = NDArray[np.float64]

_LOOKS: Mapping[str, dict[str, Any]] = {
    "strut": {"color": BLACK, "linewidth": 2.6},
    "cable": {"color": BLUE, "linewidth": 0.9},
    "clustered cable": {"color": VERMILION, "linewidth": 1.7},
}
LABEL_SIZE = (0.035, 0.035)
"""Share of the axes that the name of a node takes."""


@styled
def structure_figure(
    structure: Structure,
    nodes: Array,
    named: Sequence[str] = (),
    *,
    reference: Array | None = None,
    members: Sequence[str] = (),
) -> "Figure":
    """Draw a structure in space, with the names of as many nodes as find room.

    Parameters
    ----------
    structure
        What to draw.
    nodes
        Where its nodes are, shape (n_nodes, 3).
    named
        Nodes whose names matter most.
    reference
        Other positions, drawn in grey, shape (n_nodes, 3).
    members
        Members whose names are written at their middles.
    """
    made = figure(3.9)
    axes = _axes_in_space(made, (0.0, 0.02, 0.92, 0.94))
    if reference is not None:
        _draw_in_space(axes, structure, reference, colour="#bdbdbd")
    _draw_in_space(axes, structure, nodes)
    held = [structure.node_ids.index(node) for node in structure.supports]
    axes.scatter(*nodes[held].T, marker="^", s=30, color=GREEN, label="supports", depthshade=False, zorder=10)
    _frame(axes, structure, nodes if reference is None else np.concatenate([reference, nodes]), zoom=1.36)
    _name_nodes(axes, structure, nodes, [*named, *structure.supports, *structure.node_ids])
    _name_members(axes, structure, nodes, members)
    handles, labels = axes.get_legend_handles_labels()
    made.legend(handles, labels, loc="upper left", ncols=len(labels))
    return made


@styled
def shape_figure(structure: Structure, reference: Array, shapes: Mapping[str, Array]) -> "Figure":
    """Draw deformed shapes over the reference: in space one by one, and all together from two sides.

    Parameters
    ----------
    structure
        What to draw.
    reference
        Positions before the deformation, shape (n_nodes, 3), in grey.
    shapes
        Positions by title.
    """
    made = figure(5.6)
    everything = np.concatenate([reference, *shapes.values()])
    width = 1.0 / len(shapes)
    for i, (title, nodes) in enumerate(shapes.items()):
        axes = _axes_in_space(made, (i * width, 0.46, 0.84 * width, 0.5))
        _draw_in_space(axes, structure, reference, colour="#bdbdbd")
        _draw_in_space(axes, structure, nodes)
        _frame(axes, structure, everything, zoom=1.02)
        made.text((i + 0.5) * width, 0.965, title, ha="center", fontsize=9)
    for column, (first, second) in enumerate(((0, 2), (0, 1))):
        flat = made.add_axes((0.09 + 0.5 * column, 0.09, 0.395, 0.31))
        _draw_flat(flat, structure, reference[:, (first, second)], GREY, "reference")
        for (title, nodes), colour in zip(shapes.items(), COLOURS, strict=False):
            _draw_flat(flat, structure, nodes[:, (first, second)], colour, title.partition(":")[0])
        flat.set_aspect("equal", adjustable="datalim")
        flat.set_xlabel(labelled("xyz"[first], structure.units.length))
        flat.set_ylabel(labelled("xyz"[second], structure.units.length))
    names = made.axes[-1].get_legend_handles_labels()
    made.legend(*names, loc="center", bbox_to_anchor=(0.5, 0.43), ncols=1 + len(shapes))
    return made


def _axes_in_space(made: "Figure", place: tuple[float, float, float, float]) -> Any:  # noqa: ANN401 - Axes3D
    """Return three-dimensional axes; matplotlib's layout does not know the extent of their labels."""
    made.set_layout_engine("none")
    return made.add_axes(place, projection="3d")


def _name_nodes(axes: Any, structure: Structure, nodes: Array, order: Sequence[str]) -> None:  # noqa: ANN401
    """Write the names of nodes, the first ones first, each only where it covers none before it."""
    from matplotlib.patheffects import withStroke
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    halo = [withStroke(linewidth=2.0, foreground="white")]
    size = np.array(axes.get_window_extent().size)
    across, up, _ = proj_transform(*nodes.T, axes.get_proj())
    placed: list[Array] = []
    for name in dict.fromkeys(order):
        n = structure.node_ids.index(name)
        place = axes.transData.transform((across[n], up[n]))
        if all(np.any(np.abs(place - other) > LABEL_SIZE * size) for other in placed):
            placed.append(place)
            axes.text(*nodes[n], f" {name}", fontsize=7, color="#303030", zorder=11, path_effects=halo)


def _name_members(axes: Any, structure: Structure, nodes: Array, members: Sequence[str]) -> None:  # noqa: ANN401
    """Write the names of members at the middle segments of their paths."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.5, foreground="white")]
    for name in members:
        path = structure.members[name].nodes
        first, second = path[(len(path) - 1) // 2], path[(len(path) - 1) // 2 + 1]
        middle = nodes[[structure.node_ids.index(node) for node in (first, second)]].mean(axis=0)
        look = {"fontsize": 9, "fontweight": "bold", "color": VERMILION, "ha": "center", "zorder": 12}
        axes.text(*middle, name, path_effects=halo, **look)


def _segments(structure: Structure, nodes: Array) -> dict[str, list[Array]]:
    index = {node: i for i, node in enumerate(structure.node_ids)}
    lines: dict[str, list[Array]] = {kind: [] for kind in _LOOKS}
    for member in structure.members.values():
        kind = "clustered cable" if member.is_clustered else member.kind
        lines[kind].append(nodes[[index[node] for node in member.nodes]])
    return lines


def _draw_in_space(axes: Any, structure: Structure, nodes: Array, colour: str | None = None) -> None:  # noqa: ANN401
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    # Cables first: matplotlib has no depth, and a strut must not be hidden by a thin line.
    for kind, lines in reversed(_segments(structure, nodes).items()):
        if lines:
            look = dict(_LOOKS[kind])
            if colour is not None:
                look = {"color": colour, "linewidth": 0.6 * look["linewidth"]}
            drawn = Line3DCollection(lines, label=None if colour else f"{kind}s", **look)
            # The axes are a square; a long structure is drawn beyond it.
            drawn.set_clip_on(False)
            axes.add_collection3d(drawn)


def _draw_flat(axes: "Axes", structure: Structure, points: Array, colour: str, label: str) -> None:
    from matplotlib.collections import LineCollection

    for kind, lines in _segments(structure, points).items():
        width = 0.55 * _LOOKS[kind]["linewidth"]
        if lines:
            name = label if kind == "strut" else None
            axes.add_collection(LineCollection(lines, color=colour, linewidth=width, alpha=0.9, label=name))
    axes.autoscale_view()


def _frame(axes: Any, structure: Structure, nodes: Array, zoom: float) -> None:  # noqa: ANN401 - three-dimensional axes
    """Show all nodes to one scale, with a few round ticks."""
    from matplotlib.ticker import MultipleLocator

    low, high = nodes.min(axis=0), nodes.max(axis=0)
    span = high - low
    pad = 0.04 * span.max()
    for i, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(low[i] - pad, high[i] + pad)
        axis = getattr(axes, f"{name}axis")
        axis.set_major_locator(MultipleLocator(_round_step(max(0.45 * span[i], 0.2 * span.max()))))
        axis.pane.set_facecolor("#fafafa")
        axis.set_tick_params(labelsize=7, pad=-1)
        getattr(axes, f"set_{name}label")(
            labelled(name, structure.units.length), labelpad=_label_pad(span, i)
        )
    axes.set_box_aspect(np.maximum(span + 2 * pad, 0.15 * span.max()), zoom=zoom)
    axes.set_proj_type("ortho")
    axes.view_init(elev=18, azim=-62)


def _label_pad(span: Array, axis: int) -> float:
    """Return the distance of an axis' name; a long axis leaves its ticks more room."""
    return 2.0 if span[axis] > 0.5 * span.max() else -3.0


def _round_step(length: float) -> float:
    """Return the largest 1, 2, 4 or 5 times a power of ten that is not above `length`."""
    power = 10.0 ** np.floor(np.log10(length)) if length > 0 else 1.0
    return float(max(factor * power for factor in (1, 2, 4, 5) if factor * power <= max(length, power)))
