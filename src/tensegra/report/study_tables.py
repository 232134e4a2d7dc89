"""Tables of a study: what it varies and asks, how its runs came out, what its analyses found."""

import re
from collections import Counter
from math import isfinite
from typing import TYPE_CHECKING, Any

from tensegra.report.tables import Table, labelled, number
from tensegra.study import AnalysisEntry, Campaign, CampaignState, Selection, Study

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tensegra.report.results import Results, StoredAnalysis

__all__ = [
    "agreement_table",
    "analysis_table",
    "outcome_table",
    "output_table",
    "provenance_table",
    "reason_table",
    "reasons_by_kind",
    "state_to_dict",
    "surrogate_table",
    "title_of",
    "validation_table",
    "variable_table",
]

MOST_REASONS = 12
"""Kinds of reasons that a table lists."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


def variable_table(study: Study) -> Table:
    """List the variables, what each acts on, and its law."""
    rows = [
        (
            labelled(variable.name, variable.unit),
            f"{_words(variable.quantity)} {variable.target}",
            law_in_words(variable.distribution),
            f"{number(variable.distribution.box[0])} … {number(variable.distribution.box[1])}",
        )
        for variable in study.variables
    ]
    return Table.of("Variables", ("Name", "Acts on", "Law", "Box"), rows, "slls")


def output_table(study: Study) -> Table:
    """List the outputs."""
    rows = []
    for output in study.outputs:
        where = f" of {', '.join(output.nodes)}" if output.nodes else ""
        rows.append(
            (labelled(output.name, output.unit), f"{_words(output.quantity)} {output.target}{where}".strip())
        )
    return Table.of("Outputs", ("Name", "Quantity"), rows, "sl")


def surrogate_table(study: Study) -> Table:
    """List the surrogates that the study wants."""
    rows = [
        (
            name,
            entry.kind,
            ", ".join(entry.outputs or study.output_names),
            ", ".join(f"{key} {value}" for key, value in entry.options.items()) or "as by default",
        )
        for name, entry in study.surrogates.items()
    ]
    return Table.of("Surrogates", ("Name", "Kind", "Outputs", "Options"), rows, "ssll")


def analysis_table(study: Study) -> Table:
    """List the questions that the study asks."""
    rows = []
    for i, entry in enumerate(study.analyses):
        analysis = entry.value
        model = analysis.model
        if getattr(analysis, "compare_with", None):
            model += f", {analysis.compare_with}"
        rows.append((title_of(entry, i), entry.kind, model, _what(entry.kind, analysis)))
    return Table.of("Analyses", ("Name", "Kind", "Model", "What"), rows, "lsll")


def _what(kind: str, analysis: Any) -> str:  # noqa: ANN401 - an entry of any kind
    """Return what an analysis asks, in a few words."""
    if kind in {"optimisation", "robust"}:
        methods = analysis.methods if kind == "optimisation" else (analysis.method,)
        return f"{'greatest' if analysis.maximise else 'least'} {analysis.objective} by {', '.join(methods)}"
    if kind == "morris":
        return f"{analysis.trajectories} trajectories"
    if kind == "inverse":
        return f"inputs for {', '.join(analysis.targets)}"
    if kind == "calibration":
        n_states = len(next(iter(analysis.measurements.values())))
        return f"{n_states} measured states"
    if kind == "sensitivity" and analysis.method == "chaos":
        return "in closed form, from the expansion"
    return f"{analysis.samples} samples"


def title_of(entry: AnalysisEntry, number: int) -> str:
    """Return the name of an analysis, or its kind with its place among the analyses."""
    return entry.value.name or f"{entry.kind.capitalize()} {number + 1}"


def outcome_table(state: CampaignState) -> Table:
    """Count the runs by status."""
    total = max(state.n_done, 1)
    rows = [(status, count, f"{100 * count / total:.2f} %") for status, count in state.statuses.items()]
    if state.n_pending:
        rows.append(("pending", state.n_pending, ""))
    note = f"{1e3 * state.seconds_per_run:.3g} ms per run" if isfinite(state.seconds_per_run) else ""
    return Table.of(
        f"Outcome of {state.n_done} of {state.n_points} runs", ("Status", "Runs", "Share"), rows, "srr", note
    )


def reason_table(state: CampaignState) -> Table:
    """Count the reasons of the runs that are not stable, or strained beyond their law."""
    kinds = reasons_by_kind(state)
    note = f"and {len(kinds) - MOST_REASONS} rarer ones" if len(kinds) > MOST_REASONS else ""
    rows = [(count, reason) for reason, count in list(kinds.items())[:MOST_REASONS]]
    return Table.of("Reasons", ("Runs", "Reason"), rows, "rl", note)


def reasons_by_kind(state: CampaignState) -> dict[str, int]:
    """Count the reasons by what they have in common: their first clause, without its numbers.

    Examples
    --------
    >>> state = CampaignState(2, 2, {}, {"collapse at 30 %; node 2": 1, "collapse at 7.5 %": 1}, 0.0)
    >>> reasons_by_kind(state)
    {'collapse at … %': 2}
    """
    kinds: Counter[str] = Counter()
    for reason, count in state.reasons.items():
        kinds[_NUMBER.sub("…", reason.partition(";")[0])] += count
    return dict(kinds.most_common())


def state_to_dict(campaign: Campaign, state: CampaignState) -> dict[str, Any]:
    """Return a campaign's state as plain JSON values."""
    return {
        "study": campaign.study.name,
        "folder": str(campaign.folder),
        "n_points": state.n_points,
        "n_done": state.n_done,
        "n_failed": state.n_failed,
        "n_pending": state.n_pending,
        "statuses": state.statuses,
        "reasons": reasons_by_kind(state),
        "seconds_per_run": _finite(state.seconds_per_run),
        "driver": state.driver,
        "host": state.host,
        "rate": _finite(state.rate),
        "seconds_left": _finite(state.seconds_left),
    }


