"""The terminal: results on stdout, as tables for people or as JSON for programs."""

import json
import platform
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from tensegra.report.tables import (
    Table,
    check_lines,
    displacement_table,
    event_table,
    member_table,
    reaction_table,
    stage_table,
    structure_table,
    tension_table,
)

if TYPE_CHECKING:
    from pathlib import Path

    from tensegra.mechanics import EquilibriumPath
    from tensegra.report.check import StructureCheck, StudyCheck
    from tensegra.report.results import Results
    from tensegra.study import Campaign
    from tensegra.study.cost import Probe

__all__ = [
    "print_json",
    "print_line",
    "print_table",
    "show_dry_run",
    "show_path",
    "show_report",
    "show_results",
    "show_state",
    "show_structure_check",
    "show_study_check",
]

NARROWEST, USUAL_WIDTH = 20, 80
"""Columns below which a terminal shows nothing that could be read, and those that are then assumed."""

NARROWEST_TEXT, PADDING = 16, 2
"""Columns in which a text can still be read in lines, and those beside each column of a table."""

_STATUS_STYLES = {
    "stable": "green",
    "snapped": "yellow",
    "unstable": "yellow",
    "collapsed": "red",
    "failed": "red",
}


def show_structure_check(result: "StructureCheck", *, as_json: bool = False) -> None:
    """Show a structure, its counts and whether it stands."""
    if as_json:
        print_json(result.to_dict())
        return
    print_table(structure_table(result.structure))
    print_table(stage_table(result.path))
    print_table(event_table(result.path))
    print_table(member_table(result))
    if result.path.final.status != "failed":
        print_table(reaction_table(result.path.final))
    for line in check_lines(result):
        print_line(line)


def show_study_check(result: "StudyCheck", *, as_json: bool = False) -> None:
    """Show what a study varies, wants and asks."""
    if as_json:
        print_json(result.to_dict())
        return
    from tensegra.report.study_tables import analysis_table, output_table, surrogate_table, variable_table

    study = result.study
    print_line(repr(study))
    print_line(repr(study.structure))
    print_line()
    for table in (variable_table(study), output_table(study), surrogate_table(study), analysis_table(study)):
        print_table(table)
    for advice in study.advice:
        print_line(f"Note: {advice}.")


def show_dry_run(result: "StudyCheck", cost: "Probe", *, as_json: bool = False) -> None:
    """Show a study, what its runs will cost and what follows them."""
    from tensegra.report.estimate import estimate, estimate_table

    parts = estimate(result.study, cost)
    if as_json:
        print_json({**result.to_dict(), "cost": cost.to_dict(), "after": [part.to_dict() for part in parts]})
        return
    show_study_check(result)
    print_table(estimate_table(parts))
    print_line(str(cost))


def show_path(path: "EquilibriumPath", *, as_json: bool = False) -> None:
    """Show the equilibria of a history and where it ends."""
    if as_json:
        print_json(path.to_dict())
        return
    print_line(repr(path.structure))
    print_line()
    print_table(stage_table(path))
    print_table(event_table(path))
    if path.final.status != "failed":
        if path.actuation is not None:
            print_table(displacement_table(path))
        print_table(tension_table(path.final))
        print_table(reaction_table(path.final))
    slack = path.final.slack_members
    if slack:
        print_line(f"Slack: {', '.join(slack)}.")
    free = path.final.rigid_motions
    if free:
        print_line(f"Free, held by neither supports nor loads: {', '.join(free)}.")
    for warning in path.final.warnings:
        print_line(f"Warning: {warning}.")
    reason = f": {path.reason}" if path.reason else ""
    print_line(f"The history is {path.status}{reason}.")


def show_results(results: "Results", *, as_json: bool = False) -> None:
    """Show what a study has led to."""
    if as_json:
        print_json(results.to_dict())
        return
    from tensegra.report.analysis_tables import result_tables
    from tensegra.report.study_tables import outcome_table, validation_table

    print_table(outcome_table(results.campaign.state()))
    print_table(validation_table(results))
    for table in result_tables(results):
        print_table(table)
    for failure in results.index.failures:
        print_line(f"Could not be had: {failure}.")
    seconds = results.index.seconds
    runs = f"of which {seconds['campaign']:.1f} s for the runs"
    print_line(f"{results.folder}: done in {seconds['total']:.1f} s, {runs}.")


