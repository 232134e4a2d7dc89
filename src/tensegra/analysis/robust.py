"""Optimisation under uncertainty: the design that is good however the errors fall.

A design is judged by a statistic of what may come of it, mean − κ · std or a quantile, over one fixed set of
evenly spread draws of the errors (sample average approximation; Shapiro, Dentcheva & Ruszczyński, *Lectures
on Stochastic Programming*, 2009, ch. 5). So it is an ordinary smooth function of the design, with exact
derivatives where the model has them, and every method of `optimise` can search on it. A constraint has to
hold in the same sense: its margin's mean − κ · std, or its quantile, must not be negative.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.expression import Expression
from tensegra.analysis.measure import Measure
from tensegra.analysis.model import Evaluation, Model, as_model, points
from tensegra.analysis.optimisation import optimise
from tensegra.analysis.optimum import Optimum
from tensegra.analysis.problem import Problem, state_problem
from tensegra.analysis.propagation import Propagation, propagate
from tensegra.analysis.results import Estimate, plain
from tensegra.analysis.scatter import Scatter, scatter
from tensegra.analysis.searched import levels_of
from tensegra.analysis.truth import TrueModel
from tensegra.errors import StudyError
from tensegra.presented import Tabled

Array = NDArray[np.float64]

# Rows per call of the model.
CHUNK = 4096


@dataclass(frozen=True, repr=False)
class RobustOptimum(Tabled):
    """The robust design beside the nominal one, which knows of no errors.

    Attributes
    ----------
    name, model, method, seed, formula, constraints, maximise, measure
        What was asked; `measure` is the statistic in words.
    laws
        The law of each error and random input, in words.
    search
        Names of the inputs that were designed; the others keep the laws in `laws`.
    n_draws
        Draws that the statistic was taken over.
    robust, nominal
        The two optima. The objective of `robust` is the statistic, that of `nominal` the formula itself with
        all errors and random inputs at their means.
    spreads
        By ``robust`` and ``nominal``: what comes of the design, by the model and, where there is one, by the
        true model. The formula and the least margin of each constraint stand among the outputs.
    """

    kind = "robust"

    name: str
    model: str
    method: str
    seed: int
    formula: str
    constraints: tuple[str, ...]
    maximise: bool
    measure: str
    laws: Mapping[str, str]
    search: tuple[str, ...]
    n_draws: int
    robust: Optimum
    nominal: Optimum
    spreads: Mapping[str, Propagation] = field(default_factory=dict)

    @property
    def success(self) -> bool:
        """Whether both searches can be relied on."""
        return self.robust.success and self.nominal.success

    @property
    def reason(self) -> str:
        """How the searches ended, in words."""
        return f"robust: {self.robust.reason}; nominal: {self.nominal.reason}"

    def kept(self, design: str, constraint: str) -> Estimate:
        """Return the probability that a constraint holds at the ``robust`` or the ``nominal`` design."""
        return self.spreads[design].exceedance(_margin_of(constraint), 0.0, worst_case=True)

    def table(self) -> list[dict[str, Any]]:
        """Return a row per design and quantity: its place, and the statistics of what comes of it."""
        rows: list[dict[str, Any]] = []
        for design, optimum in (("robust", self.robust), ("nominal", self.nominal)):
            rows += [
                {"design": design, "quantity": name, "statistic": "value", "value": value}
                for name, value in optimum.inputs.items()
            ]
            rows += [
                {
                    "design": design,
                    "quantity": row["output"],
                    "statistic": row["statistic"],
                    "value": row["value"],
                    "model": row["model"],
                }
                for row in self.spreads[design].table()
            ]
        return rows

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content = vars(self) | {"kind": self.kind, "success": self.success, "reason": self.reason}
        for key in ("robust", "nominal"):
            own = content[key].to_dict()
            own.pop("trace")
            content[key] = own
        content["kept"] = {
            design: {constraint: self.kept(design, constraint) for constraint in self.constraints}
            for design in self.spreads
        }
        return dict(plain(content))

    def __repr__(self) -> str:
        return f"RobustOptimum({self.measure}; robust: {self.robust}; nominal: {self.nominal})"


@dataclass(frozen=True)
class RobustModel:
    """The statistics of formulas at a design, as a model of the design (`tensegra.analysis.Model`)."""

    scatter: Scatter
    formulas: tuple[Expression, ...]
    signs: tuple[float, ...]
    measure: Measure
    draws: Array
    box: Mapping[str, Sequence[float]]

    space = None

    @property
    def name(self) -> str:
        """The model's name."""
        return self.scatter.model.name

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the designed inputs."""
        return self.scatter.design_names

    @property
    def output_names(self) -> tuple[str, ...]:
        """``statistic`` and, for the constraints, ``margin_1``, …."""
        return ("statistic", *(f"margin_{i}" for i in range(1, len(self.formulas))))

    @property
    def bounds(self) -> Array:
        """The box of the designed inputs."""
        return np.array([self.box[name] for name in self.input_names], dtype=float)

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name."""
        return self.scatter.model.units

    @property
    def levels(self) -> dict[str, Array]:
        """The values of the designed inputs that are discrete, by name."""
        return self.scatter.levels

    def evaluate(self, X: ArrayLike) -> Evaluation:
        """Return the statistics at designs (n, n_designed); a draw that fails spoils its design."""
        X = points(X, self.input_names)
        outcomes, valid, _ = self._outcomes(X, slopes=False)
        values = [
            sign * self.measure.value(sign * column)
            for sign, column in zip(self.signs, outcomes, strict=True)
        ]
        stacked = np.where(valid[:, None], np.stack(values, axis=1), np.nan)
        return Evaluation(stacked, valid, np.where(valid, "evaluated", "failed"))

    def gradient(self, X: ArrayLike) -> Array:
        """Return their derivatives (n, n_outputs, n_designed)."""
        outcomes, valid, slopes = self._outcomes(points(X, self.input_names), slopes=True)
        found = [
            sign * self.measure.slope(sign * column, sign * slope)
            for sign, column, slope in zip(self.signs, outcomes, slopes, strict=True)
        ]
        return np.where(valid[:, None, None], np.stack(found, axis=1), np.nan)

    def uncertainty(self, X: ArrayLike) -> None:
        """Return None: it is not asked for it."""

    def _outcomes(self, X: Array, *, slopes: bool) -> tuple[list[Array], NDArray[np.bool_], list[Array]]:
        """Return each formula (n, n_draws), the designs at which no draw fails, and the slopes if wanted."""
        model, n_draws = self.scatter.model, len(self.draws)
        inputs = self.scatter.around(X, self.draws).reshape(-1, len(model.input_names))
        parts = [inputs[start : start + CHUNK] for start in range(0, len(inputs), CHUNK)]
        answers = [(model.evaluate(part).values, model.gradient(part) if slopes else None) for part in parts]
        outputs = np.concatenate([values for values, _ in answers])
        columns = dict(zip(model.input_names, inputs.T, strict=True))
        columns |= dict(zip(model.output_names, outputs.T, strict=True))
        names, chain = (*model.input_names, *model.output_names), np.zeros((0, 0, 0))
        if slopes:
            gradients = np.concatenate([slope for _, slope in answers if slope is not None])
            d = inputs.shape[1]
            chain = np.concatenate([np.broadcast_to(np.eye(d), (len(inputs), d, d)), gradients], axis=1)
            chain = chain[:, :, self.scatter.is_designed]
        values, found = [], []
        for formula in self.formulas:
            value, partials = formula.value_and_partials(columns, seeds=None if slopes else ())
            values.append(np.broadcast_to(value, (len(inputs),)).reshape(len(X), n_draws))
            if slopes:
                used = [names.index(name) for name in formula.names]
                slope = np.einsum("ns,nsd->nd", partials, chain[:, used])
                found.append(slope.reshape(len(X), n_draws, -1))
        finite = np.isfinite(outputs).all(axis=1).reshape(len(X), n_draws)
        valid = finite.all(axis=1) & np.all([np.isfinite(value).all(axis=1) for value in values], axis=0)
        return values, np.asarray(valid), found


