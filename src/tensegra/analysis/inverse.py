"""The inverse problem: the inputs that bring outputs to targets, along a whole trajectory.

At each waypoint the misfit to the targets is made smallest within the bounds, by a dogleg method for least
squares with exact derivatives (Voglis & Lagaris 2004). Where inputs are more than targets, many
would do; a weak pull towards the waypoint before picks the nearest, so that the trajectory is continuous. The
first waypoint is sought from many starts. Then the errors of the inputs are propagated at every waypoint: the
interval that the outputs will really lie in. With a surrogate, its own uncertainty is part of it, and the
true model solves every waypoint again; where it misses, the surrogate is shifted by what it is off and aims
again, and the interval lies around what the true model says.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.aiming import aim_again
from tensegra.analysis.model import as_model, column_index
from tensegra.analysis.scatter import scatter
from tensegra.analysis.searched import mean_of_each
from tensegra.analysis.trajectory import Trajectory
from tensegra.analysis.truth import TrueModel
from tensegra.analysis.waypoints import REACHED, WaypointSearch, conditions_of
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Draws of a surrogate's own error where nothing else scatters.
N_OF_MODEL = 256


def reach(
    model: object,
    targets: Mapping[str, ArrayLike],
    *,
    search: Sequence[str] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    errors: Mapping[str, object] | None = None,
    inputs: Mapping[str, object] | None = None,
    constraints: Sequence[str] = (),
    tolerance: float | Mapping[str, float] | None = None,
    starts: int = 20,
    samples: int = 256,
    seed: int = 0,
    confidence: float = 0.90,
    true_model: object | None = None,
    name: str = "inverse",
    progress: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Find the inputs that bring outputs to targets, along a trajectory.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    targets
        By output, such as the coordinate of a named node: its value at every waypoint, shape (n_waypoints,);
        a number is held all along. NaN leaves an output free at a waypoint.
    search
        Names of the inputs to choose; by default the actuators of the study and what has bounds or errors
        (all inputs of a model that has no actuators), less what `inputs` names. One that is discrete stays
        on its values. All others keep their joint law: the search takes them at their means, the intervals
        hold their scatter.
    bounds
        By designed input, [lower, upper]; the model's own box for the rest.
    errors
        By designed input: the law of the error that adds to it; ``{"same_as": name}`` for a shared one.
    inputs
        By input that is not designed: a law in place of its own, or a number.
    constraints
        Comparisons of formulas over inputs and outputs, such as ``"lowest_eigenvalue >= 1e-3"``, to be kept
        at every waypoint.
    tolerance
        How far an output may miss its target, for all or by output; a thousandth of its scale unless given.
    starts
        Starts of the search at the first waypoint, a Latin hypercube.
    samples, confidence
        Of the errors at each waypoint; level of the intervals.
    seed, true_model, name, progress
        Of the random numbers; solves the waypoints again, and has the last word on what is reached; of the
        result; called with (waypoints done, all).

    Raises
    ------
    StudyError
        If the problem cannot be stated so, or the model fails at every start.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegra.analysis import FunctionModel, reach
    >>> arm = FunctionModel(
    ...     lambda X: np.stack([np.cos(X).sum(axis=1), np.sin(X).sum(axis=1)], axis=1),
    ...     ("shoulder", "elbow"), ("x", "y"), np.array([[0.0, 1.5], [0.0, 3.0]]))
    >>> path = reach(arm, {"x": [1.5, 1.2], "y": 1.0}, errors={"elbow": {"normal": {"mean": 0, "std": 0.01}}})
    >>> path.success, bool((path.low < path.outputs).all() and (path.outputs < path.high).all())
    (True, True)
    """
    asked = as_model(model)
    wanted = _waypoints(targets)
    conditions = conditions_of(asked, constraints)
    used = {name for condition in conditions for name in condition.margin.names} | set(targets)
    if isinstance(asked, TrueModel):
        of = tuple(name for name in asked.output_names if name in used)
        asked = replace(asked, ahead=True, of=of)
    columns = column_index(asked.output_names, tuple(targets), "inverse.targets")
    around = scatter(asked, errors, inputs, search, bounds)
    way = WaypointSearch.of(asked, columns, conditions, around, bounds or {}, starts=starts, seed=seed)
    x, found = way.begin(wanted[0]), []
    for i, target in enumerate(wanted):
        x = way.solve(target, x)
        found.append(x)
        if progress is not None:
            progress(i + 1, len(wanted))
    X = np.array(found)
    allowed = _tolerance(tolerance, tuple(targets), way.scales)
    truth, place = None, list(columns)
    if true_model is not None:
        solver = as_model(true_model)
        if solver.input_names != asked.input_names:
            expected = f"the inputs {list(asked.input_names)}"
            raise StudyError.at("inverse.true_model", list(solver.input_names), expected)
        place = column_index(solver.output_names, tuple(targets), "inverse.true_model")
        solved = replace(way, model=solver, conditions=conditions_of(solver, constraints))
        X, truth = aim_again(way, solved, X, wanted, allowed, place)
    outputs = asked.evaluate(way.inputs(X)).values[:, columns]
    draws = around.draw(samples, seed) if around.scatters else None
    low, high, n_failed = _intervals(way, draws, X, outputs, seed, confidence)
    if truth is not None:
        shift = np.where(truth.valid[:, None], truth.values[:, place] - outputs, 0.0)
        low, high = low + shift, high + shift
    held = mean_of_each(around.laws)
    return Trajectory(
        name=name,
        model=asked.name,
        seed=seed,
        confidence=confidence,
        tolerance=tuple(allowed.tolist()),
        input_names=way.design_names,
        held={name: value for name, value in held.items() if name not in way.design_names},
        x=X,
        bounds=way.box,
        target_names=tuple(targets),
        targets=wanted,
        outputs=outputs,
        # A waypoint is reached when the true model says so.
        reached=_holds(outputs, wanted, allowed) & way.keeps(X) if truth is None else truth.reached,
        low=low,
        high=high,
        laws=around.laws.describe() if around.scatters else {},
        n_samples=samples if around.scatters else 0,
        n_failed=n_failed,
        true_status=None if truth is None else tuple(truth.status.tolist()),
        true_outputs=None if truth is None else truth.values[:, place],
        units=dict(asked.units),
    )


