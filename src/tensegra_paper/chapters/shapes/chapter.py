"""Figs. 3 to 5: the beam, its shapes along the actuation, and two shapes for one actuation."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from tensegra.mechanics import EquilibriumPath, PathSettings, Status, solve_path
from tensegra.report import Table, number
from tensegra.report.figures import structure_figure
from tensegra.structure import Structure
from tensegra_paper.beam_model import TIP
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.published import published, published_number
from tensegra_paper.setting import Setting
from tensegra_paper.view_figures import views_figure

__all__ = ["shapes"]

SNAPSHOTS = (0.01, 0.05, 0.10)
"""Actuations of the three shapes of Fig. 4."""

NOMINAL = (0.10, 0.20, 0.30)
"""Actuations A14 = A23 among which one with two shapes is looked for, the publication's own first."""

INCREMENTS = (0.01, 0.005, 0.02, 0.03, 0.04, 0.05, 0.10, 0.15)
"""Increments of the stepped procedure that are tried, the publication's own 1 % first."""

ELSEWHERE = 0.1
"""Centimetres between two ends of the tip that are different equilibria: far above the residual's
effect on the softest mode (below 1e-3), far below the distance of any two branches that were seen."""


def shapes(setting: Setting) -> Chapter:
    """Draw the structure, its shapes along the actuation, and a regular and an irregular one."""
    beam = setting.structure
    began = perf_counter()
    paths = {value: solve_path(beam, {"A14": value, "A23": value}) for value in SNAPSHOTS}
    snapshots = perf_counter() - began
    reference = next(iter(paths.values())).stages[-1].nodes
    began = perf_counter()
    pair = find_pair(setting)
    return Chapter(
        name="shapes",
        title="The structure and its shapes (Figs. 3–5)",
        figures=(
            Figure(
                "fig-03-structure",
                "The beam after its prestress. Top clustered cables are K1 and K4, bottom ones K2 and K3",
                lambda: structure_figure(beam, reference, TIP),
            ),
            Figure(
                "fig-03-views",
                "The same from the side and from above. Struts black, clustered cables red, classical "
                "cables blue",
                lambda: views_figure(beam, {"": reference}),
            ),
            Figure(
                "fig-04-shapes",
                "Shapes under A14 = A23 = 1, 5 and 10 %. In grey the prestressed beam, from which "
                "displacements are measured",
                lambda: views_figure(
                    beam,
                    {f"{100 * a:g} %": path.final.nodes for a, path in paths.items()},
                    reference=reference,
                ),
            ),
            *_pair_figure(pair),
        ),
        rows=(*_structure_rows(beam), *_shape_rows(paths), _pair_row(pair)),
        text=(
            (
                "The publication prints no coordinates. The beam is a reconstruction with its counts of "
                "members, its materials and its prestress, fitted to the displacements that it prints; "
                "agreement in value is therefore a fit wherever a fitted displacement is compared, and "
                "evidence elsewhere."
            ),
            *_pair_text(pair),
        ),
        findings=_pair_findings(pair),
        tables=() if pair is None else (_increment_table(pair),),
        seconds={"shapes of Fig. 4": snapshots, "search for Fig. 5": perf_counter() - began},
    )


@dataclass(frozen=True, eq=False)
class Pair:
    """An actuation that the stepped procedure answers with two shapes.

    Attributes
    ----------
    structure, actuation
        The beam with or without gravity, and A14 = A23.
    stepped
        End of the stepped procedure by increment.
    robust
        End of the path that is followed along its stable equilibria.
    regular, irregular
        Increments that end where the path ends, and elsewhere.
    """

    structure: Structure
    actuation: float
    stepped: dict[float, EquilibriumPath]
    robust: EquilibriumPath
    regular: float
    irregular: float

    @property
    def gravity(self) -> str:
        """Whether there is gravity, in words."""
        return "with gravity" if any(self.structure.gravity) else "without gravity"


