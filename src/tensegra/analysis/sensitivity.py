"""Sobol' indices: which input the scatter of an output comes from.

The design is Saltelli's, through SALib: base points A and B, and for each input i the points A with column i
of B (and B with column i of A for the second order), one *block* of 2d + 2 (or d + 2) runs per base point.
The estimators mix all runs of a block, so one failed run would spoil every index through it: whole blocks are
dropped, and the share dropped is reported with the result, because indices of the surviving region are
indices of a different question when the share is large.

First order: Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018, Table 2 (b); total: Jansen's, Table 2 (f);
second order: Saltelli 2002, doi:10.1016/S0010-4655(02)00280-1. They are (I2) of the theory.
Intervals: the normal bootstrap over blocks, all resamples in one matrix product
(`tensegra.analysis.bootstrap`).
Base points are a scrambled Sobol sequence, more even than the independent points the bootstrap takes them
for, so the intervals are on the wide side.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.blockruns import CHUNK, ask_blocks, unit_cube
from tensegra.analysis.bootstrap import half_widths
from tensegra.analysis.inputs import RandomInputs, random_inputs
from tensegra.analysis.model import as_model, column_index
from tensegra.analysis.results import plain
from tensegra.errors import StudyError
from tensegra.presented import Tabled

Array = NDArray[np.float64]

# Bootstrap resamples: the relative error of an interval's width is about 1/sqrt(2 · 200) = 5 %.
RESAMPLES = 200
# Smallest number of blocks for which a bootstrap interval means anything.
MIN_BLOCKS = 16


@dataclass(frozen=True)
class Indices:
    """Sobol' indices of one output; NaN throughout where `reason` says why there are none.

    Attributes
    ----------
    output, unit
        The output.
    variance
        Its variance over the surviving blocks.
    first, first_half, total, total_half
        Shape (d,): the indices and the half-widths of their intervals.
    second, second_half
        Shape (d, d), the upper triangle filled; None where not asked for.
    reason
        "" or why there are no indices.
    """

    output: str
    unit: str
    variance: float
    first: Array
    first_half: Array
    total: Array
    total_half: Array
    second: Array | None
    second_half: Array | None
    reason: str = ""


@dataclass(frozen=True, repr=False)
class Sensitivity(Tabled):
    """Sobol' indices of all outputs, and how they settled with the sample size.

    Attributes
    ----------
    name, model, method, seed, confidence
        What was asked; the method is ``saltelli`` or ``chaos``, which needs no runs.
    n_base
        Base points asked for.
    n_blocks
        Blocks that survived; (n_base − n_blocks) / n_base is `share_dropped`.
    n_runs, n_failed
        Model evaluations and how many of them failed.
    statuses
        Runs by status.
    input_names
        The random inputs, the order of every index array; inputs tied to one of them count with it.
    laws
        The law of each input, in words.
    indices
        By output.
    convergence
        By output: the indices of the first 2^m blocks, for growing m (the second order for all blocks only).
    sizes
        Those numbers of blocks.
    """

    kind = "sensitivity"

    name: str
    model: str
    seed: int
    confidence: float
    n_base: int
    n_blocks: int
    n_runs: int
    n_failed: int
    statuses: Mapping[str, int]
    input_names: tuple[str, ...]
    laws: Mapping[str, str]
    indices: Mapping[str, Indices]
    sizes: tuple[int, ...]
    convergence: Mapping[str, tuple[Indices, ...]]
    method: str = "saltelli"

    @property
    def share_dropped(self) -> float:
        """Share of the blocks lost to failed runs."""
        return 1.0 - self.n_blocks / self.n_base if self.n_base else 0.0

    def table(self) -> list[dict[str, Any]]:
        """Return a row per output, order and input (or pair of inputs), with the interval."""
        rows = []
        for output, found in self.indices.items():
            entries: list[tuple[str, str, float, float]] = []
            for order, values, halves in (
                ("first", found.first, found.first_half),
                ("total", found.total, found.total_half),
            ):
                entries += [
                    (order, *entry)
                    for entry in zip(self.input_names, values.tolist(), halves.tolist(), strict=True)
                ]
            if found.second is not None and found.second_half is not None:
                for i, j in zip(*np.triu_indices(len(self.input_names), 1), strict=True):
                    pair = f"{self.input_names[i]} × {self.input_names[j]}"
                    entries.append(
                        ("second", pair, float(found.second[i, j]), float(found.second_half[i, j]))
                    )
            rows += [
                {"output": output, "order": order, "input": label, "value": value}
                | {"low": value - half, "high": value + half}
                for order, label, value, half in entries
            ]
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content = vars(self) | {"kind": self.kind, "share_dropped": self.share_dropped}
        content["indices"] = {output: vars(found) for output, found in self.indices.items()}
        content["convergence"] = {
            output: [vars(found) for found in series] for output, series in self.convergence.items()
        }
        return dict(plain(content))

    def __repr__(self) -> str:
        lines = [
            f"{output}: total "
            + ", ".join(f"{n} {t:.3f}" for n, t in zip(self.input_names, found.total, strict=True))
            for output, found in self.indices.items()
        ]
        asked = f"{self.n_runs} runs of {self.model}, {self.share_dropped:.1%} of the blocks dropped"
        if self.method == "chaos":
            asked = f"in closed form from the expansion {self.model}"
        return f"Sensitivity({asked}; {'; '.join(lines)})"


def sobol_indices(
    model: object,
    inputs: Mapping[str, object] | None = None,
    *,
    samples: int = 1024,
    second_order: bool = True,
    outputs: Sequence[str] | None = None,
    seed: int = 0,
    confidence: float = 0.95,
    resamples: int = RESAMPLES,
    name: str = "sensitivity",
    chunk: int = CHUNK,
    progress: Callable[[int, int], None] | None = None,
) -> Sensitivity:
    """Estimate first, total and second order Sobol' indices by Saltelli's design.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    inputs
        By variable: a distribution, a number or ``SameAs(variable)``; what is left out has the law
        of the study, as a surrogate of it has too, or is uniform on the model's box where there is none. The
        random inputs must be independent.
    samples
        Base points N, a power of two; the model runs N (2d + 2) times, or N (d + 2) without the second order.
    second_order
        Whether to estimate the second order too.
    outputs
        Which outputs; all unless given.
    seed, confidence, resamples, name
        Of the random numbers; of the intervals; of the bootstrap; of the result.
    chunk, progress
        Points per call of the model; called with (runs done, runs in all).

    Raises
    ------
    StudyError
        If a name or a law makes no sense, or `samples` is not a power of two ≥ 16.

    Examples
    --------
    >>> from tensegra.analysis import FunctionModel, sobol_indices
    >>> import numpy as np
    >>> line = FunctionModel(lambda X: 2 * X[:, 0] + X[:, 1], ("a", "b"), ("y",), np.array([[0, 1], [0, 1]]))
    >>> sobol_indices(line, samples=1024).indices["y"].first.round(2)
    array([0.8, 0.2])
    """
    if samples < MIN_BLOCKS or samples & (samples - 1):
        raise StudyError.at("sensitivity.samples", samples, f"a power of two, {MIN_BLOCKS} or more")
    asked = as_model(model)
    laws = random_inputs(asked, inputs)
    if laws.copula is not None:
        raise StudyError.at(
            "sensitivity.inputs",
            ", ".join(laws.copula.names),
            "independent inputs; give laws of their own to these",
        )
    wanted = tuple(outputs or asked.output_names)
    columns = column_index(asked.output_names, wanted, "sensitivity.outputs")
    U = _saltelli(laws, samples, seed, second_order=second_order)
    runs = ask_blocks(asked, columns, U, laws.from_unit, samples, chunk=chunk, progress=progress)
    kept = runs.kept
    blocks = runs.values.reshape(samples, -1, len(wanted))
    sizes = tuple(2**m for m in range(6, samples.bit_length() - 1) if kept[: 2**m].sum() >= MIN_BLOCKS)
    estimator = _Estimator(laws, confidence, resamples, seed)
    units = asked.units
    indices, convergence = {}, {}
    for k, output in enumerate(wanted):
        label = (output, units.get(output, ""))
        indices[output] = estimator.indices(label, blocks[kept, :, k], second_order=second_order)
        main = blocks[:, [*range(laws.n_dimensions + 1), -1], k]  # without the runs of the second order
        steps = [estimator.indices(label, main[:n][kept[:n]], second_order=False) for n in sizes]
        convergence[output] = (*steps, indices[output])
    return Sensitivity(
        name=name,
        model=asked.name,
        seed=seed,
        confidence=confidence,
        n_base=samples,
        n_blocks=int(kept.sum()),
        n_runs=len(U),
        n_failed=runs.n_failed,
        statuses=runs.statuses,
        input_names=laws.independent,
        laws=laws.describe(),
        indices=indices,
        sizes=(*sizes, samples),
        convergence=convergence,
    )


def _saltelli(laws: RandomInputs, samples: int, seed: int, *, second_order: bool) -> Array:
    from SALib.sample import sobol

    U = sobol.sample(
        unit_cube(laws), samples, calc_second_order=second_order, seed=np.random.default_rng(seed)
    )
    return np.asarray(np.clip(U, 2.0**-31, 1.0 - 2.0**-31))  # a quantile function may be infinite at the ends


@dataclass(frozen=True)
class _Estimator:
    laws: RandomInputs
    confidence: float
    resamples: int
    seed: int

    def indices(self, label: tuple[str, str], blocks: Array, *, second_order: bool) -> Indices:
        """Estimate the indices from blocks (n_blocks, runs per block)."""
        d = self.laws.n_dimensions
        output, unit = label
        reason = ""
        if len(blocks) < MIN_BLOCKS:
            reason = f"only {len(blocks)} blocks without a failed run, at least {MIN_BLOCKS} are needed"
        elif np.ptp(blocks) <= 1e-12 * np.abs(blocks).max():
            reason = "the output does not vary"
        if reason:
            nothing = np.full(d, np.nan)
            square = np.full((d, d), np.nan) if second_order else None
            variance = 0.0 if len(blocks) >= MIN_BLOCKS else np.nan
            return Indices(output, unit, variance, nothing, nothing, nothing, nothing, square, square, reason)
        from SALib.analyze import sobol

        found = sobol.analyze(
            unit_cube(self.laws),
            blocks.ravel(),
            calc_second_order=second_order,
            num_resamples=2,  # its loop over resamples is not used
            conf_level=self.confidence,
            seed=self.seed + 1,  # SALib takes the seed 0 for none
        )
        rng = np.random.default_rng(self.seed + 1)
        halves = half_widths(
            blocks, rng, resamples=self.resamples, confidence=self.confidence, second_order=second_order
        )
        return Indices(
            output=output,
            unit=unit,
            variance=float(blocks[:, [0, -1]].var(ddof=1)),  # the columns A and B: independent base points
            first=np.array(found["S1"]),
            first_half=halves[0],
            total=np.array(found["ST"]),
            total_half=halves[1],
            second=np.array(found["S2"]) if second_order else None,
            second_half=halves[2] if second_order else None,
        )
