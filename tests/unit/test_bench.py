import json
from itertools import combinations_with_replacement

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks.solver import growth, peers
from benchmarks.solver.batches import Batches, measure_batches
from benchmarks.solver.everything import FULL, QUICK, Sizes, measure, to_markdown
from benchmarks.solver.kernel_times import PARTS, Pack
from benchmarks.solver.processes import measure_first_call, measure_memory
from benchmarks.solver.roofline import PER_BLOCK, PER_PIVOT, factor_work
from benchmarks.solver.timing import Spread, exponent, interleaved
from tensegra.mechanics.arrays import structure_arrays
from tensegra.mechanics.pattern import build_pattern
from tensegra.structure import library

TINY = Sizes(
    repeats=2,
    threads=(1, 2),
    n_runs=12,
    many_runs=20,
    run_counts=(4, 8),
    stages=(2, 3),
    stage_runs=4,
    nodes=(16, 24),
    calls=2,
    memory_runs=8,
    fresh_processes=False,
)

RESIDUAL = 1e-9
"""What is promised of every run."""


@pytest.fixture(scope="module")
def tiny():
    told = []
    benchmark = measure(TINY, lambda *what: told.append(what))
    return benchmark, told


def strict(text):
    def refuse(name):
        raise AssertionError(name)

    return json.loads(text, parse_constant=refuse)


def test_every_design_is_timed_on_every_number_of_threads(tiny):
    rows = {(row.design, row.n_runs, row.threads): row for row in tiny[0].batches.rows}
    names = ("10 % path", "five variables", "five variables + derivatives", "30 %, no gravity")
    assert set(rows) == {(name, 12, threads) for name in names for threads in (1, 2)} | {
        ("five variables", 20, 2)
    }
    for row in rows.values():
        assert row.lost == 0
        assert row.largest_residual <= RESIDUAL
        assert row.ratio.repeats == row.seconds_per_run.repeats == TINY.repeats
        assert 0.0 < row.ratio.best <= row.ratio.median <= row.ratio.worst
        assert (row.against_plain is not None) == row.design.endswith("derivatives")


def test_all_sizes_and_kernels_are_there(tiny):
    benchmark, told = tiny
    assert [row.size for row in benchmark.stage_growth.rows] == [2, 3]
    assert [row.size for row in benchmark.run_growth.rows] == [4, 8]
    assert [row.size for row in benchmark.path_growth.rows] == [16, 24]
    for grown in (benchmark.stage_growth, benchmark.run_growth, benchmark.path_growth):
        assert all(row.succeeded == 1.0 for row in grown.rows)
    assert set(benchmark.roofline.kernels) == set(PARTS)
    assert {task for task, *_ in told} == {"Batches", "Kernels", "Towers", "Runs", "Nodes", "Other programs"}


def test_the_peers_that_are_not_installed_say_so(monkeypatch):
    monkeypatch.setattr(peers.importlib.util, "find_spec", lambda _name: None)
    rows = peers.measure_peers().rows
    assert {row.program for row in rows} == {"MuJoCo", "musclepy"}
    assert all("not installed" in row.outcome for row in rows)


def test_a_peer_that_is_asked_stands_beside_ours(monkeypatch):
    def in_vain(task):
        return task.start, "did not move"

    monkeypatch.setattr(peers.importlib.util, "find_spec", lambda _name: True)
    monkeypatch.setattr(peers.importlib, "import_module", lambda _name: None)
    monkeypatch.setattr(peers, "version", lambda _name: "9.9")
    monkeypatch.setattr(peers, "_by_mujoco", in_vain)
    monkeypatch.setattr(peers, "_by_musclepy", in_vain)
    for row in peers.measure_peers().rows:
        assert row.program.endswith(" 9.9")
        assert row.outcome == "did not move"
        assert row.tip == 0.0
        assert abs(row.our_tip) > 0.0
        assert row.difference > 0.0


@pytest.mark.parametrize("name", ["mujoco", "musclepy"])
def test_an_installed_peer_agrees_with_ours(name):
    pytest.importorskip(name)
    rows = [row for row in peers.measure_peers().rows if row.program.lower().startswith(name)]
    assert rows
    for row in rows:
        # A relaxation stops at a residual of 1e-8, over a lowest eigenvalue 1e-6 of the largest.
        assert row.difference < 1e-5


def test_json_holds_everything_and_no_nan(tiny):
    content = tiny[0].to_dict()
    assert strict(json.dumps(content, allow_nan=False)) == json.loads(json.dumps(content))
    assert content["schema"] == "tensegra/benchmark/1"
    assert content["first_call"] is None
    assert set(content) >= {"machine", "versions", "batches", "roofline", "peers", "memory"}
    assert "share_of_peak" in content["roofline"]