def show_state(campaign: "Campaign", *, as_json: bool = False) -> None:
    """Show how far a campaign is."""
    from tensegra.report.study_tables import outcome_table, reason_table, state_to_dict

    state = campaign.state()
    if as_json:
        print_json(state_to_dict(campaign, state))
        return
    print_line(repr(campaign))
    print_line()
    print_table(outcome_table(state))
    print_table(reason_table(state))
    line = (
        f"{state.n_done} of {state.n_points} runs done, {state.n_failed} failed, {state.n_pending} pending."
    )
    if state.driver is not None:
        # Whether a process of another machine still lives is not to be seen from here.
        where = "" if state.host == platform.node() else f" on {state.host} (unless it died there)"
        line += f" Process {state.driver}{where} is running it"
        line += f", {state.rate:.3g} runs/s, {state.seconds_left:.0f} s left." if state.rate > 0 else "."
    print_line(line)


def show_report(path: "Path", *, as_json: bool = False) -> None:
    """Show where a report has been written."""
    if as_json:
        print_json({"report": str(path)})
    else:
        print_line(str(path))


def print_json(content: dict[str, Any]) -> None:
    """Print a result for a program."""
    # JSON has a way to write every letter in ASCII; a stream that cannot show one would lose it.
    plain = not (sys.stdout.encoding or "ascii").lower().replace("-", "").startswith("utf")
    json.dump(content, sys.stdout, indent=1, ensure_ascii=plain, allow_nan=False)
    sys.stdout.write("\n")


def _console() -> Console:
    """Return the console; one that claims to have no width is one that does not know it."""
    console = Console()
    return console if console.width >= NARROWEST else Console(width=USUAL_WIDTH)


def print_line(text: str = "") -> None:
    """Print a line of words."""
    _console().print(escape(text), soft_wrap=True, highlight=False)


def print_table(table: Table) -> None:
    """Print a table; an empty one is left out."""
    if not table.rows:
        return
    console = _console()
    parts = fitting_parts(table, console.width)
    for i, part in enumerate(parts):
        _print_part(console, part, title=table.title if i == 0 else "")
    if table.note:
        console.print(escape(table.note), style="dim", highlight=False)
    console.print()


def fitting_parts(table: Table, width: int) -> list[Table]:
    """Return a table as it is, or cut between its columns into parts that fit, the first column in each.

    A number is never cut: where one column alone is too wide, the terminal breaks the line.

    Examples
    --------
    >>> table = Table.of("", ("Run", "w", "v"), [(1, "1.25", "-3.5")], "srr")
    >>> [part.header for part in fitting_parts(table, 80)], [p.header for p in fitting_parts(table, 12)]
    ([('Run', 'w', 'v')], [('Run', 'w'), ('Run', 'v')])
    """
    needed = [_column_width(table, i) for i in range(len(table.header))]
    parts: list[list[int]] = [[0]]
    for i in range(1, len(needed)):
        if sum(needed[j] for j in parts[-1]) + needed[i] > width and len(parts[-1]) > 1:
            parts.append([0])
        parts[-1].append(i)
    return [
        replace(
            table,
            header=tuple(table.header[i] for i in part),
            rows=tuple(tuple(row[i] for i in part) for row in table.rows),
            align="".join(table.align[i] for i in part),
        )
        for part in parts
    ]


def _column_width(table: Table, i: int) -> int:
    """Return the columns of a terminal that a column of a table needs; a text can be broken into words."""
    lines = [line for cell in (table.header[i], *(row[i] for row in table.rows)) for line in cell.split("\n")]
    widest = max(map(len, lines), default=0)
    return (widest if table.align[i] in "rs" else min(widest, NARROWEST_TEXT)) + PADDING


def _print_part(console: Console, table: Table, title: str) -> None:
    shown = RichTable(
        box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_header=any(table.header), show_edge=False
    )
    for header, align in zip(table.header, table.align, strict=True):
        shown.add_column(
            escape(header),
            justify="right" if align == "r" else "left",
            no_wrap=align in "rs",
            overflow="fold",
        )
    for row in table.rows:
        shown.add_row(*(_styled(cell) for cell in row))
    if title:
        console.print(f"[bold]{escape(title)}[/bold]")
    console.print(shown)


def _styled(cell: str) -> str:
    style = _STATUS_STYLES.get(cell)
    return f"[{style}]{cell}[/{style}]" if style else escape(cell)
