import subprocess
import sys
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from tensegra.mechanics import solve_path
from tensegra.report import figures
from tensegra.report.figures.panels import MOST_PANELS, choose_panels, varying
from tensegra.structure import library
from tensegra.study import parse_study, select


def texts_in(drawing):
    """Return the extents of all texts that are drawn, with the texts."""
    from matplotlib.text import Text

    canvas = drawing.canvas
    canvas.draw()
    shown = [
        text
        for text in drawing.findobj(Text)
        if text.get_visible() and text.get_text().strip() and text.axes is not False
    ]
    return [(text.get_text(), text.get_window_extent()) for text in shown]


def axis_texts(axes):
    """Return the labels of an axes' ticks and its own labels, as drawn."""
    for axis in (axes.xaxis, axes.yaxis):
        yield [label for label in axis.get_ticklabels() if label.get_visible() and label.get_text()]


@pytest.fixture(scope="module")
def drawings(results):
    study, frame = results.campaign.study, results.campaign.frame()
    made = {
        "design": figures.design_figure(study, frame),
        "outputs": figures.output_figure(study, frame),
        "selection": figures.selection_figure(study, frame, results.campaign.select(frame)),
        "outcome": figures.outcome_figure(frame, results.campaign.select(frame)),
    }
    for name, stored in results.surrogates.items():
        made[f"parity of {name}"] = figures.parity_figure(stored.surrogate, stored.held_out())
    propagation, sensitivity, *searches = results.analyses
    contents, traces = [s.content for s in searches], [s.trace() for s in searches]
    made["propagation"] = figures.propagation_figure(propagation.content)
    made["indices"] = figures.index_figure(sensitivity.content)
    made["convergence"] = figures.index_convergence(sensitivity.content)
    made["search"] = figures.search_figure(contents, traces)
    made["visited"] = figures.visited_figure(contents, traces)
    return made


def test_tick_labels_of_an_axis_do_not_overlap(drawings):
    for name, drawing in drawings.items():
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        FigureCanvasAgg(drawing).draw()
        for axes in drawing.findobj(lambda artist: hasattr(artist, "get_xticklabels")):
            for labels in axis_texts(axes):
                if any(label.get_rotation() % 90 for label in labels):
                    continue  # a box around slanted text overlaps where the text does not
                extents = [label.get_window_extent() for label in labels]
                for first, second in combinations(extents, 2):
                    assert not first.overlaps(second), (name, [label.get_text() for label in labels])


def test_no_legend_lies_over_data(drawings):
    for name, drawing in drawings.items():
        drawing.canvas.draw()
        panels = drawing.findobj(lambda artist: hasattr(artist, "get_xticklabels"))
        inside = [axes.get_legend() for axes in panels if axes.get_legend() is not None]
        for legend in [*inside, *drawing.legends]:
            extent = legend.get_window_extent()
            assert not any(extent.overlaps(axes.get_window_extent()) for axes in panels), name


def test_a_power_of_ten_stands_in_the_name_of_its_axis():
    from tensegra.report.figures.style import figure, styled

    @styled
    def small():
        made = figure(2.0)
        axes = made.add_subplot()
        axes.plot([0.0, 4e-5], [0.0, 3e7])
        axes.set_xlabel("w [cm]")
        axes.set_ylabel("E [Pa]")
        return made

    axes = small().axes[0]
    assert "×10⁻⁵" in axes.get_xlabel()
    assert "×10⁷" in axes.get_ylabel()
    assert not axes.xaxis.get_offset_text().get_visible()


