"""Figures of screening, robust optima, trajectories and calibrations."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.report.figures.analysis import density_label, histogram, numbers, unit_of
from tensegra.report.figures.panels import MOST_PANELS, first_shown, strongest, varying
from tensegra.report.figures.style import COLOURS, GREY, WIDTH, figure, grid, legend_above, styled
from tensegra.report.tables import labelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "fit_figure",
    "marginal_figure",
    "prediction_figure",
    "robust_figure",
    "robust_panels",
    "screening_figure",
    "trajectory_figure",
]

Content = Mapping[str, Any]

RELATIVE = "density over its peak"
"""What tells a sharp law beside a wide one, which would lie flat under one scale for both."""

FAINT = 0.02
"""Of a density's peak: what lies beyond is not drawn."""

MOST_BARS = 20
"""Inputs that a screening draws; the others are weaker."""


@styled
def screening_figure(content: Content) -> "Figure":
    """Draw the mean magnitude of the elementary effects, the strongest inputs first, with their spread."""
    shown = min(len(content["input_names"]), MOST_BARS)
    effects = first_shown(content["effects"])
    made, panels = grid(len(effects), height=1.2 + 0.2 * shown)
    for axes, (output, found) in zip(panels, effects.items(), strict=True):
        strength, half, spread = (numbers(found[key]) for key in ("mu_star", "mu_star_half", "sigma"))
        order = np.argsort(-np.nan_to_num(strength), kind="stable")[:shown][::-1]
        place = np.arange(len(order))
        axes.barh(
            place,
            strength[order],
            0.62,
            xerr=half[order],
            color=COLOURS[0],
            ecolor="#404040",
            error_kw={"elinewidth": 0.9, "capsize": 2},
            label="μ*, mean magnitude",
        )
        axes.plot(spread[order], place, "D", markersize=4, color=COLOURS[1], label="σ, spread")
        axes.set_yticks(place, [content["input_names"][i] for i in order])
        axes.grid(visible=False, axis="y")
        axes.set_xlim(left=0.0)
        axes.locator_params(axis="x", nbins=5)
        axes.set_xlabel(f"effect on {labelled(output, found['unit'])}")
    legend_above(made, panels[0])
    return made


def robust_panels(content: Content) -> list[str]:
    """Return the objective and the margins that vary at one design or the other, as many as find room."""
    names = [content["formula"], *(f"margin of {constraint}" for constraint in content["constraints"])]
    moving = {name for design in content["spreads"].values() for name in varying(design)[0]["outputs"]}
    return [name for name in names if name in moving][:MOST_PANELS]


@styled
def robust_figure(content: Content, names: Sequence[str]) -> "Figure":
    """Draw what comes of the robust and of the nominal design, a panel for each of `robust_panels`."""
    made, panels = grid(len(names), height=2.5)
    for axes, name in zip(panels, names, strict=True):
        for colour, design in zip(COLOURS, ("robust", "nominal"), strict=False):
            spread = content["spreads"][design]
            histogram(axes, spread["outputs"][name], colour, filled=True, label=design)
            if spread["other"]:
                density = spread["other"]["outputs"][name]["density"]
                label = f"{design}, {spread['other']['model']}"
                axes.plot(density["grid"], density["values"], "--", color=colour, label=label)
        unit = unit_of(name.removeprefix("margin of "), content["robust"]["units"])
        axes.set_xlabel(labelled(name, unit))
        axes.set_ylabel(density_label(unit))
        axes.locator_params(axis="x", nbins=5)
        if name != content["formula"]:
            axes.axvline(0.0, color="#404040", linewidth=0.9)
    legend_above(made, panels[0])
    return made


@styled
def trajectory_figure(content: Content) -> "Figure":
    """Draw the inputs along the trajectory, and how far each output is from its targets and may be."""
    units, inputs = content["units"], content["input_names"]
    outputs = content["target_names"][:MOST_PANELS]
    made, panels = grid(1 + len(outputs), height=2.5)
    steps = np.arange(1, len(content["x"]) + 1)
    X = np.array(content["x"], dtype=float)
    # Those that move most, of the widths of their ways.
    shown = strongest(np.ptp(X, axis=0) / np.maximum(np.abs(X).max(axis=0), 1e-300), len(COLOURS))
    for i in shown:
        name = inputs[i]
        axes_label = labelled(name, units.get(name, ""))
        panels[0].plot(
            steps, X[:, i], "o-", markersize=3.5, color=COLOURS[i % len(COLOURS)], label=axes_label
        )
    panels[0].set_ylabel("inputs")
    names = panels[0].get_legend_handles_labels()
    made.legend(*names, loc="outside lower left", ncols=4)
    for k, (axes, name) in enumerate(zip(panels[1:], outputs, strict=True)):
        target = _column(content["targets"], k)
        low, high, reached = (_column(content[key], k) - target for key in ("low", "high", "outputs"))
        share = f"{100 * content['confidence']:.0f} % interval"
        axes.fill_between(steps, low, high, color=COLOURS[0], alpha=0.2, linewidth=0, label=share)
        axes.plot(
            steps, reached, "o-", markersize=3.5, color=COLOURS[0], label=f"reached, {content['model']}"
        )
        if content["true_outputs"]:
            missed = _column(content["true_outputs"], k) - target
            axes.plot(steps, missed, "x", markersize=5, color=COLOURS[1], label="true model")
        axes.axhline(0.0, color="#404040", linewidth=0.8)
        axes.set_ylabel(labelled(f"{name} − target", units.get(name, "")))
    for axes in panels:
        axes.set_xlabel("waypoint")
        axes.locator_params(axis="x", nbins=6, integer=True)
    legend_above(made, panels[1])
    return made


