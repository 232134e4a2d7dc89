"""Figures of a campaign: its design, its outputs, the selection, and what the surrogates make of it."""

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.report.figures.panels import MOST_PANELS
from tensegra.report.figures.style import (
    COLOURS,
    GREY,
    STATUS_COLOURS,
    WIDTH,
    YELLOW,
    figure,
    grid,
    legend_above,
    styled,
)
from tensegra.report.tables import labelled
from tensegra.study import Selection, Study
from tensegra.study.selection import NO_GROUP
from tensegra.surrogate.validation import HALF_WIDTH_90

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tensegra.surrogate import Surrogate

__all__ = ["design_figure", "outcome_figure", "output_figure", "parity_figure", "selection_figure"]

MOST_POINTS = 4000
"""Dots that still tell more than a black square; of more, as many are drawn at random.

Every n-th point of Sobol's sequence may keep to a part of the box, so that a stride would mislead.
"""

MOST_GROUPS = 5
"""Groups that are told apart; further ones are drawn together."""

GROUP_COLOURS = COLOURS[1:]


@styled
def design_figure(study: Study, frame: "pd.DataFrame") -> "Figure":
    """Draw the design points by pairs of variables, coloured by status, with their histograms."""
    names, units = study.input_names, study.space.units
    n = len(names)
    frame = _thinned(frame)
    made = figure(min(1.25 * n + 0.6, WIDTH))
    layout: Any = made.get_layout_engine()
    layout.set(w_pad=0.02, h_pad=0.02, wspace=0.03, hspace=0.03)
    for row in range(n):
        for column in range(row + 1):
            axes = made.add_subplot(n, n, row * n + column + 1)
            if row == column:
                axes.hist(frame[names[row]], bins=20, color=COLOURS[0], alpha=0.6)
                axes.set_yticks([])
                axes.spines["left"].set_visible(False)
            else:
                _dots_by_status(axes, frame, names[column], names[row])
            _ticks(axes)
            if row == n - 1:
                axes.set_xlabel(labelled(names[column], units[column]))
            else:
                axes.tick_params(labelbottom=False)
            if column == 0 and row > 0:
                axes.set_ylabel(labelled(names[row], units[row]))
            elif row != column:
                axes.tick_params(labelleft=False)
    if n > 1:
        legend_above(made, made.axes[1], scale=1.6)
    return made


@styled
def output_figure(study: Study, frame: "pd.DataFrame") -> "Figure":
    """Draw each output over each variable."""
    frame = _thinned(frame)
    outputs, variables = study.outputs, study.variables
    made = figure(min(1.5 * len(outputs) + 0.5, 9.0))
    shape = len(outputs), len(variables)
    for row, output in enumerate(outputs):
        for column, variable in enumerate(variables):
            axes = made.add_subplot(*shape, row * shape[1] + column + 1)
            _dots_by_status(axes, frame, variable.name, output.name)
            _ticks(axes)
            if row == len(outputs) - 1:
                axes.set_xlabel(labelled(variable.name, variable.unit))
            else:
                axes.tick_params(labelbottom=False)
            if column == 0:
                axes.set_ylabel(labelled(output.name, output.unit))
            else:
                axes.tick_params(labelleft=False)
    legend_above(made, made.axes[0], scale=1.6)
    return made


@styled
def outcome_figure(frame: "pd.DataFrame", selection: Selection) -> "Figure":
    """Draw the shares of the outcomes: by the solver's word, and by the groups of the outputs (Fig. 6)."""
    statuses = frame["status"].to_numpy()
    n_groups = int(selection.labels.max(initial=NO_GROUP)) + 1
    others = zip(range(1, min(n_groups, MOST_GROUPS)), GROUP_COLOURS, strict=False)
    bars = {
        "solver": [(status, statuses == status, colour) for status, colour in STATUS_COLOURS.items()],
        "clustering": [
            ("largest group", selection.labels == 0, COLOURS[0]),
            *((f"group {label}", selection.labels == label, colour) for label, colour in others),
            ("further groups", selection.labels >= MOST_GROUPS, YELLOW),
            ("no group", selection.labels == NO_GROUP, GREY),
        ],
    }
    made = figure(2.6)
    for row, (name, parts) in enumerate(bars.items()):
        axes = made.add_subplot(len(bars), 1, row + 1)
        begin = 0.0
        for label, mask, colour in parts:
            share = 100.0 * float(mask.mean())
            if share > 0.0:
                text = f"{label}, {share:.3g} %"
                axes.barh([0], [share], left=begin, color=colour, edgecolor="white", label=text)
                begin += share
        axes.set_xlim(0.0, 100.0)
        axes.set_yticks([0], [name])
        axes.grid(visible=False, axis="y")
        columns = min(4, len(axes.patches))
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2)
        if row == len(bars) - 1:
            axes.set_xlabel("share of the runs [%]")
        else:
            axes.tick_params(labelbottom=False)
    return made


