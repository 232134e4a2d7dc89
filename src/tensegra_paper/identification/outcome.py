"""What the search has found: the beam as a structure; a page of counts, fronts, beams that agree as well."""

from collections.abc import Iterable, Sequence

import numpy as np

import tensegra as tg
from tensegra_paper.identification.candidate import Candidate
from tensegra_paper.identification.findings import FINDINGS
from tensegra_paper.identification.front import Front
from tensegra_paper.identification.layout import N_SECTIONS
from tensegra_paper.identification.local import cost_of
from tensegra_paper.identification.records import Records, misses
from tensegra_paper.identification.search import Plan, Result
from tensegra_paper.identification.tally import Tally, markdown

__all__ = ["alike", "beam_of", "page"]

NAME = "paper_beam_identified"

DESCRIPTION = (
    "Clustered tensegrity beam: 12 struts, 32 classical and 4 clustered cables, strut area {area:g} cm2. "
    "Found by a search over a family of beams for agreement with the published responses; not the original "
    "coordinates."
)

AS_WELL = 1.5
"""Factor of the lowest cost up to which a beam counts as agreeing equally well."""


def beam_of(result: Result) -> tg.Structure:
    """Return the beam of a result as a structure, drawn where it stands by its base self-stress alone.

    Raises
    ------
    ValueError
        If its shape does not balance.
    tensegra.SolverError
        If it does not stand.
    """
    candidate = result.candidate
    structure = candidate.structure(NAME, DESCRIPTION.format(area=candidate.area))
    if structure is None:
        raise ValueError("the shape of this candidate does not balance")
    alone = tg.solve_path(structure.replace(stages=(), gravity=(0.0, 0.0, 0.0))).raise_for_status().final
    places = {
        node: tuple(place) for node, place in zip(structure.nodes, alone.nodes.round(6).tolist(), strict=True)
    }
    return structure.replace(nodes=places)


def alike(records: Records) -> list[tuple[Candidate, float]]:
    """Return the beams asked everything that cost at most `AS_WELL` times the least, the best first."""
    found = [
        (candidate, cost_of(misses(values)))
        for candidate, values in records.answers()
        if "6a upward" in values
    ]
    if not found:
        return []
    least = min(cost for _, cost in found)
    return sorted(((c, cost) for c, cost in found if cost <= AS_WELL * least), key=lambda pair: pair[1])


def page(
    beams: Sequence[Tally], best: Sequence[Result], records: Records, fronts: Iterable[Front], plan: Plan
) -> str:
    """Return the page of a search in Markdown.

    Parameters
    ----------
    beams
        Measured with many runs; the identified one is the last.
    best
        Results of the search, the best first.
    records
        Of the search.
    fronts
        Of pairs of findings.
    plan
        Of the search.
    """
    fitted = sum(finding.fitted for finding in FINDINGS)
    lines = [
        (
            f"Search with seed {plan.seed}: {len(records.kept)} solutions of candidates. Of {len(FINDINGS)} "
            f"findings {fitted} are in the fit and {len(FINDINGS) - fitted} held out."
        ),
        "",
        markdown(beams),
        "## Which findings exclude each other",
        "",
        "| First | Second | Beams | One has both | Front, from the first to the second |",
        "| --- | --- | ---: | --- | --- |",
        *(_front_line(front) for front in fronts),
        "",
        "## Beams that agree about as well",
        "",
        *_alike_lines(alike(records)),
        "",
        "## Best results",
        "",
        "| Start | Layout | Strut, cm² | Held | Self-stress, kN | Expansion, 1e-6/K | Cost |",
        "| ---: | --- | ---: | --- | ---: | ---: | ---: |",
        *(
            f"| {each.origin} | {each.candidate.layout.name} | {each.candidate.area:g} | "
            f"{each.candidate.held} | {each.candidate.self_stress:.0f} | "
            f"{1e6 * each.candidate.expansion:.1f} | {each.cost:.2f} |"
            for each in best
        ),
    ]
    return "\n".join(lines) + "\n"


def _front_line(front: Front) -> str:
    shown = (
        front.values[np.unique(np.linspace(0, len(front.values) - 1, 5).astype(int))]
        if len(front.values)
        else []
    )
    points = "; ".join(f"{first:.4g}, {second:.4g}" for first, second in shown)
    both = "yes" if front.both else "no"
    return f"| {front.keys[0]} | {front.keys[1]} | {front.n_candidates} | {both} | {points} |"


def _alike_lines(found: Sequence[tuple[Candidate, float]]) -> list[str]:
    """Return how far the properties of equally good beams are apart."""
    shapes = [(c, c.shape) for c, _ in found]
    rows: dict[str, list[float]] = {
        "radius of the first section, cm": [s.radius[0] for _, s in shapes if s],
        "radius of the last section, cm": [s.radius[N_SECTIONS - 1] for _, s in shapes if s],
        "length, cm": [s.x[-1] - s.x[0] for _, s in shapes if s],
        "overlap of the first two stages, cm": [s.x[1] - s.x[2] for _, s in shapes if s],
        "twist of the first stage, degrees": [
            float(np.degrees(s.angle[1] - s.angle[0])) for _, s in shapes if s
        ],
        "base self-stress, kN": [c.self_stress for c, _ in shapes],
        "thermal expansion, 1e-6/K": [1e6 * c.expansion for c, _ in shapes],
    }
    return [
        (
            f"{len(found)} beams cost at most {AS_WELL} times the least, "
            f"from {len({c.layout.name for c, _ in shapes})} layouts."
        ),
        "",
        "| Property | least | median | most |",
        "| --- | ---: | ---: | ---: |",
        *(f"| {name} | {min(v):.4g} | {np.median(v):.4g} | {max(v):.4g} |" for name, v in rows.items() if v),
    ]