def validation_table(results: "Results") -> Table:
    """List the errors of the surrogates on runs that they have not seen."""
    rows: list[tuple[object, ...]] = []
    for name, stored in results.surrogates.items():
        surrogate = stored.surrogate
        if surrogate.validation is None:
            continue
        for row, unit in zip(surrogate.validation.rows(), surrogate.output_units, strict=True):
            coverage = row["coverage_90"]
            rows.append(
                (
                    f"{name} ({surrogate.kind})",
                    labelled(row["output"], unit),
                    f"{number(100 * row['relative_error'], 2)} %",
                    _near_one(row["r2"]),
                    _near_one(row["r2_paper"]),
                    *(number(row[name], 2) for name in ("mean_abs_error", "rms_error", "max_abs_error")),
                    "" if coverage is None else f"{100 * coverage:.0f} %",
                    surrogate.n_train,
                    f"{surrogate.seconds:.1f}",
                )
            )
    header = (
        "Surrogate",
        "Output",
        "Error\n(Eq. 7)",
        "1 − R²",
        "1 − R²\n(Eq. 8)",
        "Mean\nerror",
        "Rms\nerror",
        "Largest\nerror",
        "In 90 %\ninterval",
    )
    note = ""
    if rows:
        measured = {
            name: stored.surrogate.validation
            for name, stored in results.surrogates.items()
            if stored.surrogate.validation
        }
        held = {validation.method for validation in measured.values()}
        note = f"Measured on runs that the surrogates have not seen ({', '.join(sorted(held))}); "
        note += "Eq. 7 is the mean relative error, Eq. 8 the paper's R²; mean, root mean square and largest "
        note += "error are in the output's unit"
        note += "".join(
            f"; {name} predicts the outcome of {100 * validation.outcome_right:.2f} % of the runs right"
            for name, validation in measured.items()
            if validation.outcome_right is not None
        )
    return Table.of("Errors of the surrogates", (*header, "Runs", "Time\n[s]"), rows, "ssrrrrrrrrr", note)


def agreement_table(selection: Selection) -> Table:
    """Set the solver's status beside the groups that the outputs form."""
    table = selection.table
    rows = [
        (str(status), *map(int, counts)) for status, counts in zip(table.index, table.to_numpy(), strict=True)
    ]
    header = (
        "Status",
        *(f"in {column}" if column != "no group" else "in no group" for column in table.columns),
    )
    return Table.of("Status and group", header, rows, "s" + "r" * len(table.columns))


def provenance_table(results: "Results") -> Table:
    """List fingerprints, seed, versions and times."""
    study, index = results.campaign.study, results.index
    rows: list[tuple[str, object]] = [
        ("Structure", study.structure.fingerprint),
        ("Study", study.fingerprint),
        ("Seed", study.seed),
        ("Finished", index.finished or "not yet"),
    ]
    if index.versions:
        rows.append(("Versions", ", ".join(f"{name} {version}" for name, version in index.versions.items())))
    times = [f"runs {index.seconds['campaign']:.1f}"] if "campaign" in index.seconds else []
    times += [f"{stored.name}{by(stored)} {stored.seconds:.1f}" for stored in results.analyses]
    if "total" in index.seconds:
        times.append(f"in all, the last time, {index.seconds['total']:.1f}")
    rows.append(("Times [s]", "; ".join(times)))
    rows += [("Could not be had", failure) for failure in index.failures]
    return Table.of("Fingerprints, seed, versions, times", ("", ""), rows, "sl")


def by(analysis: "StoredAnalysis") -> str:
    """Return the method of a search as a suffix of its name."""
    return f" by {analysis.content['method']}" if analysis.kind == "optimisation" else ""


def law_in_words(law: Any) -> str:  # noqa: ANN401 - a Distribution
    """Return a distribution as one writes it by hand.

    Examples
    --------
    >>> from tensegra.study import as_distribution
    >>> law_in_words(as_distribution({"uniform": [0.09, 0.10]}))
    'uniform(low 0.09, high 0.1)'
    """
    parameters: Mapping[str, Any] = law.parameters.model_dump(exclude_defaults=True)
    shown = [
        f"{name} {number(value) if isinstance(value, float) else value}"
        if not isinstance(value, tuple)
        else f"{len(value)} {name}"
        for name, value in parameters.items()
    ]
    return f"{law.kind}({', '.join(shown)})"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _near_one(value: float) -> str:
    """Return the distance of R² from one, which tells more than a row of nines."""
    return number(1.0 - value, 2)


def _finite(value: float) -> float | None:
    return float(value) if isfinite(value) else None