def find_pair(setting: Setting) -> Pair | None:
    """Look for an actuation with a regular and an irregular end by different increments.

    The actuations are A14 = A23 = 10, 20, 30 %, with gravity first. The irregular end taken is the
    lowest tip among those that converged.

    Returns
    -------
    Pair or None
        None where no increment leads elsewhere.
    """
    for value in NOMINAL:
        for structure in (setting.structure, setting.without_gravity):
            actuation = {"A14": value, "A23": value}
            robust = solve_path(structure, actuation)
            stepped = {
                increment: solve_path(
                    structure, actuation, settings=PathSettings(path="stepped", increment=increment)
                )
                for increment in INCREMENTS
            }
            away = {i: _distance(path, robust) for i, path in stepped.items()}
            regular = [i for i, distance in away.items() if distance <= ELSEWHERE]
            irregular = [i for i, distance in away.items() if ELSEWHERE < distance < np.inf]
            if robust.final.succeeded and regular and irregular:
                lowest = min(irregular, key=lambda i: _tip(stepped[i], "z"))
                return Pair(structure, value, stepped, robust, regular[0], lowest)
    return None


def _distance(path: EquilibriumPath, other: EquilibriumPath) -> float:
    """Return how far apart two paths end at the tip; infinity where one has no end."""
    if Status.FAILED in (path.status, other.status):
        return np.inf
    return float(max(np.linalg.norm(path.final.node(node) - other.final.node(node)) for node in TIP))


def _tip(path: EquilibriumPath, axis: str) -> float:
    return float(path.displacement(axis, nodes=list(TIP)))


def _structure_rows(beam: Structure) -> tuple[Row, ...]:
    members = beam.members.values()
    prestress = beam.stages[0].rest_length_changes
    why = "the reconstruction has the printed members"
    counts = {
        "struts": sum(not member.is_cable for member in members),
        "classical_cables": sum(member.is_cable and not member.is_clustered for member in members),
        "clustered_cables": sum(member.is_clustered for member in members),
    }
    rows = [
        Row(
            "Fig. 3",
            f"number of {name.replace('_', ' ')}",
            float(printed := published("structure", name)),
            float(count),
            "",
            Agreement.METHOD,
            count == printed,
            f"exact; {why}",
        )
        for name, count in counts.items()
    ]
    printed_area = published_number("structure", "materials", "strut", "area")
    area = next(member.area for member in members if not member.is_cable)
    assert area is not None  # noqa: S101 - of the packaged beams, which have areas
    same = area == printed_area
    return (
        *rows,
        Row(
            "Sect. 2.2",
            "shortening of cables 1 and 4 by the prestress",
            2.55,
            -100.0 * prestress["K1"],
            "%",
            Agreement.METHOD,
            prestress["K1"] == prestress["K4"] == -0.0255,
            "exact; read from the structure's stage",
        ),
        Row(
            "Table 1",
            "area of a strut",
            printed_area,
            float(area),
            "cm²",
            Agreement.VALUE,
            same or None,
            "as printed"
            if same
            else "fitted with a hundredth of the printed area, for 255 may be a misprint of 2.55",
        ),
    )


def _shape_rows(paths: dict[float, EquilibriumPath]) -> tuple[Row, ...]:
    w = [_tip(path, "z") for path in paths.values()]
    v = [abs(_tip(path, "y")) for path in paths.values()]
    texts = [", ".join(number(value, 4) for value in values) for values in (w, v)]
    return (
        Row(
            "Fig. 4",
            "displacement-z at 1, 5, 10 %",
            "large upward deflection at 10 %",
            texts[0],
            "cm",
            Agreement.VALUE,
            bool(np.all(np.diff(w) > 0.0) and w[0] > 0.0),
            "holds where it is upward and grows; the figure prints no numbers",
        ),
        Row(
            "Fig. 4",
            "magnitude of displacement-y at 1, 5, 10 %",
            "becomes larger and larger",
            texts[1],
            "cm",
            Agreement.VALUE,
            bool(np.all(np.diff(v) > 0.0)),
            "holds where it grows; the figure prints no numbers",
        ),
    )


