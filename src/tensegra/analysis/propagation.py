"""Propagation of random inputs through a model.

Samples stream through the model chunk by chunk; only counts, moments and bins stay, so ten million samples
need no more memory than ten thousand. A run that fails is no number: it is dropped from the statistics,
counted by its status and reported, and an exceedance probability also comes with what it would be had all
failed runs stayed below the limit, or all exceeded it.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.inputs import RandomInputs, random_inputs
from tensegra.analysis.model import Evaluation, Model, as_model, column_index, n_outside
from tensegra.analysis.results import Estimate, plain
from tensegra.analysis.sketch import Sketch
from tensegra.analysis.summary import Summary, summarise
from tensegra.analysis.truth import TrueModel
from tensegra.errors import StudyError
from tensegra.presented import Tabled

Array = NDArray[np.float64]

METHODS = ("monte_carlo", "quasi_monte_carlo")

# Points per call of the model: large enough to hide its overhead, small enough for a kernel matrix of 10,000
# training points (0.3 GB) to fit.
CHUNK = 4096
# Independent randomisations of the quasi-random points: with 16 the interval of a lognormal output's standard
# deviation holds in 88 %, with 32 in 95 % (`benchmarks/coverage.py`).
REPLICATES = 32


@dataclass(frozen=True)
class Difference:
    """How two models differ on the same samples, in one output.

    Attributes
    ----------
    mean
        Mean of (other − model) over the samples that both solved, with its interval.
    rms, largest
        Root mean square and largest magnitude of the difference.
    ks_distance
        Largest distance between the two distribution functions, on the quantiles 0.01 … 0.99.
    """

    output: str
    mean: Estimate
    rms: float
    largest: float
    ks_distance: float


@dataclass(frozen=True, repr=False)
class Propagation(Tabled):
    """The distribution of the outputs under random inputs.

    Attributes
    ----------
    name, model, method, seed, confidence
        What was asked.
    n_samples, n_failed, n_outside
        Samples drawn; those for which the model gave no result; those outside the model's box, where a
        surrogate extrapolates.
    statuses
        Samples by status.
    laws
        The law of each input, in words.
    inputs, outputs
        Summaries by name. The inputs' are for the figure: they show what was really drawn.
    levels, limits
        The quantiles that were asked for, and by output the limits: their estimates are in the table.
    other
        The same for a second model on the same samples, or None.
    differences
        How `other` differs, by output.
    """

    kind = "propagation"

    name: str
    model: str
    method: str
    seed: int
    confidence: float
    n_samples: int
    n_failed: int
    n_outside: int
    statuses: Mapping[str, int]
    laws: Mapping[str, str]
    inputs: Mapping[str, Summary]
    outputs: Mapping[str, Summary]
    levels: tuple[float, ...] = ()
    limits: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    other: "Propagation | None" = None
    differences: Mapping[str, Difference] = field(default_factory=dict)

    def quantile(self, output: str, probability: float) -> Estimate:
        """Return any quantile of an output with its interval, given that the run succeeds."""
        return self._summary(output).quantile(probability)

    def exceedance(self, output: str, limit: float, *, worst_case: bool = False) -> Estimate:
        """Return the probability that an output exceeds `limit`, with its interval.

        Parameters
        ----------
        output, limit
            What to ask.
        worst_case
            Widen the interval to hold whatever the failed runs may have done: none of them exceeds the limit,
            or all of them do. The value stays that of the valid runs.
        """
        summary = self._summary(output)
        return (
            summary.worst_case_exceedance(limit, self.n_failed) if worst_case else summary.exceedance(limit)
        )

    def quantiles(self) -> dict[str, dict[float, Estimate]]:
        """Return the quantiles that were asked for, by output and probability."""
        return {name: {p: s.quantile(p) for p in self.levels} for name, s in self.outputs.items()}

    def exceedances(self) -> dict[str, dict[float, Estimate]]:
        """Return the probabilities of exceeding the limits, by output and limit.

        Their intervals hold whatever the failed runs may have done.
        """
        return {
            name: {limit: self.exceedance(name, limit, worst_case=True) for limit in limits}
            for name, limits in self.limits.items()
        }

    def table(self) -> list[dict[str, Any]]:
        """Return the paper's Table 2: a row per output, model and statistic; then what else was asked for."""
        quantiles, exceedances = self.quantiles(), self.exceedances()
        rows = [
            {
                "model": self.model,
                "output": summary.name,
                "unit": summary.unit,
                "statistic": statistic,
                "value": estimate.value,
                "low": estimate.low,
                "high": estimate.high,
            }
            for summary in self.outputs.values()
            for statistic, estimate in (
                *summary.rows().items(),
                *((f"quantile {p:g}", found) for p, found in quantiles[summary.name].items()),
                *((f"P(> {limit:g})", found) for limit, found in exceedances.get(summary.name, {}).items()),
            )
        ]
        return rows + (self.other.table() if self.other else [])

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content = {key: value for key, value in vars(self).items() if key not in {"other", "differences"}}
        content |= {"kind": self.kind, "other": self.other.to_dict() if self.other else None}
        content |= {"quantiles": self.quantiles(), "exceedances": self.exceedances()}
        content["differences"] = {name: vars(difference) for name, difference in self.differences.items()}
        return dict(plain(content))

    def _summary(self, output: str) -> Summary:
        column_index(tuple(self.outputs), [output], "output")
        return self.outputs[output]

    def __repr__(self) -> str:
        shown = "; ".join(f"{s.name}: mean {s.mean}, std {s.std}" for s in self.outputs.values())
        return f"Propagation({self.n_samples} samples of {self.model}, {self.n_failed} failed; {shown})"


