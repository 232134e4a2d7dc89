import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.study import parse_study
from tensegra.surrogate import auto, choose, learn
from tensegra.surrogate.adaptive import _worst

BOX = [[0.0, 1.0], [0.0, 2.0]]


def bump(X):
    """Vary in a corner only."""
    return 1 + np.exp(-20 * ((X[:, 0] - 0.9) ** 2 + (X[:, 1] / 2 - 0.9) ** 2))


def wave(X):
    return np.stack([2 + np.sin(3 * X[:, 0] + X[:, 1]), np.exp(X[:, 0])], axis=1)


def wave_and_slopes(X):
    c = np.cos(3 * X[:, 0] + X[:, 1])
    zero = np.zeros(len(X))
    slopes = np.stack([np.stack([3 * c, c], axis=1), np.stack([np.exp(X[:, 0]), zero], axis=1)], axis=1)
    return wave(X), slopes


def test_batches_are_added_until_the_error_is_met():
    learnt = learn(wave, 1e-6, bounds=BOX)
    assert learnt.met
    assert learnt.surrogate.validation.error == learnt.rounds[-1].error <= 1e-6
    assert all(r.error > 1e-6 for r in learnt.rounds[:-1])
    assert [r.n_runs for r in learnt.rounds] == list(range(20, learnt.n_runs + 1, 10))
    assert learnt.surrogate.n_train == learnt.data.n_points == learnt.n_runs
    X = np.random.default_rng(0).uniform(size=(300, 2)) * [1, 2]
    assert np.abs(learnt.surrogate.predict(X) - wave(X)).mean() < 1e-5
    assert repr(learnt) == f"Learnt('pce': 1e-06 with {learnt.n_runs} runs)"


def test_derivatives_save_runs():
    learnt = learn(wave_and_slopes, 1e-6, bounds=BOX, compare=True)
    assert learnt.data.dY is not None
    assert learnt.n_runs < learnt.without_derivatives[-1].n_runs
    assert learnt.without_derivatives == learn(wave, 1e-6, bounds=BOX).rounds
    assert "; without derivatives 1e-06 with" in repr(learnt)


def test_the_limit_of_runs_is_kept_and_told():
    learnt = learn(bump, 1e-12, bounds=BOX, max_runs=37, batch=10)
    assert (learnt.n_runs, learnt.met) == (37, False)
    assert "1e-12 not met with 37 runs" in repr(learnt)


def test_runs_gather_where_the_error_is():
    learnt = learn(bump, 1e-12, bounds=BOX, kind="gpr", max_runs=100, batch=20)
    corner = np.all(learnt.data.X > [0.5, 1.0], axis=1)
    assert np.mean(corner[20:]) > 1.4 * np.mean(corner[:20])  # the first batch fills the space


def test_a_run_without_outputs_counts_but_is_not_learnt_from():
    def half(X):
        return np.where(X[:, 0] < 0.8, X[:, 0] ** 2 + X[:, 1], np.nan)

    learnt = learn(half, 1e-9, bounds=BOX)
    last = learnt.rounds[-1]
    assert last.n_valid < last.n_runs
    assert last.n_valid == learnt.data.n_points
    assert learnt.data.X[:, 0].max() < 0.8
    with pytest.raises(StudyError, match="none of 20 runs"):
        learn(lambda X: np.full(len(X), np.nan), 1e-3, bounds=BOX)


def test_worst_points_keep_apart():
    rng = np.random.default_rng(0)
    known, pool = rng.uniform(size=(30, 2)), rng.uniform(size=(400, 2))
    new = _worst(known, known, np.where(known[:, 0] > 0.5, 1.0, 1e-9), pool, 5)
    assert np.all(new[:, 0] > 0.35)
    apart = np.linalg.norm(new[:, None] - np.concatenate([known, new])[None], axis=2)
    apart[apart == 0] = np.inf
    assert apart.min() > 0.05


def test_a_study_is_asked_for_runs_and_derivatives():
    study = parse_study(
        {
            "schema": "tensegra/study/1",
            "structure": "library:paper_beam",
            "variables": {
                "A14": {"actuator": "A14", "distribution": {"uniform": [0.09, 0.10]}},
                "T": {"temperature": "top", "distribution": {"uniform": [0, 150]}},
            },
            "outputs": {"w": {"displacement": "z", "nodes": ["18", "23"]}},
            "design": {"sampler": "sobol", "sizes": 64},
        }
    )
    learnt = learn(study, 1e-7, compare=True, first=10, batch=4)
    assert learnt.met
    assert learnt.n_runs <= learnt.without_derivatives[-1].n_runs
    assert learnt.surrogate.input_names == ("A14", "T")
    assert learnt.surrogate.study_fingerprint == study.fingerprint


def test_the_first_batch_chooses_the_kind(monkeypatch):
    monkeypatch.setattr(auto, "CANDIDATES", auto.CANDIDATES[1::-1])
    learnt = learn(wave, 1e-2, bounds=BOX, kind="auto", max_runs=60)
    assert learnt.surrogate.kind == choose(learnt.data.rows(np.arange(20))).surrogate.kind


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"target_error": -1.0, "bounds": BOX}, "a positive error"),
        ({"target_error": 0.1, "bounds": BOX, "first": 5}, "10 runs or more at first"),
        ({"target_error": 0.1, "bounds": BOX, "batch": 1}, "2 or more in a batch"),
        ({"target_error": 0.1}, "learn: bounds"),
        ({"target_error": 0.1, "bounds": [[1, 0], [0, 1]]}, "learn: bounds"),
        ({"target_error": 0.1, "bounds": BOX, "compare": True}, "returned none"),
    ],
)
def test_what_cannot_be_is_refused(options, message):
    with pytest.raises(StudyError, match=message):
        learn(wave, **options)
