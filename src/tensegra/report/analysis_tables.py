"""Tables of what a study's analyses found."""

from collections.abc import Mapping, Sequence
from math import floor, log10
from typing import TYPE_CHECKING, Any

from tensegra.report.tables import Table, aligned, labelled, number

if TYPE_CHECKING:
    from tensegra.report.results import Results, StoredAnalysis

__all__ = [
    "analysis_tables",
    "calibration_tables",
    "exceedance_table",
    "grouped",
    "inverse_table",
    "optimum_table",
    "propagation_table",
    "result_tables",
    "robust_table",
    "screening_table",
    "sensitivity_table",
]

STATISTICS = {
    "mean": "Mean",
    "std": "Std",
    "min": "Min",
    "max": "Max",
    "q25": "25 %",
    "q50": "50 %",
    "q75": "75 %",
}

SMALL = 0.1

METHODS = {"monte_carlo": "Monte Carlo", "quasi_monte_carlo": "randomised quasi-Monte Carlo"}


def result_tables(results: "Results") -> list[Table]:
    """Return the table of each analysis; the methods of one optimisation share a table."""
    tables: list[Table] = []
    for group in grouped(results.analyses):
        tables += analysis_tables(group)
    return [table for table in tables if table.rows]


def analysis_tables(group: "Sequence[StoredAnalysis]") -> list[Table]:
    """Return the tables of one entry of the study."""
    first = group[0]
    if first.kind == "propagation":
        return [propagation_table(first), exceedance_table(first.name, [first.content])]
    if first.kind == "optimisation":
        return [optimum_table(group)]
    if first.kind == "calibration":
        return calibration_tables(first)
    tell = {
        "sensitivity": sensitivity_table,
        "morris": screening_table,
        "robust": robust_table,
        "inverse": inverse_table,
    }
    return [tell[first.kind](first)]


def grouped(analyses: "tuple[StoredAnalysis, ...]") -> "list[list[StoredAnalysis]]":
    """Return the results of each entry of the study."""
    groups: dict[int, list[StoredAnalysis]] = {}
    for analysis in analyses:
        groups.setdefault(analysis.entry, []).append(analysis)
    return list(groups.values())


def propagation_table(analysis: "StoredAnalysis") -> Table:
    """List the paper's statistics (its Table 2), a row per output and model."""
    content = analysis.content
    models = [content, *([content["other"]] if content["other"] else [])]
    rows = []
    for output, summary in content["outputs"].items():
        for model in models:
            statistics = model["outputs"][output]["statistics"]
            values = [_number(statistics[key]["value"]) for key in STATISTICS]
            # A small number has zeros before its digits; the table is as wide as a terminal.
            digits = 5 if max(map(abs, values)) >= SMALL else 4
            rows.append((labelled(output, summary["unit"]), model["model"], *aligned(values, digits)))
    note = f"{content['n_samples']} samples, {METHODS.get(content['method'], content['method'])}"
    for model in models:
        if model["n_failed"]:
            note += f"; {model['n_failed']} runs of {model['model']} failed"
        if model["n_outside"]:
            note += f"; {model['n_outside']} outside the box of {model['model']}"
    return Table.of(analysis.name, ("Output", "Model", *STATISTICS.values()), rows, "ss" + 7 * "r", note)


def sensitivity_table(analysis: "StoredAnalysis") -> Table:
    """List first-order and total indices with the half-widths of their intervals."""
    content = analysis.content
    rows = []
    for output, found in content["indices"].items():
        for i, variable in enumerate(content["input_names"]):
            cells = [
                " ± ".join(_three_decimals(found[key][i]) for key in (order, f"{order}_half"))
                for order in ("first", "total")
            ]
            rows.append((output if i == 0 else "", variable, *cells))
    note = f"{content['n_base']} base points, {content['n_runs']} runs of {content['model']}"
    if content["method"] == "chaos":
        note = f"In closed form, from the coefficients of {content['model']}"
    if content["share_dropped"]:
        note += f"; {100 * content['share_dropped']:.2g} % of the blocks dropped for failed runs"
    note += f"; ± is the half-width of the {100 * content['confidence']:.0f} % interval"
    return Table.of(analysis.name, ("Output", "Variable", "First order", "Total"), rows, "ssrr", note)


