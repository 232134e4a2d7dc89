"""The search for the inputs of one waypoint: bounded least squares, with exact derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.compiled import least_squares
from tensegra.analysis.discrete import MOST_COMBINATIONS, Levels
from tensegra.analysis.expression import Constraint, parse_constraint
from tensegra.analysis.model import Model
from tensegra.analysis.scatter import Scatter
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Weight of the pull towards the waypoint before, in units of the box, against a misfit in units of its scale:
# it moves a reachable target by a millionth of the scale at most.
PULL = 1e-3
# A target is reached where its misfit is below this share of the output's scale, unless a tolerance is given.
REACHED = 1e-3
# Of the descent, in units of the box and the scales.
TOLERANCE = 1e-9
# Cost of a waypoint that is not reached from the one before: half the square of `REACHED`, and the pull.
MISSED = 0.5 * (REACHED**2 + PULL**2)
# Starts whose descent is followed, at the first waypoint and where one is not reached from the one before.
N_FOLLOWED = 5


@dataclass(frozen=True)
class WaypointSearch:
    """Least squares in the unit cube of the designed inputs."""

    model: Model
    columns: list[int]
    conditions: tuple[Constraint, ...]
    around: Scatter
    nominal: Array
    box: Array
    levels: Levels
    starts: Array
    answers: Array
    scales: Array
    room: Array

    @classmethod
    def of(
        cls,
        model: Model,
        columns: list[int],
        conditions: tuple[Constraint, ...],
        around: Scatter,
        bounds: Mapping[str, Sequence[float]],
        *,
        starts: int,
        seed: int,
    ) -> "WaypointSearch":
        """Settle box and scales, and try the starts."""
        from scipy.stats import qmc

        drawn = around.draw(64, seed)
        limits = around.bounds(dict(bounds), drawn)
        box = np.array(list(limits.values()))
        levels = Levels.of(tuple(limits), box, around.levels)
        confined = getattr(model, "confined", None)  # no difference step is to leave the box
        if confined is not None:
            whole = np.tile(around.centre()[0][:, None], (1, 2))
            whole[around.is_designed] = box
            model = confined(whole)
        Z = levels.snap(qmc.LatinHypercube(len(box), rng=np.random.default_rng(seed)).random(starts))
        nothing = np.zeros(0)
        nominal = np.where(around.is_designed, 0.0, around.centre()[0])
        found = cls(model, columns, conditions, around, nominal, box, levels, Z, nothing, nothing, nothing)
        inputs_tried = found.inputs(found.from_unit(Z))
        values = model.evaluate(inputs_tried).values
        answers, margins = values[:, columns], found.margins(inputs_tried, values)[0]
        usable = np.isfinite(answers).all(axis=1)
        if not usable.any():
            raise StudyError(f"inverse: the model {model.name!r} failed at all of the {starts} starts")
        scales, room = (_positive(part[usable].std(axis=0)) for part in (answers, margins))
        return replace(found, answers=answers, scales=scales, room=room)

    def margins(self, inputs: Array, values: Array, slopes: Array | None = None) -> tuple[Array, Array]:
        """Return what is left of each condition (n, n_conditions), and its derivatives from `slopes`."""
        names = (*self.model.input_names, *self.model.output_names)
        columns = dict(zip(names, np.concatenate([inputs, values], axis=1).T, strict=True))
        n, d = inputs.shape
        found, rates = np.zeros((n, len(self.conditions))), np.zeros((n, len(self.conditions), d))
        for c, condition in enumerate(self.conditions):
            value, partials = condition.margin.value_and_partials(columns)
            found[:, c] = value
            if slopes is not None:
                chain = np.concatenate([np.broadcast_to(np.eye(d), (n, d, d)), slopes], axis=1)
                used = [names.index(name) for name in condition.margin.names]
                rates[:, c] = np.einsum(
                    "ns,nsd->nd", np.broadcast_to(partials, (n, len(used))), chain[:, used]
                )
        return found, rates

    def keeps(self, X: Array) -> NDArray[np.bool_]:
        """Tell at which designs (n, n_designed) all conditions hold, to a share `REACHED` of their spread."""
        inputs = self.inputs(X)
        margins, _ = self.margins(inputs, self.model.evaluate(inputs).values)
        return np.asarray((margins >= -REACHED * self.room).all(axis=1))

    @property
    def is_designed(self) -> NDArray[np.bool_]:
        """Which inputs are designed, shape (n_inputs,)."""
        return self.around.is_designed

    @property
    def design_names(self) -> tuple[str, ...]:
        """Names of the designed inputs."""
        return self.around.design_names

    def inputs(self, X: Array) -> Array:
        """Return all inputs (n, n_inputs) of designs (n, n_designed)."""
        full = np.tile(self.nominal, (len(X), 1))
        full[:, self.is_designed] = X
        return full

    def from_unit(self, Z: Array) -> Array:
        """Map the unit cube to the box."""
        low, high = self.box.T
        return self.levels.restore(
            np.atleast_2d(Z), np.atleast_2d(np.clip(low + Z * (high - low), low, high))
        )

    def begin(self, target: Array) -> Array:
        """Return the first solution, the nearest to rest."""
        return self._from_starts(target, np.clip(0.0, *self.box.T))[1]

    def solve(self, target: Array, x: Array) -> Array:
        """Return the solution nearest to `x`: from there if it is reached, else from the starts too."""
        low, high = self.box.T
        cost, found = self._descend(target, x, (x - low) / (high - low))
        if cost > MISSED:
            return min((cost, found), self._from_starts(target, x), key=lambda pair: pair[0])[1]
        return found

    def _from_starts(self, target: Array, before: Array) -> tuple[float, Array]:
        """Return the best end of the descents from the most promising starts."""
        misfit = np.nan_to_num((self.answers - target) / self.scales, nan=0.0)
        merit = np.where(np.isfinite(self.answers).all(axis=1), (misfit**2).sum(axis=1), np.inf)
        order = np.argsort(merit, kind="stable")[:N_FOLLOWED]
        ends = [self._descend(target, before, self.starts[i]) for i in order if np.isfinite(merit[i])]
        return min(ends, key=lambda pair: pair[0])

    def _descend(self, target: Array, before: Array, z: Array) -> tuple[float, Array]:
        """Return the cost and the place where the descent from `z` ends, discrete inputs on their values."""
        nothing = np.zeros(len(z), dtype=bool)
        mask = self.levels.mask
        if not mask.any():
            return self._in_the_rest(target, before, z, nothing)
        if self.levels.n_combinations <= MOST_COMBINATIONS:
            chosen = self.levels.combinations()
        else:
            _, relaxed = self._in_the_rest(target, before, z, nothing)
            low, high = self.box.T
            chosen = self.levels.around((relaxed - low) / (high - low))
        ends = [self._in_the_rest(target, before, np.where(mask, c, z), mask) for c in chosen]
        best = min(ends, key=lambda pair: pair[0])
        while self.levels.n_combinations > MOST_COMBINATIONS:  # move on as long as that is better
            low, high = self.box.T
            beside = self.levels.beside((best[1] - low) / (high - low))
            found = min(
                (self._in_the_rest(target, before, c, mask) for c in beside),
                key=lambda pair: pair[0],
                default=best,
            )
            if found[0] >= best[0]:
                break
            best = found
        return best

    def _in_the_rest(
        self, target: Array, before: Array, z: Array, frozen: NDArray[np.bool_]
    ) -> tuple[float, Array]:
        """Return the cost and the place where the descent in what is not `frozen` ends."""
        low, width = self.box[:, 0], self.box[:, 1] - self.box[:, 0]
        asked, free = np.isfinite(target), ~frozen

        def whole(part: Array) -> Array:
            point = z.copy()
            point[free] = part
            return point

        def residual(part: Array) -> Array:
            point = whole(part)
            inputs = self.inputs(self.from_unit(point))
            values = self.model.evaluate(inputs).values
            misfit = (values[0, self.columns] - target)[asked] / self.scales[asked]
            missed = np.minimum(self.margins(inputs, values)[0][0] / self.room, 0.0)
            return np.concatenate([misfit, missed, PULL * (point - (before - low) / width)])

        def slope(part: Array) -> Array:
            inputs = self.inputs(self.from_unit(whole(part)))
            values, slopes = self.model.evaluate(inputs).values, self.model.gradient(inputs)
            margins, rates = self.margins(inputs, values, slopes)
            misfit = slopes[0, self.columns][asked] / self.scales[asked, None]
            missed = np.where(margins[0] < 0.0, 1.0 / self.room, 0.0)[:, None] * rates[0]
            scaled = np.concatenate([misfit, missed])[:, self.is_designed] * width
            return np.vstack([scaled, PULL * np.eye(len(z))])[:, free]

        inside = np.clip(z[free], 1e-9, 1.0 - 1e-9)  # the method wants a start strictly within the bounds
        first = residual(inside)
        if not np.isfinite(first).all():
            return np.inf, self.from_unit(z)[0]
        if not free.any():
            return 0.5 * float(first @ first), self.from_unit(z)[0]
        result = least_squares(
            residual,
            inside,
            slope,
            bounds=(0.0, 1.0),
            method="dogbox",  # which lets inputs rest on their bounds
            xtol=TOLERANCE,
            ftol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=60,
        )
        return float(result.cost), self.from_unit(whole(result.x))[0]


def conditions_of(model: Model, constraints: Sequence[str]) -> tuple[Constraint, ...]:
    """Read constraints, of which none may be an equality."""
    names, counts = (*model.input_names, *model.output_names), getattr(model, "counts", ())
    found = [
        condition
        for i, text in enumerate(constraints)
        for condition in parse_constraint(text, names, counts=counts, place=f"constraints[{i}]")
    ]
    for condition in found:
        if condition.equality:
            raise StudyError.at("constraints", condition.text, "an inequality; an equality is a target")
    return tuple(found)


def _positive(sizes: Array) -> Array:
    return np.where(sizes > 0.0, sizes, 1.0)
