"""What an optimisation returns: the optimum, the trace of the search, and how far its starts agree."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.results import plain
from tensegra.presented import Tabled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """Every evaluation of a search, in order; all arrays have length n_evaluations.

    Attributes
    ----------
    evaluation
        1, 2, …
    start
        Which start asked (0 for a method that has one).
    x, outputs
        Inputs (n, n_inputs) and outputs (n, n_outputs), NaN where the model failed.
    objective
        As written, NaN where the model failed or it is undefined.
    feasible
        Whether all constraints hold.
    best
        Best feasible objective so far, NaN before the first: the convergence curve.
    """

    evaluation: NDArray[np.intp]
    start: NDArray[np.intp]
    x: Array
    outputs: Array
    objective: Array
    feasible: NDArray[np.bool_]
    best: Array

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        return dict(plain(vars(self)))


@dataclass(frozen=True)
class Agreement:
    """How far a search agrees with itself.

    Attributes
    ----------
    n_starts, n_converged, n_best
        Starts; those whose method reported convergence; those that reached the best objective (within a
        millionth of its spread).
    n_rivals
        Those that could have: where variables are discrete, the starts with the best values of these.
    x_low, x_high
        The box (n_inputs,) around all points known to have that objective: those visited, and those found by
        stepping along the kink that the optimum lies on.
    unique
        Whether that box is a point (within 1 % of the bounds). If not, the optimum is not unique.
    """

    n_starts: int
    n_converged: int
    n_best: int
    n_rivals: int
    x_low: Array
    x_high: Array
    unique: bool


@dataclass(frozen=True, repr=False)
class Optimum(Tabled):
    """The best point that a method found, and how.

    Attributes
    ----------
    name, model, method, seed
        What was asked.
    formula, constraints, maximise, bounds
        The problem; bounds are (n_inputs, 2).
    search, held
        Names of the inputs that were searched; the number at which each other one was held.
    x, inputs
        The optimum, as an array (n_inputs,) and by name.
    objective, outputs
        What the model says there.
    outputs_std
        The model's own standard deviation of each output, where it knows one.
    margins
        By constraint, the room that is left (0 where it is active).
    success, reason
        Whether the search can be relied on, and why or why not, in words.
    agreement
        Of the starts with each other, and of the places where the best objective was met.
    trace, n_evaluations, seconds
        The search.
    true_status, true_outputs, true_objective, true_margins, true_feasible, gap
        The optimum solved again by the true model: its status, outputs, objective, the room that is left by
        constraint, whether all hold, and the gap, true minus found objective. None where no true model was
        given or it failed.
    """

    kind = "optimisation"

    name: str
    model: str
    method: str
    seed: int
    formula: str
    constraints: tuple[str, ...]
    maximise: bool
    input_names: tuple[str, ...]
    bounds: Array
    search: tuple[str, ...]
    held: Mapping[str, float]
    x: Array
    inputs: Mapping[str, float]
    objective: float
    outputs: Mapping[str, float]
    outputs_std: Mapping[str, float] | None
    margins: Mapping[str, float]
    success: bool
    reason: str
    agreement: Agreement
    trace: Trace
    n_evaluations: int
    seconds: float
    units: Mapping[str, str] = field(default_factory=dict)
    true_status: str | None = None
    true_outputs: Mapping[str, float] | None = None
    true_objective: float | None = None
    true_margins: Mapping[str, float] | None = None
    true_feasible: bool | None = None
    gap: float | None = None

    def table(self) -> list[dict[str, Any]]:
        """Return a row per quantity at the optimum: by the model, by the true model and their difference."""
        rows: list[dict[str, Any]] = [
            {
                "quantity": name,
                "unit": self.units.get(name, ""),
                "value": value,
                "true": None,
                "difference": None,
            }
            for name, value in self.inputs.items()
        ]
        truth = self.true_outputs or {}
        for name, value, true in (
            (self.formula, self.objective, self.true_objective),
            *((name, value, truth.get(name)) for name, value in self.outputs.items()),
        ):
            difference = None if true is None else true - value
            unit = self.units.get(name, "")
            rows.append(
                {"quantity": name, "unit": unit, "value": value, "true": true, "difference": difference}
            )
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content = vars(self) | {"kind": self.kind, "agreement": vars(self.agreement)}
        return dict(plain(content))

    def __repr__(self) -> str:
        place = ", ".join(f"{name} = {self.inputs[name]:.6g}" for name in self.search)
        if self.held:
            place += "; held: " + ", ".join(f"{name} = {value:.6g}" for name, value in self.held.items())
        gap = "" if self.gap is None else f", true {self.true_objective:.6g} (gap {self.gap:.2g})"
        word = "maximum" if self.maximise else "minimum"
        found = f"{word} of {self.formula} by {self.method}: {self.objective:.6g}{gap} at {place}"
        return f"Optimum({found}; {self.reason})"
