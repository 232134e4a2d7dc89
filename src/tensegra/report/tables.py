"""Tables of results: what the terminal and the HTML report both show.

A `Table` holds text only; numbers are rounded here, once, and every column that measures something
names its unit.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import floor, isfinite, log10, nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensegra.errors import ModelError
from tensegra.files import replacing
from tensegra.mechanics import Equilibrium, EquilibriumPath
from tensegra.mechanics.history import history_arrays
from tensegra.report.members import size_of, weight_of
from tensegra.structure import Member, Structure

if TYPE_CHECKING:
    import pandas as pd

    from tensegra.report.check import StructureCheck

__all__ = [
    "Table",
    "aligned",
    "check_lines",
    "displacement_table",
    "event_table",
    "history_frame",
    "labelled",
    "member_table",
    "number",
    "reaction_table",
    "stage_table",
    "structure_table",
    "tension_table",
    "write_history",
]

NOTHING = "–"
"""Stands for a number that there is not."""

MOST_DECIMALS = 8
"""Smaller numbers are written with an exponent."""

MOST_ROWS = 24
"""Nodes that a table of displacements lists; of a larger structure those that move most."""

HISTORY_FILES = (".parquet", ".csv")
"""Ends of the names of files that a history can be written to."""


@dataclass(frozen=True)
class Table:
    """A table ready to be read.

    Attributes
    ----------
    title
        What it shows.
    header
        One text per column, with its unit.
    rows
        One text per cell.
    align
        A letter per column: ``l`` for text, ``s`` for a short word that stays on one line, ``r`` for
        numbers.
    note
        A sentence below the table, or "".
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    align: str
    note: str = ""

    @classmethod
    def of(
        cls, title: str, header: Sequence[str], rows: Iterable[Sequence[object]], align: str, note: str = ""
    ) -> "Table":
        """Build a table from cells of any kind; numbers are rounded by `number`."""
        cells = tuple(tuple(_cell(value) for value in row) for row in rows)
        return cls(title, tuple(header), cells, align, note)


def number(value: float | None, digits: int = 6) -> str:
    """Return a number with `digits` significant digits, or a dash for none.

    Examples
    --------
    >>> number(53.14669359), number(1.2e-13, 3), number(float("nan")), number(1234567.0)
    ('53.1467', '1.2e-13', '–', '1.23457e+06')
    """
    if value is None or not isfinite(value):
        return NOTHING
    return f"{value:.{digits}g}"


def aligned(values: Iterable[float], digits: int = 6) -> list[str]:
    """Return numbers with as many decimals as give the largest of them `digits` significant digits.

    Examples
    --------
    >>> aligned([53.14669, -0.01234, float("nan")])
    ['53.1467', '-0.0123', '–']
    """
    numbers = [float(value) for value in values]
    largest = max((abs(value) for value in numbers if isfinite(value)), default=0.0)
    decimals = max(0, digits - 1 - floor(log10(largest))) if largest > 0.0 else 0
    if decimals > MOST_DECIMALS or largest >= 10.0**digits:
        return [number(value, digits) for value in numbers]
    return [f"{value:z.{decimals}f}" if isfinite(value) else NOTHING for value in numbers]


def labelled(text: str, unit: str) -> str:
    """Return a name with its unit in brackets, if it has one.

    Examples
    --------
    >>> labelled("w", "cm"), labelled("A14", "")
    ('w [cm]', 'A14')
    """
    return f"{text} [{unit}]" if unit and unit != "1" else text


