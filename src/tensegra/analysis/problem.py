"""What is optimised: an objective and constraints over a model's outputs and inputs, in a box.

Inside, every method works on the same scaled problem: minimise f(z) over the unit cube subject to c(z) ≥ 0
(or c(z) = 0), where z is the position in the box, f the objective (its sign turned where it is maximised) and
both are measured by their spread over the starts. One tolerance then means the same for a displacement in
millimetres and a ratio. Outside, in the trace and the result, all is in the study's units.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.compiled import contiguous
from tensegra.analysis.discrete import Levels
from tensegra.analysis.expression import Constraint, Expression, parse_constraint, parse_expression
from tensegra.analysis.model import Evaluation, Model, SurrogateModel
from tensegra.analysis.searched import held_values, levels_of, searched_inputs
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# A margin counts as kept when it misses by less than this share of its spread: above what the methods leave
# behind (1e-9), below what anyone could measure.
FEASIBLE = 1e-8


@dataclass(frozen=True)
class Assessment:
    """The objective and the margins at points (n, d), in the study's units.

    `objective` is NaN where the model failed or the formula is undefined; `margins` is (n, n_constraints).
    """

    X: Array
    outputs: Array
    objective: Array
    margins: Array

    def rows(self, index: slice) -> "Assessment":
        """Return some of the points."""
        return Assessment(*(getattr(self, name)[index] for name in Assessment.__annotations__))


@dataclass(frozen=True)
class Local:
    """The scaled problem and its derivatives at one point; all arrays are contiguous."""

    f: float
    df: Array
    c: Array
    dc: Array

    def __post_init__(self) -> None:
        for name in ("df", "c", "dc"):
            object.__setattr__(self, name, contiguous(getattr(self, name)))


@dataclass(frozen=True)
class Scales:
    """Spread of the objective and of the margins, and the typical size of each kink's argument."""

    objective: float
    margins: Array
    kinks: Array