def robust_optimise(
    model: object,
    objective: str,
    *,
    search: Sequence[str] | None = None,
    errors: Mapping[str, object] | None = None,
    inputs: Mapping[str, object] | None = None,
    kappa: float | None = None,
    quantile: float | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    constraints: Sequence[str] = (),
    maximise: bool = True,
    method: str = "slsqp",
    starts: int = 20,
    evaluations: int = 40,
    draws: int = 64,
    samples: int = 1000,
    seed: int = 0,
    confidence: float = 0.95,
    true_model: object | None = None,
    name: str = "robust optimisation",
    progress: Callable[[int, int], None] | None = None,
) -> RobustOptimum:
    """Find the design whose outcomes are best under errors, and set it beside the nominal optimum.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    objective, constraints, maximise
        As for `tensegra.optimise`; equality constraints cannot hold under errors and are refused.
    search
        Names of the inputs to design; by default the actuators of the study and what has bounds or errors
        (all inputs of a model that has no actuators), less what `inputs` names. One that is discrete stays
        on its values. All others keep their joint law.
    errors
        By designed input: the law of the error that adds to it, such as
        ``{"normal": {"mean": 0, "std": 0.002}}``; ``{"same_as": name}`` for one error at several.
    inputs
        By input that is not designed: a law in place of its own, or a number.
    kappa
        The statistic is mean − κ · std where more is better, mean + κ · std where less is; 2 unless given.
    quantile
        Instead: the outcome that this share of all outcomes falls short of. The same holds for the
        constraints, which a share of the outcomes may miss.
    bounds
        By designed input, [lower, upper]; for a surrogate within its box less the largest error drawn.
    method
        ``slsqp``, ``bfgs`` or ``bayesian``.
    starts, evaluations
        As for `tensegra.optimise`.
    draws
        Of the errors, for the search. A statistic of m draws is itself known to a share of about 1/m of its
        spread.
    samples
        Of the errors, to tell what comes of both designs, by the model and by the true one.
    seed, confidence, true_model, name, progress
        As for `tensegra.optimise` and `tensegra.propagate`.

    Raises
    ------
    StudyError
        If the problem cannot be stated so.

    Examples
    --------
    A sharp peak of height 1 at 0.2 and a broad one of height 0.9 at 0.8:

    >>> import numpy as np
    >>> from tensegra.analysis import FunctionModel, robust_optimise
    >>> peaks = lambda X: np.exp(-((X - 0.2) / 0.02) ** 2) + 0.9 * np.exp(-((X - 0.8) / 0.2) ** 2)
    >>> model = FunctionModel(peaks, ("a",), ("y",), np.array([[0.0, 1.0]]))
    >>> found = robust_optimise(model, "y", errors={"a": {"normal": {"mean": 0, "std": 0.02}}}, starts=30)
    >>> round(found.nominal.inputs["a"], 1), round(found.robust.inputs["a"], 1)
    (0.2, 0.8)
    """
    if method == "direct":
        raise StudyError.at(
            "robust.method", method, "slsqp, bfgs or bayesian, with the true model as `model`"
        )
    asked = as_model(model)
    stated = state_problem(
        asked,
        objective,
        bounds=_everything(asked),
        constraints=constraints,
        maximise=maximise,
        search=asked.input_names,
    )
    for constraint in stated.constraints:
        if constraint.equality:
            raise StudyError.at(
                "constraints", constraint.text, "a band such as -0.1 <= v <= 0.1: errors break any equality"
            )
    around = scatter(asked, errors, inputs, search, bounds)
    if not around.scatters:
        raise StudyError("robust: nothing scatters, every input is designed without an error or fixed")
    if isinstance(asked, TrueModel):
        around = replace(around, model=replace(asked, ahead=True))
    measure = Measure.of(kappa, quantile)
    drawn = around.draw(draws, seed)
    box = around.bounds(dict(bounds or {}), drawn)
    optima = {}
    for design, sample in (("robust", drawn), ("nominal", around.centre())):
        optima[design] = optimise(
            _stated(stated, around, measure, sample, box),
            "statistic",
            constraints=[f"margin_{i} >= 0" for i in range(1, len(stated.constraints) + 1)],
            maximise=maximise,
            method=method,
            starts=starts,
            evaluations=evaluations,
            seed=seed,
            name=f"{name}, {design}",
            progress=progress,
        )
    truth = None if true_model is None else as_model(true_model)
    if truth is not None and truth.input_names != asked.input_names:
        expected = f"the inputs {list(asked.input_names)}"
        raise StudyError.at("robust.true_model", list(truth.input_names), expected)
    result = RobustOptimum(
        name=name,
        model=asked.name,
        method=method,
        seed=seed,
        formula=objective,
        constraints=tuple(constraints),
        maximise=maximise,
        measure=measure.words(objective, maximise=maximise),
        laws=around.laws.describe(),
        search=around.design_names,
        n_draws=len(drawn),
        robust=optima["robust"],
        nominal=optima["nominal"],
    )
    spreads = {
        design: _spread(stated, around, truth, optimum.x, samples, seed, confidence, f"{name}, {design}")
        for design, optimum in optima.items()
    }
    return replace(result, spreads=spreads)


