"""What every kind of surrogate promises; a new kind is added to `CASES` and has to pass."""

import zipfile

import numpy as np
import pytest

from tensegra.errors import StudyError
from tensegra.study.data import TrainingData
from tensegra.surrogate import KINDS, OutsideBoxWarning, RegimeData, Surrogate, fit, load

NAMES = ("A14", "T_top", "E_c")
BOX = np.array([[0.05, 0.10], [0.0, 150.0], [1.1e4, 1.2e4]])  # inputs of very different sizes

# Kind, options, whether it learns from derivatives, and the error (Eq. 7) that it must reach with 150 runs of
# an analytic function: one to two orders above what was measured.
CASES = {
    "gpr": ("gpr", {}, False, 1e-6),
    "gpr, inducing points": ("gpr", {"exact_limit": 50, "inducing_points": 80, "subset": 80}, False, 1e-4),
    "nn": ("nn", {"hidden": (8, 8), "iterations": 40}, False, 1e-3),
    "nn, derivatives": ("nn", {"hidden": (8,), "iterations": 40}, True, 1e-2),
    "nn, ensemble": ("nn", {"hidden": (6,), "iterations": 30, "ensemble": 3}, False, 1e-2),
    "nn, two stages": (
        "nn",
        {"training": "two_stage", "hidden": (12, 12), "adam_iterations": 300, "iterations": 300},
        False,
        1e-2,
    ),
    "pce": ("pce", {}, False, 1e-6),
    "pce, derivatives": ("pce", {}, True, 1e-6),
    "pce, one degree": ("pce", {"degree": 3}, False, 1e-3),
    "field": ("field", {}, False, 1e-5),
    "field, derivatives": ("field", {}, True, 1e-5),
    "field of processes": ("field", {"amplitudes": "gpr"}, False, 1e-5),
    "piecewise": ("piecewise", {}, False, 1e-6),
    "piecewise, two regimes": ("piecewise", {"piece": "pce", "iterations": 200}, False, 1e-5),
}

LARGE_STEP, SMALL_STEP = 1e-3, 5e-4  # of the box: well above rounding, small beside the function's waves
ANY_SLOPE = 0.15  # allowed below the second order that a remainder falls with
ROUNDING = 1e-11  # remainders below it (relative) are rounding and have no order


def truth(X):
    """Move a tip as a beam's does: two outputs of opposite curvature, never zero."""
    a, t, e = ((X - BOX[:, 0]) / (BOX[:, 1] - BOX[:, 0])).T
    v = 14 + 3 * np.sin(a + 0.4 * t) - t * e / 2
    w = 53 * np.exp(0.1 * a) - 2 * np.sqrt(1 + t) + 0.5 * np.cos(e + a)
    return np.stack([v, w], axis=1)


def truth_slopes(X):
    """Differentiate `truth`; shape (n, 2, 3)."""
    a, t, e = ((X - BOX[:, 0]) / (BOX[:, 1] - BOX[:, 0])).T
    slope = np.empty((len(X), 2, 3))
    slope[:, 0, 0], slope[:, 0, 1] = 3 * np.cos(a + 0.4 * t), 1.2 * np.cos(a + 0.4 * t) - e / 2
    slope[:, 0, 2] = -t / 2
    slope[:, 1, 0] = 5.3 * np.exp(0.1 * a) - 0.5 * np.sin(e + a)
    slope[:, 1, 1], slope[:, 1, 2] = -1 / np.sqrt(1 + t), -0.5 * np.sin(e + a)
    return slope / (BOX[:, 1] - BOX[:, 0])


def points(n, seed):
    return np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], size=(n, 3))


def runs(n, *, derivatives, seed=0):
    X = points(n, seed)
    return TrainingData(
        X=X,
        Y=truth(X),
        dY=truth_slopes(X) if derivatives else None,
        input_names=NAMES,
        output_names=("v", "w"),
        input_units=("", "degC", "kN/cm^2"),
        output_units=("cm", "cm"),
        bounds=BOX,
        study_fingerprint="f00d",
    )


def trained(case, **changes):
    kind, options, derivatives, _ = CASES[case]
    data = runs(150, derivatives=derivatives)
    if case.endswith("two regimes"):
        regimes = np.where(data.X[:, 0] < BOX[0].mean(), "left", "right")
        nothing = np.zeros((0, 3))
        data = RegimeData(runs=data, regimes=regimes, fallen_X=nothing, fallen=np.zeros(0, dtype=str))
    return fit(
        data,
        kind,
        validation=runs(80, derivatives=False, seed=7),
        **options,
        **changes,
    )