def propagate(
    model: object,
    inputs: Mapping[str, object] | None = None,
    *,
    samples: int = 10_000,
    method: str = "monte_carlo",
    outputs: Sequence[str] | None = None,
    compare_with: object | None = None,
    quantiles: Sequence[float] = (),
    limits: Mapping[str, float | Sequence[float]] | None = None,
    seed: int = 0,
    confidence: float = 0.95,
    name: str = "propagation",
    chunk: int = CHUNK,
    progress: Callable[[int, int], None] | None = None,
) -> Propagation:
    """Push random inputs through a model and summarise the outputs.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    inputs
        By variable: a distribution, a number or ``SameAs(variable)``. What is left out has the law
        of the study, as a surrogate of it has too, or is uniform on the model's box where there is none.
    samples
        Number of samples. Quasi-Monte-Carlo rounds it up (by a sixteenth at most) to up to 32 independently
        scrambled Sobol sets of 2^m points.
    method
        ``monte_carlo`` or ``quasi_monte_carlo``.
    outputs
        Which outputs to summarise; all unless given.
    compare_with
        A second model, asked at the same samples.
    quantiles, limits
        Probabilities whose quantiles, and by output limits whose probability of being exceeded, are to stand
        in the result's table. Any others can be asked of the result later.
    seed, confidence, name
        Of the random numbers; of all intervals; of the result.
    chunk
        Points per call of the model.
    progress
        Called with (samples done, samples in all).

    Raises
    ------
    StudyError
        If a name, a law, the method or a number makes no sense.

    Examples
    --------
    >>> from scipy.stats import norm
    >>> from tensegra.analysis import FunctionModel, propagate
    >>> beam = FunctionModel(lambda X: 3.0 + 2.0 * X[:, 0], ("x",), ("y",))
    >>> result = propagate(beam, {"x": norm(0.0, 1.0)}, samples=4096, method="quasi_monte_carlo")
    >>> round(result.outputs["y"].mean.value, 2), round(result.quantile("y", 0.975).value, 1)
    (3.0, 6.9)
    """
    first = as_model(model)
    second = None if compare_with is None else as_model(compare_with)
    if method not in METHODS:
        raise StudyError.at("propagation.method", method, "one of " + ", ".join(METHODS), candidates=METHODS)
    if samples < 2:
        raise StudyError.at("propagation.samples", samples, "at least 2")
    if not 0.0 < confidence < 1.0:
        raise StudyError.at("propagation.confidence", confidence, "a level between 0 and 1")
    laws = random_inputs(first, inputs)
    wanted = tuple(outputs or first.output_names)
    extras = _Extras.of(wanted, quantiles, limits or {})
    tallies = [_Tally(first, wanted, laws, laws.names)]
    if second is not None:
        tallies.append(_Tally(second, wanted, laws, ()))  # it is asked at the same inputs
    pairs = _Pairs(len(wanted))
    plan = _plan(samples, method)
    done, total = 0, sum(plan)
    for replicate, U in _unit_points(plan, method, laws.n_dimensions, seed, chunk):
        X = laws.from_unit(U)
        answers = [tally.add(X, replicate) for tally in tallies]
        if second is not None:
            pairs.add(replicate, *answers)
        done += len(X)
        if progress is not None:
            progress(done, total)
    results = [tally.result(name, method, seed, confidence, extras) for tally in tallies]
    if second is None:
        return results[0]
    differences = pairs.result(results, wanted, confidence)
    return Propagation(**{**vars(results[0]), "other": results[1], "differences": differences})


