"""Figs. 8 and 9: 100 actuations times 125 temperatures, and what the temperatures do to each actuation."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import Table
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.designs.figures import box_figure, design_figure
from tensegra_paper.claims import finding
from tensegra_paper.five_inputs import TEMPERATURES, product_design
from tensegra_paper.models import NODE
from tensegra_paper.published import published, published_number
from tensegra_paper.setting import Setting

__all__ = ["designs"]

Array: TypeAlias = NDArray[np.float64]


EXPANSION = (
    "in proportion to the thermal expansion (the share to its square), for which 1.6e-5/K was taken: none is "
    "printed"
)


@dataclass(frozen=True, eq=False)
class Spread:
    """What the temperatures do to an output.

    Attributes
    ----------
    boxes
        Minimum, quartiles and maximum over the temperatures by actuation, shape (5, n_actuations), sorted by
        the magnitude of the median; cm.
    share
        Of the output's variance over the whole design that the temperatures cause.
    by_temperature
        Of the part by temperatures, the share of each, from a regression within each actuation.
    """

    boxes: Array
    share: float
    by_temperature: Mapping[str, float]

    @property
    def quartile_distance(self) -> float:
        """Mean distance of the quartiles over the temperatures, cm."""
        return float(np.mean(self.boxes[3] - self.boxes[1]))


def designs(setting: Setting) -> Chapter:
    """Solve the product of two Sobol designs, and show what the temperatures do."""
    # Whole at any scale: solving it takes less than a second.
    n_actuations, n_temperatures = (
        published("doe", "sobol_actuations"),
        published("doe", "sobol_temperatures"),
    )
    inputs = product_design(setting, n_actuations, n_temperatures)
    runs = setting.runs("five-inputs", setting.structure, inputs)
    spreads = {
        name: spread(runs, values, n_actuations)
        for name, values in (
            ("v", runs.displacement("y", NODE)),
            ("w", runs.displacement("z", NODE)),
        )
    }
    return Chapter(
        name="designs",
        title="The design of experiments and the effect of temperature (Figs. 8–9)",
        figures=(
            Figure(
                "fig-08-design",
                f"The design: {n_actuations} actuations (a) and {n_temperatures} temperatures (b to d) of "
                "Sobol's sequence. Every actuation is solved with every temperature",
                lambda: design_figure(inputs, n_temperatures),
            ),
            Figure(
                "fig-09-temperature",
                "Displacements over the temperatures, (a) along y and (b) along z, a box for each "
                "actuation, sorted by magnitude. Boxes are quartiles, whiskers the extremes, as printed",
                lambda: box_figure({name: found.boxes for name, found in spreads.items()}),
            ),
        ),
        rows=_rows(runs, spreads),
        text=_text(runs, n_actuations, n_temperatures),
        findings=(_finding(spreads),),
        tables=(_table(spreads),),
        seconds={"runs": runs.seconds},
        seeds={name: setting.seed_of(f"designs {name}") for name in ("actuations", "temperatures")},
    )


def spread(runs: BeamRuns, values: Array, n_actuations: int) -> Spread:
    """Return what the temperatures do to an output of a product design.

    Parameters
    ----------
    runs
        The runs of `product_design`.
    values
        The output, shape (n_runs,).
    n_actuations
        Of the design.
    """
    table = values.reshape(n_actuations, -1)
    boxes = np.quantile(table, [0.0, 0.25, 0.5, 0.75, 1.0], axis=1)
    order = np.argsort(np.abs(boxes[2]), kind="stable")
    within = table - table.mean(axis=1, keepdims=True)
    temperatures = np.column_stack([runs.inputs[name] for name in TEMPERATURES])
    centred = temperatures - temperatures.mean(axis=0)
    slopes = np.linalg.lstsq(centred, within.ravel(), rcond=None)[0]
    parts = slopes**2 * centred.var(axis=0)
    return Spread(
        boxes=boxes[:, order],
        share=float(within.var() / table.var()),
        by_temperature=dict(zip(TEMPERATURES, (parts / parts.sum()).tolist(), strict=True)),
    )


def _rows(runs: BeamRuns, spreads: Mapping[str, Spread]) -> tuple[Row, ...]:
    printed = published_number("doe", "simulations")
    per_run = runs.seconds / runs.n_runs
    w = runs.displacement("z", NODE)
    low, high = np.nanmin(w), np.nanmax(w)
    return (
        Row(
            "Fig. 8",
            "number of simulations",
            printed,
            float(runs.n_runs),
            "",
            Agreement.INPUT,
            None,
            "the design was made with it; it is solved whole at any scale",
        ),
        Row(
            "Sect. 3.1",
            "runs of the design that end stable",
            None,
            100.0 * float(runs.stands.mean()),
            "%",
            Agreement.METHOD,
            bool(runs.stands.all()),
            "holds where all stand; nothing is printed",
        ),
        Row(
            "Fig. 9b",
            "range of displacement-z over the design",
            None,
            f"{low:.2f} to {high:.2f}",
            "cm",
            Agreement.VALUE,
            None,
            "the axis of the figure is not in the text; Table 2 has 46.42 to 54.03 cm for inputs of a wider "
            "range",
        ),
        Row(
            "Fig. 9",
            "mean distance of the quartiles over the temperatures, on y and on z",
            None,
            f"{spreads['v'].quartile_distance:.3f}, {spreads['w'].quartile_distance:.3f}",
            "cm",
            Agreement.VALUE,
            None,
            f"the figure prints no numbers; {EXPANSION}",
        ),
        finding(
            "temperature negligible on y",
            "share of the variance of displacement-y that temperature causes",
            100.0 * spreads["v"].share,
            "%",
            EXPANSION,
            y=spreads["v"].share,
        ),
        finding(
            "temperature high on z",
            "share of the variance of displacement-z that temperature causes",
            100.0 * spreads["w"].share,
            "%",
            f"{100 * spreads['v'].share:.1f} % on y. In centimetres the quartiles are "
            f"{spreads['w'].quartile_distance / spreads['v'].quartile_distance:.1f} times as far apart on "
            f"z; {EXPANSION}",
            z=spreads["w"].share,
            y=spreads["v"].share,
        ),
        finding(
            "T_top matters most",
            "temperature that matters most for displacement-z",
            max(spreads["w"].by_temperature, key=lambda name: spreads["w"].by_temperature[name]),
            "",
            f"T_top makes {100 * spreads['w'].by_temperature['T_top']:.1f} % of the part by temperatures, "
            "by regression within each actuation",
            shares=spreads["w"].by_temperature,
        ),
        Row(
            "Sect. 3.1",
            "time of a simulation",
            published_number("fem", "seconds_per_simulation"),
            per_run,
            "s",
            Agreement.VALUE,
            None,
            "another program on another machine: all runs go through one factorisation pattern in lockstep",
        ),
    )


def _text(runs: BeamRuns, n_actuations: int, n_temperatures: int) -> tuple[str, ...]:
    return (
        (
            f"{n_actuations} points of Sobol's sequence in (A14, A23) within 9 to 10 % times "
            f"{n_temperatures} in (T_top, T_middle, T_bottom) within 0 to 150 °C: {runs.n_runs} runs with "
            f"gravity in {runs.seconds:.2f} s. The displacements of Fig. 9 are those of node {NODE}, as "
            "printed. Whether the publication's runs had gravity is not said; the assumptions tell what it "
            "changes."
        ),
    )


def _finding(spreads: Mapping[str, Spread]) -> str:
    v, w = spreads["v"], spreads["w"]
    wide = (
        f"Over the temperatures the quartiles of displacement-z are {w.quartile_distance:.2f} cm apart, "
        f"those of displacement-y {v.quartile_distance:.2f} cm"
    )
    return (
        f"{wide}: temperature causes {100 * v.share:.0f} % of the variance of y and {100 * w.share:.0f} % of "
        "that of z. Fig. 9 calls the one negligible and the other high; here that is so in centimetres only."
    )


def _table(spreads: Mapping[str, Spread]) -> Table:
    rows = [
        (
            name,
            f"{found.quartile_distance:.3f}",
            f"{100 * found.share:.2f}",
            *(f"{100 * found.by_temperature[temperature]:.2f}" for temperature in TEMPERATURES),
        )
        for name, found in spreads.items()
    ]
    header = (
        f"Displacement of node {NODE}",
        "Quartile distance [cm]",
        "Variance by temperature [%]",
        *(f"of which {name} [%]" for name in TEMPERATURES),
    )
    return Table.of("What the temperatures do", header, rows, "lrrrrr")
