"""One search for the optimum of Eq. 12, as many chapters ask for it."""

from tensegra.analysis import Model, Optimum, TrueModel, optimise
from tensegra.surrogate import one_thread
from tensegra_paper.chapters.optimum.rows import EVALUATIONS, METHODS, PROBLEMS, XI
from tensegra_paper.setting import Setting

__all__ = ["FEWEST_STARTS", "N_STARTS", "searched"]

N_STARTS = {"slsqp": 200, "bfgs": 50, "direct": 64}
"""Of SQP as printed; of BFGS, whose number is not printed, and of `direct` enough to agree."""

FEWEST_STARTS = {"slsqp": 32, "bfgs": 12, "direct": 24}


def searched(
    setting: Setting,
    model: Model,
    truth: TrueModel,
    problem: str,
    method: str,
    *,
    seed: str,
    told_as: str,
) -> Optimum:
    """Ask one method for the optimum of one problem on a model, and solve it again by FEM.

    Parameters
    ----------
    setting
        Of the reproduction.
    model, truth
        What is searched, and what the optimum is solved with again.
    problem, method
        Keys of `PROBLEMS` and `METHODS`.
    seed
        Name by which the setting gives the seed.
    told_as
        What the search is called in the progress.
    """
    objective, constraints, _ = PROBLEMS[problem]
    # The matrices are small: more threads would wait for each other longer than they work.
    with one_thread():
        best = optimise(
            model,
            objective,
            constraints=constraints,
            method=method,
            starts=setting.count(N_STARTS.get(method, 1), least=FEWEST_STARTS.get(method, 1)),
            evaluations=EVALUATIONS,
            xi=XI if method == "bayesian" else None,
            seed=setting.seed_of(seed),
            true_model=truth,
        )
    setting.tell(f"{told_as}: {METHODS[method]} {best.objective:.6g} in {best.seconds:.1f} s")
    return best
