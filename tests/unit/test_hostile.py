"""Hostile and unlucky input: one line, exit 2, and nothing written."""

import io
import json
import os
import subprocess
import sys

import pytest
import yaml

from tensegra import cli
from tensegra.errors import LONGEST_FOUND, StudyError, shortened, shown
from tensegra.report.references import is_study_file
from tensegra.structure import parse_structure
from tensegra.study import parse_study
from tensegra.study.memory import available_bytes, campaign_bytes

HANGER = {
    "schema": "tensegra/structure/1",
    "nodes": {1: [0, 0, 0], 2: [0, 0, -2]},
    "members": {"c": {"kind": "cable", "nodes": [1, 2], "stiffness": 500, "rest_length": 2}},
    "supports": {1: "xyz", 2: "xy"},
    "actuators": {"A": {"members": ["c"], "effect": "shorten"}},
    "stages": [{"name": "load", "loads": {2: [0, 0, -3]}}],
}
STUDY = {
    "schema": "tensegra/study/1",
    "structure": {key: value for key, value in HANGER.items() if key != "schema"},
    "variables": {"A": {"actuator": "A", "distribution": {"uniform": [0.0, 0.1]}}},
    "outputs": {"w": {"displacement": "z", "nodes": [2]}},
    "design": {"sampler": "sobol", "sizes": 16},
}


def hanger(**member):
    content = json.loads(json.dumps(HANGER))
    content["members"]["c"] |= member
    return content


def refused(tensegra, *arguments):
    """Run a command that has to be refused; return its one line."""
    code, out, err = tensegra(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("tensegra: error: ")
    assert err.count("\n") == 1
    assert len(err) < 2 * cli.LONGEST_LINE
    return err


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


# Texts that a parser trips over.
TEXTS = [
    ("a.yaml", yaml.safe_dump(hanger(rest_length="1e99999999999999999999 m")), "members.c.rest_length"),
    ("a.yaml", yaml.safe_dump(hanger(rest_length="1 cm^0")), "found '1 cm^0'"),
    ("a.yaml", yaml.safe_dump(hanger(rest_length="1 " + "m*" * 5000 + "m")), "members.c.rest_length"),
    ("a.yaml", yaml.safe_dump(hanger(stiffness=5e-324)), "found 5e-324"),
    ("a.yaml", yaml.safe_dump(hanger(stiffness=1e300)), "found 1e+300"),
    ("a.yaml", yaml.safe_dump(hanger(rest_length=1e-310)), "members.c.rest_length"),
    ("a.yaml", yaml.safe_dump({**HANGER, "nodes": {1: [0, 0, 0], 2: [0, 0, -1e308]}}), "nodes.2[2]"),
    ("a.yaml", yaml.safe_dump(hanger(kind="x" * 100_000)), "xxx...xxx"),
    ("a.yaml", "x" * 100_000 + ": [", "a.yaml"),
    ("a.yaml", "a: !!bool abc", "not what its tag says"),
    ("a.yaml", "a: !!int abc", "a.yaml"),
    ("a.yaml", "a: !!timestamp abc", "not what its tag says"),
    ("a.yaml", "a: !!timestamp 2001-01-01", "found a date"),
    ("a.yaml", "a: !!binary aGFsbG8=", "found a bytes"),
    ("a.yaml", "a: !!set {1, 2}", "found a set"),
    ("a.yaml", "[" * 300_000, "nested more than 64"),
    ("a.yaml", "- " * 300_000 + "1", "nested more than 64"),
    ("a.yaml", "{a: " * 300_000, "nested more than 64"),
    ("a.json", '{"a":' * 500 + "1" + "}" * 500, "nested too deeply"),
    ("a.json", '{"a":' * 100_000, "nested too deeply"),
    ("a.json", '{"a": ' + "9" * 5000 + "}", "digits"),
    ("a.json", '{"name": "\\ud800"}', "whole characters"),
    ("a.yaml", "a0: &a0 {x: 1}\n" + "".join(
        f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 40)
    ), "merged keys"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "told"), TEXTS, ids=[told for *_, told in TEXTS])
def test_a_text_that_a_parser_trips_over(folder, tensegra, name, text, told):
    (folder / name).write_text(text)
    assert told in refused(tensegra, "check", name)


