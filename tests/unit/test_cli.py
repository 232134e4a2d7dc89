import json
import re
from pathlib import Path

import pandas as pd
import pytest
import yaml

from tensegra.cli import main

STRUCTURE = {
    "schema": "tensegra/structure/1",
    "units": {"length": "cm", "force": "kN"},
    "nodes": {1: [0, 0, 0], 2: [100, 0, 0], 3: [200, 0, 0]},
    "materials": {"steel": {"youngs_modulus": 11500}},
    "members": {
        "K1": {"kind": "cable", "nodes": [1, 2], "material": "steel", "area": 0.5, "rest_length": 99},
        "K2": {"kind": "cable", "nodes": [2, 3], "material": "steel", "area": 0.5, "rest_length": 99},
    },
    "supports": {1: "xyz", 2: "yz", 3: "xyz"},
    "actuators": {"A": {"members": ["K1"], "effect": "shorten"}},
}
STUDY = {
    "schema": "tensegra/study/1",
    "structure": "rope.yaml",
    "variables": {"A": {"actuator": "A", "distribution": {"uniform": [0.0, 0.01]}}},
    "outputs": {"u": {"displacement": "x", "nodes": [2]}, "T": {"tension": "K1"}},
    "design": {"sampler": "sobol", "sizes": 16},
    "selection": {"method": "certificate"},
    "surrogates": {"pce": {"kind": "pce"}},
    "analyses": [
        {"propagation": {"model": "pce", "samples": 32}},
        {"optimisation": {"model": "pce", "objective": "T", "starts": 2}},
    ],
}


def changed(content, keys, value):
    """Return a copy of a file's content with one value exchanged; with None, without its key."""
    copied = json.loads(json.dumps(content))
    place = copied
    for key in keys[:-1]:
        place = place[key]
    if value is None:
        del place[keys[-1]]
    else:
        place[keys[-1]] = value
    return copied


@pytest.fixture
def _files(tmp_path, monkeypatch):
    """Write the structure and the study, and work beside them."""
    monkeypatch.chdir(tmp_path)
    Path("rope.yaml").write_text(yaml.safe_dump(STRUCTURE))
    Path("study.yaml").write_text(yaml.safe_dump(STUDY))
    return tmp_path


def strict(text):
    """Read JSON that holds no NaN and no infinity."""

    def refuse(name):
        raise AssertionError(name)

    return json.loads(text, parse_constant=refuse)


def test_version_and_help(tensegra):
    code, out, _ = tensegra("--version")
    assert code == 0
    assert out.startswith("tensegra ")
    code, out, _ = tensegra("--help")
    assert code == 0
    assert all(command in out for command in ("check", "solve", "run", "status", "report"))


def test_check_a_structure(tensegra):
    code, out, err = tensegra("check", "library:paper_beam")
    assert code == 0
    assert not err
    assert "12 struts, 32 cables, 4 clustered cables" in out
    assert "Mechanisms 17, states of self-stress 1" in out
    assert "It stands" in out
    assert max(map(len, out.splitlines())) <= 90


def test_check_as_json(tensegra):
    code, out, _ = tensegra("check", "library:paper_beam", "--json")
    assert code == 0
    content = strict(out)
    assert content["stands"]
    assert content["stages"][0]["status"] == "stable"


@pytest.mark.usefixtures("_files")
def test_check_a_study(tensegra):
    code, out, _ = tensegra("check", "study.yaml")
    assert code == 0
    assert all(
        word in out for word in ("16 points", "actuator A", "displacement x of 2", "pce", "optimisation")
    )
    code, out, _ = tensegra("check", "study.yaml", "--json")
    assert strict(out)["n_points"] == 16


def test_solve_as_json(tensegra):
    code, out, err = tensegra("solve", "library:paper_beam", "-a", "A14=0.10", "-a", "A23=0.1", "--json")
    assert code == 0
    assert not err
    content = strict(out)
    assert content["structure"] == "paper_beam"
    assert content["status"] == "stable"
    stage = content["stages"][0]
    assert {
        "name",
        "status",
        "reason",
        "nodes",
        "tensions",
        "slack",
        "residual",
        "lowest_eigenvalue",
        "steps",
        "iterations",
    } <= set(stage)
    moved = content["actuation"]["displacements"]
    tip = [(a + b) / 2 for a, b in zip(moved["18"], moved["23"], strict=True)]
    # The printed digits of the reference values.
    assert tip == pytest.approx([-10.6235, 13.8088, 53.1467], abs=5e-5)