def structure_table(structure: Structure) -> Table:
    """Describe a structure: its counts, units, supports, groups and actuators."""
    units = structure.units
    kinds = [_kind(member) for member in structure.members.values()]
    members = ", ".join(
        f"{kinds.count(kind)} {kind}{'s' if kinds.count(kind) != 1 else ''}"
        for kind in _KINDS
        if kind in kinds
    )
    weight = weight_of(structure)
    rows = [
        ("Nodes", f"{structure.n_nodes}, {structure.n_free} free degrees of freedom"),
        ("Members", members),
        ("Size", f"{' × '.join(number(extent, 4) for extent in size_of(structure))} {units.length}"),
        ("Weight", f"{number(weight, 4)} {units.force} under gravity 1" if weight else ""),
        ("Units", f"{units.length}, {units.force}, {units.temperature}"),
        ("Supports", _supports(structure)),
        ("Groups", ", ".join(f"{name} ({len(ids)})" for name, ids in structure.groups.items())),
        *(
            ("Actuators" if i == 0 else "", f"{name}: {actuator.effect}s {', '.join(actuator.members)}")
            for i, (name, actuator) in enumerate(structure.actuators.items())
        ),
    ]
    return Table.of(structure.name, ("", ""), [row for row in rows if row[1]], "ll")


def member_table(result: "StructureCheck") -> Table:
    """List the members as they stand, those that carry most where not all fit."""
    units, ratios = result.structure.units, result.self_stress_ratios
    shown = sorted(result.members, key=lambda member: -abs(member.tension))[:MOST_ROWS]
    note = (
        ""
        if len(shown) == len(result.members)
        else f"the {len(shown)} of {len(result.members)} that carry most"
    )
    n_states = len(next(iter(ratios.values()), []))
    columns = [
        (f"Rest length\n[{units.length}]", [m.rest_length for m in shown]),
        (f"Length\n[{units.length}]", [m.length for m in shown]),
        ("Strain\n[%]", [100 * m.strain for m in shown]),
        (f"Tension\n[{units.force}]", [m.tension for m in shown]),
        (f"Force density\n[{units.of('force per length')}]", [m.force_density for m in shown]),
    ]
    if any(m.utilisation is not None for m in shown):
        used = [100 * m.utilisation if m.utilisation is not None else nan for m in shown]
        columns.append(("Used\n[%]", used))
    for i in range(n_states):
        header = "Self-stress\nratio" if n_states == 1 else f"Self-stress\nratio {i + 1}"
        columns.append((header, [ratios[m.name][i] for m in shown]))
    texts = [aligned(values, 5) for _, values in columns]
    rows = [(m.name, *(column[i] for column in texts)) for i, m in enumerate(shown)]
    titles = ("Member", *(title for title, _ in columns))
    return Table.of("Members as they stand", titles, rows, "s" + "r" * len(columns), note)


def stage_table(path: EquilibriumPath) -> Table:
    """List the equilibria of a history with their certificates."""
    units = path.structure.units
    header = (
        "Stage",
        "Status",
        "Steps",
        "Iterations",
        "Residual",
        f"Lowest eigen-\nvalue [{units.of('force per length')}]",
        "Largest\nstrain [%]",
        "Slack",
    )
    equilibria = [*path.stages, *([] if path.actuation is None else [path.actuation])]
    rows = [
        (
            equilibrium.stage,
            str(equilibrium.status),
            equilibrium.steps,
            equilibrium.iterations,
            number(equilibrium.residual, 2),
            number(equilibrium.lowest_eigenvalue, 5),
            number(100.0 * equilibrium.largest_strain, 3),
            len(equilibrium.slack_members),
        )
        for equilibrium in equilibria
    ]
    return Table.of("Equilibria", header, rows, "lsrrrrrr")


def event_table(path: EquilibriumPath) -> Table:
    """List where the history lost its stability, and which cables went slack or came taut."""
    length = path.structure.units.length
    rows = [
        (
            point.stage,
            f"{100 * point.parameter:.4g} %",
            point.kind + (f", a snap of {point.snap:.4g} {length}" if point.snap > 0 else ""),
            ", ".join(point.moved_nodes),
        )
        for point in path.critical_points
    ]
    rows += [
        (event.stage, f"{100 * event.parameter:.4g} %", f"{event.member} becomes {event.becomes}", "")
        for event in path.slack_events
    ]
    return Table.of("Events on the way", ("Stage", "At", "What", "Nodes moved most"), rows, "lrll")


