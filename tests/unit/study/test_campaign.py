import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pandas.testing import assert_frame_equal
from study_contents import set_at

from tensegra.errors import StudyError
from tensegra.study import InProcess, design_points, open_campaign, parse_study, pending_points
from tensegra.study.derivatives import derivative_name
from tensegra.study.driver import BLOCK_SIZES, Blocks

COLUMNS = [
    "A14", "A23", "w", "T_K1",
    "status", "reason", "residual", "lowest_eigenvalue", "steps", "iterations", "seconds",
]  # fmt: skip


class Counting:
    """A solver that counts the runs it is asked for."""

    def __init__(self, solver):
        self.solver, self.n_runs = solver, 0

    def __call__(self, structure, **inputs):
        runs = self.solver(structure, **inputs)
        self.n_runs += runs.n_runs
        return runs


@pytest.fixture
def counting(solver):
    return Counting(solver)


def test_a_campaign_has_a_row_for_every_point(tmp_path, study, solver):
    campaign = study.run(tmp_path / "runs", solver=solver)
    frame = campaign.frame()
    assert list(frame.columns) == COLUMNS
    X = design_points(study)
    assert_array_equal(frame[["A14", "A23"]].to_numpy(), X)
    failed = X[:, 0] > 0.098
    assert 0 < failed.sum() < len(X)
    assert_array_equal(frame["status"] == "failed", failed)
    assert_array_equal(frame["w"].isna(), failed)
    assert set(frame["reason"][failed]) == {"no equilibrium was found"}
    assert_allclose(frame["w"][~failed], 100 * X[~failed].sum(axis=1))


def test_shards_are_read_by_plain_pandas_with_stable_types(tmp_path, study, solver):
    study.run(tmp_path / "runs", solver=solver)
    shards = sorted((tmp_path / "runs" / "shards").glob("*.parquet"))
    assert len(shards) == 4
    for shard in shards:
        frame = pd.read_parquet(shard)
        types = [str(kind) for kind in frame.dtypes]
        assert types[:4] == ["float64"] * 4
        assert types[6:] == ["float64", "float64", "int32", "int32", "float64"]
        assert frame["reason"].notna().all()
    whole = pd.read_parquet(tmp_path / "runs" / "shards")
    assert len(whole) == 64


def test_running_again_computes_nothing(tmp_path, study, counting):
    first = study.run(tmp_path, solver=counting).frame()
    again = study.run(tmp_path, solver=counting).frame()
    assert counting.n_runs == 64
    assert_frame_equal(first, again)


@pytest.mark.parametrize(
    ("design", "extended"),
    [
        ({"sampler": "sobol", "sizes": 40}, {"sampler": "sobol", "sizes": 100}),
        ({"sampler": "latin_hypercube", "sizes": 30}, {"sampler": "latin_hypercube", "sizes": [30, 10]}),
        ({"sampler": "full_factorial", "levels": 5}, {"sampler": "full_factorial", "levels": 9}),
    ],
    ids=["sobol", "latin_hypercube", "full_factorial"],
)
def test_a_larger_design_computes_the_new_points_only(tmp_path, content, counting, design, extended):
    content["design"] = design
    parse_study(content).run(tmp_path, solver=counting)
    content["design"] = extended
    study = parse_study(content)
    frame = study.run(tmp_path, solver=counting).frame()
    assert counting.n_runs == study.n_points == len(frame)
    assert_array_equal(frame[["A14", "A23"]].to_numpy(), design_points(study))


def test_a_point_that_the_design_repeats_is_run_once_and_shown_as_often(tmp_path, content, counting):
    content["variables"]["A14"]["distribution"] = {"discrete": {"values": [0.09, 0.095]}}
    content["variables"]["A23"]["distribution"] = {"discrete": {"values": [0.07, 0.08, 0.09]}}
    seen = []
    study = parse_study(content)
    campaign = study.run(tmp_path, solver=counting, progress=lambda *counts: seen.append(counts))
    assert counting.n_runs == 6
    assert len(campaign.frame()) == 64
    assert seen[-1] == (64, 64, 0)