def optimum_table(analyses: "Sequence[StoredAnalysis]") -> Table:
    """List the optima of the methods, and what the true model says of each."""
    contents = [analysis.content for analysis in analyses]
    first = contents[0]
    units = first["units"]
    rows: list[tuple[object, ...]] = [
        (
            labelled(name, units.get(name, "")),
            *_on_bounds([content["inputs"][name] for content in contents], bounds),
        )
        for name, bounds in zip(first["input_names"], first["bounds"], strict=True)
        if name in first["search"]
    ]
    labels: list[tuple[str, list[float | None]]] = []
    labels.append(("objective", [content["objective"] for content in contents]))
    labels.append(("objective, true model", [content["true_objective"] for content in contents]))
    for name in first["outputs"]:
        text = labelled(name, units.get(name, ""))
        labels.append((text, [content["outputs"][name] for content in contents]))
        true = [(content["true_outputs"] or {}).get(name) for content in contents]
        labels.append((f"{text}, true model", true))
    rows += [(label, *map(number, values)) for label, values in labels]
    rows.append(("status, true model", *(content["true_status"] or "" for content in contents)))
    if first["constraints"]:
        kept = {True: "hold", False: "do not hold", None: "–"}
        rows.append(("constraints, true model", *(kept[content["true_feasible"]] for content in contents)))
    rows.append(("evaluations", *(content["n_evaluations"] for content in contents)))
    rows.append(("time [s]", *(f"{content['seconds']:.1f}" for content in contents)))
    constraints = f" subject to {', '.join(first['constraints'])}" if first["constraints"] else ""
    note = (
        f"{'Greatest' if first['maximise'] else 'Least'} {first['formula']}{constraints} on {first['model']}"
        f"; searched: {', '.join(first['search'])}"
    )
    if first["held"]:
        note += "; held: " + ", ".join(f"{name} = {number(value)}" for name, value in first["held"].items())
    methods = [content["method"] for content in contents]
    return Table.of(analyses[0].name, ("", *methods), rows, "s" + len(methods) * "r", note)


def exceedance_table(title: str, contents: Sequence[Mapping[str, Any]]) -> Table:
    """List the quantiles and the probabilities of exceeding limits that were asked for, with intervals."""
    rows = []
    models = [model for content in contents for model in (content, content["other"]) if model]
    for content in models:
        for output, summary in content["outputs"].items():
            name = labelled(output, summary["unit"])
            asked = [
                (f"{100 * float(p):g} % quantile", found)
                for p, found in content["quantiles"].get(output, {}).items()
            ]
            asked += [
                (f"P(> {float(limit):g})", found)
                for limit, found in content["exceedances"].get(output, {}).items()
            ]
            rows += [
                (name, content["model"], what, *(number(found[key], 4) for key in ("value", "low", "high")))
                for what, found in asked
            ]
    note = ""
    if rows:
        note = f"The intervals hold with {100 * contents[0]['confidence']:.0f} %"
        note += "; those of probabilities hold whatever failed runs may have done"
    header = ("Output", "Model", "Quantity", "Value", "From", "To")
    return Table.of(f"{title}: quantiles and limits", header, rows, "sssrrr", note)


def screening_table(analysis: "StoredAnalysis") -> Table:
    """List the elementary effects, the strongest input of each output first."""
    content = analysis.content
    rows: list[tuple[object, ...]] = []
    for output, found in content["effects"].items():
        order = sorted(range(len(content["input_names"])), key=lambda i: -(found["mu_star"][i] or 0.0))
        for place, i in enumerate(order):
            cells = [number(found[key][i], 4) for key in ("mu_star", "mu_star_half", "mu", "sigma")]
            name = labelled(output, found["unit"]) if place == 0 else ""
            rows.append((name, content["input_names"][i], f"{cells[0]} ± {cells[1]}", *cells[2:]))
    note = f"{content['n_asked']} trajectories, {content['n_runs']} runs of {content['model']}; "
    note += "effects over the whole range of an input; "
    note += f"± is the half-width of the {100 * content['confidence']:.0f} % interval"
    if content["share_dropped"]:
        note += f"; {100 * content['share_dropped']:.2g} % of the trajectories dropped for failed runs"
    header = ("Output", "Variable", "μ*", "μ", "σ")
    return Table.of(analysis.name, header, rows, "ssrrr", note)


