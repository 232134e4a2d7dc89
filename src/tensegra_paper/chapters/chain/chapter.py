"""The paper's own chain, run once as printed: its runs, its selection, its network, its searches, then FEM.

Stepped runs of (A1, A23, A4) → the largest group that HDBSCAN finds → a network 2 × 50 of (u, v, w) on all of
it, Adam then L-BFGS (Eq. 10) → SQP, BFGS and Bayesian optimisation on that network → FEM at the end.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra import SolverError
from tensegra.analysis import Optimum, SurrogateModel
from tensegra.report import Table, number
from tensegra.study import TrainingData
from tensegra.surrogate import measure
from tensegra_paper.beam_model import BeamRuns
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.optimum import well_posed_optimum
from tensegra_paper.chapters.optimum.figures import range_figure
from tensegra_paper.chapters.optimum.rows import EVALUATIONS, METHODS, PROBLEMS, place
from tensegra_paper.chapters.optimum.searching import searched
from tensegra_paper.chapters.optimum.straight import slices
from tensegra_paper.claims import finding
from tensegra_paper.groups import OUTPUTS, PRINTED_GROUPS, Groups, stepped_groups
from tensegra_paper.models import LIFT_INPUTS, NETWORK, cable_model, lift_runs, lift_surrogate, trained
from tensegra_paper.published import published_number
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["chain"]

Array: TypeAlias = NDArray[np.float64]

SEARCHED = ("slsqp", "bfgs", "bayesian")

BATCH, LBFGS_ITERATIONS = 1024, 100
"""Runs of an iteration of Adam, and the limit of L-BFGS: the training has to end within a minute or so."""

FEWEST_KEPT = 100
"""Runs below which a network of 2,953 weights has nothing to learn from."""

CENTRES = 500
"""Of the Gaussian process: with all runs its matrix would have some 10¹⁰ elements."""


@dataclass(frozen=True)
class Learned:
    """A surrogate of the kept runs.

    Attributes
    ----------
    surrogate
        Of u, v and w.
    errors
        Mean |error| over mean |displacement| of each output on held-out designs that stand.
    """

    surrogate: "Surrogate"
    errors: tuple[float, ...]


def chain(setting: Setting) -> Chapter:
    """Go the publication's way from its runs to its optimum, and solve that again by FEM."""
    runs, kept = lift_runs(setting, stepped=True), stepped_groups(setting, PRINTED_GROUPS)
    truth = cable_model(setting, LIFT_INPUTS, OUTPUTS)
    if kept.keep.sum() < FEWEST_KEPT:
        raise SolverError(
            f"HDBSCAN keeps {int(kept.keep.sum())} of {runs.n_runs} stepped runs, too few to learn from; a "
            "larger --scale finds its groups"
        )
    data = _data(runs, kept.keep, truth.bounds)
    held_out = lift_runs(setting, held_out=True)
    batch = BATCH if data.n_points > BATCH else None
    network = _learned(
        setting,
        "chain-network",
        data,
        held_out,
        "nn",
        NETWORK | {"adam_batch": batch, "iterations": LBFGS_ITERATIONS},
    )
    setting.tell(f"Eq. 10: network on {data.n_points} runs in {network.surrogate.seconds:.0f} s")
    process = _learned(
        setting, "chain-process", data, held_out, "gpr", {"exact_limit": CENTRES, "inducing_points": CENTRES}
    )
    setting.tell(f"Eq. 10: Gaussian process on {data.n_points} runs in {process.surrogate.seconds:.0f} s")
    model = SurrogateModel(network.surrogate, "network", truth.space)
    found = {
        name: {
            method: searched(
                setting,
                model,
                truth,
                name,
                method,
                seed=f"chain {method}",
                told_as=f"{name}, on the network",
            )
            for method in SEARCHED
        }
        for name in PROBLEMS
    }
    shown = slices(setting, model)
    best = well_posed_optimum(setting)
    fallen = int((kept.keep & ~runs.stands).sum())
    judged = partial(finding, scale=setting.scale)
    posed, printed = found["well posed"]["slsqp"], found["Eq. 12 as printed"]
    by_fem = _lift(posed)
    return Chapter(
        name="chain",
        title="The paper's own chain, from its runs to its optimum (Eq. 10, Sect. 4)",
        figures=(
            Figure(
                "chain-range",
                "w by the network of Eq. 10, trained on the runs that the publication's rule keeps. Lines "
                "are v = −1, 0 and 1 cm; it answers everywhere, also where the structure collapses or no "
                "run was kept (compare Fig. 14, by our surrogate)",
                lambda: range_figure(shown),
            ),
        ),
        rows=(
            *_training_rows(network, process, data.n_points, lift_surrogate(setting)),
            judged(
                "one optimum",
                "places that the three methods find for Eq. 12 on the network",
                "; ".join(f"{METHODS[method]} {place(one)}" for method, one in printed.items()),
                "",
                "Eq. 12 is 1 wherever v = 0, so that there is a whole surface of optima; printed is A1 0.3, "
                "A23 0.3, A4 0.16 by all of them",
                places=[one.x.tolist() for one in printed.values()],
            ),
            judged(
                "optimum confirmed",
                "w at SQP's optimum on the network, by the network and by FEM",
                f"{posed.outputs['w']:.1f}, {by_fem:.1f}",
                "cm",
                f"greatest w with |v| ≤ 1 cm, at {place(posed)}; there FEM says "
                f"{posed.true_status or 'nothing'}, v = {_value(posed, 'v'):.1f} cm. Direct FEM finds "
                f"{best.w:.2f} cm",
                network=posed.outputs["w"],
                fem=by_fem,
            ),
        ),
        text=_text(runs, data.n_points, fallen, network, process, found, best.w, kept),
        findings=(
            (
                f"The publication's chain on {runs.n_runs} runs: SQP on its network promises w = "
                f"{posed.outputs['w']:.1f} cm with |v| ≤ 1 cm, FEM finds {by_fem:.1f} cm there and v = "
                f"{_value(posed, 'v'):.1f} cm; the greatest that FEM itself finds is {best.w:.2f} cm."
            ),
        ),
        tables=tuple(_table(name, each) for name, each in found.items()),
        seconds={
            "network, training": network.surrogate.seconds,
            "Gaussian process, training": process.surrogate.seconds,
            **{
                f"{METHODS[m]}, {name}": one.seconds
                for name, each in found.items()
                for m, one in each.items()
            },
        },
        seeds={name: setting.seed_of(f"surrogate {name}") for name in ("chain-network", "chain-process")},
    )


