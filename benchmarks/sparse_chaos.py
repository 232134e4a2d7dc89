"""Sparse polynomial chaos beside OpenTURNS (`pip install tensegra[openturns]`).

    python -m benchmarks.sparse_chaos [SEEDS]

Relative mean square error on 10,000 random points, of a Sobol design: Ishigami with 200 runs, Borehole with
100, G-function with 500. OpenTURNS searches with LARS and the corrected leave-one-out error in hyperbolic
sets of five candidates a run, of the norms 0.5, 0.75 and 1; told is the set that is best on the test points,
which is in its favour. LARS and pursuit by correlation as scikit-learn has them, on the same sets, with the
number of terms taken by the corrected leave-one-out error and the set by the test points, stand beside.
"""

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lars_path, orthogonal_mp

from benchmarks.functions import CASES, Case
from tensegra.surrogate import fit
from tensegra.surrogate.basis import Basis
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.problem import Problem
from tensegra.surrogate.pursuit import hyperbolic
from tensegra.surrogate.search import law_recurrences

NORMS = (0.5, 0.75, 1.0)
CANDIDATES_PER_RUN, MOST_CANDIDATES = 5, 2_000
MAX_DEGREE = 30
SHARE_OF_RUNS = 0.8
N_FRESH = 10_000

Predictor = Callable[[np.ndarray], np.ndarray]


def by_tensegra(case: Case, seed: int) -> list[Predictor]:
    surrogate = fit(case.data(case.n_runs, seed), "pce", validation=None, seed=seed)
    return [lambda X: surrogate.predict(X)[:, 0]]


def by_openturns(case: Case, seed: int) -> list[Predictor]:
    import openturns as ot

    ot.Log.Show(ot.Log.NONE)
    data, laws = case.data(case.n_runs, seed), []
    for law in case.laws:
        parameters = law.parameters
        match law.kind:
            case "uniform":
                laws.append(ot.Uniform(parameters.low, parameters.high))
            case "normal":
                laws.append(ot.Normal(parameters.mean, parameters.std))
            case _:
                laws.append(ot.LogNormalMuSigma(parameters.mean, parameters.std).getDistribution())
    joint = ot.JointDistribution(laws)
    found = []
    for norm in NORMS:
        numbering = ot.HyperbolicAnisotropicEnumerateFunction(len(laws), norm)
        families = [ot.StandardDistributionPolynomialFactory(law) for law in laws]
        basis = ot.OrthogonalProductPolynomialFactory(families, numbering)
        size = min(CANDIDATES_PER_RUN * case.n_runs, MOST_CANDIDATES)
        while max(max(numbering(i)) for i in range(size)) > MAX_DEGREE:
            size = int(0.9 * size)
        algorithm = ot.FunctionalChaosAlgorithm(
            ot.Sample(data.X),
            ot.Sample(data.Y),
            joint,
            ot.FixedStrategy(basis, size),
            ot.LeastSquaresStrategy(
                ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
            ),
        )
        algorithm.run()
        metamodel = algorithm.getResult().getMetaModel()
        found.append(lambda X, metamodel=metamodel: np.array(metamodel(ot.Sample(X)))[:, 0])
    return found


def by_scikit_learn(case: Case, seed: int, *, lars: bool) -> list[Predictor]:
    data = case.data(case.n_runs, seed)
    problem = Problem.of(data)
    coordinates = Coordinates.of(problem)
    recurrences = law_recurrences(problem, coordinates, MAX_DEGREE)
    W, t = coordinates.forward(problem.Z), problem.T[:, 0]
    limit = int(SHARE_OF_RUNS * len(t))
    found = []
    for norm in NORMS:
        size = min(CANDIDATES_PER_RUN * case.n_runs, MOST_CANDIDATES)
        candidates = hyperbolic(np.full(W.shape[1], MAX_DEGREE), norm, size)
        A = Basis(recurrences, candidates).values(W).T
        unit = A[:, 1:] / np.linalg.norm(A[:, 1:], axis=0)
        if lars:
            _, active, _ = lars_path(unit, t, method="lar", max_iter=limit)
            order = np.array(active)
        else:
            path = np.atleast_2d(orthogonal_mp(unit, t, n_nonzero_coefs=limit, return_path=True))
            order = np.argsort(np.argmax(path != 0, axis=1) + limit * ~path.any(axis=1), kind="stable")
            order = order[: np.count_nonzero(path.any(axis=1))]
        chosen, c = _best_leading(A, t, np.concatenate([[0], order + 1]))

        def predict(X: np.ndarray, terms: np.ndarray = candidates[chosen], c: np.ndarray = c) -> np.ndarray:
            values = Basis(recurrences, terms).values(coordinates.forward(problem.scaling.inputs(X)))
            return problem.scaling.output_shift + problem.scaling.output_scale * (c @ values)

        found.append(predict)
    return found


def _best_leading(A: np.ndarray, t: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the leading terms with the smallest corrected leave-one-out error, and their coefficients."""
    Q, _ = np.linalg.qr(A[:, order])
    residual, leverage, errors = t.copy(), np.zeros(len(t)), []
    for k, q in enumerate(Q.T, start=1):
        residual -= q * (q @ residual)
        leverage += q**2
        errors.append(np.mean((residual / np.maximum(1 - leverage, 1e-9)) ** 2) * len(t) / max(len(t) - k, 1))
    chosen = order[: int(np.argmin(errors)) + 1]
    return chosen, np.linalg.lstsq(A[:, chosen], t, rcond=None)[0]


WAYS = {
    "tensegra `pce`": by_tensegra,
    "OpenTURNS, LARS": by_openturns,
    "scikit-learn, LARS": lambda case, seed: by_scikit_learn(case, seed, lars=True),
    "scikit-learn, pursuit": lambda case, seed: by_scikit_learn(case, seed, lars=False),
}


def main(n_seeds: int) -> None:
    warnings.simplefilter("ignore", ConvergenceWarning)
    warnings.filterwarnings("ignore", message="Orthogonal matching pursuit ended prematurely")
    warnings.filterwarnings("ignore", message=".*lie outside the box")
    print("| | " + " | ".join(f"{name}, {case.n_runs} runs" for name, case in CASES.items()) + " |")
    print("| --- " * (len(CASES) + 1) + "|")
    for way, learn in WAYS.items():
        told = []
        for case in CASES.values():
            errors, start = [], time.perf_counter()
            for seed in range(n_seeds):
                X = case.points(N_FRESH, 1000 + seed, sobol=False)
                truth = case.function(X)
                each = [np.mean((predict(X) - truth) ** 2) / truth.var() for predict in learn(case, seed)]
                errors.append(min(each))
            seconds = (time.perf_counter() - start) / n_seeds
            told.append(f"{np.median(errors):.1e} ({max(errors):.1e}), {seconds:.1f} s")
        print(f"| {way} | " + " | ".join(told) + " |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5)