def test_solve_for_people(tensegra):
    code, out, _ = tensegra("solve", "library:paper_beam", "-a", "A14=0.10", "-t", "top=50")
    assert code == 0
    assert "Displacements from the last stage, cm" in out
    assert "Tensions, kN" in out
    assert "Reactions, kN" in out
    assert "The history is stable." in out


def test_a_temperature_may_be_a_quantity(tensegra):
    answers = [tensegra("solve", "library:paper_beam", "-t", f"top={t}", "--json") for t in ("50", "90 degF")]
    assert answers[0] == answers[1]
    assert answers[0][0] == 0


def test_check_shows_what_the_supports_bear(tensegra):
    code, out, _ = tensegra("check", "library:paper_beam")
    assert code == 0
    assert re.search(r"Reactions, kN\n.*\bsum +0\.0000 +0\.0000 +10\.87", out, re.DOTALL)


@pytest.mark.usefixtures("_files")
def test_solve_writes_the_path(tensegra):
    code, *_ = tensegra("solve", "rope.yaml", "-a", "A=0.01", "-o", "path.parquet")
    assert code == 0
    frame = pd.read_parquet("path.parquet")
    assert {"stage", "parameter", "x_2", "T_K1"} <= set(frame)
    assert frame["stage"].iloc[-1] == "actuation"


@pytest.mark.usefixtures("_files")
def test_solve_writes_the_path_as_csv_too(tensegra):
    code, *_ = tensegra("solve", "rope.yaml", "-a", "A=0.01", "-o", "path.csv")
    assert code == 0
    assert pd.read_csv("path.csv")["stage"].iloc[-1] == "actuation"


def test_an_unstable_start_is_no_failure_if_the_history_ends_stable(tensegra, request):
    case = request.config.rootpath / "tests" / "validation" / "cases" / "cts_dbar_planar.structure.json"
    code, out, _ = tensegra("solve", case, "--json")
    content = strict(out)
    assert content["stages"][0]["status"] == "unstable"
    assert content["stages"][-1]["status"] == "stable"
    assert code == 0


def test_an_end_that_does_not_stand_is_a_failure_whose_result_is_printed(tensegra, request, tmp_path):
    case = request.config.rootpath / "tests" / "validation" / "cases" / "cts_dbar_planar.structure.json"
    content = json.loads(case.read_text())
    content["stages"] = content["stages"][:1]
    first = tmp_path / "first.json"
    first.write_text(json.dumps(content))
    code, out, _ = tensegra("solve", first, "--json")
    assert code == 1
    assert strict(out)["status"] == "unstable"
    code, out, _ = tensegra("check", first)
    assert code == 1
    assert "does not stand" in out
    code, out, _ = tensegra("solve", first, "--settle-start", "--json")
    assert code == 0
    assert strict(out)["stages"][0]["status"] in {"stable", "snapped"}