def displacement_table(path: EquilibriumPath) -> Table:
    """List the displacements by the actuation, largest first where not all nodes fit."""
    structure, moved = path.structure, path.displacements
    magnitude = np.linalg.norm(moved, axis=1)
    shown = np.flatnonzero(magnitude > 0.0)
    note = ""
    if len(shown) > MOST_ROWS:
        note = f"the {MOST_ROWS} of {len(shown)} moving nodes that move most"
        shown = np.sort(shown[np.argsort(-magnitude[shown], kind="stable")[:MOST_ROWS]])
    texts = aligned(np.column_stack([moved[shown], magnitude[shown]]).ravel())
    rows = [(structure.node_ids[n], *texts[4 * i : 4 * i + 4]) for i, n in enumerate(shown)]
    title = f"Displacements from the last stage, {structure.units.length}"
    return Table.of(title, ("Node", "u", "v", "w", "magnitude"), rows, "lrrrr", note)


def tension_table(equilibrium: Equilibrium) -> Table:
    """List the extremes of the tensions by kind of member, and each clustered cable."""
    structure = equilibrium.structure
    kinds = np.array([_kind(member) for member in structure.members.values()])
    ids = np.array(structure.member_ids)
    tensions = equilibrium.tensions
    indices = [index for kind in _KINDS if len(index := np.flatnonzero(kinds == kind))]
    extremes = [(index[tensions[index].argmin()], index[tensions[index].argmax()]) for index in indices]
    texts = aligned(tensions[np.array(extremes).ravel()])
    rows = [
        (
            f"{kinds[index[0]]}s",
            len(index),
            int(equilibrium.slack[index].sum()) if kinds[index[0]] != "strut" else "",
            texts[2 * i],
            ids[low],
            texts[2 * i + 1],
            ids[high],
        )
        for i, (index, (low, high)) in enumerate(zip(indices, extremes, strict=True))
    ]
    title = f"Tensions, {structure.units.force}"
    return Table.of(title, ("", "Members", "Slack", "Least", "in", "Greatest", "in"), rows, "lrrrlrl")


def reaction_table(equilibrium: Equilibrium) -> Table:
    """List the forces of the supports on the structure, largest first where not all nodes fit, and their sum.

    A dash stands where a coordinate is free.
    """
    structure, forces = equilibrium.structure, equilibrium.reactions
    held = ~equilibrium.arrays.free
    shown = np.flatnonzero(held.any(axis=1))
    if not len(shown):
        return Table.of("Reactions", ("Node", "x", "y", "z"), [], "lrrr")
    total, note = forces.sum(axis=0), "forces of the supports on the structure"
    if len(shown) > MOST_ROWS:
        note += f"; the {MOST_ROWS} of {len(shown)} supported nodes where they are largest"
        magnitude = np.linalg.norm(forces[shown], axis=1)
        shown = np.sort(shown[np.argsort(-magnitude, kind="stable")[:MOST_ROWS]])
    listed = np.where(held, forces, np.nan)[shown]
    texts = aligned(np.vstack([listed, total]).ravel())
    names = [*(structure.node_ids[n] for n in shown), "sum"]
    rows = [(name, *texts[3 * i : 3 * i + 3]) for i, name in enumerate(names)]
    return Table.of(f"Reactions, {structure.units.force}", ("Node", "x", "y", "z"), rows, "lrrr", note)