def test_progress_counts_up_to_the_end(tmp_path, study, solver):
    seen = []
    campaign = study.run(tmp_path, solver=solver, progress=lambda *counts: seen.append(counts))
    n_failed = campaign.state().n_failed
    assert [done for done, _, _ in seen] == [0, 16, 32, 48, 64]
    assert {total for _, total, _ in seen} == {64}
    assert seen[-1] == (64, 64, n_failed)
    assert n_failed > 0


def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path, study, counting):
    def interrupt(done, *_):
        if done == 32:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study.run(tmp_path / "a", solver=counting, progress=interrupt)
    state = open_campaign(tmp_path / "a").state()
    assert (state.n_done, state.n_pending, state.driver) == (32, 32, None)
    resumed = study.run(tmp_path / "a", solver=counting)
    # The block under way, which nobody was there to store, is lost; no more than that.
    assert counting.n_runs <= 64 + 16
    undisturbed = study.run(tmp_path / "b", solver=counting)
    assert_frame_equal(resumed.frame(), undisturbed.frame(), check_exact=True)


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-100])


def alter(path):
    content = bytearray(path.read_bytes())
    # Within the numbers of the first column, which no reader would miss.
    content[len(content) // 20] ^= 0xFF
    path.write_bytes(content)


def empty(path):
    path.write_bytes(b"")


@pytest.mark.parametrize("spoil", [cut_short, alter, empty], ids=["cut_short", "altered", "empty"])
def test_a_spoilt_shard_is_set_aside_and_computed_again(tmp_path, study, counting, caplog, spoil):
    campaign = study.run(tmp_path, solver=counting)
    expected = campaign.frame()
    victim = campaign.store.paths()[1]
    spoil(victim)
    left_over = victim.with_name(".00000000-x.41.writing.parquet")
    left_over.write_bytes(b"half")
    with pytest.raises(StudyError, match=f"{victim.name}: cannot be read .*; run the study again"):
        campaign.state()
    assert_frame_equal(study.run(tmp_path, solver=counting).frame(), expected)
    assert counting.n_runs == 64 + 16
    assert "its runs are solved again" in caplog.text
    assert [path.name for path in (tmp_path / "broken").iterdir()] == [victim.name]
    assert not left_over.exists()


def test_a_shard_that_cannot_be_written_is_told_and_leaves_nothing(tmp_path, study, solver, monkeypatch):
    import pyarrow.parquet as pq

    write = pq.write_table
    calls = []

    def fail_on_the_third(table, file, **options):
        calls.append(table)
        if len(calls) == 3:
            raise OSError(28, "No space left on device")
        write(table, file, **options)

    monkeypatch.setattr(pq, "write_table", fail_on_the_third)
    with pytest.raises(StudyError, match=r"cannot be written .no space left on device.; the shards"):
        study.run(tmp_path, solver=solver)
    assert open_campaign(tmp_path).state().n_done == 32
    assert [path.name for path in (tmp_path / "shards").iterdir() if path.suffix != ".parquet"] == []
    assert study.run(tmp_path, solver=solver).state().n_pending == 0


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"changes": {"gravity": [0, 0, 0]}}, "structure"),
        ({"solver": {"policy": "stop"}}, "solver"),
        ({"derivatives": True}, "derivatives"),
    ],
)
def test_the_folder_of_another_study_is_refused(tmp_path, content, solver, change, part):
    parse_study(content).run(tmp_path, solver=solver)
    message = f"holds the campaign of another study, 'study', of which {part} differ"
    with pytest.raises(StudyError, match=message):
        parse_study(content | change).run(tmp_path, solver=solver)


def test_a_folder_with_something_else_is_refused(tmp_path, study, solver):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(StudyError, match=r"found 'thesis.tex' and no campaign"):
        study.run(tmp_path, solver=solver)


