"""What a result shows of itself: the figure of `plot()` and the tables of a notebook."""

from collections.abc import Sequence
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.analysis import (
    Calibration,
    Optimum,
    Propagation,
    RobustOptimum,
    Screening,
    Sensitivity,
    Trajectory,
)
from tensegra.errors import SolverError, StudyError
from tensegra.mechanics import Batch, Equilibrium, EquilibriumPath
from tensegra.presented import Tabled
from tensegra.report import figures
from tensegra.report.figures.surrogate import response_figure
from tensegra.report.study_tables import outcome_table, reason_table
from tensegra.report.tables import (
    Table,
    displacement_table,
    event_table,
    labelled,
    reaction_table,
    stage_table,
    structure_table,
    tension_table,
)
from tensegra.structure import Structure
from tensegra.study import Campaign
from tensegra.surrogate import Surrogate

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["figure_of", "html_of", "tables_of"]

MOST_SHAPES = 5
"""Runs of a batch that are drawn over one another: more could not be told apart."""

MOST_ROWS = 20
"""Rows of a result's table that a notebook shows; `to_dataframe()` has them all."""


@singledispatch
def figure_of(result: Any) -> "Figure":  # noqa: ANN401 - any result
    """Return the figure of a result.

    Raises
    ------
    TensegraError
        There is nothing to draw.
    """
    raise TypeError(f"a {type(result).__name__} has no figure")


@figure_of.register(Structure)
def _(structure: Structure) -> "Figure":
    return figures.structure_figure(structure, structure.coordinates)


@figure_of.register(Equilibrium)
def _(equilibrium: Equilibrium) -> "Figure":
    _require_position(equilibrium)
    structure = equilibrium.structure
    return figures.structure_figure(structure, equilibrium.nodes, reference=structure.coordinates)


@figure_of.register(EquilibriumPath)
def _(path: EquilibriumPath) -> "Figure":
    _require_position(path.stages[-1])
    _require_position(path.final)
    return figures.shape_figure(path.structure, path.stages[-1].nodes, {"end of path": path.final.nodes})


@figure_of.register(Batch)
def _(batch: Batch) -> "Figure":
    found = np.flatnonzero(np.isfinite(batch.nodes).all(axis=(1, 2)))
    if not len(found):
        raise SolverError(
            f"{batch.structure.name}: all {batch.n_runs} runs failed, there is no shape to draw"
        )
    shown = found[np.unique(np.linspace(0, len(found) - 1, MOST_SHAPES).round().astype(int))]
    shapes = {f"run {run}": batch.nodes[run] for run in shown}
    return figures.shape_figure(batch.structure, batch.start[0], shapes)


@figure_of.register(Campaign)
def _(campaign: Campaign) -> "Figure":
    frame = campaign.frame()
    if frame.empty:
        raise StudyError(f"{campaign.folder}: found no runs yet, expected some to draw")
    return figures.output_figure(campaign.study, frame)


@figure_of.register(Surrogate)
def _(surrogate: Surrogate) -> "Figure":
    return response_figure(surrogate)


@figure_of.register(Propagation)
def _(result: Propagation) -> "Figure":
    return figures.propagation_figure(result.to_dict())


@figure_of.register(Sensitivity)
def _(result: Sensitivity) -> "Figure":
    return figures.index_figure(result.to_dict())


@figure_of.register(Screening)
def _(result: Screening) -> "Figure":
    return figures.screening_figure(result.to_dict())


@figure_of.register(Optimum)
def _(result: Optimum) -> "Figure":
    if not len(result.trace.evaluation):
        raise StudyError(f"{result.name}: the search has visited no point, there is nothing to draw")
    return figures.search_figure([result.to_dict()], [_trace(result)])


@figure_of.register(RobustOptimum)
def _(result: RobustOptimum) -> "Figure":
    content = result.to_dict()
    return figures.robust_figure(content, figures.robust_panels(content))


@figure_of.register(Trajectory)
def _(result: Trajectory) -> "Figure":
    return figures.trajectory_figure(result.to_dict())


@figure_of.register(Calibration)
def _(result: Calibration) -> "Figure":
    return figures.marginal_figure(result.to_dict())


def _trace(result: Optimum) -> "pd.DataFrame":
    import pandas as pd

    trace = result.trace
    return pd.DataFrame({key: getattr(trace, key) for key in ("evaluation", "objective", "best")})


