"""Figs. 10 and 11: how far the Gaussian process and the network are from runs that they have not seen."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.report import Table, number
from tensegra.surrogate import Validation, measure
from tensegra_paper.chapter import Agreement, Chapter, Figure, Row
from tensegra_paper.chapters.accuracy.figures import error_figure, parity_figure
from tensegra_paper.claims import finding
from tensegra_paper.models import NETWORK, FiveInputs, five_inputs, trained
from tensegra_paper.published import published_number
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = ["Learned", "accuracy"]

Array: TypeAlias = NDArray[np.float64]

SIZES = (50, 100, 200, 500, 1000, 2000)
"""Training sizes of Fig. 10 at full scale; beyond, nothing is printed and the errors stay where they are."""

SMALL_SIZES = (50, 200, 1000)
"""Below a tenth of the scale: the size that the publication prints numbers for, and two on the way."""

SMALL = 0.1

PRINTED_SIZE = 1000
"""Size for which errors and times are printed."""

N_PREDICTED = 100_000

KINDS: Mapping[str, tuple[str, dict[str, Any]]] = {"gpr": ("gpr", {}), "nn": ("nn", dict(NETWORK))}
NAMES = {"gpr": "Gaussian process", "nn": "network"}


@dataclass(frozen=True, eq=False)
class Learned:
    """One surrogate of Fig. 10.

    Attributes
    ----------
    kind, size
        What it is, and the number of runs it was trained on.
    seconds
        Time of the training, both outputs.
    validation
        Measured on the held-out runs.
    predicted
        What it says of them, shape (n_held_out, 2).
    """

    kind: str
    size: int
    seconds: float
    validation: Validation
    predicted: Array


def accuracy(setting: Setting) -> Chapter:
    """Train both kinds on more and more runs, and measure them on the 2,500 held out."""
    data = five_inputs(setting)
    largest = setting.count(SIZES[-1], least=PRINTED_SIZE)
    sizes = [n for n in (SIZES if setting.scale >= SMALL else SMALL_SIZES) if n <= largest]
    learned = [_learned(setting, data, kind, size) for kind in KINDS for size in sizes]
    at_printed = {one.kind: one for one in learned if one.size == PRINTED_SIZE}
    predicting = _prediction_times(setting, data)
    units = data.held_out.output_units
    gpr, nn = (100 * max(at_printed[kind].validation.relative_error) for kind in KINDS)
    return Chapter(
        name="accuracy",
        title="Accuracy of the surrogates (Figs. 10–11)",
        figures=(
            Figure(
                "fig-10-error",
                "Relative error (Eq. 7) over the number of runs learned from, (a) of y and (b) of z, on "
                "2,500 runs held out. Crosses are read from the publication's text, for 1,000 runs",
                lambda: error_figure(_curves(learned), _crosses()),
            ),
            Figure(
                "fig-11-parity",
                "Surrogates against FEM, trained on 1,000 runs, (a) y and (b) z. Above the predictions, "
                "below their errors on the 2,500 runs held out",
                lambda: parity_figure(
                    data.held_out.Y,
                    {NAMES[kind]: one.predicted for kind, one in at_printed.items()},
                    data.held_out.output_names,
                    units,
                ),
            ),
        ),
        rows=(*_error_rows(at_printed), *_time_rows(at_printed, predicting)),
        text=_text(data, learned, predicting),
        findings=(
            (
                f"With 1,000 runs the Gaussian process is {number(gpr, 2)} % off (printed: 1e-5 %) after "
                f"{at_printed['gpr'].seconds:.1f} s (printed: 630 s), the publication's network "
                f"{number(nn, 2)} % (1e-2 %) after {at_printed['nn'].seconds:.1f} s (147 s)."
            ),
        ),
        tables=(_table(learned),),
        seconds={f"{NAMES[one.kind]}, {one.size} runs": one.seconds for one in learned}
        | {f"{name}, {N_PREDICTED} predictions": time for name, time in predicting.items()},
        seeds={"held out": setting.seed_of("held out")}
        | {f"surrogate {kind}": setting.seed_of(f"surrogate {_name(kind, PRINTED_SIZE)}") for kind in KINDS},
    )


def _name(kind: str, size: int) -> str:
    return f"{'network' if kind == 'nn' else 'process'}-{size}"


def _learned(setting: Setting, data: FiveInputs, kind: str, size: int) -> Learned:
    """Train and measure one surrogate, or read what was measured before."""
    held_out = data.held_out

    def make() -> dict[str, Array]:
        surrogate = _surrogate(setting, data, kind, size)
        setting.tell(f"Fig. 10: {NAMES[kind]} on {size} runs, trained in {surrogate.seconds:.1f} s")
        return {"predicted": surrogate.predict(held_out.X), "seconds": np.array(surrogate.seconds)}

    kept = setting.kept(f"accuracy-{_name(kind, size)}", [kind, size, held_out.n_points], make)
    validation = measure(
        held_out.Y,
        kept["predicted"],
        None,
        method=f"held out {held_out.n_points}",
        n_train=size,
        output_names=held_out.output_names,
    )
    return Learned(kind, size, float(kept["seconds"]), validation, kept["predicted"])


def _surrogate(setting: Setting, data: FiveInputs, kind: str, size: int) -> "Surrogate":
    """Train a surrogate; those that other chapters ask too are kept, the large processes are not."""
    from tensegra.surrogate import fit

    name, options = _name(kind, size), KINDS[kind][1]
    runs = data.training.rows(np.arange(size))
    if kind == "nn" or size == PRINTED_SIZE:
        return trained(setting, name, runs, KINDS[kind][0], **options)
    return fit(runs, KINDS[kind][0], validation=None, seed=setting.seed_of(f"surrogate {name}"), **options)


def _prediction_times(setting: Setting, data: FiveInputs) -> dict[str, float]:
    """Return the time of 100,000 predictions by kind, in seconds; for the network in single precision too."""
    low, high = data.training.box.T
    X = np.random.default_rng(setting.seed_of("predictions")).uniform(low, high, size=(N_PREDICTED, len(low)))
    process, network = (_surrogate(setting, data, kind, PRINTED_SIZE) for kind in KINDS)
    return {
        "Gaussian process": _seconds(lambda: process.predict(X), 1),
        "network": _seconds(lambda: network.predict(X), 5),
        "network, single precision": _seconds(lambda: network.predict(X, fast=True), 5),
    }


def _seconds(ask: Callable[[], object], repetitions: int) -> float:
    """Return the best of some times: the others waited for whoever else uses the machine."""
    times = []
    for _ in range(repetitions):
        began = perf_counter()
        ask()
        times.append(perf_counter() - began)
    return min(times)


def _curves(learned: Sequence[Learned]) -> dict[str, dict[str, tuple[list[int], list[float]]]]:
    """Return by output and kind the sizes and the relative errors in percent."""
    outputs = learned[0].validation.output_names
    return {
        output: {
            NAMES[kind]: (
                [one.size for one in learned if one.kind == kind],
                [100 * one.validation.relative_error[k] for one in learned if one.kind == kind],
            )
            for kind in KINDS
        }
        for k, output in enumerate(outputs)
    }


def _crosses() -> dict[str, tuple[int, float]]:
    return {
        NAMES[kind]: (PRINTED_SIZE, published_number("surrogates", kind, "relative_error_percent_1000"))
        for kind in KINDS
    }


def _error_rows(at_printed: Mapping[str, Learned]) -> list[Row]:
    """Return the rows of Figs. 10 and 11: what is claimed of each kind, and each R² beside the print."""
    errors = {
        kind: [100 * error for error in one.validation.relative_error] for kind, one in at_printed.items()
    }
    rows = [
        finding(
            claim,
            f"relative error (Eq. 7) of v and w, {NAMES[kind]}, 1,000 runs",
            ", ".join(number(error, 2) for error in errors[kind]),
            "%",
            f"on {at_printed[kind].validation.n_validation} runs held out",
            error=max(errors[kind]),
        )
        for claim, kind in (("process error", "gpr"), ("network error", "nn"))
    ]
    rows.append(
        finding(
            "process more accurate",
            "the more accurate kind for 1,000 runs",
            "Gaussian process" if max(errors["gpr"]) < max(errors["nn"]) else "network",
            "",
            "by Eq. 7",
            process=errors["gpr"],
            network=errors["nn"],
        )
    )
    for kind, one in at_printed.items():
        measured = one.validation
        for k, (output, axis) in enumerate((("v", "y"), ("w", "z"))):
            key = "r2_1000" if kind == "gpr" else f"r2_{axis}_1000"
            printed = published_number("surrogates", kind, key)
            rows.append(
                Row(
                    f"Fig. 11{'ab'[k]}",
                    f"R² (Eq. 8) of {output}, {NAMES[kind]}, 1,000 runs",
                    printed,
                    measured.r2_paper[k],
                    "",
                    Agreement.METHOD,
                    measured.r2[k] >= printed,
                    f"the usual R² is 1 − {1 - measured.r2[k]:.1e}; holds where that is the printed value "
                    "or more. Eq. 8 compares spreads, so that it may exceed 1",
                )
            )
    return rows


def _time_rows(at_printed: Mapping[str, Learned], predicting: Mapping[str, float]) -> list[Row]:
    other = "another program on another machine"
    rows = [
        Row(
            "Sect. 3.2",
            f"training on 1,000 runs, {NAMES[kind]}, both outputs",
            published_number("surrogates", kind, "train_seconds_1000"),
            one.seconds,
            "s",
            Agreement.VALUE,
            None,
            f"{other}; {how}",
        )
        for (kind, one), how in zip(
            at_printed.items(),
            (
                "ours fits the length scales on 300 of the runs and conditions on all",
                "the same recipe: 2 × 50 neurons, 5,000 iterations of Adam on all runs, then L-BFGS",
            ),
            strict=True,
        )
    ]
    rows.append(
        Row(
            "Sect. 3.2",
            "100,000 predictions, network",
            published_number("surrogates", "nn", "predict_100000_ms"),
            1e3 * predicting["network, single precision"],
            "ms",
            Agreement.VALUE,
            None,
            f"{other}; in single precision on one thread, {1e3 * predicting['network']:.0f} ms in double "
            "precision",
        )
    )
    trained = {kind: one.seconds for kind, one in at_printed.items()}
    rows.append(
        finding(
            "process slower",
            "training on 1,000 runs, Gaussian process over network",
            trained["gpr"] / trained["nn"],
            "",
            f"{trained['gpr']:.1f} s over {trained['nn']:.1f} s; ours finds the length scales on 300 of the "
            "runs",
            process=trained["gpr"],
            network=trained["nn"],
        )
    )
    ratio = predicting["Gaussian process"] / predicting["network, single precision"]
    rows.append(
        finding(
            "three orders",
            "100,000 predictions, Gaussian process over network",
            ratio,
            "",
            f"{1e3 * predicting['Gaussian process']:.0f} ms with 1,000 centres and two outputs; the cost "
            "grows with the number of runs learned from",
            ratio=ratio,
        )
    )
    return rows


def _text(data: FiveInputs, learned: Sequence[Learned], predicting: Mapping[str, float]) -> tuple[str, ...]:
    sizes = sorted({one.size for one in learned})
    return (
        (
            f"{data.runs.n_runs} runs by FEM, 100 actuations times 125 temperatures (Fig. 8), in "
            f"{data.runs.seconds:.2f} s; {data.held_out.n_points} of them, drawn at random, are held out. v "
            "and w are the displacements of node 23, as printed. Both kinds learn from the first "
            f"{', '.join(map(str, sizes))} of the others in one random order. The recipe of the network is "
            "the same at every size and scale: 2 × 50 neurons, 5,000 iterations of Adam, up to 2,000 of "
            "L-BFGS."
        ),
        (
            "A Gaussian process loses its accuracy in the algebra, not in the data, which are exact to "
            "twelve digits: length scales from the likelihood of a subset, and the smallest nugget with "
            "which the factorisation passes."
        ),
        (
            f"100,000 predictions take {1e3 * predicting['network, single precision']:.1f} ms by the network "
            f"in single precision, {1e3 * predicting['network']:.0f} ms in double precision, and "
            f"{predicting['Gaussian process']:.2f} s by the Gaussian process."
        ),
    )


def _table(learned: Sequence[Learned]) -> Table:
    rows = [
        (
            NAMES[one.kind],
            str(one.size),
            *(number(100 * error, 2) for error in one.validation.relative_error),
            *(f"{r2:.6f}" for r2 in one.validation.r2_paper),
            *(number(1 - r2, 2) for r2 in one.validation.r2),
            f"{one.seconds:.1f}",
        )
        for one in learned
    ]
    pairs = [f"{what}, {output}" for what in ("Eq. 7 [%]", "Eq. 8", "1 − R²") for output in ("v", "w")]
    return Table.of(
        "Error and time of training", ("Kind", "Runs", *pairs, "Training [s]"), rows, "sr" + 7 * "r"
    )
