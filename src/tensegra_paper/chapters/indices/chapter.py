"""Figs. 13 and 19: which input the scatter of the tip comes from."""

from collections.abc import Sequence
from time import perf_counter
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import CERTIFIED, MIN_BLOCKS, Sensitivity, SurrogateModel, chaos_indices, sobol_indices
from tensegra.report import Table
from tensegra.report.figures import index_convergence, index_figure
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.claims import finding
from tensegra_paper.five_inputs import TEMPERATURES
from tensegra_paper.models import NETWORK, beam_model, cable_model, five_inputs, trained
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

__all__ = ["indices"]

Array: TypeAlias = NDArray[np.float64]

CABLES = ("A1", "A2", "A3", "A4")
TOP, BOTTOM = ("A1", "A4"), ("A2", "A3")

AT_REST = (*CERTIFIED, "collapsed")
"""Statuses where a collapsed structure counts by the position in which it came to rest."""

RUNS_PER_BASE_POINT = {4: 10, 5: 12}
"""2d + 2, with the second order."""

SAME = 1e-3
"""Indices by a surrogate and by FEM agree on the same design where they differ by no more than this."""

UNPRINTED = "the figure prints no numbers, and the shares depend on coordinates that are not printed"


def indices(setting: Setting) -> Chapter:
    """Estimate the indices of four actuations and of five inputs by FEM, and the latter by surrogates too."""
    four, resting, seconds = _four(setting)
    setting.tell(f"Fig. 13: {four.n_runs} runs in {seconds['four actuations']:.0f} s")
    five, network, chaos, more = _five(setting)
    seconds |= more
    return Chapter(
        name="indices",
        title="Sensitivity indices (Figs. 13 and 19)",
        figures=_figures(four, resting, five),
        rows=(*_four_rows(four, resting), *_five_rows(five, network, chaos)),
        text=_text(four, resting, five),
        findings=(
            (
                "The reduction to three inputs rests on A1 and A4 acting much more on z than A2 and A3 (Fig. "
                f"13). On this beam A4 is the weakest: {_listed(four, 'w')}; and A14, not A23, is the "
                "strongest on y (Fig. 19)."
            ),
            (
                f"{100 * four.share_dropped:.0f} % of the Saltelli blocks of Fig. 13 hold a run that "
                "collapses, and what is counted for it changes the indices: dropping the blocks or taking "
                f"the collapsed position moves them by up to {_apart(four, resting):.2f}. The publication "
                "does not say what it did."
            ),
        ),
        tables=(
            _table(
                "Four actuations in [0, 30] %, without gravity",
                {"blocks that stand": four, "collapsed runs at rest": resting},
            ),
            _table("Five inputs, with gravity", {"FEM": five, "network": network, "chaos": chaos}),
        ),
        seconds=seconds,
        seeds={name: setting.seed_of(name) for name in ("four indices", "five indices")},
    )