def robust_table(analysis: "StoredAnalysis") -> Table:
    """Set the robust design beside the nominal one: where they are, and what comes of them."""
    content = analysis.content
    units = content["robust"]["units"]
    designs = ("robust", "nominal")
    rows: list[tuple[object, ...]] = [
        (
            labelled(name, units.get(name, "")),
            *_on_bounds([content[design]["inputs"][name] for design in designs], bounds),
        )
        for name, bounds in zip(content["robust"]["input_names"], content["robust"]["bounds"], strict=True)
    ]
    spreads = [content["spreads"][design] for design in designs]
    models = [spreads, *([[spread["other"] for spread in spreads]] if spreads[0]["other"] else [])]
    for given in models:
        name = given[0]["model"]
        for key in ("mean", "std", "min"):
            values = [spread["outputs"][content["formula"]]["statistics"][key]["value"] for spread in given]
            unit = units.get(content["formula"], "")
            rows.append(
                (
                    f"{STATISTICS[key].lower()} of {labelled(content['formula'], unit)}, {name}",
                    *map(number, values),
                )
            )
        if given[0]["n_failed"] or given[1]["n_failed"]:
            rows.append((f"failed samples, {name}", *(spread["n_failed"] for spread in given)))
        for constraint in content["constraints"]:
            kept = [spread["exceedances"][f"margin of {constraint}"]["0.0"] for spread in given]
            rows.append(
                (
                    f"P({constraint}), {name}",
                    *(
                        f"{100 * each['value']:.1f} % [{100 * each['low']:.1f}, {100 * each['high']:.1f}]"
                        for each in kept
                    ),
                )
            )
    rows.append(("evaluations of the statistic", *(content[design]["n_evaluations"] for design in designs)))
    rows.append(("time [s]", *(f"{content[design]['seconds']:.1f}" for design in designs)))
    sense = "Greatest" if content["maximise"] else "Least"
    constraints = f" subject to {', '.join(content['constraints'])}" if content["constraints"] else ""
    note = (
        f"{sense} {content['measure']}{constraints}, over {content['n_draws']} draws, by {content['method']}"
    )
    note += f"; the statistics are of {spreads[0]['n_samples']} samples"
    rest = [f"{name} {law}" for name, law in content["laws"].items() if name not in content["search"]]
    if rest:
        note += f"; not designed: {', '.join(rest)}"
    return Table.of(analysis.name, ("", *designs), rows, "srr", note)


def inverse_table(analysis: "StoredAnalysis") -> Table:
    """List the waypoints: inputs, targets, what is reached, and the interval to expect."""
    content = analysis.content
    units = content["units"]
    header = ["", *(labelled(name, units.get(name, "")) for name in content["input_names"])]
    header += [
        "Output",
        "Target",
        "Reached",
        "Interval",
        *(["True model"] if content["true_outputs"] else []),
    ]
    rows = []
    for i, x in enumerate(content["x"]):
        for k, name in enumerate(content["target_names"]):
            place = [i + 1, *(number(value, 4) for value in x)] if k == 0 else [""] * (len(x) + 1)
            reached, target = _on_scale(content["outputs"][i][k], content["targets"][i][k])
            low, high = (number(content[end][i][k], 4) for end in ("low", "high"))
            row = [*place, labelled(name, units.get(name, "")), target, reached, f"{low} … {high}"]
            row += [number(content["true_outputs"][i][k], 5)] if content["true_outputs"] else []
            rows.append(row)
    note = f"{content['reason']}; the intervals hold {100 * content['confidence']:.0f} % of the outcomes"
    if content["n_samples"]:
        note += f" of {content['n_samples']} samples of what scatters"
    if content["held"]:
        held = [f"{name} about {number(value)}" for name, value in content["held"].items()]
        note += f"; not searched: {', '.join(held)}"
    lost = sum(content["n_failed"])
    if lost:
        note += f"; {lost} samples failed"
    n_inputs = len(content["input_names"])
    align = "r" * (n_inputs + 1) + "s" + "r" * (len(header) - n_inputs - 2)
    return Table.of(analysis.name, header, rows, align, note)