@dataclass(frozen=True)
class _Extras:
    """Quantiles and limits, checked."""

    levels: tuple[float, ...]
    limits: dict[str, tuple[float, ...]]

    @classmethod
    def of(
        cls,
        outputs: tuple[str, ...],
        levels: Sequence[float],
        limits: Mapping[str, float | Sequence[float]],
    ) -> "_Extras":
        column_index(outputs, tuple(limits), "propagation.limits")
        for level in levels:
            if not 0.0 < level < 1.0:
                raise StudyError.at("propagation.quantiles", level, "a probability between 0 and 1")
        several = {name: tuple(map(float, np.atleast_1d(limit))) for name, limit in limits.items()}
        for name, values in several.items():
            if not np.isfinite(values).all():
                raise StudyError.at(f"propagation.limits.{name}", list(values), "finite numbers")
        return cls(tuple(map(float, levels)), several)


def _plan(samples: int, method: str) -> list[int]:
    """Return how many points each independent replicate has."""
    if method == "monte_carlo":
        return [samples]
    size = 1 << max(int(np.ceil(np.log2(samples / REPLICATES))), 1)
    return [size] * max(-(-samples // size), 2)


def _unit_points(
    plan: Sequence[int], method: str, n_dimensions: int, seed: int, chunk: int
) -> Iterator[tuple[int, Array]]:
    """Yield (replicate, points of the open unit cube)."""
    for replicate, (size, child) in enumerate(
        zip(plan, np.random.SeedSequence(seed).spawn(len(plan)), strict=True)
    ):
        rng = np.random.default_rng(child)
        draw, step = _independent(rng, n_dimensions), chunk
        if method == "quasi_monte_carlo":
            from scipy.stats import qmc

            draw = qmc.Sobol(n_dimensions, scramble=True, rng=rng).random
            step = 1 << (chunk.bit_length() - 1)  # a power of two keeps the sequence balanced
        for start in range(0, size, step):
            # A quantile function is infinite at 0; half the generator's spacing stands for it.
            yield replicate, np.maximum(draw(min(step, size - start)), 2.0**-54)


def _independent(rng: np.random.Generator, n_dimensions: int) -> Callable[[int], Array]:
    return lambda n: rng.random((n, n_dimensions))


class _Tally:
    """All that is counted for one model while the samples stream by."""

    def __init__(
        self, model: Model, outputs: tuple[str, ...], laws: RandomInputs, drawn: tuple[str, ...]
    ) -> None:
        self.model, self.outputs, self.laws = model, outputs, laws
        self.columns = column_index(model.output_names, outputs, "propagation.outputs")
        self.order = column_index(laws.names, model.input_names, "propagation.compare_with")
        self.box = None if isinstance(model, TrueModel) else model.bounds  # the truth extrapolates nowhere
        self.sketches: dict[int, list[Sketch]] = {}
        self.drawn = {name: Sketch() for name in drawn}
        self.statuses: Counter[str] = Counter()
        self.n_samples = self.n_failed = self.n_outside = 0

    def add(self, X: Array, replicate: int) -> Evaluation:
        mine = X[:, self.order]
        found = self.model.evaluate(mine)
        answer = Evaluation(found.values[:, self.columns], found.valid, found.status)
        for sketch, column in zip(self.drawn.values(), X.T, strict=False):
            sketch.add(column)
        rows = self.sketches.setdefault(replicate, [Sketch() for _ in self.outputs])
        for sketch, column in zip(rows, answer.values[answer.valid].T, strict=True):
            sketch.add(column)
        self.statuses.update(answer.tally())
        self.n_samples += len(X)
        self.n_failed += answer.n_failed
        self.n_outside += n_outside(mine, self.box)
        return answer

    def result(self, name: str, method: str, seed: int, confidence: float, extras: "_Extras") -> Propagation:
        units, by_output = self.model.units, zip(*self.sketches.values(), strict=True)
        return Propagation(
            name=name,
            model=self.model.name,
            method=method,
            seed=seed,
            confidence=confidence,
            n_samples=self.n_samples,
            n_failed=self.n_failed,
            n_outside=self.n_outside,
            statuses=dict(self.statuses.most_common()),
            laws=self.laws.describe(),
            inputs={
                variable: summarise(variable, [sketch], confidence=confidence, unit=units.get(variable, ""))
                for variable, sketch in self.drawn.items()
            },
            outputs={
                output: summarise(output, sketches, confidence=confidence, unit=units.get(output, ""))
                for output, sketches in zip(self.outputs, by_output, strict=True)
            },
            levels=extras.levels,
            limits=extras.limits,
        )


class _Pairs:
    """Differences of two models on the samples that both solved."""

    def __init__(self, n_outputs: int) -> None:
        self.n_outputs = n_outputs
        self.sketches: dict[int, list[Sketch]] = {}

    def add(self, replicate: int, first: Evaluation, second: Evaluation) -> None:
        both = first.valid & second.valid
        rows = self.sketches.setdefault(replicate, [Sketch() for _ in range(self.n_outputs)])
        for sketch, column in zip(rows, (second.values - first.values)[both].T, strict=True):
            sketch.add(column)

    def result(
        self, results: Sequence[Propagation], outputs: Sequence[str], confidence: float
    ) -> dict[str, Difference]:
        found = {}
        for output, sketches in zip(outputs, zip(*self.sketches.values(), strict=True), strict=True):
            summary = summarise(output, sketches, confidence=confidence)
            largest = max(abs(summary.minimum), abs(summary.maximum))
            rms = float(np.hypot(summary.mean.value, summary.std.value)) if summary.n > 1 else np.nan
            distance = _ks_distance(results[0].outputs[output], results[1].outputs[output])
            found[output] = Difference(output, summary.mean, rms, largest, distance)
        return found


def _ks_distance(first: Summary, second: Summary) -> float:
    """Return the largest distance of two distribution functions, seen at the quantiles of both."""
    if first.n == 0 or second.n == 0:
        return np.nan
    levels = np.linspace(0.01, 0.99, 99)
    points = [summary.value_at(level) for summary in (first, second) for level in levels]
    gaps = [first.share_above(point) - second.share_above(point) for point in points]
    return float(np.max(np.abs(gaps)))