@styled
def marginal_figure(content: Content) -> "Figure":
    """Draw prior and posterior of each parameter, and below the pairs of parameters."""
    parameters, units = content["parameters"][:MOST_PANELS], content["units"]
    draws, prior = np.array(content["draws"], dtype=float), np.array(content["prior_draws"], dtype=float)
    p = len(parameters)
    pairs = [(i, j) for j in range(p) for i in range(j)][:6]
    columns = min(3, max(p, 1))
    rows = -(-p // columns) + -(-len(pairs) // columns)
    made = figure(2.2 * rows, WIDTH if columns > 1 else 0.6 * WIDTH)
    for k, parameter in enumerate(parameters):
        axes = made.add_subplot(rows, columns, k + 1)
        _bars(axes, prior[:, k], GREY, "prior")
        _bars(axes, draws[:, k], COLOURS[0], "posterior")
        axes.axvspan(parameter["low"], parameter["high"], color=COLOURS[0], alpha=0.12, linewidth=0)
        axes.set_xlabel(labelled(parameter["name"], units.get(parameter["name"], "")))
        axes.set_yticks([])
        axes.locator_params(axis="x", nbins=4)
        if k % columns == 0:
            axes.set_ylabel(RELATIVE)
    first = columns * -(-p // columns)
    for m, (i, j) in enumerate(pairs):
        axes = made.add_subplot(rows, columns, first + m + 1)
        axes.plot(draws[:, i], draws[:, j], ".", markersize=2.5, alpha=0.4, color=COLOURS[0], rasterized=True)
        names = [parameters[k]["name"] for k in (i, j)]
        axes.set_xlabel(labelled(names[0], units.get(names[0], "")))
        axes.set_ylabel(labelled(names[1], units.get(names[1], "")))
        axes.locator_params(nbins=4)
    legend_above(made, made.axes[0])
    return made


@styled
def fit_figure(content: Content) -> "Figure":
    """Draw how far the measurements lie from what the posterior predicts, and how far they may."""
    found, units = content["prediction"], content["units"]
    outputs = found["outputs"][:MOST_PANELS]
    made, panels = grid(len(outputs), height=2.4)
    along, label = _abscissa(found, units)
    for k, (axes, output) in enumerate(zip(panels, outputs, strict=True)):
        mean, stds = _column(found["mean"], k), _column(found["stds"], k)
        low, high, measured = (_column(found[key], k) - mean for key in ("low", "high", "measured"))
        share = f"{100 * content['confidence']:.0f} % interval of a new measurement"
        axes.vlines(along, low, high, color=COLOURS[0], alpha=0.35, linewidth=5, label=share)
        axes.errorbar(
            along,
            measured,
            stds,
            fmt="o",
            markersize=3.5,
            color="black",
            elinewidth=0.9,
            capsize=2,
            label="measured ± std",
        )
        if found["true"]:
            departure = np.where(np.isfinite(measured), _column(found["true"], k) - mean, np.nan)
            axes.plot(along, departure, "x", color=COLOURS[1], label="true model")
        axes.axhline(0.0, color="#404040", linewidth=0.8)
        axes.set_xlabel(label)
        axes.set_ylabel(labelled(f"{output} − predicted", units.get(output, "")))
        axes.locator_params(axis="x", nbins=5)
        axes.margins(x=0.12)
    legend_above(made, panels[0])
    return made


@styled
def prediction_figure(contents: Sequence[Content]) -> "Figure":
    """Draw the outputs predicted from the prior and from the posterior."""
    prior, posterior = contents
    outputs = first_shown(posterior["outputs"])
    made, panels = grid(len(outputs), height=2.3)
    for axes, (name, summary) in zip(panels, outputs.items(), strict=True):
        ends = []
        for shown, colour, label in (
            (prior["outputs"][name], GREY, "from the prior"),
            (summary, COLOURS[0], "from the posterior"),
        ):
            grid_points, values = (numbers(shown["density"][key]) for key in ("grid", "values"))
            if not len(values):
                continue
            height = values / values.max()
            axes.fill_between(grid_points, height, color=colour, alpha=0.45, linewidth=0, label=label)
            ends += grid_points[height > FAINT][[0, -1]].tolist()
        if ends:  # the extremes of many samples would leave the rest a line
            axes.set_xlim(min(ends), max(ends))
        axes.set_xlabel(labelled(name, summary["unit"]))
        axes.locator_params(axis="x", nbins=5)
        axes.set_yticks([])
    panels[0].set_ylabel(RELATIVE)
    legend_above(made, panels[0])
    return made


def _abscissa(found: Content, units: Mapping[str, str]) -> tuple[np.ndarray, str]:
    """Return what to draw the measured states over: the one known input that varies, or their number."""
    varied = {name: column for name, column in found["known"].items() if len(set(column)) > 1}
    if len(varied) == 1:
        ((name, column),) = varied.items()
        return np.array(column, dtype=float), labelled(name, units.get(name, ""))
    return np.arange(1.0, len(found["measured"]) + 1.0), "measured state"


def _bars(axes: "Axes", values: np.ndarray, colour: str, label: str) -> None:
    heights, edges = np.histogram(values, 30)
    axes.stairs(heights / max(heights.max(), 1), edges, fill=True, color=colour, alpha=0.45, label=label)


def _column(rows: Sequence[Sequence[float | None]], k: int) -> np.ndarray:
    """Return a column with NaN for null."""
    return numbers([row[k] for row in rows])