def _four(setting: Setting) -> tuple[Sensitivity, Sensitivity, dict[str, float]]:
    """Return the indices of four actuations: of the blocks that stand, and with collapsed runs at rest."""
    from dataclasses import replace

    truth = cable_model(setting, CABLES)
    printed = int(published("sensitivity", "four_cables", "samples"))
    # A block stands with all of its runs, so that few do; a bootstrap needs some dozens.
    samples = setting.power_of_two(printed // RUNS_PER_BASE_POINT[4], least=8 * MIN_BLOCKS)
    seed = setting.seed_of("four indices")
    began = perf_counter()
    four = sobol_indices(truth, samples=samples, seed=seed, name="four actuations")
    middle = perf_counter()
    resting = sobol_indices(
        replace(truth, statuses=AT_REST, name="FEM, collapsed runs at rest"), samples=samples, seed=seed
    )
    seconds = {"four actuations": middle - began, "again, collapsed runs at rest": perf_counter() - middle}
    return four, resting, seconds


def _five(setting: Setting) -> tuple[Sensitivity, Sensitivity, Sensitivity, dict[str, float]]:
    """Return the indices of five inputs: by FEM, by the network on the same design, and from an expansion."""
    data, truth = five_inputs(setting), beam_model(setting)
    network = trained(setting, "network-1000", data.training.rows(np.arange(1000)), "nn", **NETWORK)
    chaos = trained(setting, "chaos-1000", data.training.rows(np.arange(1000)), "pce")
    printed = int(published("sensitivity", "five_inputs", "samples"))
    samples = setting.power_of_two(printed // RUNS_PER_BASE_POINT[5], least=256)
    seed = setting.seed_of("five indices")
    began = perf_counter()
    by_fem = sobol_indices(truth, samples=samples, seed=seed, name="five inputs")
    middle = perf_counter()
    by_network = sobol_indices(SurrogateModel(network, "network", truth.space), samples=samples, seed=seed)
    seconds = {"five inputs, FEM": middle - began, "five inputs, network": perf_counter() - middle}
    return by_fem, by_network, chaos_indices(SurrogateModel(chaos, "chaos", truth.space)), seconds


def _total(found: Sensitivity, output: str, names: Sequence[str]) -> Array:
    """Return the total indices of some inputs on an output."""
    order = [found.input_names.index(name) for name in names]
    return np.asarray(found.indices[output].total[order])


def _listed(found: Sensitivity, output: str) -> str:
    totals = zip(found.input_names, _total(found, output, found.input_names), strict=True)
    return ", ".join(f"{name} {total:.3f}" for name, total in totals)


def _by_name(found: Sensitivity, output: str, names: Sequence[str]) -> dict[str, float]:
    """Return the total indices of some inputs on an output by name."""
    return dict(zip(names, _total(found, output, names).tolist(), strict=True))


def _four_rows(four: Sensitivity, resting: Sensitivity) -> list[Row]:
    top, bottom = _by_name(four, "w", TOP), _by_name(four, "w", BOTTOM)
    rest = f"all blocks, a collapsed run where it came to rest: {_listed(resting, 'w')}"
    blocks = f"{four.n_blocks} of {four.n_base} blocks, those in which no run collapses"
    rows = [
        finding(
            "top much stronger",
            "total indices of w, blocks that stand",
            _listed(four, "w"),
            "",
            f"{blocks}; {rest}; {UNPRINTED}",
            top=top,
            bottom=bottom,
        ),
        finding(
            "bind the bottom",
            "total indices of w, kept apart over bound together",
            f"{min(top.values()):.3f} over {max(bottom.values()):.3f}",
            "",
            f"the weaker of A1 and A4 over the stronger of A2 and A3; {rest}. On this beam the search loses "
            "more by binding A2 than it would by binding A4: the three inputs are adopted from the print",
            kept=top,
            bound=bottom,
        ),
    ]
    rows += [
        Row(
            "Fig. 13a",
            f"total indices of v, {'all blocks' if found is resting else 'blocks that stand'}",
            None,
            _listed(found, "v"),
            "",
            Agreement.VALUE,
            None,
            "the text says nothing of displacement-y",
        )
        for found in (four, resting)
    ]
    rows.append(
        Row(
            "Fig. 13",
            "blocks dropped for a run that collapses",
            None,
            100.0 * four.share_dropped,
            "%",
            Agreement.VALUE,
            None,
            f"{four.n_failed} of {four.n_runs} runs collapse, and a block has {RUNS_PER_BASE_POINT[4]}; the "
            "publication does not say what it did with its failed runs",
        )
    )
    return rows


def _five_rows(five: Sensitivity, network: Sensitivity, chaos: Sensitivity) -> list[Row]:
    actuation = [_by_name(five, output, ("A14", "A23")) for output in ("v", "w")]
    temperature = [_by_name(five, output, TEMPERATURES) for output in ("v", "w")]
    apart = _apart(five, network)
    inside, n_indices, farthest = _inside(five, chaos)
    return [
        finding(
            "actuation much larger",
            "weaker actuation over strongest temperature, total indices on v and on w",
            ", ".join(
                f"{min(a.values()):.3f} over {max(t.values()):.3f}"
                for a, t in zip(actuation, temperature, strict=True)
            ),
            "",
            "the stronger actuation alone is "
            + " and ".join(f"{max(a.values()):.3f}" for a in actuation)
            + f"; {UNPRINTED}",
            actuation=actuation,
            temperature=temperature,
        ),
        finding(
            "T_bottom negligible",
            "total index of T_bottom, on v and on w",
            ", ".join(f"{each['T_bottom']:.3f}" for each in temperature),
            "",
            UNPRINTED,
            total=[each["T_bottom"] for each in temperature],
        ),
        finding(
            "A14 high on z",
            "total index of A14 on w",
            actuation[1]["A14"],
            "",
            UNPRINTED,
            total=actuation[1]["A14"],
        ),
        finding(
            "A14 low on y",
            "total index of A14 on v",
            actuation[0]["A14"],
            "",
            f"A23 has {actuation[0]['A23']:.3f}; {UNPRINTED}",
            total=actuation[0]["A14"],
            other=actuation[0]["A23"],
        ),
        finding(
            "A23 highest on y",
            "strongest input on v, by total index",
            five.input_names[int(np.argmax(five.indices["v"].total))],
            "",
            f"v: {_listed(five, 'v')}; {UNPRINTED}",
            totals=_by_name(five, "v", five.input_names),
        ),
        Row(
            "Fig. 19",
            "indices by the network less those by FEM, largest difference",
            None,
            apart,
            "",
            Agreement.METHOD,
            apart <= SAME,
            f"first and total indices on the same {five.n_runs} points; tolerance {SAME:g}",
        ),
        Row(
            "Fig. 19",
            "indices from a chaos expansion within the FEM's 95 % intervals",
            None,
            f"{inside} of {n_indices}",
            "",
            Agreement.METHOD,
            farthest <= 2.0,
            f"the farthest lies {farthest:.2f} half-widths from the middle of its interval; one in twenty "
            "may lie outside, so holds up to 2",
        ),
    ]


def _apart(one: Sensitivity, other: Sensitivity) -> float:
    """Return the largest difference of the first and total indices of two results."""
    return max(
        float(np.abs(getattr(one.indices[output], order) - getattr(other.indices[output], order)).max())
        for output in one.indices
        for order in ("first", "total")
    )


def _inside(sampled: Sensitivity, exact: Sensitivity) -> tuple[int, int, float]:
    """Return how many indices lie in the sampled intervals, of how many, and the farthest in half-widths."""
    shares = np.concatenate(
        [
            np.abs(getattr(exact.indices[output], order) - getattr(found, order))
            / np.maximum(getattr(found, f"{order}_half"), 1e-12)
            for output, found in sampled.indices.items()
            for order in ("first", "total")
        ]
    )
    return int((shares <= 1.0).sum()), shares.size, float(shares.max())


def _text(four: Sensitivity, resting: Sensitivity, five: Sensitivity) -> tuple[str, ...]:
    statuses = ", ".join(f"{count} {status}" for status, count in four.statuses.items())
    shift = _apart(four, resting)
    return (
        (
            f"Four actuations, each in [0, 30] %, without gravity: {four.n_base} base points of Saltelli's "
            f"design, {four.n_runs} runs by FEM for the printed 10,000, for a base is a power of two "
            f"({statuses}). The estimators mix the {RUNS_PER_BASE_POINT[4]} runs of a block, so a block with "
            f"a collapsed run is dropped whole; {four.n_blocks} are left. They say what drives the response "
            "where the structure stands, and no longer belong to independent inputs in the whole box. "
            "Counting a collapsed run by the position in which it came to rest keeps every block, but that "
            f"position is one of many; the indices differ by up to {shift:.2f}."
        ),
        (
            "Five inputs, A14 and A23 in [9, 10] % and three temperatures in [0, 150] °C, with gravity: "
            f"{five.n_base} base points, {five.n_runs} runs by FEM for the printed 100,000, none of which "
            "fails; displacements of node 23, as printed. Intervals are 95 %, by bootstrap over blocks."
        ),
    )


def _table(title: str, results: dict[str, Sensitivity]) -> Table:
    """List first and total indices with the half-widths of their intervals."""
    first = next(iter(results.values()))
    rows: list[tuple[object, ...]] = []
    for output in first.indices:
        for i, name in enumerate(first.input_names):
            cells = [
                f"{getattr(found.indices[output], order)[i]:.3f} ± "
                f"{getattr(found.indices[output], f'{order}_half')[i]:.1g}"
                for found in results.values()
                for order in ("first", "total")
            ]
            rows.append((output if i == 0 else "", name, *cells))
    header = ("Output", "Input", *(f"{order}, {how}" for how in results for order in ("first", "total")))
    note = "; ".join(
        f"{how}: {found.n_blocks} of {found.n_base} blocks" for how, found in results.items() if found.n_base
    )
    return Table.of(title, header, rows, "ss" + (len(header) - 2) * "r", f"{note}; ± is half a 95 % interval")


def _figures(four: Sensitivity, resting: Sensitivity, five: Sensitivity) -> tuple[Figure, ...]:
    kept, rest, inputs = four.to_dict(), resting.to_dict(), five.to_dict()
    return (
        Figure(
            "fig-13-four-actuations",
            f"Indices of four actuations, printed as (a) for v and (b) for w. Of the {four.n_blocks} of "
            f"{four.n_base} blocks in which no run collapses; bars are 95 % intervals",
            lambda: index_figure(kept),
        ),
        Figure(
            "collapsed-at-rest",
            "The same from all blocks. A collapsed run counts by the position in which it came to rest",
            lambda: index_figure(rest),
        ),
        Figure(
            "fig-19-five-inputs",
            "Indices of two actuations and three temperatures, printed as (a) for v and (b) for w. "
            f"{five.n_runs} runs by FEM; bars are 95 % intervals",
            lambda: index_figure(inputs),
        ),
        Figure(
            "index-convergence",
            "Total indices over the number of base points. Bands are 95 % intervals",
            lambda: index_convergence(inputs),
        ),
    )