@pytest.fixture(scope="module", params=list(CASES))
def case(request):
    return request.param


@pytest.fixture(scope="module")
def surrogate(case):
    return trained(case)


def test_every_kind_is_in_the_suite():
    assert {kind for kind, *_ in CASES.values()} == set(KINDS)


def test_shapes(surrogate):
    X = points(9, 3)
    assert surrogate.predict(X).shape == (9, 2)
    assert surrogate.gradient(X).shape == (9, 2, 3)
    assert surrogate.predict(X[:0]).shape == (0, 2)
    assert surrogate.gradient(X[:0]).shape == (0, 2, 3)


def test_it_says_what_it_is(surrogate, case):
    assert surrogate.input_names == NAMES
    assert surrogate.output_names == ("v", "w")
    assert surrogate.n_train == 150
    assert surrogate.seconds > 0
    assert surrogate.study_fingerprint == "f00d"
    assert repr(surrogate).startswith(
        f"Surrogate('{CASES[case][0]}': A14, T_top, E_c → v, w; 150 runs; error "
    )
    assert repr(surrogate).endswith("relative (Eq. 7, held out 80))")
    assert "degC" in surrogate.describe()


def test_it_is_accurate_and_its_validation_says_so(surrogate, case):
    X = points(80, 7)
    error = np.mean(np.abs(surrogate.predict(X) - truth(X)) / np.abs(truth(X)), axis=0)
    assert surrogate.validation.relative_error == pytest.approx(tuple(error))
    assert max(error) < CASES[case][3]
    assert min(surrogate.validation.r2) > 0.99


def test_points_do_not_see_each_other(surrogate):
    """A block of many points gives what its rows give alone, up to the order of summation."""
    X = points(2100, 5)
    one_by_one = np.concatenate([surrogate.predict(X[i : i + 1]) for i in (0, 1023, 1024, 2048, 2099)])
    # The weights of a process are large and of alternating sign; the order of their sum shows at 1e-9.
    np.testing.assert_allclose(surrogate.predict(X)[[0, 1023, 1024, 2048, 2099]], one_by_one, rtol=1e-8)


def test_gradient_is_the_derivative(surrogate):
    """The remainder of the first-order expansion falls with the square of the step (Taylor slope)."""
    rng = np.random.default_rng(11)
    middle = BOX.mean(axis=1) + 0.3 * (BOX[:, 1] - BOX[:, 0]) * rng.uniform(-1, 1, size=(6, 3))
    direction = (BOX[:, 1] - BOX[:, 0]) * rng.normal(size=(6, 3))
    value = surrogate.predict(middle)
    slope = np.einsum("nki,ni->nk", surrogate.gradient(middle), direction)

    def remainder(step):
        # Central, so that its first term is of the third order for an exact gradient.
        ahead, behind = (
            surrogate.predict(middle + step * direction),
            surrogate.predict(middle - step * direction),
        )
        return np.linalg.norm((ahead - behind) / 2 - step * slope)

    large, small = remainder(10 * LARGE_STEP), remainder(10 * SMALL_STEP)
    if large > 1e-7 * np.linalg.norm(value):
        assert np.log2(large / small) > 3 - ANY_SLOPE
    assert small < 1e-4 * 10 * SMALL_STEP * np.linalg.norm(slope)


def test_saved_and_loaded_it_predicts_the_same_bits(surrogate, tmp_path):
    path = surrogate.save(tmp_path / "beam.tg")
    loaded = load(path)
    X = points(50, 4)
    assert np.array_equal(loaded.predict(X), surrogate.predict(X))
    assert np.array_equal(loaded.gradient(X), surrogate.gradient(X))
    if surrogate.has_std:
        assert np.array_equal(loaded.predict(X, return_std=True)[1], surrogate.predict(X, return_std=True)[1])
    assert repr(loaded) == repr(surrogate)
    assert loaded.validation == surrogate.validation
    for name in ("kind", "input_names", "output_names", "input_units", "output_units", "n_train", "seconds"):
        assert getattr(loaded, name) == getattr(surrogate, name)
    assert np.array_equal(loaded.bounds, surrogate.bounds)
    assert loaded.study_fingerprint == "f00d"
    assert loaded.save(tmp_path / "again.tg").read_bytes() == path.read_bytes()


