"""The sections of a report, each from the results that it is about; none where there are none."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegra.mechanics import solve_batch, solve_path
from tensegra.report import figures
from tensegra.report.analysis_tables import analysis_tables, grouped
from tensegra.report.figures.panels import choose_panels, constant_note, varying
from tensegra.report.report import Figure, Section
from tensegra.report.results import Results, StoredAnalysis
from tensegra.report.study_tables import (
    agreement_table,
    analysis_table,
    outcome_table,
    output_table,
    provenance_table,
    reason_table,
    surrogate_table,
    validation_table,
    variable_table,
)
from tensegra.report.tables import number, structure_table
from tensegra.study.evaluate import batch_inputs
from tensegra.viewer import scene

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Drawing

__all__ = ["Writer"]


class Writer:
    """Writes the sections of one report, and numbers its figures.

    Parameters
    ----------
    results
        What there is.
    frame
        The campaign's runs.
    pdf
        Whether to keep each figure as PDF, too.
    """

    def __init__(self, results: Results, frame: "pd.DataFrame", *, pdf: bool = False) -> None:
        self.pdf = pdf
        self.results, self.frame = results, frame
        self.campaign, self.study = results.campaign, results.campaign.study
        self.panels = choose_panels(self.study, frame)
        self.drawn = self.panels.of(self.study)
        self.n_figures = 0

    @property
    def parts(self) -> "Sequence[Callable[[], Iterator[Section]]]":
        """The parts of the report in order; each yields its sections."""
        return (
            self._structure,
            self._design,
            self._outcome,
            self._selection,
            self._surrogates,
            self._analyses,
            self._provenance,
        )

    def _add(
        self,
        section: Section,
        title: str,
        text: str,
        drawing: "Drawing",
        scene: dict[str, Any] | None = None,
    ) -> None:
        self.n_figures += 1
        share = round(100 * min(1.0, drawing.get_figwidth() / figures.WIDTH))
        pdf = figures.pdf(drawing) if self.pdf else None
        section.figures.append(Figure(self.n_figures, title, text, figures.svg(drawing), share, pdf, scene))

    def _structure(self) -> Iterator[Section]:
        """Show the structure as it stands, and at the extremes of the last output."""
        structure, study = self.study.structure, self.study
        section = Section("Structure", "structure", tables=[structure_table(structure)])
        if structure.description:
            section.paragraphs.append(structure.description)
        output = self.drawn.outputs[-1]
        values = self.frame[output.name].to_numpy()
        if np.isfinite(values).any():
            rows = [int(np.nanargmin(values)), int(np.nanargmax(values))]
            X = self.frame[list(study.input_names)].to_numpy()[rows]
            inputs: dict[str, Any] = batch_inputs(structure, study.variables, X)
            runs = solve_batch(structure, **inputs)
            reference = runs.nodes[0] - runs.displacements[0]
            path = solve_path(structure)
            named = [node for item in study.outputs for node in item.nodes]
            when = f"after its stage '{structure.stages[-1].name}'" if structure.stages else "as it stands"
            self._add(
                section,
                f"The structure {when}",
                "Nodes are named as far as their names find room.",
                figures.structure_figure(structure, reference, named),
                scene(path),
            )
            shapes = {
                f"{word} {output.name}: {number(values[row], 4)} {output.unit}".rstrip(): nodes
                for word, row, nodes in zip(("least", "greatest"), rows, runs.nodes, strict=True)
            }
            self._add(
                section,
                f"The runs with the least and the greatest {output.name}",
                "In grey the reference, from which displacements are measured.",
                figures.shape_figure(structure, reference, shapes),
                scene(runs, labels=list(shapes)),
            )
        yield section

    def _design(self) -> Iterator[Section]:
        """Tell what was varied."""
        study = self.study
        section = Section("Design", "design", tables=[variable_table(study), output_table(study)])
        sampler = str(study.design.written()["sampler"]).replace("_", " ")
        section.paragraphs.append(f"{study.n_points} design points, sampler {sampler}, seed {study.seed}.")
        section.paragraphs += [f"Note: {advice}." for advice in study.advice]
        section.paragraphs += self.panels.notes
        drawing = figures.design_figure(self.drawn, self.frame)
        self._add(section, "The design points", "By pairs of variables, coloured by status.", drawing)
        yield section

    def _outcome(self) -> Iterator[Section]:
        """Tell how the runs came out."""
        state = self.campaign.state()
        section = Section("Outcome", "outcome", tables=[outcome_table(state), reason_table(state)])
        if self.panels.outputs:
            drawing = figures.output_figure(self.drawn, self.frame)
            self._add(
                section, "The outputs over the variables", "A dot per run, coloured by status.", drawing
            )
        yield section

    def _selection(self) -> Iterator[Section]:
        """Tell which runs the surrogates learn from."""
        frame = self.frame
        selection = self.campaign.select(frame)
        section = Section("Selection", "selection", tables=[agreement_table(selection)])
        section.paragraphs.append(
            f"{selection.n_kept} of {len(frame)} runs are learned from: those {selection.rule}."
        )
        if selection.note:
            section.paragraphs.append(f"{selection.note}.")
        text = "Shares of all runs, by the solver's word and by the groups of the outputs."
        self._add(section, "The outcomes", text, figures.outcome_figure(frame, selection))
        if self.panels.outputs:
            drawing = figures.selection_figure(self.drawn, frame, selection)
            self._add(section, "The selection", "Runs by pairs of outputs.", drawing)
        yield section

    def _surrogates(self) -> Iterator[Section]:
        """Tell how far the surrogates are from the truth."""
        if not self.results.surrogates:
            return
        tables = [surrogate_table(self.study), validation_table(self.results)]
        section = Section("Surrogates", "surrogates", tables=tables)
        for name, stored in self.results.surrogates.items():
            if not stored.held_out_path.is_file():
                continue
            surrogate, held_out = stored.surrogate, stored.held_out()
            shown = [name for name in surrogate.output_names if name in self.panels.outputs]
            if not shown:
                continue
            text = f"{len(held_out)} runs that it has not seen; below the error"
            text += ", with the surrogate's own 90 % interval." if surrogate.has_std else "."
            drawing = figures.parity_figure(surrogate, held_out, shown)
            self._add(section, f"Surrogate {name} against the truth", text, drawing)
        yield section

    def _analyses(self) -> Iterator[Section]:
        """Tell what was asked, and the answers."""
        tell = {
            "propagation": self._propagation,
            "sensitivity": self._sensitivity,
            "morris": self._screening,
            "optimisation": self._optimisation,
            "robust": self._robust,
            "inverse": self._inverse,
            "calibration": self._calibration,
        }
        for group in grouped(self.results.analyses):
            tables = analysis_tables(group)
            section = Section(group[0].name, f"analysis-{group[0].entry + 1}", tables=tables)
            tell[group[0].kind](section, group)
            yield section

    def _propagation(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        laws = "; ".join(f"{name} {law}" for name, law in content["laws"].items())
        section.paragraphs.append(f"Propagation of random inputs: {laws}.")
        content, constant = varying(content)
        if constant:
            section.paragraphs.append(constant_note(constant))
        if content["outputs"]:
            self._add(
                section,
                f"{section.title}: inputs and outputs",
                "Above the inputs as drawn; below the outputs, histograms and kernel densities.",
                figures.propagation_figure(content),
            )

    def _sensitivity(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        section.paragraphs += [
            f"{output}: no indices, {found['reason']}."
            for output, found in content["indices"].items()
            if found["reason"]
        ]
        content, _ = varying(content)
        if not content["indices"]:
            return
        drawing = figures.index_figure(content)
        text = "First order and total, with their intervals."
        self._add(section, f"{section.title}: Sobol indices", text, drawing)
        if not content["convergence"]:
            return
        drawing = figures.index_convergence(content)
        text = "Total indices, with their intervals, over the number of base points."
        self._add(section, f"{section.title}: convergence", text, drawing)

    def _screening(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        section.paragraphs += [
            f"{output}: no effects, {found['reason'] or 'the output does not vary'}."
            for output, found in content["effects"].items()
            if found["reason"] or not any(found["mu_star"])
        ]
        content, _ = varying(content)
        if not content["effects"]:
            return
        text = "μ* says how much an input matters; where σ is as large, its effect depends on the others."
        self._add(section, f"{section.title}: elementary effects", text, figures.screening_figure(content))

    def _optimisation(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        contents, traces = [stored.content for stored in group], [stored.trace() for stored in group]
        section.paragraphs += [f"{content['method']}: {content['reason']}." for content in contents]
        text = "The objective over the evaluations; the star is the optimum solved again by the true model."
        drawing = figures.search_figure(contents, traces)
        self._add(section, f"{section.title}: convergence", text, drawing)
        drawing = figures.visited_figure(contents, traces)
        self._add(section, f"{section.title}: visited solutions", "Where the methods looked.", drawing)

    def _robust(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        laws = "; ".join(f"{name} {law}" for name, law in content["laws"].items() if law != "0")
        section.paragraphs += [f"Errors and random inputs: {laws}.", f"{_sentence(content['reason'])}."]
        text = "Histograms by the model"
        text += ", densities by the true model (dashed)." if content["spreads"]["robust"]["other"] else "."
        names = figures.robust_panels(content)
        if names:
            self._add(section, f"{section.title}: outcomes", text, figures.robust_figure(content, names))

    def _inverse(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        laws = "; ".join(f"{name} {law}" for name, law in content["laws"].items() if law != "0")
        section.paragraphs += [f"Errors and random inputs: {laws}."] if laws else []
        text = "The inputs at each waypoint; how far each output is from its target, and is to be expected."
        self._add(section, f"{section.title}: trajectory", text, figures.trajectory_figure(content))

    def _calibration(self, section: Section, group: Sequence[StoredAnalysis]) -> None:
        content = group[0].content
        section.paragraphs.append(f"{_sentence(content['reason'])}.")
        text = "Prior and posterior of each parameter, its interval shaded; below, draws by pairs."
        self._add(section, f"{section.title}: posterior", text, figures.marginal_figure(content))
        text = "How far the measurements lie from the prediction, and may be expected to lie."
        self._add(section, f"{section.title}: measurements", text, figures.fit_figure(content))
        if content["after"]:
            drawing = figures.prediction_figure(content["after"])
            self._add(section, f"{section.title}: prediction", "Before and after the measurements.", drawing)

    def _provenance(self) -> Iterator[Section]:
        """Tell where all of this comes from."""
        tables = [analysis_table(self.study), provenance_table(self.results)]
        yield Section("Provenance", "provenance", tables=tables)


def _sentence(text: str) -> str:
    """Return a text with a capital at its beginning."""
    return text[:1].upper() + text[1:]
