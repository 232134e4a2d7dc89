"""Fig. 20: which runs are learned from, by clusters of their outputs and by the solver's certificate."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import Table, number
from tensegra.report.figures import output_figure
from tensegra.study import TrainingData
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.selection.figures import MOST_POINTS, kept_figure
from tensegra_paper.claims import finding
from tensegra_paper.groups import OUTPUTS, PRINTED_GROUPS, Groups, run_table, stepped_groups
from tensegra_paper.models import (
    LIFT_INPUTS,
    cable_model,
    lift_data,
    lift_runs,
    lift_surrogate,
    trained,
)
from tensegra_paper.published import published_number
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["selection"]

Mask: TypeAlias = NDArray[np.bool_]

LARGEST_SHARE_OF_ERROR, SMALLEST_SHARE_RIGHT = 5e-4, 0.99
"""Mean error over mean displacement on all designs that stand, and share of outcomes predicted right."""

N_POLYNOMIAL = 10_000
"""Most runs that a polynomial learns from, to tell the rules of selection apart."""

FEW = 4096
"""Runs that are clustered once more alone: what the rule finds depends on their number."""

MOST_GROUPS = 4
"""Groups that a table tells apart."""

MAX_DEGREE, FEWEST_KEPT = 10, 500
"""Of the polynomial, and the runs that its 286 terms need; a rule that keeps fewer has nothing to show."""


def selection(setting: Setting) -> Chapter:
    """Cluster the stepped runs as the publication does, and compare with the certificate of stable paths."""
    stepped, path = lift_runs(setting, stepped=True), lift_runs(setting)
    setting.tell(
        f"Fig. 20: {stepped.n_runs} runs in {stepped.seconds:.0f} s, again along paths {path.seconds:.0f} s"
    )
    groups = tuple(stepped_groups(setting, outputs) for outputs in (PRINTED_GROUPS, OUTPUTS))
    few = stepped_groups(setting, PRINTED_GROUPS, min(FEW, stepped.n_runs))
    surrogate = lift_surrogate(setting)
    compared = _compared(setting, stepped, path, groups)
    study = cable_model(setting, LIFT_INPUTS, OUTPUTS).study
    frame = run_table(path)
    shown = min(MOST_POINTS, stepped.n_runs)
    return Chapter(
        name="selection",
        title="Selection of the runs to learn from (Fig. 20)",
        figures=(
            Figure(
                "fig-20-clusters",
                f"The first {shown} of {stepped.n_runs} stepped runs. (a) All that converged; (b) the "
                "largest group of (v, w) that HDBSCAN finds with a smallest group of 40, the publication's "
                "rule, with the runs that it leaves out on top; (c) the same of (u, v, w)",
                lambda: kept_figure(stepped, {each.name: each.keep for each in groups}),
            ),
            Figure(
                "certified-outcomes",
                f"The same designs followed along stable paths, {min(4000, path.n_runs)} of {path.n_runs} "
                "drawn at random. Outputs over the three actuations, by what the solver says of each run",
                lambda: output_figure(study, frame),
            ),
        ),
        rows=(*_rows(setting, stepped, path, groups, few), *_surrogate_rows(surrogate)),
        text=_text(stepped, path, groups, surrogate),
        findings=_findings(stepped, groups),
        tables=(*(_agreement_table(each, stepped) for each in groups), _comparison_table(compared)),
        seconds={
            "stepped runs": stepped.seconds,
            "runs along stable paths": path.seconds,
            "training": surrogate.seconds,
            **{f"HDBSCAN of {each.name}": each.seconds for each in groups},
        },
        seeds={name: setting.seed_of(name) for name in ("lift", "lift-held-out", "surrogate lift")},
    )


def _findings(stepped: BeamRuns, groups: Sequence[Groups]) -> tuple[str, ...]:
    first = groups[0]
    kept, fallen, lost = first.counts(stepped.stands)
    lost_prestress = int((first.keep & (stepped.status == "collapsed")).sum())
    return (
        (
            f"{_fewer(stepped)}he publication's selection, run as printed, finds {first.n_groups} groups of "
            f"{first.name} (printed: 4) and leaves out {100 * lost / stepped.stands.sum():.2g} % of the runs "
            f"that stand. The largest group holds {kept} of {stepped.n_runs} runs (printed: 98,365), of "
            f"which {fallen} do not stand; {lost_prestress} of these have lost their prestress and come to "
            "rest among standing ones, where no cluster of positions can tell them apart."
        ),
    )


def _fewer(stepped: BeamRuns) -> str:
    """Begin a sentence, with a warning where there are fewer runs than printed."""
    printed = int(published_number("selection", "samples"))
    if stepped.n_runs == printed:
        return "T"
    return f"With {stepped.n_runs} runs instead of {printed}, on which it depends, t"


def _compared(
    setting: Setting, stepped: BeamRuns, path: BeamRuns, groups: Sequence[Groups]
) -> list[tuple[str, str, int, int, tuple[float, ...]]]:
    """Learn from the runs that each rule keeps, and return (rule, kind, runs, not standing, errors) for each.

    The errors are mean |error| over mean |displacement|, of v and of w, on held-out designs that stand.
    """
    held_out = lift_data(setting, lift_runs(setting, held_out=True)).runs
    rules: list[tuple[str, BeamRuns, Mask]] = [("certified along stable paths", path, path.stands)]
    rules += [(f"largest group of {each.name}, stepped", stepped, each.keep) for each in groups]
    results = []
    for i, (rule, runs, kept) in enumerate(rules):
        if kept.sum() < FEWEST_KEPT:
            continue
        chosen = np.flatnonzero(kept)[: setting.count(N_POLYNOMIAL, least=1000)]
        data = TrainingData(
            X=runs.X[chosen],
            Y=np.column_stack([runs.v, runs.w])[chosen],
            bounds=held_out.box,
            input_names=held_out.input_names,
            output_names=held_out.output_names,
        )
        surrogate = trained(setting, f"kept-{i}-pce", data, "pce", held_out, degree=MAX_DEGREE)
        assert surrogate.validation is not None  # noqa: S101 - asked for
        fallen = int((~runs.stands[chosen]).sum())
        label = f"polynomial, degree {MAX_DEGREE}"
        results.append((rule, label, len(chosen), fallen, surrogate.validation.normalised_error))
    whole = lift_surrogate(setting).validation
    assert whole is not None  # noqa: S101 - asked for
    results.append(("all, by regime", "a piece for each regime", path.n_runs, -1, whole.normalised_error))
    return results


def _rows(
    setting: Setting, stepped: BeamRuns, path: BeamRuns, groups: Sequence[Groups], few: Groups
) -> list[Row]:
    first, whole = groups
    judged = partial(finding, scale=setting.scale)
    kept, fallen, lost = first.counts(stepped.stands)
    stand, n_runs = int(stepped.stands.sum()), stepped.n_runs
    converged = int((stepped.status != "failed").sum())
    other_kept, other_fallen, other_lost = whole.counts(stepped.stands)
    data = "stepped runs, as printed; which outputs were clustered and how they were scaled is not said"
    return [
        judged(
            "four groups",
            f"groups of {first.name}",
            float(first.n_groups),
            "",
            f"{whole.n_groups} of {whole.name}; of the first {len(few.labels)} runs alone {few.n_groups}, "
            f"the largest with {100 * few.keep.mean():.0f} %: what the rule finds depends on the number of "
            f"runs; {data}",
            groups=first.n_groups,
        ),
        judged(
            "largest group",
            f"runs in the largest group of {first.name}",
            100.0 * kept / n_runs,
            "%",
            f"{kept} of {n_runs}, of which {converged} converged; {100 * other_kept / n_runs:.1f} % of "
            f"{whole.name}. The printed share is that of Fig. 6a, with gravity and [1, 10] %, while Fig. 6b "
            "prints about half for designs like these",
            share=100.0 * kept / n_runs,
        ),
        judged(
            "all viable",
            "runs that stand and are left out",
            100.0 * lost / stand,
            "%",
            f"{lost} of {stand}; {100 * other_lost / stand:.2g} % with {whole.name}",
            left_out=100.0 * lost / stand,
        ),
        judged(
            "upward alone",
            "runs in the largest group that do not stand",
            100.0 * fallen / max(kept, 1),
            "%",
            f"{fallen} of {kept}, of which {int((first.keep & (stepped.status == 'collapsed')).sum())} have "
            f"lost their prestress; {100 * other_fallen / max(other_kept, 1):.1f} % with {whole.name}",
            fallen=100.0 * fallen / max(kept, 1),
        ),
        Row(
            "Fig. 20",
            "runs that stand, stepped and along stable paths",
            None,
            f"{100 * stepped.stands.mean():.1f}, {100 * path.stands.mean():.1f}",
            "%",
            Agreement.VALUE,
            None,
            f"of the same {n_runs} designs; {100 * np.mean(stepped.status == 'failed'):.1f} % of the "
            "stepped runs do not converge, none along stable paths",
        ),
        Row(
            "Appendix B",
            "selected runs that meet the convergence tolerance",
            "all",
            "all",
            "",
            Agreement.INPUT,
            None,
            "runs that do not converge have no outputs to be clustered, so that it could not be otherwise",
        ),
    ]


def least_right(n_train: int) -> float:
    """Return the share of outcomes that has to be predicted right after learning from a number of runs.

    A border between regimes in three inputs is known to the distance of the runs next to it, which goes
    with the cube root of their number.

    Examples
    --------
    >>> least_right(100_000), round(least_right(12_500), 3)
    (0.99, 0.98)
    """
    full = published_number("optimisation", "training_samples")
    return 1.0 - (1.0 - SMALLEST_SHARE_RIGHT) * float(max(1.0, full / n_train) ** (1.0 / 3.0))


def _surrogate_rows(surrogate: "Surrogate") -> list[Row]:
    measured = surrogate.validation
    least = least_right(surrogate.n_train)
    assert measured is not None  # noqa: S101 - asked for
    assert measured.outcome_right is not None  # noqa: S101 - the regimes are known
    rows = [
        Row(
            "Eq. 10",
            f"mean error over mean displacement of {output}, designs that stand",
            None,
            100.0 * error,
            "%",
            Agreement.METHOD,
            error <= LARGEST_SHARE_OF_ERROR,
            f"{surrogate.n_train} runs learned from, {measured.n_validation} that stand held out; tolerance "
            f"{100 * LARGEST_SHARE_OF_ERROR:g} %",
        )
        for output, error in zip(measured.output_names, measured.normalised_error, strict=True)
    ]
    rows.append(
        Row(
            "Eq. 10",
            "held-out designs whose outcome is predicted right",
            None,
            100.0 * measured.outcome_right,
            "%",
            Agreement.METHOD,
            measured.outcome_right >= least,
            f"taut, slack or collapsed; has to be {100 * least:.3g} % or more after {surrogate.n_train} "
            "runs. The publication's network knows of no outcome",
        )
    )
    rows.append(
        Row(
            "Sect. 4.1",
            "time to learn from the runs",
            published_number("surrogates", "nn", "train_seconds_100000"),
            surrogate.seconds,
            "s",
            Agreement.VALUE,
            None,
            f"{surrogate.n_train} runs, another kind of surrogate: a piece for each regime",
        )
    )
    return rows


def _text(
    stepped: BeamRuns, path: BeamRuns, groups: Sequence[Groups], surrogate: "Surrogate"
) -> tuple[str, ...]:
    listed = {
        how: ", ".join(
            f"{n} {name}" for name, n in zip(*np.unique(runs.status, return_counts=True), strict=True)
        )
        for how, runs in (("stepped", stepped), ("path", path))
    }
    first, whole = (each.counts(stepped.stands) for each in groups)
    return (
        (
            f"{stepped.n_runs} Sobol points of (A1, A23, A4) in [0, 30] %, without gravity, solved twice: in "
            f"increments of 1 % by plain Newton–Raphson, as the publication does it ({listed['stepped']}), "
            f"and along stable paths ({listed['path']}). A collapsed run has lost its prestress and has no "
            "unique position."
        ),
        (
            "The publication's rule, on the publication's kind of data: HDBSCAN with a smallest group of 40, "
            f"runs that did not converge as noise, the largest group kept. In {groups[0].name} it keeps "
            f"{first[0]} runs and leaves out {first[2]} that stand; {first[1]} of those kept do not stand. "
            f"In {groups[1].name} it keeps {whole[0]}, leaves out {whole[2]} and keeps {whole[1]} that do "
            "not stand. What no cluster of positions can see are runs without prestress among those with: "
            "the solver's certificate asks the equilibrium itself. The publication speaks of 'the first two "
            "groups' as its database and of the largest one as well; here it is the largest."
        ),
        (
            "The last table trains the same polynomial on what each rule keeps, and measures it on held-out "
            "designs that stand along stable paths. The surrogate that our optimisation uses learns from all "
            f"{surrogate.n_train} runs along stable paths, a piece for each regime, with the probability of "
            "each outcome; the next chapter goes the publication's way to the end."
        ),
    )


def _statuses(runs: BeamRuns) -> str:
    names, counts = np.unique(runs.status, return_counts=True)
    return ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))


def _agreement_table(groups: Groups, stepped: BeamRuns) -> Table:
    """Count the runs of each status in each group."""
    columns = list(range(min(groups.n_groups, MOST_GROUPS)))
    rows = []
    for status in np.unique(stepped.status):
        own = groups.labels[stepped.status == status]
        cells = [int((own == label).sum()) for label in columns]
        rows.append(
            (str(status), *cells, int(((own >= len(columns)) & (own >= 0)).sum()), int((own < 0).sum()))
        )
    header = ("Status", *(f"group {label}" for label in columns), "further", "none")
    return Table.of(
        f"Certificate and groups of {groups.name}, stepped runs", header, rows, "s" + "r" * (len(header) - 1)
    )


def _comparison_table(compared: Sequence[tuple[str, str, int, int, tuple[float, ...]]]) -> Table:
    rows = [
        (
            rule,
            kind,
            str(n_runs),
            str(fallen) if fallen >= 0 else "told apart",
            *(number(100 * e, 2) for e in errors),
        )
        for rule, kind, n_runs, fallen, errors in compared
    ]
    header = ("Runs kept", "Surrogate", "Runs", "of which do not stand", "Error of v [%]", "Error of w [%]")
    return Table.of(
        "Learning from what each rule keeps", header, rows, "llrrrr", "Mean error over mean displacement"
    )