def _require_position(equilibrium: Equilibrium) -> None:
    """Refuse to draw an equilibrium that was not found."""
    if not np.isfinite(equilibrium.nodes).all():
        equilibrium.raise_for_status()
        raise SolverError(f"stage '{equilibrium.stage}' has no position to draw")


@singledispatch
def tables_of(result: Any) -> "list[Table]":  # noqa: ANN401 - any result
    """Return the tables of a result; without rows where there is nothing to tell."""
    raise TypeError(f"a {type(result).__name__} has no tables")


@tables_of.register(Structure)
def _(structure: Structure) -> list[Table]:
    return [structure_table(structure)]


@tables_of.register(Equilibrium)
def _(equilibrium: Equilibrium) -> list[Table]:
    if equilibrium.status == "failed":
        return []
    return [tension_table(equilibrium), reaction_table(equilibrium)]


@tables_of.register(EquilibriumPath)
def _(path: EquilibriumPath) -> list[Table]:
    moved = path.actuation is not None and path.actuation.status != "failed"
    return [stage_table(path), event_table(path), *([displacement_table(path)] if moved else [])]


@tables_of.register(Batch)
def _(batch: Batch) -> list[Table]:
    rows = []
    for status, count in zip(*np.unique(batch.status.astype(str), return_counts=True), strict=True):
        of = batch.status == status
        eigenvalues = batch.lowest_eigenvalue[of & np.isfinite(batch.lowest_eigenvalue)]
        residuals = batch.residual[of & np.isfinite(batch.residual)]
        rows.append(
            (
                str(status),
                int(count),
                float(eigenvalues.min()) if len(eigenvalues) else None,
                float(residuals.max()) if len(residuals) else None,
            )
        )
    unit = batch.structure.units.of("force per length")
    header = ("Status", "Runs", labelled("Lowest eigenvalue", unit), "Largest residual")
    return [Table.of("Runs", header, rows, "srrr")]


@tables_of.register(Campaign)
def _(campaign: Campaign) -> list[Table]:
    state = campaign.state()
    return [outcome_table(state), reason_table(state)]


@tables_of.register(Surrogate)
def _(surrogate: Surrogate) -> list[Table]:
    box = [
        (name, unit, float(low), float(high))
        for name, unit, (low, high) in zip(
            surrogate.input_names, surrogate.input_units, surrogate.bounds, strict=True
        )
    ]
    tables = [Table.of("Trained in", ("Input", "Unit", "From", "To"), box, "ssrr")]
    if surrogate.validation is not None:
        title = f"Error ({surrogate.validation.method})"
        tables.append(_of_rows(title, surrogate.to_dataframe().to_dict("records")))
    return tables


@tables_of.register(Tabled)
def _(result: Tabled) -> list[Table]:
    return [_of_rows("", result.table())]


def _of_rows(title: str, rows: Sequence[Any]) -> Table:
    """Lay rows out as they are, a column for each key."""
    header = tuple(dict.fromkeys(key for row in rows for key in row))
    shown = [[_plain(row.get(key)) for key in header] for row in rows[:MOST_ROWS]]
    numeric = [all(isinstance(row[k], float | int | None) for row in shown) for k in range(len(header))]
    more = len(rows) - len(shown)
    note = f"{more} more rows: to_dataframe() has them all." if more else ""
    names = tuple(key.replace("_", " ") for key in header)
    return Table.of(title, names, shown, "".join("r" if n else "l" for n in numeric), note)


def _plain(value: object) -> object:
    """Return NumPy's numbers as Python's, so that they are rounded like these."""
    return value.item() if isinstance(value, np.generic) else value


def html_of(result: Any) -> str:  # noqa: ANN401 - any result
    """Return what a result is, and its tables, as a piece of HTML."""
    tables = [_table_html(table) for table in tables_of(result) if table.rows]
    return "\n".join([f"<p><code>{escape(repr(result))}</code></p>", *tables])


def _table_html(table: Table) -> str:
    sides = ["right" if align == "r" else "left" for align in table.align]

    def row(tag: str, cells: Sequence[str]) -> str:
        made = (
            f'<{tag} style="text-align:{side}">{escape(cell).replace(chr(10), "<br>")}</{tag}>'
            for side, cell in zip(sides, cells, strict=True)
        )
        return f"<tr>{''.join(made)}</tr>"

    caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    head = f"<thead>{row('th', table.header)}</thead>" if any(table.header) else ""
    body = "".join(row("td", cells) for cells in table.rows)
    note = f"<p><small>{escape(table.note)}</small></p>" if table.note else ""
    return f"<table>{caption}{head}<tbody>{body}</tbody></table>{note}"
