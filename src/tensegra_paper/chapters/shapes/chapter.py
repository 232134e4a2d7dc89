"""Figs. 1 to 5: the beam, its shapes along the actuation, and two shapes for one actuation."""

from time import perf_counter

import numpy as np

from tensegra.mechanics import EquilibriumPath, Status, solve_path
from tensegra.report import Table, number
from tensegra.report.figures import structure_figure
from tensegra.structure import STRAIN_LIMIT, Structure
from tensegra_paper.beam_model import TIP
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.shapes.pair import INCREMENTS, NOMINAL, Pair, find_pair, tip
from tensegra_paper.claims import finding
from tensegra_paper.published import published_number
from tensegra_paper.setting import Setting
from tensegra_paper.view_figures import views_figure

__all__ = ["shapes"]

CLUSTERED = ("K1", "K2", "K3", "K4")

SNAPSHOTS = (0.01, 0.05, 0.10)
"""Actuations of the three shapes of Fig. 4."""


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
        title="The structure and its shapes (Figs. 1–5)",
        figures=(
            Figure(
                "fig-03a-structure",
                "(a) The beam after its prestress. The clustered cables K1 and K4 run along the top, K2 and "
                "K3 along the bottom; all nodes that find room are numbered",
                lambda: structure_figure(beam, reference, TIP, members=CLUSTERED),
            ),
            Figure(
                "fig-03bc-views",
                "The same from the side, printed as (c), and from above, printed as (b). Struts black, "
                "clustered cables orange-red, classical cables blue",
                lambda: views_figure(beam, {"": reference}),
            ),
            Figure(
                "fig-04-shapes",
                "Shapes under A14 = A23 = 1, 5 and 10 %, from the side (a, c, e) and from above (b, d, f). "
                "In grey the prestressed beam, from which displacements are measured",
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
            (
                "Figs. 1 and 2 of the publication are sketches without data, of fingers that grasp and of "
                "the two kinds of cable; they are left out. So is Fig. 7, a flow chart: the chapters of this "
                "page are its boxes, in its order."
            ),
            *_pair_text(pair),
        ),
        findings=_pair_findings(pair),
        tables=() if pair is None else (_increment_table(pair),),
        seconds={"shapes of Fig. 4": snapshots, "search for Fig. 5": perf_counter() - began},
    )


def _structure_rows(beam: Structure) -> tuple[Row, ...]:
    """Return what was put into the beam: read back, so that it could not fail."""
    members = beam.members.values()
    prestress = beam.stages[0].rest_length_changes
    counts = {
        "struts": sum(not member.is_cable for member in members),
        "classical_cables": sum(member.is_cable and not member.is_clustered for member in members),
        "clustered_cables": sum(member.is_clustered for member in members),
    }
    area = next(member.area for member in members if not member.is_cable)
    assert area is not None  # noqa: S101 - of the packaged beams, which have areas
    printed_area = published_number("structure", "materials", "strut", "area")
    back = "the reconstruction was built with it"
    rows: list[tuple[str, str, float, float, str, str]] = [
        (
            "Fig. 3",
            f"number of {name.replace('_', ' ')}",
            published_number("structure", name),
            count,
            "",
            back,
        )
        for name, count in counts.items()
    ]
    rows.append(
        ("Sect. 2.2", "shortening of K1 and K4 by the prestress", 2.55, -100.0 * prestress["K1"], "%", back)
    )
    slender = "a hundredth of what is printed, for 255 may be a misprint of 2.55"
    same = area == printed_area
    rows.append(("Table 1", "area of a strut", printed_area, area, "cm²", back if same else slender))
    return tuple(
        Row(place, what, float(printed), float(ours), unit, Agreement.INPUT, None, why)
        for place, what, printed, ours, unit, why in rows
    )


def _shape_rows(paths: dict[float, EquilibriumPath]) -> tuple[Row, ...]:
    w = [tip(path, "z") for path in paths.values()]
    v = [abs(tip(path, "y")) for path in paths.values()]
    strains = [100.0 * path.final.largest_strain for path in paths.values()]
    w_text, v_text, strain_text = (
        ", ".join(number(value, 4) for value in values) for values in (w, v, strains)
    )
    return (
        Row(
            "Fig. 4",
            "displacement-z at 1, 5, 10 %",
            "a large deflection at 10 %",
            w_text,
            "cm",
            Agreement.INPUT,
            None,
            "the beam was fitted to the lift that Table 2 prints at 9 and 10 %",
        ),
        finding(
            "y grows",
            "magnitude of displacement-y at 1, 5, 10 %",
            v_text,
            "cm",
            "the figure prints no numbers",
            v=v,
        ),
        Row(
            "Sect. 2.1",
            "largest strain at 1, 5, 10 %",
            "small",
            strain_text,
            "%",
            Agreement.VALUE,
            None,
            f"the third assumption of the publication; {_stress(paths[SNAPSHOTS[-1]])} at 10 %. Steel "
            "yields at a tenth of it: the lengths fitted to the print carry more prestress than a real rope",
        ),
    )