@dataclass(frozen=True)
class Problem:
    """An optimisation problem; built by `state_problem`.

    Attributes
    ----------
    model
        Answers for the outputs.
    objective, constraints
        Formulas over the outputs and inputs of the model.
    bounds
        The box (d, 2), without width for an input that is held.
    maximise
        Whether the largest objective is wanted.
    search
        Names of the inputs that are searched; the others are held.
    levels
        The values that discrete inputs take, in the unit cube.
    """

    model: Model
    objective: Expression
    constraints: tuple[Constraint, ...]
    bounds: Array
    maximise: bool
    search: tuple[str, ...]
    levels: Levels

    @property
    def held(self) -> dict[str, float]:
        """The number at which each input that is not searched is held."""
        pairs = zip(self.model.input_names, self.bounds[:, 0].tolist(), strict=True)
        return {name: value for name, value in pairs if name not in self.search}

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which inputs have no room in the box, shape (d,)."""
        return np.asarray(self.bounds[:, 0] == self.bounds[:, 1])

    @property
    def n_inputs(self) -> int:
        """Number of variables d."""
        return len(self.bounds)

    @cached_property
    def used_outputs(self) -> tuple[str, ...]:
        """The outputs that the formulas use."""
        formulas = (self.objective, *(constraint.margin for constraint in self.constraints))
        names = {name for formula in formulas for name in formula.names}
        return tuple(name for name in self.model.output_names if name in names)

    def from_unit(self, Z: ArrayLike) -> Array:
        """Map the unit cube to the box."""
        low, high = self.bounds.T
        Z = np.asarray(Z, dtype=float)
        X = np.asarray(np.clip(low + Z * (high - low), low, high))
        return self.levels.restore(Z, X) if self.levels.mask.any() and Z.ndim == 2 else X

    def to_unit(self, X: ArrayLike) -> Array:
        """Map the box to the unit cube; an input that is held lies at 0."""
        low, high = self.bounds.T
        return np.asarray((np.asarray(X, dtype=float) - low) / np.where(high > low, high - low, 1.0))

    def columns(self, X: Array, outputs: Array) -> dict[str, Array]:
        """Return inputs and outputs by name, as the formulas want them."""
        named = dict(zip(self.model.input_names, X.T, strict=True))
        return named | dict(zip(self.model.output_names, outputs.T, strict=True))

    def assess(self, X: Array, found: Evaluation) -> Assessment:
        """Apply the formulas, as they are written, to the model's answer at `X`."""
        columns = self.columns(X, found.values)
        objective = np.broadcast_to(self.objective(columns), (len(X),))
        margins = [np.broadcast_to(constraint.margin(columns), (len(X),)) for constraint in self.constraints]
        stacked = np.stack(margins, axis=1) if margins else np.zeros((len(X), 0))
        usable = found.valid & np.isfinite(objective) & np.isfinite(stacked).all(axis=1)
        return Assessment(X, found.values, np.where(usable, objective, np.nan), stacked)

    def violation(self, margins: Array, scales: Scales) -> Array:
        """Return the largest scaled violation (n,) of the constraints; 0 where all hold."""
        if not self.constraints:
            return np.zeros(len(margins))
        equality = np.array([constraint.equality for constraint in self.constraints])
        scaled = margins / scales.margins
        return np.asarray(np.where(equality, np.abs(scaled), np.maximum(-scaled, 0.0)).max(axis=1))

    def scales(self, assessment: Assessment) -> Scales:
        """Measure the spread of everything over a first set of points.

        Raises
        ------
        StudyError
            If the model failed at all of them.
        """
        usable = np.isfinite(assessment.objective)
        if not usable.any():
            raise StudyError(
                f"optimisation: the model {self.model.name!r} or the objective '{self.objective}' "
                f"gave no number at any of the {len(usable)} starting points"
            )
        columns = self.columns(assessment.X[usable], assessment.outputs[usable])
        kinks = [np.median(np.abs(e.kink_arguments(columns)), axis=1) for e in self._formulas]
        flat = np.concatenate(kinks) if kinks else np.zeros(0)
        return Scales(
            objective=float(_spread(assessment.objective[usable])),
            margins=np.array([_spread(column) for column in assessment.margins[usable].T]),
            kinks=np.where(flat > 0.0, flat, 1.0),
        )

    def localise(self, X: Array, found: Evaluation, scales: Scales, smoothing: Array) -> list[Local]:
        """Return the scaled problem and its derivatives; `smoothing` (n,) is relative to the kinks.

        A point where the model fails is infinitely bad, which makes a line search step back from it. So is
        one that misses a condition which has no slope there, such as a number of slack cables: no descent
        would mend it.
        """
        n, d = X.shape
        gradient = self.model.gradient(X)
        columns = self.columns(X, found.values)
        chain = np.concatenate([np.broadcast_to(np.eye(d), (n, d, d)), gradient], axis=1)
        seeds = (*self.model.input_names, *self.model.output_names)
        width = self.bounds[:, 1] - self.bounds[:, 0]
        values, slopes, offset = [], [], 0
        for formula, scale in zip(self._formulas, (scales.objective, *scales.margins), strict=True):
            used = [seeds.index(name) for name in formula.names]
            kinks = scales.kinks[offset : offset + formula.n_kinks, None]
            offset += formula.n_kinks
            rounded = kinks * smoothing if formula.n_kinks and smoothing.any() else None
            value, partials = formula.value_and_partials(columns, smoothing=rounded)
            values.append(np.broadcast_to(value, (n,)) / scale)
            slope = np.einsum("ns,nsd->nd", np.broadcast_to(partials, (n, len(used))), chain[:, used])
            slopes.append(slope * width / scale)
        sign = -1.0 if self.maximise else 1.0
        f, c = sign * values[0], np.stack(values[1:], axis=1) if self.constraints else np.zeros((n, 0))
        df, dc = sign * slopes[0], np.stack(slopes[1:], axis=1) if self.constraints else np.zeros((n, 0, d))
        usable = found.valid & np.isfinite(f) & np.isfinite(c).all(axis=1)
        usable &= np.isfinite(df).all(axis=1) & np.isfinite(dc).all(axis=(1, 2))
        equality = np.array([constraint.equality for constraint in self.constraints], dtype=bool)
        missed = np.where(equality, c != 0.0, c < 0.0)
        usable &= ~(missed & ~np.asarray(dc, dtype=bool).any(axis=2)).any(axis=1)
        return [
            Local(float(f[i]), df[i], c[i], dc[i])
            if usable[i]
            else Local(np.inf, np.zeros(d), np.zeros(c.shape[1]), np.zeros((c.shape[1], d)))
            for i in range(n)
        ]

    @property
    def has_kinks(self) -> bool:
        """Whether any formula holds ``abs``, ``min`` or ``max`` that could not be split away."""
        return any(formula.n_kinks for formula in self._formulas)

    @property
    def _formulas(self) -> tuple[Expression, ...]:
        return (self.objective, *(constraint.margin for constraint in self.constraints))