@pytest.mark.parametrize("command", ["check", "solve"])
def test_a_name_with_a_zero_byte_is_no_files(folder, tensegra, command):
    assert "expected the name of a file" in refused(tensegra, command, "a\0b.yaml")
    (folder / "study.json").write_text(json.dumps({**STUDY, "structure": "a\0b.yaml"}))
    assert "expected the name of a file" in refused(tensegra, "check", "study.json")
    (folder / "study.json").write_text(
        json.dumps({**STUDY, "design": {"sampler": "file", "file": "a\0.csv"}})
    )
    assert "null byte" in refused(tensegra, "check", "study.json")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no pipes with names")
def test_a_pipe_that_nobody_fills_is_not_waited_for(folder, tensegra):
    os.mkfifo(folder / "pipe.yaml")
    assert "not a file" in refused(tensegra, "check", "pipe.yaml")


def test_four_thousand_empty_lines_are_read_at_once(folder):
    (folder / "empty.yaml").write_text("\n" * 40_000 + "  \n" * 4000 + "a: 1\n")
    assert not is_study_file("empty.yaml")
    # Linear in the text: an engine that went back from each line would not return.
    for text in ('{"name": "a", "schema": "tensegra/study/1"}', "# a\n\n schema :  'tensegra/study/1'"):
        (folder / "study.yaml").write_text(text)
        assert is_study_file("study.yaml")


# Tables whose rows are not those of their header.
TABLES = [
    ("A,B\n0.01,0.05,0.09\n", "line 2: found '3 fields', expected as many as the header has, 2"),
    ("A,B\n0.01\n", "found '1 fields'"),
    ("A,B,A\n0.01,0.5,0.02\n", "found 'A', expected a name for one column only"),
    ("", "it is empty"),
    ("A\n", "has no row"),
    ('A\n"0.01\n', "a CSV file"),
    ("A\n0.01\n0.5\n", "row 2"),
    ("A\nTrue\n", "row 1"),
    ("A\n1e-320\n", "in size"),
]


@pytest.mark.parametrize(("text", "told"), TABLES, ids=[told for _, told in TABLES])
def test_points_stand_under_their_names_or_are_refused(folder, tensegra, text, told):
    (folder / "points.csv").write_text(text)
    content = {**STUDY, "design": {"sampler": "file", "file": "points.csv"}}
    (folder / "study.json").write_text(json.dumps(content))
    assert told in refused(tensegra, "design", "study.json", "-o", "x.csv")
    assert not (folder / "x.csv").exists()


@pytest.mark.parametrize(("text", "told"), TABLES[:6], ids=[told for _, told in TABLES[:6]])
@pytest.mark.parametrize("place", ["empirical", "measurements"])
def test_all_tables_are_read_by_the_same_rules(folder, text, told, place):
    (folder / "table.csv").write_text(text)
    content = json.loads(json.dumps(STUDY))
    if place == "empirical":
        content["variables"]["A"]["distribution"] = {"empirical": {"file": "table.csv", "column": "A"}}
    else:
        content["analyses"] = [{"calibration": {"model": "truth", "measurements": "table.csv"}}]
    with pytest.raises(StudyError) as refusal:
        parse_study(content, folder)
    assert told in str(refusal.value)


def test_an_index_column_without_a_name_is_passed_over(folder):
    (folder / "points.csv").write_text(",A\n0,0.02\n1,0.03\n")
    study = parse_study({**STUDY, "design": {"sampler": "file", "file": "points.csv"}}, folder)
    assert study.points.ravel().tolist() == [0.02, 0.03]


# Names that become files.
@pytest.mark.parametrize(
    "name",
    ["../../escaped", "/etc/escaped", "a/b", "a\\b", "..", ".hidden", "-rf", "a ", "con", "NUL.x", "a:b",
     "x" * 200, "a\nb", "é" * 60],
)  # fmt: skip
def test_a_surrogate_name_that_leads_elsewhere_is_refused(folder, tensegra, name):
    (folder / "study.json").write_text(json.dumps({**STUDY, "surrogates": {name: {"kind": "pce"}}}))
    assert "expected a name that a file can have" in refused(tensegra, "run", "study.json", "-o", "c")
    assert os.listdir(folder) == ["study.json"]  # noqa: PTH208 - names, as they are