@pytest.mark.usefixtures("_files")
def test_run_status_and_report(tensegra):
    code, out, err = tensegra("run", "study.yaml", "-o", "campaign", "--workers", "1")
    assert code == 0
    assert "runs: 16 of 16" in err
    assert all(word in out for word in ("Outcome of 16 of 16 runs", "pce (pce)", "Propagation 1", "slsqp"))

    code, out, err = tensegra("run", "study.yaml", "-o", "campaign", "--workers", "1", "--json")
    assert code == 0
    content = strict(out)
    assert content["statuses"] == {"stable": 16}
    assert [analysis["kind"] for analysis in content["analyses"]] == ["propagation", "optimisation"]

    code, out, _ = tensegra("status", "campaign")
    assert code == 0
    assert "16 of 16 runs done, 0 failed, 0 pending." in out
    code, out, _ = tensegra("status", "campaign", "--json")
    assert strict(out)["n_done"] == 16

    code, out, _ = tensegra("report", "campaign", "-o", "page.html", "--json")
    assert code == 0
    assert strict(out) == {"report": "page.html"}
    assert "</html>" in Path("page.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("_files")
def test_a_study_whose_surrogates_cannot_be_had_exits_with_one(tensegra, monkeypatch):
    from tensegra.errors import StudyError

    def nothing(*_):
        raise StudyError("no run to learn from")

    monkeypatch.setattr("tensegra.study.Campaign.training_data", nothing)
    code, out, _ = tensegra("run", "study.yaml", "-o", "campaign", "--workers", "1")
    assert code == 1
    assert "Could not be had: no run to learn from." in out


@pytest.mark.usefixtures("_files")
def test_a_dry_run_does_nothing(tensegra):
    code, out, _ = tensegra("run", "study.yaml", "-o", "campaign", "--dry-run")
    assert code == 0
    assert "16 points" in out
    assert "16 runs to be done, expected in" in out
    assert "from a probe of 16: 16 stable)" in out
    code, out, _ = tensegra("run", "study.yaml", "-o", "campaign", "--dry-run", "--workers", "2", "--json")
    assert code == 0
    cost = strict(out)["cost"]
    assert (cost["n_pending"], cost["workers"]) == (16, 2)
    assert cost["expected_seconds"] > 0
    assert not Path("campaign").exists()


@pytest.mark.usefixtures("_files")
def test_a_dry_run_counts_what_is_pending(tensegra):
    from tensegra.study import read_study

    read_study("study.yaml").run("campaign")
    code, out, _ = tensegra("run", "study.yaml", "-o", "campaign", "--dry-run")
    assert code == 0
    assert "Nothing is left to run." in out
    Path("more.yaml").write_text(yaml.safe_dump(changed(STUDY, ("design", "sizes"), 32)))
    code, out, _ = tensegra("run", "more.yaml", "-o", "campaign", "--dry-run", "--json")
    assert strict(out)["cost"]["n_pending"] == 16


@pytest.mark.usefixtures("_files")
def test_design_points_are_written_and_serve_as_a_design(tensegra):
    from tensegra.study import design_points, read_study

    code, out, _ = tensegra("design", "study.yaml", "-o", "points.parquet")
    assert (code, out) == (0, "points.parquet: 16 points of A\n")
    code, out, _ = tensegra("design", "study.yaml", "-o", "points.csv", "--json")
    assert strict(out) == {"points": "points.csv", "n_points": 16, "units": {"A": ""}}
    drawn = design_points(read_study("study.yaml"))
    for name in ("points.parquet", "points.csv"):
        Path("again.yaml").write_text(
            yaml.safe_dump(changed(STUDY, ("design",), {"sampler": "file", "file": name}))
        )
        assert (design_points(read_study("again.yaml")) == drawn).all()
    code, _, err = tensegra("design", "study.yaml", "-o", "points.xlsx")
    assert code == 2
    assert "expected a file named .csv or .parquet" in err


@pytest.mark.usefixtures("_files")
def test_a_scheduler_gives_the_same_rows_as_this_process(tensegra):
    from tensegra.study import open_campaign

    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        code, out, err = tensegra(
            "run", "study.yaml", "-o", "there", "--scheduler", cluster.scheduler_address
        )
    assert code == 0
    assert "runs: 16 of 16" in err
    assert "Outcome of 16 of 16 runs" in out
    code, *_ = tensegra("run", "study.yaml", "-o", "here")
    assert code == 0
    there, here = (open_campaign(name).frame().drop(columns="seconds") for name in ("there", "here"))
    pd.testing.assert_frame_equal(there, here, check_exact=True)


@pytest.mark.usefixtures("_files")
def test_a_scheduler_that_is_not_there_is_told(tensegra, monkeypatch):
    from tensegra.study.cluster import Dask

    monkeypatch.setattr(
        "tensegra.study.driver.executor_for", lambda _, scheduler: Dask(scheduler=scheduler, patience=1.0)
    )
    code, out, err = tensegra("run", "study.yaml", "-o", "campaign", "--scheduler", "tcp://127.0.0.1:9")
    assert (code, out) == (2, "")
    assert "tcp://127.0.0.1:9: no Dask scheduler answers" in err


@pytest.mark.usefixtures("_files")
def test_a_study_names_its_own_folder(tensegra):
    code, *_ = tensegra("run", "study.yaml", "--workers", "1")
    assert code == 0
    assert Path("runs/study/results.json").is_file()


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("members", "K1", "nodes"), [1, 7], "members.K1.nodes[1]: found '7'"),
        (("members", "K1", "arae"), 1.0, "did you mean 'area'"),
        (("nodes", "2"), [float("nan"), 0, 0], "nodes.2[0]"),
        (("members", "K1", "area"), -0.5, "members.K1.area"),
        (("actuators", "A", "members"), ["K9"], "actuators.A.members[0]: found 'K9'"),
        (("schema",), None, "schema"),
    ],
)
@pytest.mark.usefixtures("_files")
def test_a_structure_that_cannot_be_is_refused_in_one_line(tensegra, keys, value, message):
    Path("bad.yaml").write_text(yaml.safe_dump(changed(STRUCTURE, keys, value)))
    for command in ("solve", "check"):
        code, out, err = tensegra(command, "bad.yaml")
        assert code == 2
        assert not out
        assert err.startswith("tensegra: error: bad.yaml")
        assert err.count("\n") == 1
        assert message in err