def _everything(model: Model) -> dict[str, Sequence[float]]:
    """Return bounds for a problem of which only the formulas are used."""
    if model.bounds is not None:
        return {}
    levels = levels_of(model)
    return {
        name: (levels[name][0], levels[name][-1]) if name in levels else (0, 1) for name in model.input_names
    }


def _stated(
    stated: Problem, around: Scatter, measure: Measure, drawn: Array, box: Mapping[str, Sequence[float]]
) -> RobustModel:
    formulas = (stated.objective, *(constraint.margin for constraint in stated.constraints))
    signs = (1.0 if stated.maximise else -1.0, *(1.0 for _ in stated.constraints))
    return RobustModel(around, formulas, signs, measure, drawn, box)


def _spread(
    stated: Problem,
    around: Scatter,
    truth: Model | None,
    x: Array,
    samples: int,
    seed: int,
    confidence: float,
    name: str,
) -> Propagation:
    """Propagate the errors at one design, through the model and the true one."""
    formulas: dict[str, tuple[Expression, ...]] = {str(stated.objective): (stated.objective,)}
    margins: dict[str, tuple[Expression, ...]] = {}
    for constraint in stated.constraints:
        label = _margin_of(constraint.text)
        margins[label] = (*margins.get(label, ()), constraint.margin)
    formulas |= margins
    known = {key: value for key, value in formulas.items() if key not in stated.model.output_names}
    compared = None
    if truth is not None and truth.name != around.model.name:
        compared = replace(around, model=truth).at(x, known)
    return propagate(
        around.at(x, known),
        around.given(),
        samples=samples,
        method="quasi_monte_carlo",
        compare_with=compared,
        limits=dict.fromkeys(margins, 0.0),
        seed=seed,
        confidence=confidence,
        name=name,
    )


def _margin_of(constraint: str) -> str:
    return f"margin of {constraint}"