def test_a_campaign_is_opened_without_the_original_files(tmp_path, content, solver):
    points = "A14,A23\n0.0951,0.08\n0.09,0.1\n"
    (tmp_path / "points.csv").write_text(points)
    content["design"] = {"sampler": "file", "file": "points.csv"}
    study = parse_study(content, tmp_path)
    frame = study.run(tmp_path / "runs", solver=solver).frame()
    (tmp_path / "points.csv").unlink()
    (tmp_path / "runs").rename(tmp_path / "moved")
    campaign = open_campaign(tmp_path / "moved")
    assert campaign.study.fingerprint == study.fingerprint
    assert_frame_equal(campaign.frame(), frame)
    manifest = json.loads((tmp_path / "moved" / "manifest.json").read_text())
    assert manifest["units"] == {"A14": "", "A23": "", "w": "cm", "T_K1": "kN"}
    assert manifest["seed"] == 1
    assert {"tensegra", "numpy"} <= set(manifest["versions"])


def test_what_is_no_campaign_is_not_opened(tmp_path):
    with pytest.raises(StudyError, match="no campaign is here"):
        open_campaign(tmp_path)
    (tmp_path / "manifest.json").write_text('{"schema": "tensegra/campaign/0"}')
    with pytest.raises(StudyError, match="found 'tensegra/campaign/0', expected tensegra/campaign/1"):
        open_campaign(tmp_path)


def test_a_tampered_study_is_noticed(tmp_path, study, solver):
    study.run(tmp_path, solver=solver)
    resolved = json.loads((tmp_path / "study.json").read_text())
    set_at(resolved, "variables.A14.distribution.uniform.low", 0.08)
    (tmp_path / "study.json").write_text(json.dumps(resolved))
    with pytest.raises(StudyError, match="not the study that the rows belong to"):
        open_campaign(tmp_path)


def test_training_data_are_the_certified_rows(tmp_path, study, solver):
    campaign = study.run(tmp_path, solver=solver)
    data = campaign.training_data()
    X = design_points(study)
    assert_array_equal(data.X, X[X[:, 0] <= 0.098])
    assert data.input_names == ("A14", "A23")
    assert data.output_units == ("cm", "kN")
    assert_allclose(data.bounds, [[0.09, 0.10], [0.07, 0.10]])
    assert data.study_fingerprint == study.fingerprint
    assert data.distributions == study.space.distributions
    assert campaign.training_data(["T_K1"]).output_names == ("T_K1",)
    with pytest.raises(StudyError, match="did you mean 'w'"):
        campaign.training_data(["W"])


def test_a_campaign_without_a_certified_row_teaches_nothing(tmp_path, content, solver):
    content["variables"]["A14"]["distribution"] = {"uniform": [0.0985, 0.1]}
    campaign = parse_study(content).run(tmp_path, solver=solver)
    with pytest.raises(StudyError, match="found none of 64 runs to learn from"):
        campaign.training_data()


def test_the_state_counts_statuses_and_reasons(tmp_path, study, solver):
    state = study.run(tmp_path, solver=solver).state()
    assert (state.n_points, state.n_done, state.n_pending) == (64, 64, 0)
    assert sum(state.statuses.values()) == 64
    assert state.reasons["no equilibrium was found"] == state.n_failed
    assert state.seconds_per_run == pytest.approx(1e-3)
    assert state.driver is None
    assert np.isnan(state.seconds_left)


def test_the_order_of_the_results_makes_no_difference(tmp_path, study, solver):
    class Backwards:
        threads = 1

        def map(self, function, tasks):
            return InProcess().map(function, reversed(list(tasks)))

    one = study.run(tmp_path / "a", executor=Backwards(), solver=solver)
    two = study.run(tmp_path / "b", solver=solver)
    assert_frame_equal(one.frame(), two.frame(), check_exact=True)


def test_a_solver_that_breaks_ends_the_campaign_with_its_error(tmp_path, study, solver):
    calls = []

    def breaks(structure, **inputs):
        calls.append(1)
        if len(calls) == 3:
            raise ZeroDivisionError
        return solver(structure, **inputs)

    with pytest.raises(ZeroDivisionError):
        study.run(tmp_path, solver=breaks)
    assert open_campaign(tmp_path).state().n_done == 32
    assert study.run(tmp_path, solver=solver).state().n_pending == 0