def _pair_row(pair: Pair | None) -> Row:
    place, quantity = "Fig. 5", "shapes of one actuation by different increments"
    printed = "one regular, one irregular"
    if pair is None:
        why = f"increments of {_percent(INCREMENTS)} all end where the path ends, or do not converge"
        return Row(place, quantity, printed, "one", "", Agreement.VALUE, holds=False, why=why)
    irregular = pair.stepped[pair.irregular]
    return Row(
        place,
        quantity,
        printed,
        f"w {number(_tip(pair.stepped[pair.regular], 'z'), 4)} and {number(_tip(irregular, 'z'), 4)} cm",
        "",
        Agreement.VALUE,
        holds=True,
        why=(
            f"A14 = A23 = {100 * pair.actuation:g} % {pair.gravity}, increments of {100 * pair.regular:g} "
            f"and {100 * pair.irregular:g} %; the second end is {irregular.status}. Which actuation and "
            "which increments the publication took is not printed"
        ),
    )


def _pair_figure(pair: Pair | None) -> tuple[Figure, ...]:
    if pair is None:
        return ()
    reference = pair.robust.stages[-1].nodes
    ends = {
        f"{word}, increments of {100 * i:g} %": pair.stepped[i].final.nodes
        for i, word in ((pair.regular, "regular"), (pair.irregular, "irregular"))
    }
    return (
        Figure(
            "fig-05-two-shapes",
            f"Two ends of the stepped procedure for A14 = A23 = {100 * pair.actuation:g} % {pair.gravity}. "
            "The path that is followed along stable equilibria ends in the regular one",
            lambda: views_figure(pair.structure, ends, reference=reference),
        ),
    )


def _pair_text(pair: Pair | None) -> tuple[str, ...]:
    if pair is None:
        return (
            "No increment of the stepped procedure led to another equilibrium for A14 = A23 = 10 to 30 %.",
        )
    irregular = pair.stepped[pair.irregular]
    return (
        "The publication gets an irregular shape beside the regular one by another length of the loading "
        "steps. The same happens here: plain Newton–Raphson with fixed increments neither predicts nor "
        f"watches stability. Under A14 = A23 = {100 * pair.actuation:g} % {pair.gravity} increments of "
        f"{100 * pair.irregular:g} % end at w = {number(_tip(irregular, 'z'), 4)} cm, which is "
        f"{irregular.status}"
        + (f" ({irregular.reason})" if irregular.reason else "")
        + f". The path followed in adaptive steps is {pair.robust.status} all the way and ends at "
        f"w = {number(_tip(pair.robust, 'z'), 4)} cm, where increments of {100 * pair.regular:g} % end too.",
    )


def _pair_findings(pair: Pair | None) -> tuple[str, ...]:
    if pair is None:
        return ()
    irregular = pair.stepped[pair.irregular]
    standing = "does not stand" if not irregular.final.succeeded else "stands on another branch"
    return (
        (
            "The irregular shape of Fig. 5 is made by the procedure: the same actuation in other "
            f"increments ends in an equilibrium that {standing}; the path along stable equilibria reaches "
            "the regular one."
        ),
    )


def _increment_table(pair: Pair) -> Table:
    rows = [("path along stable equilibria", pair.robust)]
    rows += [(f"stepped, {100 * i:g} %", path) for i, path in pair.stepped.items()]
    cells = [
        (
            name,
            str(path.status),
            number(_tip(path, "y"), 5) if path.final.status != Status.FAILED else number(None),
            number(_tip(path, "z"), 5) if path.final.status != Status.FAILED else number(None),
            path.reason,
        )
        for name, path in rows
    ]
    title = f"Ends of A14 = A23 = {100 * pair.actuation:g} % {pair.gravity} by procedure and increment"
    return Table.of(title, ("Procedure", "Status", "v [cm]", "w [cm]", "What it says"), cells, "lsrrl")


def _percent(values: tuple[float, ...]) -> str:
    return ", ".join(f"{100 * value:g}" for value in values) + " %"