def test_markdown_holds_every_table(tiny):
    text = to_markdown(tiny[0])
    tables = tiny[0].tables()
    assert len(tables) == 8
    for table in tables:
        assert f"### {table.title}" in text
        assert all(len(row) == len(table.header) == len(table.align) for row in table.rows)


@pytest.mark.parametrize("as_json", [False, True])
def test_the_command_shows_and_writes(monkeypatch, capsys, tmp_path, tiny, as_json):
    asked = []

    def measured(sizes, _listener):
        asked.append(sizes)
        return tiny[0]

    monkeypatch.setattr(command, "measure", measured)
    file = tmp_path / "bench.md"
    with pytest.raises(SystemExit) as left:
        command.app(["--quick", "-o", str(file), *(["--json"] if as_json else [])])
    out = capsys.readouterr().out
    assert not left.value.code
    assert asked == [QUICK]
    assert file.read_text(encoding="utf-8") == to_markdown(tiny[0])
    if as_json:
        assert strict(out) == json.loads(json.dumps(tiny[0].to_dict()))
    else:
        assert max(map(len, out.splitlines())) <= 80
        assert all(table.title in out for table in tiny[0].tables())


def test_quick_is_smaller_than_full():
    assert max(QUICK.run_counts) == 10_000
    assert max(FULL.run_counts) == 1_000_000
    assert QUICK.n_runs < FULL.n_runs
    assert max(QUICK.nodes) < max(FULL.nodes)


@pytest.mark.parametrize(
    "structure", [library.paper_beam(), library.tower(5, 4, clustered="one"), library.prism(3)], ids=str
)
def test_work_is_that_of_eliminating_block_by_block(structure):
    arrays = structure_arrays(structure)
    pattern = build_pattern(arrays)
    work = factor_work(pattern)

    neighbours = {block: set() for block in range(pattern.n_blocks)}
    for member in structure.members.values():
        path = [pattern.node_block[arrays.node_index[node]] for node in member.nodes]
        for a in path:
            neighbours.get(a, set()).update(b for b in path if b >= 0 and b != a)
    updates = scaled = 0
    for block in range(pattern.n_blocks):
        later = sorted(other for other in neighbours[block] if other > block)
        scaled += len(later)
        for a, b in combinations_with_replacement(later, 2):
            updates += 1
            if a != b:
                neighbours[a].add(b)
                neighbours[b].add(a)
    assert (work.block_updates, work.scaled_blocks) == (updates, scaled)
    assert work.filled_blocks == pattern.n_blocks + scaled
    assert work.multiply_adds == PER_BLOCK * (updates + scaled) + PER_PIVOT * pattern.n_blocks


def test_the_timed_kernels_stand_at_an_equilibrium():
    assert Pack(library.paper_beam()).residual <= RESIDUAL


def test_works_are_done_in_rounds():
    done = []
    timed = interleaved({"a": lambda: done.append("a"), "b": lambda: done.append("b")}, 3)
    assert done == ["a", "b"] * 4
    assert timed.wall["a"].shape == timed.cpu["b"].shape == timed.reference.shape == (3,)
    assert np.all(timed.reference > 0.0)


def test_spread_and_exponent():
    assert Spread.of([4.0, 1.0]) == Spread(1.0, 2.5, 4.0, 2)
    sizes = np.array([10.0, 30.0, 100.0])
    assert exponent(sizes, 3e-6 * sizes**1.25) == pytest.approx(1.25, rel=1e-12)
    assert np.isnan(exponent([1.0], [1.0]))


def test_the_fit_takes_the_largest_sizes():
    rows = [
        growth.GrowthRow(n, 1, Spread.of([t]), 1.0)
        for n, t in ((1, 9.0), (10, 1.0), (100, 10.0), (1000, 100.0))
    ]
    grown = growth.Growth.of("title", "Nodes", "the path", rows)
    assert grown.exponent == pytest.approx(1.0, rel=1e-12)
    assert [row[-1] for row in grown.table().rows] == ["–", "-0.95", "1.00", "1.00"]


def test_a_batch_in_one_go_is_left_out_where_it_is_not_wanted():
    found = measure_batches(4, 1, threads=(1,))
    assert isinstance(found, Batches)
    assert [row.n_runs for row in found.rows] == [4, 4, 4, 4]


@pytest.mark.slow
def test_memory_of_a_fresh_process():
    memory = measure_memory(64, 1)
    assert memory.peak >= memory.before > 0
    assert memory.results > 64 * 24 * 3 * 8
    assert memory.table().rows[1][0] == "Peak"


@pytest.mark.slow
def test_first_calls_of_fresh_processes():
    found = measure_first_call()
    assert list(found.compiling) == list(found.cached) == ["import tensegra", "solve_path", "solve_batch"]
    assert all(cpu > 0.0 for steps in (found.compiling, found.cached) for _, cpu in steps.values())
    assert found.table().rows[-1][0] == "together"
