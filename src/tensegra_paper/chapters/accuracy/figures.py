"""Figures of the surrogates' errors."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import labelled
from tensegra.report.figures import COLOURS, GREY, WIDTH, figure, grid, legend_above, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["error_figure", "parity_figure"]

Array: TypeAlias = NDArray[np.float64]


@styled
def error_figure(
    curves: Mapping[str, Mapping[str, tuple[Sequence[int], Sequence[float]]]],
    crosses: Mapping[str, tuple[int, float]],
) -> "Figure":
    """Draw relative errors over the number of runs, a panel per output.

    Parameters
    ----------
    curves
        By output and surrogate: numbers of runs, and errors in percent.
    crosses
        By surrogate: the number of runs and the error that are printed.
    """
    made, panels = grid(len(curves), height=2.6)
    for k, (axes, (output, by_kind)) in enumerate(zip(panels, curves.items(), strict=True)):
        for colour, (kind, (sizes, errors)) in zip(COLOURS, by_kind.items(), strict=False):
            axes.loglog(sizes, errors, "o-", markersize=3.5, color=colour, label=kind)
            axes.plot(*crosses[kind], "x", markersize=8, color=colour, label=f"{kind}, printed")
        axes.set_title(f"({'ab'[k]}) {output}")
        axes.set_xlabel("runs learned from")
    panels[0].set_ylabel("relative error [%]")
    legend_above(made, panels[0])
    return made


@styled
def parity_figure(
    true: Array, predicted: Mapping[str, Array], outputs: Sequence[str], units: Sequence[str]
) -> "Figure":
    """Draw predictions over true outputs, and their errors below, a column per output.

    Parameters
    ----------
    true
        Outputs by FEM, shape (n_runs, n_outputs).
    predicted
        By surrogate, the same shape.
    outputs, units
        Of the columns.
    """
    n = len(outputs)
    made = figure(4.6, WIDTH)
    for k, (output, unit) in enumerate(zip(outputs, units, strict=True)):
        above, below = made.add_subplot(2, n, k + 1), made.add_subplot(2, n, n + k + 1)
        ends = [true[:, k].min(), true[:, k].max()]
        above.plot(ends, ends, color=GREY, linewidth=1.0)
        for i, (kind, values) in enumerate(predicted.items()):
            dots: dict[str, Any] = {
                "color": COLOURS[i],
                "linewidths": 0,
                "alpha": 0.6,
                "rasterized": True,
                "label": kind,
            }
            above.scatter(true[:, k], values[:, k], s=14 - 8 * i, **dots)
            error = np.maximum(np.abs(values[:, k] - true[:, k]), np.finfo(float).tiny)
            below.scatter(true[:, k], error, s=5, **dots)
        below.set_yscale("log")
        above.set_title(f"({'ab'[k]}) {output}")
        below.set_xlabel(labelled(f"{output}, FEM", unit))
        if k == 0:
            above.set_ylabel(labelled("surrogate", unit))
            below.set_ylabel(labelled("|surrogate − FEM|", unit))
    legend_above(made, made.axes[0], scale=2.0)
    return made