def test_two_names_of_one_file_are_refused(folder, tensegra):
    surrogates = {"pce": {"kind": "pce"}, "PCE": {"kind": "pce"}}
    (folder / "study.json").write_text(json.dumps({**STUDY, "surrogates": surrogates}))
    assert "where case makes no difference" in refused(tensegra, "check", "study.json")


# Numbers beyond all measure, in a study.
@pytest.mark.parametrize(
    ("law", "told"),
    [
        ({"uniform": [1e-320, 0.1]}, "in size"),
        ({"normal": {"mean": 0.1, "std": 1e-310}}, "in size"),
        ({"normal": [-5.0e12, 1.0]}, "less than 1000-fold"),
        ({"uniform": [0.0, 1e300]}, "in size"),
    ],
)
def test_a_law_beyond_all_measure_is_refused(law, told):
    content = json.loads(json.dumps(STUDY))
    content["variables"]["A"]["distribution"] = law
    with pytest.raises(StudyError, match=told):
        parse_study(content)


def test_a_temperature_that_no_member_has_is_refused():
    content = json.loads(json.dumps(STUDY))
    content["structure"]["materials"] = {"m": {"youngs_modulus": 100, "thermal_expansion": 1e-5}}
    content["structure"]["members"]["c"] = {"kind": "cable", "nodes": [1, 2], "material": "m", "area": 1}
    content["variables"] = {"T": {"temperature": "c", "distribution": {"normal": [1e13, 1.0]}}}
    with pytest.raises(StudyError, match="less than 1000-fold"):
        parse_study(content)
    content["variables"]["T"]["distribution"] = {"normal": [-1e6, 1.0]}
    with pytest.raises(StudyError, match="leave a rest length"):
        parse_study(content)


# More than the memory holds.
def test_a_billion_runs_are_refused_with_the_memory_that_they_need(folder, tensegra):
    (folder / "study.json").write_text(json.dumps({**STUDY, "design": {"sampler": "sobol", "sizes": 10**9}}))
    for command in (["check"], ["run", "-o", "c"], ["run", "--dry-run"], ["design", "-o", "x.csv"]):
        told = refused(tensegra, command[0], "study.json", *command[1:])
        assert "found '1000000000 points', expected fewer: they would need about" in told
    assert os.listdir(folder) == ["study.json"]  # noqa: PTH208 - names, as they are


def test_as_many_samples_are_refused_alike(folder, tensegra):
    analyses = [{"propagation": {"model": "truth", "samples": 10**12}}]
    (folder / "study.json").write_text(json.dumps({**STUDY, "analyses": analyses}))
    assert "analyses[0].propagation.samples" in refused(tensegra, "check", "study.json")
    assert campaign_bytes(10**6, 3, 3) < available_bytes() < campaign_bytes(10**12, 3, 3)