def _data(runs: BeamRuns, keep: NDArray[np.bool_], bounds: Array) -> TrainingData:
    return TrainingData(
        X=runs.X[keep],
        Y=runs.tip.mean(axis=1)[keep],
        bounds=bounds,
        input_names=LIFT_INPUTS,
        output_names=OUTPUTS,
        output_units=("cm",) * len(OUTPUTS),
    )


def _learned(
    setting: Setting, name: str, data: TrainingData, held_out: BeamRuns, kind: str, options: Mapping[str, Any]
) -> Learned:
    surrogate = trained(setting, name, data, kind, **options)
    stands = held_out.stands
    truth = held_out.tip.mean(axis=1)[stands]
    measured = measure(
        truth,
        surrogate.predict(held_out.X[stands]),
        None,
        method=f"held out {int(stands.sum())}",
        n_train=data.n_points,
        output_names=OUTPUTS,
    )
    return Learned(surrogate, measured.normalised_error)


def _value(one: Optimum, output: str) -> float:
    """Return an output by FEM at an optimum; NaN where there is no equilibrium that stands."""
    return float((one.true_outputs or {}).get(output, np.nan))


def _lift(one: Optimum) -> float:
    return _value(one, "w")


def _training_rows(network: Learned, process: Learned, n_runs: int, regimes: "Surrogate") -> list[Row]:
    other = "another program on another machine"
    assert regimes.validation is not None  # noqa: S101 - asked for
    own = max(100 * error for error in regimes.validation.normalised_error)
    worst = {name: max(100 * e for e in one.errors) for name, one in (("nn", network), ("gpr", process))}
    rows = [
        Row(
            "Sect. 3.2",
            f"training on {n_runs} runs, network 2 × 50 of u, v and w",
            published_number("surrogates", "nn", "train_seconds_100000"),
            network.surrogate.seconds,
            "s",
            Agreement.VALUE,
            None,
            f"{other}; 5,000 iterations of Adam, each on {min(n_runs, BATCH)} runs in turn, then L-BFGS on "
            f"all, at most {LBFGS_ITERATIONS} iterations",
        ),
        Row(
            "Sect. 3.2",
            f"training on {n_runs} runs, Gaussian process of u, v and w",
            "several hours",
            process.surrogate.seconds,
            "s",
            Agreement.VALUE,
            None,
            f"{other}; on {CENTRES} inducing points that see all runs. With every run as a centre the "
            f"matrix would have {float(n_runs) ** 2:.1e} elements, {8e-9 * float(n_runs) ** 2:.0f} GB",
        ),
    ]
    rows += [
        Row(
            "Eq. 10",
            f"largest mean error over mean displacement of u, v and w, {name}",
            None,
            worst[key],
            "%",
            Agreement.VALUE,
            None,
            "on held-out designs that stand along stable paths; the surrogate by regimes of our chain has "
            f"{own:.2g} % (v and w)",
        )
        for key, name in (("nn", "network"), ("gpr", "Gaussian process"))
    ]
    return rows


