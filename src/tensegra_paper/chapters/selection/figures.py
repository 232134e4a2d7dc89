"""Figure of the selection of runs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report.figures import COLOURS, GREY, grid, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["kept_figure"]

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

MOST_POINTS = 12_000
"""Dots that still tell more than a blot.

Of more the first are drawn: the beginning of Sobol's sequence fills the box, every n-th of it may not.
"""


@styled
def kept_figure(v: Array, w: Array, stands: Mask, rules: Mapping[str, Mask]) -> "Figure":
    """Draw the runs in the plane of v and w, a panel for each rule of selection.

    Parameters
    ----------
    v, w
        Displacements, shape (n_runs,), cm.
    stands
        Whether each run stands, by the solver.
    rules
        By name, which runs are kept.
    """
    made, panels = grid(len(rules), height=2.6)
    thin = slice(0, MOST_POINTS)
    for axes, (name, kept) in zip(panels, rules.items(), strict=True):
        for label, mask, colour in (
            ("left out", ~kept, GREY),
            ("kept, stands", kept & stands, COLOURS[0]),
            ("kept, collapsed", kept & ~stands, COLOURS[1]),
        ):
            shown = mask[thin]
            axes.scatter(
                v[thin][shown],
                w[thin][shown],
                s=2.0,
                color=colour,
                alpha=0.35 if colour == GREY else 0.7,
                linewidths=0,
                label=label,
                rasterized=True,
            )
        axes.set_title(f"{name}: {100 * kept.mean():.1f} %")
        axes.set_xlabel("v [cm]")
    panels[0].set_ylabel("w [cm]")
    legend_above(made, panels[0], scale=4.0)
    for handle in made.legends[0].legend_handles:
        if handle is not None:
            handle.set_alpha(1.0)
    return made