@pytest.fixture
def with_derivatives(content):
    content["derivatives"] = True
    content["outputs"]["k"] = {"lowest_eigenvalue": True}
    set_at(content, "design.sizes", 24)
    return parse_study(content)


def test_derivatives_are_columns_and_training_data(tmp_path, with_derivatives):
    study = with_derivatives
    campaign = study.run(tmp_path)
    names = [derivative_name(output, name) for output in ("w", "T_K1") for name in ("A14", "A23")]
    assert list(campaign.frame().columns[-4:]) == names == ["dw/dA14", "dw/dA23", "dT_K1/dA14", "dT_K1/dA23"]
    X = design_points(study)
    expected = study.evaluate(X, derivatives=True).dY
    data = campaign.training_data(["T_K1", "w"])
    assert_array_equal(data.dY, expected[:, [1, 0]])
    # The lowest eigenvalue has none.
    assert campaign.training_data().dY is None
    assert campaign.training_data(["k"]).dY is None
    reopened = open_campaign(tmp_path)
    assert reopened.study.derivatives
    assert_frame_equal(reopened.frame(), campaign.frame())


def test_a_selected_run_without_a_derivative_is_left_out_and_counted(tmp_path, with_derivatives, caplog):
    campaign = with_derivatives.run(tmp_path)
    frame = campaign.frame()
    frame.loc[[3, 7], "dw/dA14"] = np.nan
    data = campaign._with_derivatives(campaign.training_data(["w"]), frame)
    assert data.n_points == 22
    assert_array_equal(data.X, design_points(with_derivatives)[[i for i in range(24) if i not in {3, 7}]])
    assert "2 selected runs have no derivative" in caplog.text


def sizes(blocks, seconds_per_run, delay=0):
    """Return the sizes of the blocks where each run takes some seconds, told `delay` blocks late."""
    seen = []
    for block in blocks:
        seen.append(len(block.points))
        if len(seen) > delay:
            n = seen[len(seen) - 1 - delay]
            blocks.learn(n, n * seconds_per_run)
    return seen


@pytest.mark.parametrize("delay", [0, 3])
@pytest.mark.parametrize(
    ("n_points", "seconds_per_run", "largest"),
    [
        (100_000, 1e-5, 6250),  # a sixteenth of the campaign
        (10_000_000, 1e-5, 16_384),
        (100_000, 1e-2, 100),  # a second
        (100_000, 10.0, 16),
        (20, 1e-5, 16),
    ],
)
def test_blocks_take_a_second_within_limits(n_points, seconds_per_run, largest, delay):
    points = np.arange(n_points)
    seen = sizes(Blocks(np.zeros((n_points, 1)), points), seconds_per_run, delay)
    assert sum(seen) == n_points
    assert seen[0] == BLOCK_SIZES[0]
    assert max(seen) == largest


def test_blocks_are_the_points_in_order():
    X = np.arange(100.0)[:, None]
    blocks = list(Blocks(X, np.flatnonzero(np.arange(100) % 3)))
    assert_array_equal(np.concatenate([block.points for block in blocks]), np.flatnonzero(np.arange(100) % 3))
    assert_array_equal(
        np.concatenate([block.X for block in blocks])[:, 0], np.flatnonzero(np.arange(100) % 3)
    )


def test_what_is_pending_is_told_without_a_trace(tmp_path, study, content, solver):
    assert_array_equal(pending_points(study), np.arange(64))
    assert_array_equal(pending_points(study, tmp_path / "nowhere"), np.arange(64))
    assert not (tmp_path / "nowhere").exists()
    study.run(tmp_path / "runs", solver=solver)
    set_at(content, "design.sizes", 80)
    assert_array_equal(pending_points(parse_study(content), tmp_path / "runs"), np.arange(64, 80))
    content["changes"] = {"gravity": [0, 0, 0]}
    with pytest.raises(StudyError, match="holds the campaign of another study"):
        pending_points(parse_study(content), tmp_path / "runs")
