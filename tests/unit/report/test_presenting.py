"""Every public result says what it is, draws itself, lays itself out, and becomes a table of pandas."""

import re
from html.parser import HTMLParser

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest

import tensegra as tg
from tensegra import presented
from tensegra.above import Above
from tensegra.errors import SolverError, StudyError
from tensegra.presented import Presented, Tabled

BOX = np.array([[0.0, 1.0], [0.0, 2.0]])
LAWS = {"a": {"uniform": [0, 1]}, "b": {"uniform": [0, 2]}}
MOST_TEXT = 1200
"""Characters of a repr that can still be read in a terminal."""


def outputs(X):
    return np.stack([X[:, 0] + X[:, 1] ** 2, X[:, 0] * X[:, 1]], axis=1)


MODEL = tg.FunctionModel(outputs, ("a", "b"), ("v", "w"), BOX)

PRISM = tg.library.prism(3)

MADE = {
    "Structure": lambda _: PRISM,
    "Equilibrium": lambda _: tg.solve_path(PRISM).final,
    "EquilibriumPath": lambda _: tg.solve_path(tg.library.paper_beam(), {"A14": 0.01}),
    "Batch": lambda _: tg.solve_batch(tg.library.paper_beam(), actuation={"A14": [0.0, 0.01, 0.02]}),
    "Campaign": lambda results: results.campaign,
    "Surrogate": lambda results: tg.load_surrogate(results.surrogates["gpr"].path),
    "Propagation": lambda _: tg.propagate(MODEL, LAWS, samples=64),
    "Sensitivity": lambda _: tg.sobol_indices(MODEL, LAWS, samples=64),
    "Screening": lambda _: tg.morris_screening(MODEL, LAWS, trajectories=4),
    "Optimum": lambda _: tg.optimise(MODEL, "v", method="slsqp", starts=2),
    "RobustOptimum": lambda _: tg.robust_optimise(
        MODEL, "v", errors={"a": {"normal": {"mean": 0, "std": 0.01}}}, samples=64, starts=2
    ),
    "Trajectory": lambda _: tg.reach(MODEL, {"v": [1.0, 1.5]}),
    "Calibration": lambda _: tg.calibrate(
        MODEL, {"v": [1.0, 1.1], "v_std": [0.1, 0.1]}, inputs=LAWS, draws=100, warmup=50
    ),
}


@pytest.fixture(scope="module")
def made(results):
    kept = {}

    def make(name):
        if name not in kept:
            kept[name] = MADE[name](results)
        return kept[name]

    return make


def test_no_public_result_is_left_out():
    public = {
        name
        for name in tg.__all__
        if isinstance(getattr(tg, name), type) and issubclass(getattr(tg, name), Presented)
    }
    assert public == set(MADE)


@pytest.mark.parametrize("name", MADE)
def test_it_is_what_it_says(made, name):
    assert type(made(name)) is getattr(tg, name)
    text = repr(made(name))
    assert text.startswith(f"{name}(")
    assert text.endswith(")")
    assert len(text) < MOST_TEXT
    assert "array(" not in text
    assert re.search(r"\d", text)


@pytest.mark.parametrize("name", MADE)
def test_it_draws_itself(made, name):
    figure = made(name).plot()
    assert isinstance(figure, matplotlib.figure.Figure)
    assert any(axes.lines or axes.collections or axes.patches for axes in figure.axes)


class Reader(HTMLParser):
    """Counts what is open, and keeps the cells."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.n_tables = [], [], 0

    def handle_starttag(self, tag, _):
        if tag != "br":
            self.open.append(tag)
        self.n_tables += tag == "table"

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in {"td", "th"}:
            self.cells.append(data)


@pytest.mark.parametrize("name", MADE)
def test_a_notebook_shows_its_tables(made, name):
    reader = Reader()
    reader.feed(made(name)._repr_html_())
    assert not reader.open
    assert reader.n_tables
    assert any(re.search(r"\d", cell) for cell in reader.cells)


@pytest.mark.parametrize("name", MADE)
def test_it_becomes_a_table_of_pandas(made, name):
    frame = made(name).to_dataframe()
    assert isinstance(frame, pd.DataFrame)
    assert len(frame) > 0
    if isinstance(made(name), Tabled):
        assert set(frame.columns) == {key for row in made(name).table() for key in row}


def test_the_tables_hold_the_numbers_of_the_result(made):
    batch = made("Batch")
    frame = batch.to_dataframe()
    assert frame["18.z"].tolist() == batch.coordinate("z", 18).tolist()
    member = batch.member_ids[0]
    assert frame[f"T.{member}"].tolist() == batch.tension(member).tolist()
    members = made("Structure").to_dataframe().set_index("member")
    for name, member in PRISM.members.items():
        assert members.loc[name, "rest_length"] == member.rest_length
        assert members.loc[name, "stiffness"] == PRISM.axial_stiffness(name)
    surrogate = made("Surrogate")
    assert surrogate.to_dataframe()["rms_error"].tolist() == list(surrogate.validation.rms_error)


def test_names_that_look_like_html_stay_names():
    nodes = {"<b>": (0, 0, 0), "<i>": (1, 0, 0)}
    rope = tg.Structure(
        name="<script>",
        nodes=nodes,
        members={"<u>": tg.Member("cable", ("<b>", "<i>"), 0.9, stiffness=10.0)},
        supports={"<b>": "xyz", "<i>": "yz"},
    )
    html = rope._repr_html_() + tg.solve_path(rope).final._repr_html_()
    assert not {"<b>", "<i>", "<u>", "<script>"} & set(re.findall(r"<\w+>", html))


def test_a_solution_that_failed_has_nothing_to_draw_and_says_why():
    from dataclasses import replace

    path = tg.solve_path(PRISM)
    lost = replace(
        path.final,
        status=tg.Status.FAILED,
        reason="no equilibrium",
        nodes=np.full_like(path.final.nodes, np.nan),
    )
    failed = replace(path, stages=(*path.stages[:-1], lost), actuation=None)
    for result in (lost, failed):
        with pytest.raises(SolverError, match="no equilibrium"):
            result.plot()
        assert "no equilibrium" in repr(result)
        assert "no equilibrium" in result._repr_html_()


def test_batches_and_campaigns_without_a_run_say_so(made, small_study, tmp_path):
    from dataclasses import replace

    batch = made("Batch")
    with pytest.raises(SolverError, match="all 3 runs failed"):
        replace(batch, nodes=np.full_like(batch.nodes, np.nan)).plot()
    study = small_study(surrogates={}, analyses=[])
    folder = tmp_path / "empty"
    campaign = study.run(folder)
    for shard in (folder / "shards").iterdir():
        shard.unlink()
    with pytest.raises(StudyError, match="no runs yet"):
        campaign.plot()


def test_what_is_not_known_is_not_drawn():
    from tensegra.report import presenting

    for of in (presenting.figure_of, presenting.tables_of):
        with pytest.raises(TypeError, match="a str has no"):
            of("text")


def test_who_draws_is_asked_when_something_is_shown(monkeypatch):
    asked = []

    class Presenter:
        def figure_of(self, result):
            return ("figure", result)

        def html_of(self, result):
            return f"html of {type(result).__name__}"

    monkeypatch.setattr(presented, "presenter", Above())
    presented.presenter.brought_by(lambda: asked.append("asked") or Presenter())
    assert not asked
    assert PRISM.plot() == ("figure", PRISM)
    assert PRISM._repr_html_() == "html of Structure"
    assert asked == ["asked", "asked"]