@pytest.mark.parametrize(
    ("keys", "value", "message"),
    [
        (("variables", "A", "distribution"), {"uniform": [0.0, 1.5]}, "variables.A.distribution"),
        (("variables", "A", "actuator"), "B", "variables.A.actuator: found 'B'"),
        (("outputs", "u", "nodes"), [9], "outputs.u.nodes[0]: found '9'"),
        (("structure",), "rop.yaml", "no such file; did you mean 'rope.yaml'"),
        (("surrogates", "pce", "degre"), 3, "did you mean 'degree'"),
        (("analyses", 1, "optimisation", "objective"), "T + V", "analyses[1].optimisation.objective"),
    ],
)
@pytest.mark.usefixtures("_files")
def test_a_study_that_cannot_be_is_refused_in_one_line(tensegra, keys, value, message):
    Path("bad.yaml").write_text(yaml.safe_dump(changed(STUDY, keys, value)))
    for arguments in (("check", "bad.yaml"), ("run", "bad.yaml", "-o", "campaign", "--workers", "1")):
        code, out, err = tensegra(*arguments)
        assert code == 2
        assert not out
        assert err.startswith("tensegra: error: ")
        assert err.count("\n") == 1
        assert message in err
    assert not Path("campaign").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("solve", "rpe.yaml"), "rpe.yaml: no such file; did you mean 'rope.yaml'"),
        (("check", "nothing.yaml"), "nothing.yaml: no such file"),
        (("solve", "."), "expected a file named .yaml, .yml or .json"),
        (("solve", "library:paper_beem"), "did you mean 'paper_beam'"),
        (("solve", "rope.yaml", "-a", "A"), "-a: found 'A'"),
        (("solve", "rope.yaml", "-a", "A=nan"), "-a: found 'A=nan'"),
        (("solve", "rope.yaml", "-a", "A=0.1", "-a", "A=0.2"), "-a: 'A' is set twice"),
        (("solve", "rope.yaml", "-a", "AA=0.1"), "found 'AA', expected an actuator"),
        (("solve", "rope.yaml", "-a", "A=1"), "actuation A"),
        (("solve", "rope.yaml", "-t", "K9=1"), "found 'K9'"),
        (
            ("solve", "rope.yaml", "-t", "K1=1e9"),
            "-t: K1: found 1000000000.0, expected a difference of at most",
        ),
        (("solve", "rope.yaml", "-t", "K1=5 kN"), "-t: found 'K1=5 kN'"),
        (("solve", "rope.yaml", "-o", "path.xls"), "-o: found 'path.xls'"),
        (("run", "nothing.yaml"), "nothing.yaml: no such file"),
        (("run", "rope.yaml"), "rope.yaml"),
        (("status", "."), "no campaign is here"),
        (("report", "nowhere"), "nowhere: no campaign is here"),
        (("solve", "broken.yaml"), "broken.yaml"),
        (("solve", "binary.yaml"), "binary.yaml: this is not a text in UTF-8"),
    ],
)
@pytest.mark.usefixtures("_files")
def test_bad_input_is_one_line_and_exit_two(tensegra, arguments, message):
    Path("broken.yaml").write_text("nodes: [1, 2\nmembers: }")
    Path("binary.yaml").write_bytes(b"\xff\xfe\x00\x01")
    code, out, err = tensegra(*arguments)
    assert code == 2
    assert not out
    assert err.startswith("tensegra: error: ")
    assert err.count("\n") == 1
    assert message in err


def test_an_unknown_option_is_exit_two(tensegra):
    code, _, err = tensegra("solve", "library:paper_beam", "--fast")
    assert code == 2
    assert "--fast" in err


@pytest.mark.parametrize("wrong", ["18=-1", "18.w=-1", "=1", "18.z", "18.z=x", ".=1", "18.z=2 cm"])
def test_a_load_without_a_node_and_an_axis_is_refused(capsys, wrong):
    with pytest.raises(SystemExit) as left:
        main(["solve", "library:paper_beam", "-l", wrong])
    assert left.value.code == 2
    assert "-l" in capsys.readouterr().err