def _text(
    runs: BeamRuns,
    n_kept: int,
    fallen: int,
    network: Learned,
    process: Learned,
    found: Mapping[str, Mapping[str, Optimum]],
    direct: float,
    kept: Groups,
) -> tuple[str, ...]:
    posed = found["well posed"]
    left_out = float(np.mean(~kept.keep[runs.stands]))
    unstable = runs.status == "unstable"
    apart = f"{100 * np.mean(~kept.keep[unstable]):.0f} %" if unstable.any() else "none"
    told = "; ".join(
        f"{METHODS[method]} {one.outputs['w']:.1f} cm on the network, {_lift(one):.1f} cm by FEM "
        f"({one.true_status or 'no equilibrium'})"
        for method, one in posed.items()
    )
    return (
        (
            f"{runs.n_runs} stepped runs, {n_kept} kept by the largest group of (v, w), among them {fallen} "
            "that do not stand. A network 2 × 50 learns u, v and w from all of them (mean error on standing "
            f"designs {', '.join(number(100 * e, 2) for e in network.errors)} % for u, v, w), a Gaussian "
            f"process on {CENTRES} inducing points beside it "
            f"({', '.join(number(100 * e, 2) for e in process.errors)} %). SQP starts from "
            f"{posed['slsqp'].agreement.n_starts} points of a Latin hypercube, as printed, BFGS from "
            f"{posed['bfgs'].agreement.n_starts}; Bayesian optimisation asks {EVALUATIONS} times."
        ),
        (
            f"Where it works: the largest group leaves out {100 * left_out:.2g} % of the runs that stand, "
            f"and {apart} of the shapes that do not; the network follows its data. Where it fails: a network "
            "answers everywhere. It was given runs without prestress as if they stood, it is asked in "
            "corners where no run was kept, and nothing tells a search that it has left the data. For the "
            f"greatest w with |v| ≤ 1 cm: {told}. For Eq. 12 as printed the methods end in different places, "
            "for it is 1 on a whole surface."
        ),
        (
            "What ours does about it: runs are followed along stable paths with a certificate each, so that "
            "what does not stand is known; a piece is learned for each regime, with the probability that a "
            "design stands; every optimum is solved again by FEM, and where that does not confirm it runs "
            "are added and the search is repeated; and the structure itself is searched with its exact "
            f"derivatives, which finds {direct:.2f} cm."
        ),
    )


def _table(title: str, found: Mapping[str, Optimum]) -> Table:
    columns = list(found.values())
    rows: list[tuple[object, ...]] = [
        (name, *(f"{one.inputs[name]:.4f}" for one in columns)) for name in LIFT_INPUTS
    ]
    for name in ("v", "w"):
        rows.append((f"{name} [cm], network", *(f"{one.outputs[name]:.2f}" for one in columns)))
        rows.append((f"{name} [cm], FEM", *(f"{_value(one, name):.2f}" for one in columns)))
    rows += [
        ("status, FEM", *(one.true_status or "" for one in columns)),
        ("evaluations", *(one.n_evaluations for one in columns)),
        ("time [s]", *(f"{one.seconds:.1f}" for one in columns)),
    ]
    return Table.of(
        f"On the publication's network: {title}",
        ("", *(METHODS[method] for method in found)),
        rows,
        "s" + "r" * len(found),
    )
