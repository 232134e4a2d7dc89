"""Figures of the optimisation."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import Optimum
from tensegra.report.figures import COLOURS, figure, search_figure, styled
from tensegra_paper.chapters.optimum.straight import Slice, Surface

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["convergence_figure", "range_figure", "solutions_figure", "surface_figure"]

Array: TypeAlias = NDArray[np.float64]

MARKS = ("o", "s", "^", "D")
LEVEL = 10.0
"""Distance of the contours of w, cm."""


def convergence_figure(found: Mapping[str, Optimum], names: Mapping[str, str]) -> "Figure":
    """Draw the best objective over the evaluations, a panel per method (Fig. 17)."""
    return search_figure(*_contents(found, names))


@styled
def solutions_figure(found: Mapping[str, Mapping[str, Array]]) -> "Figure":
    """Draw histograms of w at the intermediate solutions, a row per problem and a panel per method (Fig. 18).

    Parameters
    ----------
    found
        By problem and method, w at the solutions, cm.
    """
    made = figure(3.8)
    top = max(float(w.max()) for each in found.values() for w in each.values())
    edges = np.linspace(0.0, top, 26).tolist()
    for row, (problem, each) in enumerate(found.items()):
        for column, (method, w) in enumerate(each.items()):
            axes = made.add_subplot(len(found), len(each), row * len(each) + column + 1)
            axes.hist(w, edges, color=COLOURS[column], alpha=0.8)
            axes.set_title(f"({'abc'[column]}) {method}, {len(w)} solutions")
            axes.set_xlabel("w [cm]" if row == len(found) - 1 else "")
            axes.set_ylabel(f"{problem}\nnumber" if column == 0 else "")
    return made


def _contents(
    found: Mapping[str, Optimum], names: Mapping[str, str]
) -> "tuple[list[dict[str, Any]], list[pd.DataFrame]]":
    """Return what the report's figures of a search take."""
    import pandas as pd

    contents, traces = [], []
    for method, one in found.items():
        contents.append(
            {
                "method": names[method],
                "formula": one.formula,
                "maximise": one.maximise,
                "true_objective": one.true_objective,
                "input_names": one.input_names,
                "bounds": one.bounds.tolist(),
                "units": one.units,
            }
        )
        trace = one.trace
        columns = {"evaluation": trace.evaluation, "objective": trace.objective, "best": trace.best}
        traces.append(pd.DataFrame(columns | dict(zip(one.input_names, trace.x.T, strict=True))))
    return contents, traces


@styled
def range_figure(shown: Sequence[Slice]) -> "Figure":
    """Draw w over A1 and A4, a panel for each A23, with lines v = −1, 0 and 1 cm (Fig. 14)."""
    made = figure(2.9)
    top = max(float(np.nanmax(each.w)) for each in shown)
    levels = np.arange(0.0, top + LEVEL, LEVEL)
    drawn: Any = None
    panels = [made.add_subplot(1, len(shown), i + 1) for i in range(len(shown))]
    for axes, each in zip(panels, shown, strict=True):
        x, y = 100 * each.grid, 100 * each.grid
        drawn = axes.contourf(x, y, each.w.T, levels=levels, cmap="cividis")
        axes.contour(
            x,
            y,
            each.v.T,
            levels=[-1.0, 0.0, 1.0],
            colors="white",
            linewidths=(0.6, 1.4, 0.6),
            linestyles="-",
        )
        axes.grid(visible=False)
        axes.set_title(f"A23 = {100 * each.value:.0f} %")
        axes.set_xlabel("A1 [%]")
    panels[0].set_ylabel("A4 [%]")
    made.colorbar(drawn, ax=panels, label="w [cm]")
    return made


@styled
def surface_figure(surface: Surface, found: Mapping[str, Optimum], names: Mapping[str, str]) -> "Figure":
    """Draw A4 and w on the surface v = 0 over A1 and A23, with the places where the methods end."""
    made = figure(3.4)
    # Squares of a panel that is some 190 points wide, so that they touch.
    side = 190.0 / len(np.unique(surface.X[:, 0]))
    for k, (quantity, values) in enumerate((("A4 [%]", 100 * surface.X[:, 2]), ("w [cm]", surface.w))):
        axes = made.add_subplot(1, 2, k + 1)
        dots = axes.scatter(
            100 * surface.X[:, 0],
            100 * surface.X[:, 1],
            c=values,
            s=side**2,
            marker="s",
            cmap="cividis",
            linewidths=0,
            rasterized=True,
        )
        made.colorbar(dots, ax=axes, label=quantity)
        for mark, colour, (method, one) in zip(MARKS, COLOURS[1:], found.items(), strict=False):
            label = f"{names[method]}, w = {one.outputs['w']:.0f} cm"
            place = 100 * one.x[0], 100 * one.x[1]
            axes.plot(
                *place,
                mark,
                markersize=8,
                color=colour,
                markeredgecolor="black",
                label=label,
                clip_on=False,
                zorder=3,
            )
        axes.set_xlim(0, 30)
        axes.set_ylim(0, 30)
        axes.set_xlabel("A1 [%]")
        axes.set_ylabel("A23 [%]" if k == 0 else "")
    handles, labels = made.axes[0].get_legend_handles_labels()
    made.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return made