@styled
def selection_figure(study: Study, frame: "pd.DataFrame", selection: Selection) -> "Figure":
    """Draw the runs in the space of the outputs: those that are learned from, and the others."""
    names = study.output_names
    units = {output.name: output.unit for output in study.outputs}
    pairs = list(combinations(names, 2)) or [(names[0], names[0])]
    made, panels = grid(len(pairs[:6]))
    labels = selection.labels
    kinds = [("learned from", selection.keep, COLOURS[0], "o")]
    kinds.append(("in the largest group, not certified", (labels == 0) & ~selection.keep, COLOURS[1], "s"))
    kinds += [
        (f"group {label}", (labels == label) & ~selection.keep, colour, marker)
        for label, colour, marker in zip(range(1, 4), COLOURS[2:], "vD^", strict=False)
    ]
    others = ~selection.keep & ((labels < 0) | (labels > 3))
    kinds.append(("in no group", others, GREY, "x"))
    for axes, (first, second) in zip(panels, pairs, strict=False):
        for label, mask, colour, marker in kinds:
            rows = np.flatnonzero(mask)[_shown(int(mask.sum()))]
            if len(rows):
                edge: dict[str, Any] = {} if marker == "x" else {"linewidths": 0}
                axes.scatter(
                    frame[first].to_numpy()[rows],
                    frame[second].to_numpy()[rows],
                    s=9,
                    marker=marker,
                    color=colour,
                    alpha=0.6,
                    label=f"{label} ({int(mask.sum())})",
                    rasterized=True,
                    **edge,
                )
        axes.set_xlabel(labelled(first, units[first]))
        axes.set_ylabel(labelled(second, units[second]))
    legend_above(made, panels[0])
    return made


@styled
def parity_figure(
    surrogate: "Surrogate", held_out: "pd.DataFrame", outputs: "Sequence[str] | None" = None
) -> "Figure":
    """Draw predicted over true outputs of the held-out runs, and below the error with its 90 % interval."""
    unit_of = dict(zip(surrogate.output_names, surrogate.output_units, strict=True))
    names = list(outputs or surrogate.output_names)[:MOST_PANELS]
    units = [unit_of[name] for name in names]
    n = len(names)
    made = figure(4.4, min(WIDTH, 2.5 * n + 0.6))
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        true = held_out[name].to_numpy()
        # NaN where the surrogate takes the run for one that does not stand.
        predicted = held_out[f"{name}_predicted"].to_numpy()
        above, below = made.add_subplot(2, n, k + 1), made.add_subplot(2, n, n + k + 1)
        ends = [min(true.min(), np.nanmin(predicted)), max(true.max(), np.nanmax(predicted))]
        above.plot(ends, ends, color=GREY, linewidth=1.0)
        above.scatter(true, predicted, s=9, color=COLOURS[0], alpha=0.6, linewidths=0, rasterized=True)
        above.set_title(f"{name}")
        above.set_ylabel(labelled("predicted", unit) if k == 0 else "")
        std = held_out.get(f"{name}_std")
        if std is not None:
            bars = HALF_WIDTH_90 * std.to_numpy()
            below.errorbar(
                true, predicted - true, yerr=bars, fmt="none", ecolor="#c9c9c9", elinewidth=0.7, zorder=1
            )
        below.axhline(0.0, color=GREY, linewidth=1.0)
        below.scatter(
            true, predicted - true, s=9, color=COLOURS[1], alpha=0.7, linewidths=0, zorder=2, rasterized=True
        )
        below.set_xlabel(labelled("true", unit))
        below.set_ylabel(labelled("predicted − true", unit) if k == 0 else "")
        below.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3))
        for axes in (above, below):
            axes.locator_params(axis="x", nbins=4)
            axes.locator_params(axis="y", nbins=5)
    return made


def _dots_by_status(axes: "Axes", frame: "pd.DataFrame", x: str, y: str) -> None:
    size = float(np.clip(4000 / max(len(frame), 1), 3.0, 14.0))
    for status, colour in STATUS_COLOURS.items():
        rows = frame[frame["status"] == status]
        if len(rows):
            axes.scatter(
                rows[x],
                rows[y],
                s=size,
                color=colour,
                alpha=0.65,
                linewidths=0,
                label=status,
                rasterized=True,
            )


def _ticks(axes: "Axes") -> None:
    axes.locator_params(nbins=3)
    axes.tick_params(labelsize=7)


def _thinned(frame: "pd.DataFrame") -> "pd.DataFrame":
    return frame.iloc[_shown(len(frame))]


def _shown(n_rows: int) -> np.ndarray:
    """Return the numbers of the rows that are drawn, in their order."""
    if n_rows <= MOST_POINTS:
        return np.arange(n_rows)
    return np.sort(np.random.default_rng(0).choice(n_rows, MOST_POINTS, replace=False))
