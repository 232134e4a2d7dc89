"""Expansions with more candidate terms than runs."""

import numpy as np
import pytest
from scipy.stats import qmc

from tensegra.study import TrainingData
from tensegra.study.distributions import as_distribution
from tensegra.surrogate import fit
from tensegra.surrogate.basis import Basis, recurrence, total_degree, uniform_quadrature, univariate
from tensegra.surrogate.leastsquares import LeastSquares, Rows
from tensegra.surrogate.prior import Sizes, _surprise, condition, likely_sizes
from tensegra.surrogate.pursuit import hyperbolic, pursue
from tensegra.surrogate.sparse import tried

G_WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0])
LOGNORMAL_R = {"lognormal": {"mean": 3698.3, "std": 3734.0}}


def legendre(n_inputs, degree=12):
    return np.stack([recurrence(*uniform_quadrature(-1, 1), degree)] * n_inputs)


def cube(n, d, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, size=(n, d))


def ishigami(X):
    return np.sin(X[:, 0]) + 7 * np.sin(X[:, 1]) ** 2 + 0.1 * X[:, 2] ** 4 * np.sin(X[:, 0])


def borehole(X):
    r_w, r, T_u, H_u, T_l, H_l, L, K_w = X.T
    log = np.log(r / r_w)
    return 2 * np.pi * T_u * (H_u - H_l) / (log * (1 + 2 * L * T_u / (log * r_w**2 * K_w) + T_u / T_l))


def g_function(X):
    return np.prod((np.abs(4 * X - 2) + G_WEIGHTS) / (1 + G_WEIGHTS), axis=1)


def uniform(*bounds):
    return [{"uniform": list(pair)} for pair in bounds]


# Function, laws, runs, and the largest relative mean square error: what OpenTURNS 1.27 reaches with LARS on
# the set of candidates that is best on the test points, a hundredth of that, or less.
GOALS = {
    "Ishigami": (ishigami, uniform(*[(-np.pi, np.pi)] * 3), 200, 1e-15),
    "Borehole": (
        borehole,
        [
            {"normal": {"mean": 0.1, "std": 0.0161812}},
            LOGNORMAL_R,
            *uniform((63070, 115600), (990, 1110), (63.1, 116), (700, 820), (1120, 1680), (9855, 12045)),
        ],
        100,
        1e-5,
    ),
    "G-function": (g_function, uniform(*[(0, 1)] * 8), 500, 5e-3),
}


