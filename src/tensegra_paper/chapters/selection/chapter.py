"""Fig. 20: which runs are learned from, by clusters of their outputs and by the solver's certificate."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import Table, number
from tensegra.report.figures import output_figure
from tensegra.study import Selection, TrainingData, select
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.selection.figures import kept_figure
from tensegra_paper.models import (
    LIFT_INPUTS,
    NETWORK,
    cable_model,
    lift_data,
    lift_runs,
    lift_surrogate,
    trained,
)
from tensegra_paper.published import published, published_number
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    import pandas as pd

    from tensegra.surrogate import Surrogate

__all__ = ["selection"]

Array: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

OUTPUTS = ("u", "v", "w")
"""What the publication's q of Eq. 10 holds."""

CLUSTERED = (OUTPUTS, ("v", "w"), ("w",))
"""Outputs that are clustered; which of them the publication took is not printed."""

LARGEST_SHARE_OF_ERROR, SMALLEST_SHARE_RIGHT = 5e-4, 0.99
"""Mean error over mean displacement on all designs that stand, and share of outcomes predicted right."""

N_POLYNOMIAL, N_NETWORK = 10_000, 2000
"""Most runs that a polynomial and the network learn from, to tell the rules of selection apart."""

MAX_DEGREE, FEWEST_KEPT = 10, 500
"""Of the polynomial, and the runs that its 286 terms need; a rule that keeps fewer has nothing to show."""


@dataclass(frozen=True)
class Clusters:
    """What HDBSCAN made of some outputs.

    Attributes
    ----------
    outputs
        What was clustered.
    found
        Groups and agreement with the certificate.
    seconds
        Time that it took.
    """

    outputs: tuple[str, ...]
    found: Selection
    seconds: float

    @property
    def n_groups(self) -> int:
        """Number of groups."""
        return int(self.found.labels.max()) + 1

    def counts(self, stands: Mask) -> tuple[int, int, int]:
        """Return the numbers of runs kept, of these that do not stand, and of others that stand."""
        kept = self.found.keep
        return int(kept.sum()), int((kept & ~stands).sum()), int((~kept & stands).sum())


def selection(setting: Setting) -> Chapter:
    """Cluster the runs of three actuations, compare with the certificate, and learn from those kept."""
    runs = lift_runs(setting)
    setting.tell(f"Fig. 20: {runs.n_runs} runs in {runs.seconds:.0f} s")
    frame = _frame(runs)
    clusters = tuple(_clusters(frame, outputs) for outputs in CLUSTERED)
    surrogate = lift_surrogate(setting)
    compared = _compared(setting, runs, clusters)
    rules = {"certified": runs.stands}
    rules |= {f"group of ({', '.join(each.outputs)})": each.found.keep for each in clusters[:2]}
    study = cable_model(setting, LIFT_INPUTS, OUTPUTS).study
    first = clusters[0]
    kept, _, _ = first.counts(runs.stands)
    return Chapter(
        name="selection",
        title="Selection of the runs to learn from (Fig. 20)",
        figures=(
            Figure(
                "fig-20-clusters",
                f"All of {runs.n_runs} runs, and the selected ones. By the solver's certificate, and by "
                "the largest group that HDBSCAN finds (smallest group 40 runs), the publication's rule",
                lambda: kept_figure(runs.v, runs.w, runs.stands, rules),
            ),
            Figure(
                "fig-20-certificate",
                "The same runs by what the solver says of them. Outputs over the three actuations",
                lambda: output_figure(study, frame),
            ),
        ),
        rows=(*_rows(runs, clusters), *_surrogate_rows(surrogate)),
        text=_text(runs, clusters, surrogate),
        findings=(
            (
                "Clusters of the outputs do not find the runs that stand: the largest group of (u, v, w) "
                f"keeps {100 * kept / runs.n_runs:.0f} % of the runs (printed: 98.4 %), while the solver "
                f"certifies {100 * runs.stands.mean():.1f} %."
            ),
        ),
        tables=(*(_agreement_table(each) for each in clusters), _comparison_table(compared)),
        seconds={
            "runs": runs.seconds,
            "training": surrogate.seconds,
            **{f"HDBSCAN of ({', '.join(each.outputs)})": each.seconds for each in clusters},
        },
        seeds={name: setting.seed_of(name) for name in ("lift", "lift-held-out", "surrogate lift")},
    )


def _frame(runs: BeamRuns) -> "pd.DataFrame":
    """Return inputs, outputs and statuses as the selection and its figures take them."""
    import pandas as pd

    outputs = runs.tip.mean(axis=1)
    columns = dict(runs.inputs) | dict(zip(OUTPUTS, outputs.T, strict=True))
    return pd.DataFrame({**columns, "status": runs.status})


def _clusters(frame: "pd.DataFrame", outputs: Sequence[str]) -> Clusters:
    began = perf_counter()
    size = int(published("selection", "min_cluster_size"))
    found = select(frame, list(outputs), method="hdbscan", min_cluster_size=size)
    return Clusters(tuple(outputs), found, perf_counter() - began)