def history_frame(path: EquilibriumPath) -> "pd.DataFrame":
    """Return every accepted step of a history as a row; no row where the first stage failed.

    Columns: ``stage``, ``parameter``, ``iterations``, then ``x_<node>``, ``y_<node>``, ``z_<node>`` and
    ``T_<member>``, as a field surrogate calls its outputs. The units stand in the frame's `attrs`, which
    Parquet keeps.
    """
    import pandas as pd

    structure, units = path.structure, path.structure.units
    steps = {
        "stage": pd.Series([point.stage for point in path.history], dtype="str"),
        "parameter": np.array([point.parameter for point in path.history], dtype=np.float64),
        "iterations": np.array([point.iterations for point in path.history], dtype=np.int64),
    }
    nodes, tensions = history_arrays(structure, path.history)
    numbers: dict[str, np.ndarray] = {}
    for n, node in enumerate(structure.node_ids):
        numbers |= {f"{axis}_{node}": nodes[:, n, i] for i, axis in enumerate("xyz")}
    numbers |= {f"T_{member}": tensions[:, e] for e, member in enumerate(structure.member_ids)}
    frame = pd.DataFrame(steps | numbers)
    frame.attrs = {
        "structure": structure.name,
        "units": {"length": units.length, "force": units.force, "temperature": units.temperature},
    }
    return frame


def write_history(path: EquilibriumPath, file: Path) -> None:
    """Write `history_frame` as Parquet or, for reading anywhere, as CSV with all digits.

    Raises
    ------
    ModelError
        The file is named otherwise, or cannot be written.
    """
    suffix = file.suffix.lower()
    if suffix not in HISTORY_FILES:
        raise ModelError.at("-o", file.name, "a file named .parquet or .csv", candidates=HISTORY_FILES)
    frame = history_frame(path)
    with replacing(file, ModelError) as opened:
        if suffix == ".csv":
            frame.to_csv(opened, index=False, lineterminator="\n")
        else:
            frame.to_parquet(opened, index=False)


_KINDS = ("strut", "cable", "clustered cable")


def _kind(member: Member) -> str:
    return member.kind if not member.is_clustered else "clustered cable"


def _supports(structure: Structure) -> str:
    nodes_by_axes: dict[str, list[str]] = {}
    for node, axes in structure.supports.items():
        nodes_by_axes.setdefault(axes, []).append(node)
    return "; ".join(f"{axes} at {', '.join(nodes)}" for axes, nodes in nodes_by_axes.items())


def _cell(value: object) -> str:
    return number(value) if isinstance(value, float) or value is None else str(value)


def check_lines(result: "StructureCheck") -> list[str]:
    """Return sentences that tell a newcomer whether the structure stands, and what holds it up."""
    units = result.structure.units
    lines = []
    if result.statics is not None and result.locked is not None:
        clusters = any(member.is_clustered for member in result.structure.members.values())
        lines.append(
            f"Mechanisms {result.statics.n_mechanisms}, states of self-stress {result.statics.n_self_stress} "
            "(in the given coordinates, all cables taut)."
        )
        if clusters:
            lines.append(
                f"With the pulleys locked: mechanisms {result.locked.n_mechanisms}, "
                f"states of self-stress {result.locked.n_self_stress}."
            )
    if result.prestress_stiffness is not None:
        holds = "hold" if result.prestress_stiffness > 0.0 else "do not hold"
        lines.append(
            f"The tensions {holds} the mechanisms: lowest stiffness on them "
            f"{result.prestress_stiffness:.4g} {units.of('force per length')}."
        )
    if result.vibration is not None:
        frequencies = ", ".join(f"{frequency:.3g}" for frequency in result.vibration.frequencies[:4])
        lines.append(f"Lowest natural frequencies {frequencies} Hz (consistent masses from the weights).")
    utilisation = result.path.final.utilisation if result.path.final.succeeded else {}
    if utilisation:
        member, share = max(utilisation.items(), key=lambda item: item[1])
        lines.append(f"Highest utilisation {100 * share:.3g} %, of member {member}.")
    lines += [f"Warning: {slip.rstrip('.')}{'' if slip.endswith('?') else '.'}" for slip in result.slips]
    return [*lines, f"{result.verdict}."]
