"""The product design as dots, and boxes of the outputs over its temperatures."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import labelled
from tensegra.report.figures import COLOURS, figure, grid, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["box_figure", "design_figure"]

Array: TypeAlias = NDArray[np.float64]

PAIRS = (("A14", "A23"), ("T_top", "T_bottom"), ("T_bottom", "T_middle"), ("T_top", "T_middle"))
"""Panels a to d of Fig. 8."""

LIMITS = {"A": (8.9, 10.1), "T": (-8.0, 158.0)}


@styled
def design_figure(inputs: Mapping[str, Array], n_temperatures: int) -> "Figure":
    """Draw the points of both factors of the design by pairs of inputs.

    Parameters
    ----------
    inputs
        Of `product_design`.
    n_temperatures
        Number of temperatures, which run fastest.
    """
    made, panels = grid(len(PAIRS), columns=4, height=2.1)
    for k, (axes, (first, second)) in enumerate(zip(panels, PAIRS, strict=True)):
        kind = first[0]
        rows = slice(None, None, n_temperatures) if kind == "A" else slice(0, n_temperatures)
        factor, unit = (100.0, "%") if kind == "A" else (1.0, "°C")
        colour = COLOURS[0] if kind == "A" else COLOURS[1]
        x, y = (factor * inputs[name][rows] for name in (first, second))
        axes.scatter(x, y, s=8, color=colour, linewidths=0, alpha=0.8)
        axes.set_xlim(*LIMITS[kind])
        axes.set_ylim(*LIMITS[kind])
        axes.set_box_aspect(1.0)
        axes.locator_params(nbins=4)
        axes.set_xlabel(labelled(first.replace("_", " "), unit))
        axes.set_ylabel(labelled(second.replace("_", " "), unit))
        axes.set_title(f"({'abcd'[k]})")
    return made


@styled
def box_figure(boxes: Mapping[str, Array]) -> "Figure":
    """Draw a box for each actuation, by output.

    Parameters
    ----------
    boxes
        By output: minimum, quartiles and maximum by actuation, shape (5, n_actuations), cm.
    """
    made = figure(2.2 * len(boxes))
    for row, (name, values) in enumerate(boxes.items()):
        axes = made.add_subplot(len(boxes), 1, row + 1)
        drawn = [
            {"whislo": low, "q1": first, "med": middle, "q3": third, "whishi": high, "fliers": []}
            for low, first, middle, third, high in values.T
        ]
        axes.bxp(
            drawn,
            positions=np.arange(1, len(drawn) + 1),
            widths=0.72,
            showfliers=False,
            patch_artist=True,
            manage_ticks=False,
            boxprops={"facecolor": COLOURS[5], "edgecolor": COLOURS[0], "linewidth": 0.6},
            whiskerprops={"color": COLOURS[0], "linewidth": 0.6, "linestyle": (0, (3, 2))},
            capprops={"color": COLOURS[0], "linewidth": 0.6},
            medianprops={"color": COLOURS[1], "linewidth": 1.2},
        )
        axes.set_xlim(0.0, len(drawn) + 1.0)
        axes.set_ylabel(labelled(name, "cm"))
        axes.set_title(f"({'ab'[row]}) displacement-{'yz'[row]}")
        if row == len(boxes) - 1:
            axes.set_xlabel("actuation (A14, A23), sorted by the magnitude of the median")
        else:
            axes.tick_params(labelbottom=False)
        axes.grid(visible=False, axis="x")
    return made