def _waypoints(targets: Mapping[str, ArrayLike]) -> Array:
    """Return the targets (n_waypoints, n_targets), NaN where an output is free."""
    if not targets:
        raise StudyError.at("inverse.targets", {}, "a target for at least one output")
    columns = [np.atleast_1d(np.asarray(values, dtype=float)) for values in targets.values()]
    n = max(column.size for column in columns)
    for name, column in zip(targets, columns, strict=True):
        if column.ndim != 1 or column.size not in {1, n} or np.isinf(column).any():
            raise StudyError.at(f"inverse.targets.{name}", list(column.shape), f"one finite number, or {n}")
    return np.stack([np.broadcast_to(column, (n,)) for column in columns], axis=1)


def _tolerance(tolerance: float | Mapping[str, float] | None, names: tuple[str, ...], scales: Array) -> Array:
    given = tolerance if isinstance(tolerance, Mapping) else dict.fromkeys(names, tolerance)
    column_index(names, tuple(given), "inverse.tolerance")
    found = []
    for name, scale in zip(names, scales, strict=True):
        value = given.get(name)
        if value is not None and not value > 0.0:
            raise StudyError.at("inverse.tolerance", value, "a positive number")
        found.append(REACHED * scale if value is None else value)
    return np.array(found, dtype=float)


def _holds(outputs: Array, targets: Array, allowed: Array) -> NDArray[np.bool_]:
    missed = np.where(
        np.isnan(targets), 0.0, np.abs(outputs - targets)
    )  # a run that failed is NaN, and misses
    return np.asarray((missed <= allowed).all(axis=1))


def _intervals(
    way: WaypointSearch, draws: Array | None, X: Array, outputs: Array, seed: int, confidence: float
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return the ends of the intervals (n_waypoints, n_targets), and how many samples failed."""
    model, rng = way.model, np.random.default_rng(seed)
    levels = np.array([0.5 - confidence / 2, 0.5 + confidence / 2])
    ends, failed = [], []
    for x, output in zip(X, outputs, strict=True):
        own = way.inputs(x[None])
        inputs = own if draws is None else way.around.around(x[None], draws)[0]
        found = np.tile(output, (1, 1)) if draws is None else model.evaluate(inputs).values[:, way.columns]
        std = model.uncertainty(inputs)
        if std is not None:
            n = max(len(found), N_OF_MODEL)
            found = np.resize(found, (n, found.shape[1]))
            found = found + np.resize(std[:, way.columns], found.shape) * rng.standard_normal(found.shape)
        good = np.isfinite(found).all(axis=1)
        failed.append(int((~good).sum()))
        ends.append(
            np.quantile(found[good], levels, axis=0) if good.any() else np.full((2, output.size), np.nan)
        )
    low, high = np.swapaxes(np.array(ends), 0, 1)
    return low, high, np.array(failed, dtype=np.intp)