def calibration_tables(analysis: "StoredAnalysis") -> list[Table]:
    """List the posterior of each parameter, the measurements beside what is predicted, and what follows."""
    content = analysis.content
    units, share = content["units"], f"{100 * content['confidence']:.0f} %"
    rows = [
        (
            labelled(p["name"], units.get(p["name"], "")),
            f"{number(p['prior_mean'], 5)} ± {number(p['prior_std'], 2)}",
            f"{number(p['mean'], 5)} ± {number(p['std'], 2)}",
            f"{number(p['low'], 5)} … {number(p['high'], 5)}",
            f"{p['rhat']:.3f}",
            f"{min(p['bulk_ess'], p['tail_ess']):.0f}",
        )
        for p in content["parameters"]
    ]
    header = ("Parameter", "Prior", "Posterior", f"{share} interval", "R̂", "Effective\nsample size")
    note = f"{content['n_chains']} chains of {content['n_draws']} draws on {content['model']}"
    note += "; ± is one standard deviation"
    tables = [Table.of(analysis.name, header, rows, "srrrrr", note), _fit_table(content)]
    if content["after"]:
        tables.append(_after_table(analysis.name, content))
        labelled_after = [
            {**after, "model": f"{after['model']}, {label}"}
            for label, after in zip(("prior", "posterior"), content["after"], strict=True)
        ]
        tables.append(exceedance_table(f"{analysis.name}: prediction", labelled_after))
    return tables


def _fit_table(content: Mapping[str, Any]) -> Table:
    """Set each measurement beside its prediction."""
    found, units = content["prediction"], content["units"]
    header = [
        *(labelled(name, units.get(name, "")) for name in found["known"]),
        "Output",
        "Measured",
        "Predicted",
    ]
    header += [f"{100 * content['confidence']:.0f} % interval"] + (["True model"] if found["true"] else [])
    rows = []
    for k, output in enumerate(found["outputs"]):
        for i, row in enumerate(found["measured"]):
            if row[k] is None:
                continue
            cells: list[object] = [number(column[i], 4) for column in found["known"].values()]
            cells += [labelled(output, units.get(output, ""))]
            cells += [
                f"{number(row[k], 5)} ± {number(found['stds'][i][k], 2)}",
                number(found["mean"][i][k], 5),
            ]
            cells.append(f"{number(found['low'][i][k], 5)} … {number(found['high'][i][k], 5)}")
            cells += [number(found["true"][i][k], 5)] if found["true"] else []
            rows.append(cells)
    align = "r" * len(found["known"]) + "s" + "r" * (len(header) - len(found["known"]) - 1)
    note = f"New data would be at least as far off with a probability of {found['p_value']:.2f}"
    note += "; the intervals are of a new measurement"
    if found["true"]:
        note += "; the true model is at the posterior's mode"
    return Table.of("Measurements and predictions", header, rows, align, note)


def _after_table(title: str, content: Mapping[str, Any]) -> Table:
    """List the outputs predicted from the prior and from the posterior."""
    prior, posterior = content["after"]
    rows = []
    for output, summary in posterior["outputs"].items():
        for label, given in (("prior", prior), ("posterior", posterior)):
            statistics = given["outputs"][output]["statistics"]
            values = [_number(statistics[key]["value"]) for key in STATISTICS]
            rows.append((labelled(output, summary["unit"]), label, *aligned(values, 5)))
    laws = "; ".join(
        f"{name} {law}" for name, law in posterior["laws"].items() if name not in content["parameter_names"]
    )
    note = f"{posterior['n_samples']} samples of {posterior['model']}" + (f"; {laws}" if laws else "")
    return Table.of(
        f"{title}: prediction", ("Output", "From", *STATISTICS.values()), rows, "ss" + 7 * "r", note
    )


def _three_decimals(value: float | None) -> str:
    return number(value) if value is None else f"{round(value, 3) + 0.0:.3f}"


def _on_scale(value: float | None, target: float | None) -> tuple[str, str]:
    """Return what is reached and its target with the same decimals; what is rounding is zero."""
    if value is None or target is None:
        return number(value, 5), number(target, 5)
    return number(round(value, 4) + 0.0, 6), number(target, 6)


def _on_bounds(values: list[float], bounds: Sequence[float]) -> list[str]:
    """Return inputs to six digits of their box: what is rounding beside the box is zero."""
    decimals = 6 - floor(log10(max(bounds[1] - bounds[0], 1e-300)))
    return [number(round(value, decimals) + 0.0) for value in values]


def _number(value: float | None) -> float:
    return float("nan") if value is None else value
