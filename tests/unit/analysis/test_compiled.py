"""What compiled optimisers are handed, and what comes of it: optima as good as SciPy's own."""

import ast
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

import tensegra.analysis
from tensegra.analysis import FunctionModel, SurrogateModel, optimise, reach
from tensegra.analysis.compiled import minimise
from tensegra.analysis.model import central_differences
from tensegra.surrogate import RegimeData, fit

FOLDER = Path(tensegra.analysis.__file__).parent
COMPILED = {"minimize", "least_squares", "root", "fmin_slsqp", "fmin_l_bfgs_b"}

OPTIONS = {
    "pce": {},
    "gpr": {},
    "nn": {"hidden": (12,), "ensemble": 1},
    "piecewise": {},
    "field": {},
}
# The share by which two optima of one smooth function may differ.
SAME_OPTIMUM = 1e-8


def outputs(X):
    a, b, c, d = X.T
    return np.column_stack([2 * a + b - 0.7 * c**2 + 0.4 * a * d, a + c + b**2, d])


def data(kind):
    X = np.random.default_rng(0).uniform(-1, 1, (300, 4))
    if kind == "piecewise":
        return RegimeData.of(X, outputs(X), np.full(len(X), "taut"))
    return X, outputs(X)


def test_one_module_alone_calls_the_compiled_optimisers():
    for path in FOLDER.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("scipy"):
                taken = {alias.name for alias in node.names} & (COMPILED | {"optimize"})
                assert not taken or path.name == "compiled.py", f"{path.name} imports {taken}"


@pytest.mark.parametrize("method", ["SLSQP", "L-BFGS-B"])
@pytest.mark.parametrize(
    "layout", [np.asfortranarray, lambda A: np.repeat(A, 2, axis=-1)[..., ::2], np.float32]
)
def test_the_layout_of_a_callbacks_answer_is_of_no_consequence(method, layout):
    Q = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.5], [0.0, 0.5, 2.0]])
    lines = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.0]])

    def value(z):
        return 0.5 * z @ Q @ z - z.sum(), layout((Q @ z - 1.0)[None])[0]

    conditions = [("ineq", lambda z: 0.5 - lines @ z, lambda _: layout(-lines))] if method == "SLSQP" else []
    found = minimise(
        value,
        np.full(3, 0.9),
        method=method,
        bounds=[(-1, 1)] * 3,
        constraints=conditions,
        options={"ftol": 1e-13},
    )
    exact = minimize(
        lambda z: 0.5 * z @ Q @ z - z.sum(),
        np.zeros(3),
        bounds=[(-1, 1)] * 3,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda z: 0.5 - lines @ z} if conditions else (),
        options={"ftol": 1e-14},
    )
    assert_allclose(found.x, exact.x, atol=1e-4 if layout is np.float32 else 1e-5)


@pytest.mark.parametrize("kind", OPTIONS)
def test_twenty_starts_find_what_scipy_finds_from_the_best_start(kind):
    surrogate = fit(data(kind), kind, seed=1, **OPTIONS[kind])
    names = surrogate.output_names
    best = optimise(surrogate, names[0], constraints=[f"{names[1]} <= 0.5"], starts=20)
    bounds = np.array(surrogate.bounds)

    def ask(x):
        return surrogate.predict(np.clip(x, *bounds.T)[None])[0]

    def slope(x):
        return np.array(surrogate.gradient(np.clip(x, *bounds.T)[None])[0], order="C")

    ends = [
        minimize(
            lambda x: -ask(x)[0],
            start,
            jac=lambda x: -slope(x)[0].copy(),
            bounds=bounds,
            method="SLSQP",
            constraints={
                "type": "ineq",
                "fun": lambda x: 0.5 - ask(x)[1],
                "jac": lambda x: -slope(x)[1].copy(),
            },
            options={"ftol": 1e-15, "maxiter": 500},
        )
        for start in np.random.default_rng(1).uniform(*bounds.T, (10, 4))
    ]
    kept = [end for end in ends if ask(end.x)[1] <= 0.5 + 1e-9]
    theirs = max(-end.fun for end in kept)
    assert best.objective >= theirs - SAME_OPTIMUM * abs(theirs)
    assert best.outputs[names[1]] <= 0.5 + 1e-7
    assert best.agreement.n_best >= 10


def test_few_starts_that_agree_are_told():
    # 25 hills, one of which is a little higher
    def hills(X):
        return (
            np.cos(10 * np.pi * X[:, 0])
            + np.cos(10 * np.pi * X[:, 1])
            + 0.1 * np.exp(-20 * ((X - 0.6) ** 2).sum(1))
        )

    model = FunctionModel(hills, ("a", "b"), ("y",), np.array([[0.0, 1.0]] * 2))
    best = optimise(model, "y", starts=20)
    assert 2 * best.agreement.n_best < 20
    assert "fewer than half agree" in best.reason
    assert "fewer than half agree" not in optimise(model, "-(a - 0.3) ** 2", starts=20).reason


def test_few_starts_that_converge_are_told(monkeypatch):
    monkeypatch.setattr("tensegra.analysis.slsqp.MAX_ITERATIONS", 1)
    model = FunctionModel(
        lambda X: np.exp(X[:, 0] * X[:, 1]), ("a", "b"), ("y",), np.array([[-1.0, 1.0]] * 2)
    )
    best = optimise(model, "y - a ** 2 - b ** 4", starts=10)
    assert "fewer than half converged, most of the others say: Iteration limit reached" in best.reason


@pytest.mark.parametrize("own", [None, np.array([[-5.0, 5.0]] * 2)], ids=["unbounded", "wider"])
def test_no_difference_step_leaves_the_search_box(own):
    low, high = np.array([0.2, -0.1]), np.array([0.4, 0.3])
    asked = []

    def function(X):
        asked.append(X.copy())
        return ((X - high - 1) ** 2).sum(axis=1)

    model = FunctionModel(function, ("a", "b"), ("y",), own)
    bounds = {"a": [low[0], high[0]], "b": [low[1], high[1]]}
    for ask in (
        lambda: optimise(model, "y", bounds=bounds, maximise=False, starts=5),
        lambda: optimise(model, "y", bounds=bounds, method="bfgs", starts=5),
        lambda: reach(model, {"y": [3.0, 4.0]}, bounds=bounds, starts=5),
    ):
        ask()
    X = np.concatenate(asked)
    assert np.all((low <= X) & (high >= X))
    assert not np.allclose(X.min(axis=0), X.max(axis=0))


def test_differences_beyond_the_box_are_still_derivatives():
    model = FunctionModel(lambda X: X[:, 0] ** 2, ("a",), ("y",), np.array([[0.0, 1.0]]))
    assert_allclose(
        central_differences(model, np.array([[-1.0], [0.5], [2.0]]))[:, 0, 0], [-2, 1, 4], atol=2e-3
    )


def test_surrogate_gradients_are_strided_so_the_test_above_means_something():
    surrogate = fit(data("pce"), "pce")
    assert not SurrogateModel(surrogate).gradient(np.zeros((5, 4))).flags.c_contiguous