def test_nothing_in_the_file_is_pickled(surrogate, tmp_path):
    with zipfile.ZipFile(surrogate.save(tmp_path / "beam.tg")) as archive:
        for name in archive.namelist():
            assert name in {"surrogate.json", "sums.json"} or name.endswith(".npy")
            if name.endswith(".npy"):
                with archive.open(name) as entry:
                    assert not np.lib.format.read_array(entry, allow_pickle=False).dtype.hasobject


def test_columns_go_by_name_where_they_have_one(surrogate):
    X = points(5, 6)
    table = {"E_c": X[:, 2], "unused": np.zeros(5), "A14": X[:, 0], "T_top": X[:, 1]}
    assert np.array_equal(surrogate.predict(table), surrogate.predict(X))
    with pytest.raises(StudyError, match="A14, T_top, E_c"):
        surrogate.predict({"A14": X[:, 0]})


@pytest.mark.parametrize("shape", [(5, 2), (5, 4), (3,), (5, 3, 1)])
def test_wrong_number_of_columns_is_refused(surrogate, shape):
    with pytest.raises(StudyError, match=r"the columns A14, T_top, E_c in this order"):
        surrogate.predict(np.full(shape, 0.07))


def test_a_number_that_is_not_finite_is_refused(surrogate):
    X = points(4, 1)
    X[2, 1] = np.nan
    with pytest.raises(StudyError, match=r"T_top of point 2: found nan"):
        surrogate.predict(X)


def test_outside_its_box_it_warns(surrogate):
    X = points(4, 1)
    X[3, 1] = 151.0
    assert surrogate.inside(X).tolist() == [True, True, True, False]
    with pytest.warns(OutsideBoxWarning, match=r"1 of 4 points lie outside .* \(T_top\)"):
        surrogate.predict(X)
    with pytest.warns(OutsideBoxWarning):
        surrogate.gradient(X)
    surrogate.predict(BOX.T)  # the corners belong to it


def test_standard_deviation_is_not_negative_or_refused(surrogate):
    X = points(300, 8)
    if not surrogate.has_std:
        with pytest.raises(StudyError, match="no standard deviation"):
            surrogate.predict(X, return_std=True)
        return
    Y, std = surrogate.predict(X, return_std=True)
    assert np.array_equal(Y, surrogate.predict(X))
    assert std.shape == (300, 2)
    assert np.all(std >= 0)
    at_runs = surrogate.predict(points(150, 0), return_std=True)[1]
    assert np.mean(at_runs) <= np.mean(std) * 1.05  # it knows best where it has been


def test_the_same_seed_gives_the_same_surrogate(surrogate, case):
    X = points(20, 2)
    assert np.array_equal(trained(case).predict(X), surrogate.predict(X))


def test_an_output_that_does_not_vary_is_learnt(case):
    kind, options, _, _ = CASES[case]
    X = points(60, 0)
    Y = np.stack([truth(X)[:, 0], np.full(60, 5.0)], axis=1)
    surrogate = fit((X, Y), kind, validation=None, **options)
    assert surrogate.validation is None
    np.testing.assert_allclose(surrogate.predict(X)[:, 1], 5.0, atol=1e-2)
    np.testing.assert_allclose(surrogate.gradient(X)[:, 1] * (BOX[:, 1] - BOX[:, 0]), 0.0, atol=0.1)


def test_an_input_that_does_not_vary_does_no_harm(case):
    kind, options, _, _ = CASES[case]
    X = points(60, 0)
    X[:, 1] = 20.0
    surrogate = fit((X, truth(X)), kind, validation=None, **options)
    assert np.all(np.isfinite(surrogate.predict(X)))
    np.testing.assert_allclose(surrogate.predict(X), truth(X), rtol=2e-2)


def test_an_unknown_option_is_refused(case):
    kind = CASES[case][0]
    with pytest.raises(StudyError, match=f"options of {kind}: found 'iterationz'"):
        fit(runs(20, derivatives=False), kind, iterationz=3)


def test_load_is_a_class_method_too(surrogate, tmp_path):
    assert Surrogate.load(surrogate.save(tmp_path / "a.tg")).kind == surrogate.kind
