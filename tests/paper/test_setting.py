import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.mechanics import PathSettings
from tensegra_paper import setting as module
from tensegra_paper.beam_model import solve_beam
from tensegra_paper.setting import Setting

ACTUATION = np.linspace(0.01, 0.05, 10)
INPUTS = {"A14": ACTUATION, "A23": ACTUATION}


@pytest.fixture
def solved(monkeypatch):
    """Return the numbers of runs that are solved, a number for each call; a block holds four runs."""
    calls = []

    def counting(structure, inputs, *rest, **options):
        calls.append(len(inputs["A14"]))
        return solve_beam(structure, inputs, *rest, **options)

    monkeypatch.setattr(module, "solve_beam", counting)
    monkeypatch.setattr(module, "BLOCK", 4)
    return calls


@pytest.mark.parametrize(
    ("full", "least", "expected"), [(100_000, 1, 1000), (10_000, 500, 500), (50, 500, 50)]
)
def test_a_count_is_scaled_between_its_bounds(tmp_path, full, least, expected):
    assert Setting(tmp_path, scale=0.01).count(full, least) == expected


def test_at_full_scale_nothing_is_reduced(tmp_path):
    assert Setting(tmp_path).count(12_500, least=100) == 12_500


@pytest.mark.parametrize(
    ("scale", "full", "least", "expected"),
    [
        (1.0, 100_000, 1, 131_072),
        (0.01, 100_000, 1, 1024),
        (0.01, 10_000, 512, 512),
        (0.01, 10_000, 500, 512),
    ],
)
def test_a_power_of_two_stays_one(tmp_path, scale, full, least, expected):
    assert Setting(tmp_path, scale=scale).power_of_two(full, least) == expected


@pytest.mark.parametrize("scale", [0.0, -1.0, 1.5, float("nan")])
def test_a_scale_out_of_range_is_refused(tmp_path, scale):
    with pytest.raises(StudyError, match="--scale"):
        Setting(tmp_path, scale=scale)


def test_an_unknown_beam_is_refused_with_the_nearest_name(tmp_path):
    with pytest.raises(StudyError, match="did you mean 'paper_beam'"):
        Setting(tmp_path, "paper_bean")


def test_seeds_differ_by_name_and_by_seed(tmp_path):
    one, other = Setting(tmp_path, seed=1), Setting(tmp_path, seed=2)
    assert len({one.seed_of("a"), one.seed_of("b"), other.seed_of("a")}) == 3


def test_gravity_can_be_left_out(tmp_path):
    setting = Setting(tmp_path)
    assert setting.structure.gravity == (0.0, 0.0, -1.0)
    assert setting.without_gravity.gravity == (0.0, 0.0, 0.0)


def test_runs_are_solved_once(tmp_path, solved):
    setting = Setting(tmp_path)
    first = setting.runs("one", setting.structure, INPUTS)
    assert solved == [4, 4, 2]
    again = Setting(tmp_path).runs("one", setting.structure, INPUTS)
    assert solved == [4, 4, 2]
    assert again.seconds == first.seconds
    for name, array in first.to_arrays().items():
        np.testing.assert_array_equal(again.to_arrays()[name], array)


def test_blocks_are_put_together_in_order(tmp_path, solved):
    setting = Setting(tmp_path)
    runs = setting.runs("one", setting.structure, INPUTS)
    np.testing.assert_array_equal(runs.w, solve_beam(setting.structure, INPUTS).w)
    assert len(solved) == 3


def test_an_interrupted_design_goes_on_with_its_next_block(tmp_path, solved, monkeypatch):
    setting = Setting(tmp_path)
    counting = module.solve_beam

    def interrupted(*arguments, **options):
        if len(solved) == 1:
            raise KeyboardInterrupt
        return counting(*arguments, **options)

    monkeypatch.setattr(module, "solve_beam", interrupted)
    with pytest.raises(KeyboardInterrupt):
        setting.runs("one", setting.structure, INPUTS)
    monkeypatch.setattr(module, "solve_beam", counting)
    resumed = Setting(tmp_path)
    runs = resumed.runs("one", setting.structure, INPUTS)
    assert solved == [4, 4, 2]
    assert runs.n_runs == 10
    # Of the three blocks the first was solved before; its time is not of this process.
    assert sorted(seconds > 0.0 for seconds in resumed.spared.values()) == [False, False, True]


@pytest.mark.parametrize("what", ["inputs", "settings", "structure"])
def test_what_the_runs_depend_on_is_solved_again_when_it_changes(tmp_path, solved, what):
    setting = Setting(tmp_path)
    setting.runs("one", setting.structure, INPUTS)
    changed = {
        "inputs": lambda: setting.runs("one", setting.structure, INPUTS | {"A14": ACTUATION + 1e-9}),
        "settings": lambda: setting.runs("one", setting.structure, INPUTS, PathSettings(first_step=0.4)),
        "structure": lambda: setting.runs("one", setting.without_gravity, INPUTS),
    }
    changed[what]()
    assert solved == [4, 4, 2] * 2


def test_what_is_kept_depends_on_its_parts(tmp_path):
    setting = Setting(tmp_path)
    made = [
        setting.kept("x", parts, lambda v=v: {"x": np.array(v)})["x"] for parts, v in ((1, 1), (1, 2), (2, 3))
    ]
    assert [float(value) for value in made] == [1.0, 1.0, 3.0]
    assert float(Setting(tmp_path, scale=0.5).kept("x", 1, lambda: {"x": np.array(4.0)})["x"]) == 4.0