def test_a_notebook_shows_a_figure_without_pyplot(tmp_path):
    program = (
        "import sys, tensegra as tg\n"
        "shown = tg.solve_path(tg.library.prism()).plot()._repr_png_()\n"
        "assert shown.startswith(b'\\x89PNG') and len(shown) > 10_000\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=tmp_path)  # noqa: S603


def test_axes_name_their_units(drawings):
    for name in ("outputs", "selection", "propagation"):
        labels = {axes.get_xlabel() for axes in drawings[name].axes} | {
            axes.get_ylabel() for axes in drawings[name].axes
        }
        assert any("[cm]" in label for label in labels), name
    assert "T [degC]" in {axes.get_xlabel() for axes in drawings["design"].axes}


def test_a_figure_always_gives_the_same_bytes(results):
    content = results.analyses[1].content
    assert figures.svg(figures.index_figure(content)) == figures.svg(figures.index_figure(content))


def test_the_structure_is_drawn_where_it_is():
    beam = library.paper_beam()
    path = solve_path(beam, {"A14": 0.05, "A23": 0.05})
    nodes = path.final.nodes
    drawing = figures.structure_figure(beam, nodes, ["18"], reference=path.stages[-1].nodes)
    axes = drawing.axes[0]
    low, high = np.array([axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()]).T
    assert np.all(low <= nodes.min(axis=0))
    assert np.all(high >= nodes.max(axis=0))
    names = {text.get_text().strip() for text in axes.texts}
    assert "18" in names
    assert names <= set(beam.node_ids)


def test_one_shape_alone_is_drawn_too():
    prism = library.prism()
    nodes = prism.coordinates
    drawing = figures.shape_figure(prism, nodes, {"lifted": nodes + np.array([0.0, 0.0, 0.1])})
    assert len(drawing.axes) == 3


def test_figures_need_no_pyplot():
    code = (
        "import sys; from tensegra.report import figures; from tensegra.structure import library; "
        "p = library.prism(); figures.svg(figures.structure_figure(p, p.coordinates)); "
        "sys.exit('matplotlib.pyplot' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0  # noqa: S603


def test_shares_of_the_outcome_are_those_of_the_runs():
    statuses = ["stable"] * 6 + ["collapsed"] * 3 + ["failed"]
    frame = pd.DataFrame({"w": np.arange(10.0), "status": statuses})
    labels = np.array([0, 0, 0, 0, 1, 1, -1, -1, -1, -1])
    drawing = figures.outcome_figure(frame, replace(select(frame, ["w"]), labels=labels))
    solver, clustering = drawing.axes
    shares = [[patch.get_width() for patch in axes.patches] for axes in (solver, clustering)]
    assert shares == [[60.0, 30.0, 10.0], [40.0, 20.0, 40.0]]
    texts = [text.get_text() for text in clustering.get_legend().get_texts()]
    assert texts == ["largest group, 40 %", "group 1, 20 %", "no group, 40 %"]


def test_legends_stay_inside_their_figures(drawings):
    for name, drawing in drawings.items():
        drawing.canvas.draw()
        for legend in drawing.legends:
            box = legend.get_window_extent()
            assert box.x0 >= 0, name
            assert box.x1 <= drawing.bbox.x1, name


def many(n_variables, n_outputs, n_runs=64):
    """Return a study of many variables and outputs, with runs that depend on few of them."""
    content = {
        "structure": "library:paper_beam",
        "variables": {
            f"x{i}": {"rest_length": f"c{i + 1}", "distribution": {"uniform": [60.0, 70.0]}}
            for i in range(n_variables)
        },
        "outputs": {f"y{k}": {"tension": f"c{k % 32 + 1}"} for k in range(n_outputs)},
        "design": {"sampler": "sobol", "sizes": n_runs},
        "analyses": [{"propagation": {"model": "truth", "samples": 8, "outputs": [f"y{n_outputs - 1}"]}}],
    }
    study = parse_study(content)
    X = np.random.default_rng(0).uniform(60.0, 70.0, (n_runs, n_variables))
    # Only the last two variables matter, and the first output is the same everywhere.
    Y = np.outer(X[:, -1] + 0.8 * X[:, -2], np.arange(n_outputs))
    frame = pd.DataFrame(np.hstack([X, Y]), columns=[*study.input_names, *study.output_names])
    return study, frame.assign(status="stable")


def test_a_figure_shows_a_bounded_number_of_what_matters():
    study, frame = many(28, 200)
    panels = choose_panels(study, frame)
    assert {"x26", "x27"} < set(panels.variables)
    assert len(panels.variables) == len(panels.outputs) == MOST_PANELS
    assert panels.outputs[-1] == "y199"  # the one that an analysis names
    assert panels.constant == ("y0",)
    told = " ".join(panels.notes)
    assert "Of 28 variables the figures show the 6 on which the outputs depend most" in told
    assert "Of 199 outputs the figures show 6" in told
    assert "does not vary: y0" in told
    drawn = panels.of(study)
    assert len(figures.design_figure(drawn, frame).axes) == 21
    assert len(figures.output_figure(drawn, frame).axes) == 36


def test_of_few_all_are_shown_and_nothing_is_said():
    study, frame = many(3, 4)
    panels = choose_panels(study, frame)
    assert (panels.variables, panels.outputs) == (study.input_names, ("y1", "y2", "y3"))
    assert panels.notes == ["No figure of what does not vary: y0."]


@pytest.mark.parametrize("n", [1, 50, 200])
def test_figures_of_analyses_have_a_bounded_number_of_panels(n):
    index = {key: [0.5] * n for key in ("first", "total", "first_half", "total_half")} | {"reason": ""}
    names = [f"x{i}" for i in range(n)]
    outputs = {f"y{k}": index for k in range(n)}
    steps = {f"y{k}": [index, index] for k in range(n)}
    content = {"input_names": names, "indices": outputs, "convergence": steps, "sizes": [8, 16]}
    effects = {
        f"y{k}": {"mu_star": [1.0] * n, "mu_star_half": [0.1] * n, "sigma": [1.0] * n, "unit": ""}
        for k in range(n)
    }
    shown = min(n, MOST_PANELS)
    assert len(figures.index_figure(content).axes) == shown
    assert len(figures.index_convergence(content).axes) == shown
    assert len(figures.screening_figure({"input_names": names, "effects": effects}).axes) == shown


def test_a_figure_is_had_as_pdf_too(drawings):
    assert figures.pdf(drawings["outcome"]).startswith(b"%PDF")


def test_no_analysis_draws_an_output_that_does_not_vary(small_study, tmp_path):
    from tensegra.report.pipeline import carry_out
    from tensegra.report.report import build_report

    outputs = {
        "w": {"displacement": "z", "nodes": [18, 23]},
        "still": {"displacement": "z", "nodes": [1]},  # a support
    }
    asked = [
        {"propagation": {"name": "Scatter", "model": "truth", "samples": 8}},
        {"propagation": {"name": "Still", "model": "truth", "samples": 8, "outputs": ["still"]}},
        {"sensitivity": {"name": "Shares", "model": "truth", "samples": 64}},
        {"morris": {"name": "Screening", "model": "truth", "trajectories": 4}},
    ]
    study = small_study(
        outputs=outputs, surrogates={}, analyses=asked, design={"sampler": "sobol", "sizes": 8}
    )
    results = carry_out(study, tmp_path / "campaign", workers=1)
    sections = {section.title: section for section in build_report(results).sections}
    scatter, still = sections["Scatter"], sections["Still"]
    assert len(scatter.figures) == 1
    assert any("does not vary: still" in text for text in scatter.paragraphs)
    assert still.figures == []
    assert any("does not vary: still" in text for text in still.paragraphs)
    for name in ("Shares", "Screening"):
        section = sections[name]
        assert section.figures, name
        assert any(text.startswith("still: no") for text in section.paragraphs), name
    for stored in results.analyses:
        content, constant = varying(stored.content)
        assert constant == ["still"]
        if stored.name == "Scatter":
            drawn = {axes.get_xlabel() for axes in figures.propagation_figure(content).axes}
            assert "w [cm]" in drawn
            assert not any("still" in label for label in drawn)