@pytest.mark.parametrize("name", ["Ishigami", "Borehole", pytest.param("G-function", marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", [0, 1])
def test_known_functions_of_few_runs(name, seed):
    function, written, n, goal = GOALS[name]
    laws = tuple(as_distribution(law) for law in written)

    def points(unit):
        return np.column_stack([law.ppf(u) for law, u in zip(laws, unit.T, strict=True)])

    X = points(qmc.Sobol(len(laws), seed=seed).random_base2(9)[:n])
    bounds = np.array([law.box for law in laws])
    surrogate = fit(
        TrainingData(X=X, Y=function(X), distributions=laws, bounds=bounds), "pce", validation=None
    )
    new = np.clip(points(np.random.default_rng(9).uniform(size=(5000, len(laws)))), *bounds.T)
    predicted, std = surrogate.predict(new, return_std=True)
    error = np.abs(predicted[:, 0] - function(new))
    assert np.mean(error**2) < goal * np.var(function(new))
    if name != "Ishigami":  # which is exact to rounding
        assert 0.75 < np.mean(error < 1.645 * std[:, 0]) < 0.99


def test_products_need_no_order_and_no_parents():
    """A term whose divisors are not in the set, or behind it, is the product of its factors all the same."""
    Z, recurrences = cube(40, 3), legendre(3)
    indices = total_degree(3, 5)
    order = np.concatenate([[0], np.random.default_rng(1).permutation(np.arange(1, len(indices)))])
    ordered = Basis(recurrences, indices).values(Z)
    for chosen in (order, order[:9]):
        basis = Basis(recurrences, indices[chosen])
        np.testing.assert_allclose(basis.values(Z), ordered[chosen], atol=1e-12)
        slopes = Basis(recurrences, indices).derivatives(Z)[1][:, chosen]
        np.testing.assert_allclose(basis.derivatives(Z)[1], slopes, atol=1e-11)
        c = np.random.default_rng(2).normal(size=(len(chosen), 2))
        np.testing.assert_allclose(basis.sums(Z, c), basis.values(Z).T @ c, atol=1e-12)


def test_a_pursuit_finds_the_terms_that_are_there():
    Z, recurrences = cube(60, 6), legendre(6)
    candidates = hyperbolic(np.full(6, 12), 0.75, 600)
    values = Basis(recurrences, candidates).values(Z)
    there = [0, 3, 40, 200, 555]
    T = (np.array([5.0, 1.0, -0.5, 0.2, 0.1]) @ values[there])[:, None]
    order, size = pursue(values, T, 40)
    assert set(there) <= set(order[:size].tolist())
    assert size <= 12


def test_a_pursuit_takes_no_term_that_those_before_it_make():
    Z = np.repeat(cube(8, 2), 3, axis=0)
    values = Basis(legendre(2), total_degree(2, 6)).values(Z)
    order, _ = pursue(values, np.exp(Z[:, :1]), 20)
    assert len(order) <= 8
    assert np.linalg.matrix_rank(values[order]) == len(order)


def test_the_slope_of_the_prior_is_its_derivative():
    rng = np.random.default_rng(0)
    p = univariate(legendre(3), cube(25, 3), 5)[0][:, 1:]
    T = rng.normal(size=(25, 2))
    theta, direction = rng.uniform(0.1, 0.5, size=(3, 4)), rng.normal(size=(3, 4))
    _, slope, by_nugget = _surprise(p, T, theta, 0.1)
    exact = np.sum(slope * direction) + 0.3 * by_nugget

    def remainder(step):
        ahead, behind = (_surprise(p, T, theta + s * direction, 0.1 + 0.3 * s)[0] for s in (step, -step))
        return abs((ahead - behind) / 2 - step * exact)

    assert np.log2(remainder(2e-3) / remainder(1e-3)) == pytest.approx(3, abs=0.1)


def test_left_out_with_a_prior_is_what_leaving_out_gives():
    Z = cube(30, 2)
    values = Basis(legendre(2), total_degree(2, 8)).values(Z)
    weights = 0.5 ** total_degree(2, 8).sum(axis=1)
    T = np.exp(Z[:, :1] * Z[:, 1:])
    whole = condition(values, T, weights, 1e-4)
    assert len(values) > len(T)  # more terms than runs
    for i in range(0, 30, 7):
        others = np.arange(30) != i
        without = condition(values[:, others], T[others], weights, 1e-4)
        np.testing.assert_allclose(
            T[i] - values[:, i] @ without.coefficients, whole.residuals[i], rtol=1e-6, atol=1e-9
        )


def test_inputs_and_degrees_that_do_not_matter_get_no_size():
    Z = cube(80, 4)
    p = univariate(legendre(4), Z, 7)[0][:, 1:]
    # Without any noise the likelihood is flat to rounding, and where it is largest depends on the threads.
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(Z))
    T = (Z[:, 0] ** 4 + Z[:, 1] + noise)[:, None]
    found = likely_sizes(p, T - T.mean(axis=0), free=True)
    assert isinstance(found, Sizes)
    assert found.theta[2:].max() < 1e-6 * found.theta[:2].max()
    assert found.theta[1, 1:].max() < 1e-6 * found.theta[1, 0]
    assert found.theta[0, [0, 2]].max() < 1e-3 * found.theta[0, [1, 3]].min()


def test_an_output_that_does_not_vary_has_a_prior_too():
    p = univariate(legendre(2), cube(20, 2), 4)[0][:, 1:]
    assert not likely_sizes(p, np.zeros((20, 1)), free=True).theta.any()


def test_ways_are_compared_on_runs_that_they_have_not_seen():
    Z = cube(40, 2)
    rows = Rows(Z, Z[:, :1] ** 2, None)
    seen = []

    class Remembers:
        def __init__(self, rows):
            seen.append(len(rows.Z))
            self.known = {row.tobytes(): t for row, t in zip(rows.Z, rows.targets[:, 0], strict=True)}

        def predict(self, Z):
            return np.array([self.known.get(row.tobytes(), [9.0]) for row in Z])

    def honest(rows):
        system = LeastSquares.of(rows, Basis(legendre(2), total_degree(2, 2)))

        class Fitted:
            def predict(self, Z):
                return system.basis.values(Z).T @ system.coefficients(6)

        return Fitted()

    errors = tried(rows, [Remembers, honest], np.random.default_rng(0))
    assert errors[1] < np.log(1e-10) < np.log(5) < errors[0]
    assert seen == [30]


def test_outputs_of_many_inputs_share_a_basis():
    X = cube(120, 4)
    Y = np.column_stack([np.exp(X[:, 0] + 0.3 * X[:, 1]), 1 / (3 + X[:, 2] + X[:, 3]), np.full(120, 2.0)])
    surrogate = fit((X, Y), "pce", validation=None)
    new = 0.95 * cube(500, 4, seed=4)
    truth = np.column_stack([np.exp(new[:, 0] + 0.3 * new[:, 1]), 1 / (3 + new[:, 2] + new[:, 3])])
    error = np.sqrt(np.mean((surrogate.predict(new)[:, :2] - truth) ** 2, axis=0))
    assert np.all(error < np.array([1e-5, 1e-2]) * truth.std(axis=0))
    np.testing.assert_allclose(surrogate.predict(new)[:, 2], 2.0, atol=1e-9)
