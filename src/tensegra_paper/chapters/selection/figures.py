"""Figure of the selection of runs."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report.figures import BLACK, COLOURS, grid, legend_above, styled
from tensegra_paper.beam_model import BeamRuns

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["MOST_POINTS", "kept_figure"]

Mask: TypeAlias = NDArray[np.bool_]

MOST_POINTS = 12_000
"""Dots that still tell more than a blot.

Of more the first are drawn: the beginning of Sobol's sequence fills the box, every n-th of it may not.
"""


@styled
def kept_figure(runs: BeamRuns, rules: Mapping[str, Mask]) -> "Figure":
    """Draw the runs in the plane of v and w: all of them, then a panel for each rule of selection.

    Parameters
    ----------
    runs
        What is selected from; those that failed have no place.
    rules
        By name, which runs are kept.
    """
    made, panels = grid(1 + len(rules), height=2.8)
    thin = slice(0, MOST_POINTS)
    everything: list[tuple[str, Mask, str]] = [
        ("stands", runs.stands, COLOURS[0]),
        ("prestress lost", runs.status == "collapsed", COLOURS[1]),
        ("does not stand", runs.status == "unstable", COLOURS[2]),
        ("left out, stands or not", np.zeros(runs.n_runs, dtype=np.bool_), BLACK),
    ]
    for k, axes in enumerate(panels):
        kept = runs.status != "failed"
        title = f"all, {100 * kept.mean():.1f} % converged"
        shown = everything[:3] if k else everything
        if k:
            name, chosen = list(rules.items())[k - 1]
            title = f"group of {name}: {100 * chosen.mean():.1f} %"
            shown = [(label, mask & chosen, colour) for label, mask, colour in shown]
            # On top, where what is kept would hide them.
            shown.append(("", kept & ~chosen, BLACK))
        for label, mask, colour in shown:
            axes.scatter(
                runs.v[thin][mask[thin]],
                runs.w[thin][mask[thin]],
                s=2.0,
                color=colour,
                alpha=0.6,
                linewidths=0,
                label=label,
                rasterized=True,
            )
        axes.set_title(f"({'abc'[k]}) {title}")
        axes.set_xlabel("v [cm]")
        axes.set_ylim(*_limits(runs))
        axes.set_xlim(*_limits(runs, "v"))
    panels[0].set_ylabel("w [cm]")
    legend_above(made, panels[0], scale=4.0)
    for handle in made.legends[0].legend_handles:
        if handle is not None:
            handle.set_alpha(1.0)
    return made


def _limits(runs: BeamRuns, output: str = "w") -> tuple[float, float]:
    """Return where nearly all runs lie: a few spurious roots lie metres away."""
    low, high = np.nanquantile(getattr(runs, output), [0.002, 0.998])
    pad = 0.05 * (high - low)
    return float(low - pad), float(high + pad)