def _compared(
    setting: Setting, runs: BeamRuns, clusters: Sequence[Clusters]
) -> list[tuple[str, str, int, int, tuple[float, ...]]]:
    """Learn from the runs that each rule keeps, and return (rule, kind, runs, not standing, errors) for each.

    The errors are mean |error| over mean |displacement|, of v and of w, on held-out designs that stand.
    """
    held_out = lift_data(setting, lift_runs(setting, held_out=True)).runs
    rules: dict[str, Mask] = {"certified by the solver": runs.stands}
    rules |= {f"largest group of ({', '.join(each.outputs)})": each.found.keep for each in clusters[:2]}
    results = []
    for i, (rule, kept) in enumerate(rules.items()):
        if kept.sum() < FEWEST_KEPT:
            continue
        kinds: dict[str, tuple[str, int, dict[str, Any]]] = {
            f"polynomial, degree {MAX_DEGREE}": ("pce", N_POLYNOMIAL, {"degree": MAX_DEGREE})
        }
        if i == 0:
            kinds["the publication's network"] = ("nn", N_NETWORK, dict(NETWORK))
        for label, (kind, most, options) in kinds.items():
            n_most = setting.count(most, least=500 if kind == "nn" else 1000)
            chosen = np.flatnonzero(kept)[:n_most]
            data = TrainingData(
                X=runs.X[chosen],
                Y=np.column_stack([runs.v, runs.w])[chosen],
                bounds=held_out.box,
                input_names=held_out.input_names,
                output_names=held_out.output_names,
            )
            surrogate = trained(setting, f"kept-{i}-{kind}", data, kind, held_out, **options)
            assert surrogate.validation is not None  # noqa: S101 - asked for
            fallen = int((~runs.stands[chosen]).sum())
            results.append((rule, label, len(chosen), fallen, surrogate.validation.normalised_error))
    whole = lift_surrogate(setting).validation
    assert whole is not None  # noqa: S101 - asked for
    results.append(("all, by regime", "a piece for each regime", runs.n_runs, -1, whole.normalised_error))
    return results


def _rows(runs: BeamRuns, clusters: Sequence[Clusters]) -> list[Row]:
    printed = published("selection")
    share = 100 * printed["kept"] / printed["samples"]
    rows = [
        Row(
            "Fig. 20",
            "runs that the solver certifies",
            share,
            100.0 * float(runs.stands.mean()),
            "%",
            Agreement.VALUE,
            None,
            "stable equilibria. The printed share is the one of Fig. 6a, which has gravity and [1, 10] %; "
            "without gravity the publication itself prints about half in [1, 30] % (Fig. 6b)",
        )
    ]
    for each in clusters:
        name = ", ".join(each.outputs)
        kept, fallen, lost = each.counts(runs.stands)
        rows += [
            Row(
                "Fig. 20",
                f"runs in the largest group of ({name})",
                share,
                100.0 * kept / runs.n_runs,
                "%",
                Agreement.VALUE,
                None,
                f"{kept} runs, of which {fallen} do not stand; {lost} that stand are left out. Which "
                "outputs were clustered is not printed, nor how they were scaled; here they are "
                "standardised",
            ),
            Row(
                "Fig. 20",
                f"groups of ({name})",
                float(printed["groups"]),
                float(each.n_groups),
                "",
                Agreement.VALUE,
                None,
                f"{int((each.found.labels < 0).sum())} runs belong to none; the number depends on what is "
                "clustered",
            ),
        ]
    return rows


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


def _text(runs: BeamRuns, clusters: Sequence[Clusters], surrogate: "Surrogate") -> tuple[str, ...]:
    names, counts = np.unique(runs.status, return_counts=True)
    listed = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True))
    first, second = clusters[0].counts(runs.stands), clusters[1].counts(runs.stands)
    return (
        (
            f"{runs.n_runs} Sobol points of (A1, A23, A4) in [0, 30] %, without gravity: {listed}. A run is "
            "collapsed where the prestress is lost on the way; it then has no unique position."
        ),
        (
            "HDBSCAN with a smallest group of 40, as in the publication, on standardised outputs. In (u, "
            f"v, w) it finds {clusters[0].n_groups} groups, of which the largest keeps {first[0]} runs, "
            f"{first[1]} of them collapsed. In (v, w) the largest keeps {second[0]}, but {second[1]} of "
            f"these are collapsed and {second[2]} that stand are left out: collapsed structures come to rest "
            "among standing ones. The solver's certificate asks the equilibrium itself."
        ),
        (
            "The last table trains the same polynomial on what each rule keeps, and measures it on held-out "
            "designs that stand: what is learned from matters more than how. The surrogate that the "
            f"optimisation uses learns from all {surrogate.n_train} runs, a piece for each regime, with the "
            "probability of each outcome."
        ),
    )


def _agreement_table(clusters: Clusters) -> Table:
    table = clusters.found.table
    rows = [
        (str(status), *(str(int(count)) for count in row))
        for status, row in zip(table.index, table.to_numpy(), strict=True)
    ]
    title = f"Certificate and groups of ({', '.join(clusters.outputs)}), runs"
    return Table.of(title, ("Status", *map(str, table.columns)), rows, "s" + "r" * len(table.columns))


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