def _stress(path: EquilibriumPath) -> str:
    """Return the largest stress of an end in words."""
    structure, strains = path.structure, path.final.strains
    worst = int(np.argmax(np.abs(strains)))
    name = structure.member_ids[worst]
    material = structure.members[name].material
    assert material is not None  # noqa: S101 - of the packaged beams, which have materials
    stress = strains[worst] * structure.materials[material].youngs_modulus
    return f"{stress / 100:.2g} GPa in {name}"  # 1 GPa is 100 kN/cm²


def _strained(path: EquilibriumPath) -> str:
    """Return the largest strain of an end in words."""
    return f"a largest strain of {100 * path.final.largest_strain:.3g} % ({_stress(path)})"


def _pair_row(pair: Pair | None) -> Row:
    quantity = "shapes of one actuation by different increments"
    limit = STRAIN_LIMIT
    if pair is None:
        why = f"increments of {_percent(INCREMENTS)} all end where the path ends, or do not converge"
        return finding("two shapes", quantity, "one", "", why, largest_strain=None, limit=limit)
    irregular = pair.stepped[pair.irregular]
    return finding(
        "two shapes",
        quantity,
        f"w {number(tip(pair.stepped[pair.regular], 'z'), 4)} and {number(tip(irregular, 'z'), 4)} cm",
        "",
        f"{pair.told}, increments of {100 * pair.regular:g} and {100 * pair.irregular:g} %; the second end "
        f"is {irregular.status} with {_strained(irregular)}, the limit is {100 * limit:g} %. Increments of "
        f"{_percent(INCREMENTS)} were tried at A14 = A23 = {_percent(NOMINAL)} and at random ones; which "
        "the publication took is not printed",
        largest_strain=irregular.final.largest_strain,
        limit=limit,
    )


def _pair_figure(pair: Pair | None) -> tuple[Figure, ...]:
    if pair is None:
        return ()
    reference = pair.robust.stages[-1].nodes
    other = "irregular" if pair.admissible else "no shape, beyond the law"
    ends = {
        f"({letter}) steps of {100 * i:g} %, {word}": pair.stepped[i].final.nodes
        for letter, i, word in (("a", pair.regular, "regular"), ("b", pair.irregular, other))
    }
    strained = _strained(pair.stepped[pair.irregular])
    return (
        Figure(
            "fig-05-two-shapes",
            f"Two ends of the stepped procedure for {pair.told}. (a) ends where the path of stable "
            f"equilibria ends, with {_strained(pair.robust)}; (b) has {strained}",
            lambda: views_figure(pair.structure, ends, reference=reference),
        ),
    )


def _pair_text(pair: Pair | None) -> tuple[str, ...]:
    if pair is None:
        return (
            "No increment of the stepped procedure led to another equilibrium for A14 = A23 = 10 to 30 %.",
        )
    irregular = pair.stepped[pair.irregular]
    told = (
        "The publication gets an irregular shape beside the regular one by another length of the loading "
        f"steps. Here, under {pair.told}, increments of {100 * pair.irregular:g} % end at w = "
        f"{number(tip(irregular, 'z'), 4)} cm, {irregular.status}, with {_strained(irregular)}; the path "
        f"followed in adaptive steps is {pair.robust.status} all the way and ends at w = "
        f"{number(tip(pair.robust, 'z'), 4)} cm with {_strained(pair.robust)}, where increments of "
        f"{100 * pair.regular:g} % end too. "
    )
    if pair.admissible:
        return (
            (
                f"{told}Both are within small strain: plain Newton–Raphson leaves the branch where a step is "
                "too long for it, and nothing in it tells. It is rare (Fig. 6)."
            ),
        )
    return (
        told + "The other end is a root of the equations that no rope could reach: the linear law was left "
        "far behind. It is no evidence about the shape in Fig. 5b, of which neither actuation nor strain is "
        "printed.",
    )


def _pair_findings(pair: Pair | None) -> tuple[str, ...]:
    if pair is None:
        return ()
    irregular = pair.stepped[pair.irregular]
    if pair.admissible:
        return (
            (
                "Two shapes of one actuation by other lengths of the steps, as in Fig. 5, exist within small "
                f"strain ({pair.told}), but many ends of plain Newton–Raphson off the stable path are "
                "spurious roots far beyond it (Fig. 6)."
            ),
        )
    return (
        (
            "Other increments of plain Newton–Raphson do end elsewhere (Fig. 5), but what was found here is "
            f"a spurious root with {_strained(irregular)}; within small strain no second shape was found."
        ),
    )


def _increment_table(pair: Pair) -> Table:
    rows = [("path along stable equilibria", pair.robust)]
    rows += [(f"stepped, {100 * i:g} %", path) for i, path in pair.stepped.items()]
    cells = [
        (
            name,
            str(path.status),
            number(tip(path, "y"), 5) if path.final.status != Status.FAILED else number(None),
            number(tip(path, "z"), 5) if path.final.status != Status.FAILED else number(None),
            number(100.0 * path.final.largest_strain, 3),
            path.reason,
        )
        for name, path in rows
    ]
    title = f"Ends of {pair.told} by procedure and increment"
    return Table.of(
        title, ("Procedure", "Status", "v [cm]", "w [cm]", "Strain [%]", "What it says"), cells, "lsrrrl"
    )


def _percent(values: tuple[float, ...]) -> str:
    return ", ".join(f"{100 * value:g}" for value in values) + " %"
