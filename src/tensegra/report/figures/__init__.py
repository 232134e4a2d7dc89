"""The figures: each function takes results and returns a matplotlib figure; nothing is shown or kept."""

from tensegra.report.figures.analysis import (
    index_convergence,
    index_figure,
    propagation_figure,
    search_figure,
    visited_figure,
)
from tensegra.report.figures.questions import (
    fit_figure,
    marginal_figure,
    prediction_figure,
    robust_figure,
    screening_figure,
    trajectory_figure,
)
from tensegra.report.figures.structure import shape_figure, structure_figure
from tensegra.report.figures.study import (
    design_figure,
    outcome_figure,
    output_figure,
    parity_figure,
    selection_figure,
)
from tensegra.report.figures.style import WIDTH, pdf, svg

__all__ = [
    "WIDTH",
    "design_figure",
    "fit_figure",
    "index_convergence",
    "index_figure",
    "marginal_figure",
    "outcome_figure",
    "output_figure",
    "parity_figure",
    "pdf",
    "prediction_figure",
    "propagation_figure",
    "robust_figure",
    "screening_figure",
    "search_figure",
    "selection_figure",
    "shape_figure",
    "structure_figure",
    "svg",
    "trajectory_figure",
    "visited_figure",
]
