"""Figures of the analyses, from what they left in the campaign's folder."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.report.figures.panels import first_shown, strongest
from tensegra.report.figures.style import COLOURS, GREY, figure, grid, legend_above, styled
from tensegra.report.tables import labelled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["index_convergence", "index_figure", "propagation_figure", "search_figure", "visited_figure"]

Content = Mapping[str, Any]

MOST_INPUTS = 10
"""Small panels of inputs that a figure has, in rows of five."""

MOST_BARS = 20
"""Inputs that a figure has bars for; the others are weaker."""


def _strongest_inputs(content: Content, most: int = MOST_BARS) -> list[int]:
    """Return the numbers of the inputs with the greatest total index for any output, in their order."""
    totals = [numbers(found["total"]) for found in content["indices"].values() if not found["reason"]]
    if not totals:
        return list(range(min(most, len(content["input_names"]))))
    return strongest(np.nan_to_num(np.array(totals)).max(axis=0), most)


@styled
def propagation_figure(content: Content) -> "Figure":
    """Draw the inputs as drawn, and the histogram and density of each output, of one model or two."""
    random = {name: s for name, s in content["inputs"].items() if s["statistics"]["std"]["value"]}
    inputs = list(first_shown(random, MOST_INPUTS).values())
    outputs = list(first_shown(content["outputs"]).values())
    columns = max(len(outputs), 3)
    input_rows = -(-len(inputs) // 5)
    made = figure(1.45 * input_rows + 2.6 * -(-len(outputs) // columns) + 0.3)
    parts: Any = made.subfigures(2, 1, height_ratios=(1.45 * input_rows, 2.6))
    top, bottom = parts
    for i, summary in enumerate(inputs):
        axes = top.add_subplot(input_rows, min(len(inputs), 5), i + 1)
        histogram(axes, summary, GREY, filled=True)
        axes.set_xlabel(labelled(summary["name"], summary["unit"]))
        axes.locator_params(nbins=3)
        axes.tick_params(labelsize=7)
    top.supylabel("density", fontsize=8.5)
    models = [content, *([content["other"]] if content["other"] else [])]
    for k, summary in enumerate(outputs):
        axes = bottom.add_subplot(-(-len(outputs) // columns), min(columns, len(outputs)), k + 1)
        for m, model in enumerate(models):
            shown = model["outputs"][summary["name"]]
            histogram(axes, shown, COLOURS[m], filled=m == 0, label=model["model"])
            density = shown["density"]
            style = "-" if m == 0 else "--"
            axes.plot(
                density["grid"],
                density["values"],
                style,
                color=COLOURS[m],
                label=f"{model['model']}, kernel density",
            )
        axes.set_xlabel(labelled(summary["name"], summary["unit"]))
        axes.locator_params(axis="x", nbins=5)
        if k == 0 or summary["unit"] != outputs[k - 1]["unit"]:
            axes.set_ylabel(density_label(summary["unit"]))
    legend_above(bottom, bottom.axes[0])
    return made


@styled
def index_figure(content: Content) -> "Figure":
    """Draw first-order and total Sobol indices with their intervals, a panel per output."""
    indices = first_shown(content["indices"])
    made, panels = grid(len(indices), height=2.5)
    shown = _strongest_inputs(content)
    variables = [content["input_names"][i] for i in shown]
    place = np.arange(len(variables))
    for axes, (output, found) in zip(panels, indices.items(), strict=True):
        for shift, order, colour in ((-0.2, "first", COLOURS[0]), (0.2, "total", COLOURS[3])):
            heights = numbers(found[order])[shown]
            axes.bar(
                place + shift,
                heights,
                0.38,
                yerr=numbers(found[f"{order}_half"])[shown],
                color=colour,
                ecolor="#404040",
                error_kw={"elinewidth": 0.9, "capsize": 2},
                label="first order" if order == "first" else "total",
            )
        axes.set_title(output)
        axes.set_xticks(place, variables, rotation=40, ha="right", rotation_mode="anchor")
        axes.grid(visible=False, axis="x")
        axes.axhline(0.0, color="#404040", linewidth=0.8)
    panels[0].set_ylabel("Sobol index")
    legend_above(made, panels[0])
    return made


@styled
def index_convergence(content: Content) -> "Figure":
    """Draw the total indices over the number of base points, to see whether they have settled."""
    convergence = first_shown(content["convergence"])
    made, panels = grid(len(convergence), height=2.2)
    sizes = np.array(content["sizes"], dtype=float)
    shown = _strongest_inputs(content, len(COLOURS))
    for axes, (output, steps) in zip(panels, convergence.items(), strict=True):
        for colour, i in zip(COLOURS, shown, strict=False):
            variable = content["input_names"][i]
            total = np.array([numbers(step["total"])[i] for step in steps])
            half = np.array([numbers(step["total_half"])[i] for step in steps])
            axes.plot(sizes, total, "o-", markersize=3, color=colour, label=variable)
            axes.fill_between(sizes, total - half, total + half, color=colour, alpha=0.15, linewidth=0)
        axes.set_xscale("log", base=2)
        axes.set_xticks(sizes[::2] if len(sizes) > 4 else sizes)
        axes.set_title(output)
        axes.set_xlabel("base points")
    panels[0].set_ylabel("total index")
    legend_above(made, panels[0])
    return made


@styled
def search_figure(contents: Sequence[Content], traces: "Sequence[pd.DataFrame]") -> "Figure":
    """Draw the best objective over the evaluations, a panel per method."""
    columns = 2 if len(contents) == 4 else 3
    made, panels = grid(len(contents), columns=columns, height=2.4)
    for axes, content, trace in zip(panels, contents, traces, strict=True):
        step = max(1, len(trace) // 3000)
        shown = trace.iloc[::step]
        axes.plot(
            shown["evaluation"],
            shown["objective"],
            ".",
            markersize=2.5,
            color=GREY,
            alpha=0.5,
            label="visited",
            rasterized=True,
        )
        axes.step(trace["evaluation"], trace["best"], where="post", color=COLOURS[0], label="best so far")
        if content["true_objective"] is not None:
            axes.plot(
                [trace["evaluation"].iloc[-1]],
                [content["true_objective"]],
                "*",
                markersize=9,
                color="black",
                label="true model",
            )
        axes.set_title(content["method"])
        axes.set_xlabel("evaluations")
        axes.locator_params(axis="x", nbins=4)
        axes.ticklabel_format(axis="x", style="plain")
    for axes in panels[:: min(columns, len(panels))]:
        axes.set_ylabel(labelled("objective", unit_of(contents[0]["formula"], contents[0]["units"])))
    legend_above(made, panels[0])
    return made


@styled
def visited_figure(contents: Sequence[Content], traces: "Sequence[pd.DataFrame]") -> "Figure":
    """Draw histograms of the objective and of each input over all visited solutions, by method."""
    first = contents[0]
    bounds = dict(zip(first["input_names"], first["bounds"], strict=True))
    names = [*[name for name, (low, high) in bounds.items() if low < high][:MOST_INPUTS], "objective"]
    finite = np.concatenate([trace["objective"].to_numpy() for trace in traces])
    finite = finite[np.isfinite(finite)]
    bounds["objective"] = [finite.min(), finite.max()] if len(finite) else [0.0, 1.0]
    made, panels = grid(len(names), height=1.9)
    for axes, name in zip(panels, names, strict=True):
        low, high = bounds[name]
        edges = np.linspace(low, high if high > low else low + 1.0, 25).tolist()
        for m, (content, trace) in enumerate(zip(contents, traces, strict=True)):
            values = trace[name].to_numpy()
            values = values[np.isfinite(values)]
            weights = np.full(len(values), 1.0 / max(len(values), 1))
            axes.hist(
                values,
                edges,
                weights=weights,
                histtype="step",
                color=COLOURS[m],
                linewidth=1.4,
                label=content["method"],
            )
        unit = unit_of(first["formula"] if name == "objective" else name, first["units"])
        axes.set_xlabel(labelled(name, unit))
        axes.locator_params(axis="x", nbins=4)
    for axes in panels[:: min(3, len(panels))]:
        axes.set_ylabel("share of visits")
    legend_above(made, panels[0])
    return made


def histogram(axes: "Axes", summary: Content, colour: str, *, filled: bool, label: str | None = None) -> None:
    """Draw the histogram of a summary as a density."""
    edges = np.array(summary["histogram"]["edges"], dtype=float)
    counts = np.array(summary["histogram"]["counts"], dtype=float)
    heights = counts / max(counts.sum(), 1.0) / np.diff(edges)
    if filled:
        axes.stairs(heights, edges, fill=True, color=colour, alpha=0.35, label=label)
    else:
        axes.stairs(heights, edges, color=colour, alpha=0.8, linewidth=0.9, label=label)


def density_label(unit: str) -> str:
    """Return the name of an axis of densities of a quantity."""
    return f"density [1/({unit})]" if "/" in unit else f"density [1/{unit}]" if unit else "density"


def unit_of(formula: str, units: Mapping[str, str]) -> str:
    """Return the unit of a formula that is one name or its magnitude, or a comparison of that; else none.

    Examples
    --------
    >>> unit_of("abs(v) <= 2", {"v": "cm"}), unit_of("v / w", {"v": "cm", "w": "cm"})
    ('cm', '')
    """
    return units.get(_MAGNITUDE.sub(r"\1", re.split(r"[<>=]=?", formula)[0].strip()), "")


_MAGNITUDE = re.compile(r"^abs\(\s*(\w+)\s*\)$")


def numbers(values: Sequence[float | None]) -> np.ndarray:
    """Return numbers with NaN for null."""
    return np.array([np.nan if value is None else value for value in values], dtype=float)
