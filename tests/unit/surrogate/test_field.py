import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.mechanics import solve_batch
from tensegra.structure import library
from tensegra.study.data import TrainingData
from tensegra.surrogate import field_arrays, field_runs, fit, load

BOX = np.array([[0.09, 0.10], [0.09, 0.10], [0.0, 100.0]])


def batch(n, seed=0):
    a, b, t = np.random.default_rng(seed).uniform(*BOX.T, size=(n, 3)).T
    return solve_batch(library.paper_beam(), actuation={"A14": a, "A23": b}, temperature={"top": t})


@pytest.fixture(scope="module")
def runs():
    return batch(200)


@pytest.fixture(scope="module")
def surrogate(runs):
    return fit(field_runs(runs, bounds=BOX), "field", validation=batch(100, seed=1))


def test_all_nodes_and_tensions_from_a_batch(surrogate):
    assert surrogate.input_names == ("A14", "A23", "top")
    assert len(surrogate.output_names) == 3 * 24 + 48
    assert (surrogate.output_units[0], surrogate.output_units[-1]) == ("cm", "kN")
    assert "x_1, y_1, z_1, x_2, … (120 in all)" in repr(surrogate)
    new = batch(50, seed=2)
    nodes, tensions = field_arrays(surrogate, surrogate.predict(field_runs(new).runs.X))
    # A tip moves by 50 cm, tensions are of some hundred kN; measured 1e-5 cm and 1e-4 kN.
    np.testing.assert_allclose(nodes, new.nodes, atol=1e-3)
    np.testing.assert_allclose(tensions, new.tensions, atol=1e-2)
    assert surrogate.validation.error < 1e-4
    assert np.median(surrogate.validation.coverage_90) == pytest.approx(0.9, abs=0.06)
    assert len(surrogate.model.modes) < 40


def test_gradient_is_the_batch_derivative(surrogate):
    new = batch(20, seed=3)
    slopes = surrogate.gradient(field_runs(new).runs.X)
    exact = field_runs(new, derivatives=True).runs.dY
    size = np.abs(exact).max(axis=(0, 1))  # of each input, whose units differ
    np.testing.assert_allclose(slopes / size, exact / size, atol=1e-3)


def test_batch_derivatives_are_those_of_the_runs(runs):
    data = field_runs(runs, derivatives=True)
    np.testing.assert_array_equal(
        data.runs.dY[:, :72, 2], runs.derivative("top", "temperature").nodes.reshape(200, 72)
    )
    np.testing.assert_array_equal(data.runs.dY[:, 72:, 0], runs.derivative("A14").tensions)


def test_fewer_modes_for_a_larger_tolerance(runs):
    sizes = [
        len(fit(runs, "field", validation=None, tolerance=t, options={"degree": 1}).model.modes)
        for t in (1e-1, 1e-3, 1e-5)
    ]
    assert sizes[0] < sizes[1] < sizes[2]
    data = field_runs(runs).runs
    T = (data.Y - data.Y.mean(axis=0)) / np.r_[
        np.full(72, data.Y[:, :72].std(axis=0).max()), np.full(48, data.Y[:, 72:].std(axis=0).max())
    ]
    singular = np.linalg.svd(T, compute_uv=False)
    left = np.sqrt(np.cumsum(singular[::-1] ** 2)[::-1] / np.sum(singular**2))
    assert sizes == [int(np.argmax(np.append(left, 0) <= t)) for t in (1e-1, 1e-3, 1e-5)]


def test_outputs_of_rank_two_take_two_modes():
    X = np.random.default_rng(0).uniform(size=(50, 2))
    amplitudes = np.stack([np.sin(X[:, 0]), X[:, 0] * X[:, 1]], axis=1)
    Y = 4 + amplitudes @ np.random.default_rng(1).normal(size=(2, 30))
    surrogate = fit((X, Y), "field", validation=10)
    assert len(surrogate.model.modes) == 2
    assert surrogate.validation.error < 1e-6


def test_an_input_varied_twice_keeps_two_names():
    names = field_runs(
        solve_batch(
            library.prism(),
            actuation={"top": [0.0, 0.01]},
            temperature={"top": [0.0, 1.0]},
            loads={("t1", "z"): [0.0, -0.1]},
        )
    ).runs.input_names
    assert names == ("top", "temperature_top", "Fz_t1")


def test_saved_and_loaded(surrogate, runs, tmp_path):
    loaded = load(surrogate.save(tmp_path / "field.tg"))
    X = field_runs(runs).runs.X
    assert np.array_equal(loaded.predict(X), surrogate.predict(X))
    assert field_arrays(loaded, loaded.predict(X)).nodes.shape == (200, 24, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "field: tolerance"),
        ({"max_modes": 0}, "field: max_modes"),
        ({"amplitudes": "field"}, "another kind"),
    ],
)
def test_wrong_options_are_refused(options, message):
    X = np.random.default_rng(0).uniform(size=(20, 2))
    with pytest.raises(StudyError, match=message):
        fit((X, X), "field", validation=None, **options)


def test_what_is_not_a_field_is_refused():
    data = TrainingData(X=np.arange(20.0)[:, None], Y=np.arange(20.0) ** 2, output_names=("w",))
    surrogate = fit(data, "pce", validation=None)
    with pytest.raises(StudyError, match="as field_runs names them"):
        field_arrays(surrogate, surrogate.predict([[1.0]]))
    with pytest.raises(StudyError, match="varies nothing"):
        field_runs(solve_batch(library.prism()))