@dataclass
class Recorder:
    """Asks the model on behalf of a method, and keeps every evaluation."""

    problem: Problem
    progress: Callable[[int, int], None] | None = None
    expected: int = 0
    starts: list[NDArray[np.intp]] = field(default_factory=list)
    parts: list[Assessment] = field(default_factory=list)
    n_evaluations: int = 0

    def evaluate(self, Z: ArrayLike, starts: Iterable[int]) -> tuple[Array, Evaluation, Assessment]:
        """Evaluate points of the unit cube, each for the start that asked."""
        return self.evaluate_at(self.problem.from_unit(np.atleast_2d(np.asarray(Z, dtype=float))), starts)

    def evaluate_at(self, X: Array, starts: Iterable[int]) -> tuple[Array, Evaluation, Assessment]:
        """Evaluate points (n, n_inputs) in the problem's units."""
        found = self.problem.model.evaluate(X)
        assessment = self.problem.assess(X, found)
        self.parts.append(assessment)
        self.starts.append(np.fromiter(starts, dtype=np.intp))
        self.n_evaluations += len(X)
        if self.progress is not None:
            self.progress(self.n_evaluations, self.expected)
        return X, found, assessment

    def adopt(self, X: Array, outputs: Array) -> None:
        """Take in evaluations (n, …) of an earlier search as its first ones."""
        self.parts.append(self.problem.assess(X, Evaluation.of_values(outputs)))
        self.starts.append(np.zeros(len(X), dtype=np.intp))
        self.n_evaluations += len(X)

    def all(self) -> tuple[Assessment, NDArray[np.intp]]:
        """Return every evaluation in order, and the start that each belongs to."""
        joined = Assessment(
            *(
                np.concatenate([getattr(part, name) for part in self.parts])
                for name in Assessment.__annotations__
            )
        )
        return joined, np.concatenate(self.starts)


def state_problem(
    model: Model,
    objective: str,
    *,
    bounds: Mapping[str, Sequence[float]] | None = None,
    constraints: Sequence[str] = (),
    maximise: bool = False,
    search: Sequence[str] | None = None,
    inputs: Mapping[str, object] | None = None,
) -> Problem:
    """Read the formulas, settle what is searched, and the box.

    Parameters
    ----------
    model, objective, bounds, constraints, maximise
        The problem.
    search, inputs
        What is searched and where the rest is held, as `tensegra.analysis.searched` settles it.

    Raises
    ------
    StudyError
        For a formula that cannot be read, an unknown variable, one that is told both to be searched and not
        to, a bound that is none, a box that leaves that of a surrogate, and a name that is both input and
        output.
    """
    names = (*model.input_names, *model.output_names)
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise StudyError.at("optimisation", doubled[0], "a name that is not both a variable and an output")
    conditions = [
        condition
        for number, text in enumerate(constraints)
        for condition in parse_constraint(
            text, names, counts=getattr(model, "counts", ()), place=f"constraints[{number}]"
        )
    ]
    formula = parse_expression(objective, names, place="objective")
    bounds, inputs = bounds or {}, inputs or {}
    searched = searched_inputs(model, search, inputs, {"bounds": bounds})
    for condition in conditions:
        if set(condition.margin.names) <= set(model.input_names) - set(searched):
            expected = f"a condition that what is searched ({', '.join(searched)}) can move"
            raise StudyError.at("constraints", condition.text, expected)
    held = {name: (value, value) for name, value in held_values(model, searched, inputs).items()}
    box = _box(model, {**bounds, **held})
    levels = Levels.of(model.input_names, box, levels_of(model))
    confined = getattr(model, "confined", None)  # no difference step is to leave the box
    model = model if confined is None else confined(box)
    return Problem(model, formula, tuple(conditions), box, maximise, searched, levels)


def _box(model: Model, bounds: Mapping[str, Sequence[float]]) -> Array:
    rows = []
    for column, name in enumerate(model.input_names):
        own = None if model.bounds is None else model.bounds[column]
        if name not in bounds and own is None:
            raise StudyError.at("bounds", sorted(bounds), f"bounds of {name!r} too: the model has none")
        row = np.array(bounds.get(name, own), dtype=float)
        place = f"bounds.{name}"
        if row.shape != (2,) or not np.isfinite(row).all() or row[0] > row[1]:
            raise StudyError.at(place, bounds.get(name), "two finite numbers [lower, upper]")
        if isinstance(model, SurrogateModel) and own is not None:
            slack = 1e-9 * (own[1] - own[0])
            if row[0] < own[0] - slack or row[1] > own[1] + slack:
                box = [float(own[0]), float(own[1])]
                raise StudyError.at(
                    place, row.tolist(), f"within the box {box} that the surrogate was trained in"
                )
        rows.append(row)
    return np.array(rows)


def _spread(values: Array) -> float:
    """Return the standard deviation, or the size, or 1: something positive to measure `values` by."""
    for size in (values.std(), np.abs(values).max()):
        if size > 1e-12 * max(float(np.abs(values).max()), np.finfo(float).tiny):
            return float(size)
    return 1.0