def test_a_limit_of_memory_is_told_before_libraries_are_loaded():
    pytest.importorskip("resource")
    program = "from tensegra.cli import main; main(['check', 'library:prism'])"
    done = subprocess.run(  # noqa: S603 - a fixed program
        ["/bin/sh", "-c", 'ulimit -v 512000; exec "$0" -c "$1"', sys.executable, program],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "the limit is 500 MB, expected at least 640" in done.stderr


# Terminals that cannot show what there is.
def test_a_terminal_without_letters_shows_what_it_can(folder):
    (folder / "study.json").write_text(json.dumps(STUDY))
    program = "from tensegra.cli import main; main(['check', 'study.json'])"
    for changes in ({"PYTHONIOENCODING": "ascii"}, {"COLUMNS": "0"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}):
        done = subprocess.run(  # noqa: S603 - a fixed program
            [sys.executable, "-c", program],
            capture_output=True,
            timeout=60,
            check=False,
            env={**os.environ, **changes},
        )
        assert (done.returncode, done.stderr) == (0, b"")
        assert b"displacement z of 2" in done.stdout


def test_json_loses_no_letter_on_a_terminal_without_it(folder, monkeypatch):
    (folder / "study.json").write_text(json.dumps({**STUDY, "name": "Träger"}))
    out = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", out)
    with pytest.raises(SystemExit):
        cli.main(["check", "study.json", "--json"])
    out.flush()
    assert json.loads(out.buffer.getvalue())["study"] == "Träger"


def test_what_is_long_is_told_by_its_ends():
    assert shortened("a" * 50 + "b" * 50, 13) == "aaaaa...bbbbb"
    deep = []
    for _ in range(100_000):
        deep = [deep]
    for value in ("x" * 10**6, [1] * 10**6, dict.fromkeys(range(10**5)), 10**5000, deep):
        assert len(shown(value)) <= LONGEST_FOUND
    with pytest.raises(StudyError) as refusal:
        raise StudyError.at("a" * 10**5, "b" * 10**5, "c" * 10**5, candidates=["b" * 10**5])
    assert len(str(refusal.value)) < cli.LONGEST_LINE


def test_too_little_memory_is_one_line(tensegra, monkeypatch):
    def hungry(_):
        raise MemoryError("Unable to allocate 7.45 GiB")

    monkeypatch.setattr("tensegra.report.references.structure_from", hungry)
    assert "not enough memory (Unable to allocate 7.45 GiB)" in refused(tensegra, "check", "a.yaml")


# Folders that are something else.
def test_a_folder_that_is_none_is_told_for_what_it_is(folder, tensegra):
    (folder / "study.json").write_text(json.dumps(STUDY))
    (folder / "link").symlink_to(folder / "nowhere")
    assert "a link to" in refused(tensegra, "run", "study.json", "-o", "link")
    (folder / "file").touch()
    assert "a file is there" in refused(tensegra, "run", "study.json", "-o", "file")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Run a study with a surrogate and an analysis, once."""
    folder = tmp_path_factory.mktemp("campaign")
    surrogates, analyses = {"p": {"kind": "pce"}}, [{"propagation": {"model": "p", "samples": 32}}]
    (folder / "study.json").write_text(json.dumps({**STUDY, "surrogates": surrogates, "analyses": analyses}))
    with pytest.raises(SystemExit) as left:
        cli.main(["run", str(folder / "study.json"), "-o", str(folder / "c")])
    assert not left.value.code
    return folder


DAMAGE = [
    (
        "manifest.json",
        lambda text: text.replace("fingerprint", "fingerprimt"),
        "fingerprint: found 'nothing'",
    ),
    ("manifest.json", lambda text: text[: len(text) // 2], "cannot be read"),
    ("manifest.json", lambda _: "[" * 100_000, "cannot be read"),
    ("surrogates/p.parquet", lambda _: "", "delete it and run the study again"),
    ("surrogates/p.tg", lambda text: text[:100], "damaged"),
    ("analyses/01-propagation.json", lambda text: text[:50], "delete it and run the study again"),
]


@pytest.mark.parametrize(("name", "damage", "told"), DAMAGE, ids=[told for *_, told in DAMAGE])
def test_a_damaged_campaign_is_told_in_one_line(campaign, tensegra, name, damage, told):
    path = campaign / "c" / name
    whole = path.read_bytes()
    try:
        path.write_bytes(damage(whole.decode("latin-1")).encode("latin-1"))
        code, out, err = tensegra("report", campaign / "c")
        assert (code, out) == (2, "")
        assert told in err.splitlines()[-1]
    finally:
        path.write_bytes(whole)


def test_a_report_needs_the_name_of_a_page(campaign, tensegra):
    for output in (".", "/", "page.pdf"):
        assert "expected a file named .html" in refused(tensegra, "report", campaign / "c", "-o", output)


def test_a_damaged_surrogate_is_made_anew_by_a_run(campaign, tensegra):
    path = campaign / "c" / "surrogates" / "p.tg"
    whole = path.read_bytes()
    path.write_bytes(whole[:200])
    code, _, _ = tensegra("run", campaign / "study.json", "-o", campaign / "c")
    assert code == 0
    assert len(path.read_bytes()) > len(whole) / 2


def test_deep_values_of_a_caller_are_refused_too():
    deep: list = []
    for _ in range(5000):
        deep = [deep]
    with pytest.raises(Exception, match="64 lists and mappings"):
        parse_structure({"nodes": deep, "members": {}})
