"""The figure of a surrogate: how each output answers to each input."""

from typing import TYPE_CHECKING

import numpy as np

from tensegra.report.figures.panels import MOST_PANELS
from tensegra.report.figures.style import COLOURS, figure, legend_above, styled
from tensegra.report.tables import labelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tensegra.surrogate import Surrogate

__all__ = ["response_figure"]

POINTS = 65
"""Points of a line."""

HALF_WIDTH_90 = 1.6449
"""Of the interval that holds 90 % of a normal law, in its standard deviations."""


@styled
def response_figure(surrogate: "Surrogate") -> "Figure":
    """Draw each output over each input, the others at the middle of the box that it was trained in.

    The band is the 90 % interval of the surrogate's own standard deviation, where it has one. Of more than
    `MOST_PANELS` inputs or outputs the first are shown.
    """
    low, high = surrogate.bounds.T
    n_inputs = min(len(surrogate.input_names), MOST_PANELS)
    n_outputs = min(len(surrogate.output_names), MOST_PANELS)
    made = figure(min(1.6 * n_outputs + 0.5, 9.0))
    for i in range(n_inputs):
        X = np.tile((low + high) / 2, (POINTS, 1))
        X[:, i] = np.linspace(low[i], high[i], POINTS)
        std = None
        if surrogate.has_std:
            Y, std = surrogate.predict(X, return_std=True)
        else:
            Y = surrogate.predict(X)
        for k in range(n_outputs):
            axes = made.add_subplot(n_outputs, n_inputs, k * n_inputs + i + 1)
            axes.plot(X[:, i], Y[:, k], color=COLOURS[0], label="surrogate")
            if std is not None:
                half = HALF_WIDTH_90 * std[:, k]
                axes.fill_between(
                    X[:, i],
                    Y[:, k] - half,
                    Y[:, k] + half,
                    color=COLOURS[0],
                    alpha=0.25,
                    label="90 % interval",
                )
            axes.locator_params(nbins=4)
            if k == n_outputs - 1:
                axes.set_xlabel(labelled(surrogate.input_names[i], surrogate.input_units[i]))
            else:
                axes.tick_params(labelbottom=False)
            if i == 0:
                axes.set_ylabel(labelled(surrogate.output_names[k], surrogate.output_units[k]))
    legend_above(made, made.axes[0])
    return made
