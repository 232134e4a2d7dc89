"""Whole fields: hundreds of outputs that are combinations of a few modes.

The positions of all nodes and the tensions of all members depend on a few inputs, so they lie close to a
space of few dimensions. A singular value decomposition of the runs finds it, and a surrogate of another kind
learns the coordinates in it (proper orthogonal decomposition; Hesthaven and Ubbiali, *Journal of
Computational Physics* 363, 2018).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.calibration import FEWEST_RUNS, Predictor, cross_calibrated
from tensegra.surrogate.parts import Part, train_part
from tensegra.surrogate.problem import Problem

__all__ = ["Field", "train"]

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Field:
    """Modes, and the surrogate of their amplitudes (`tensegra.surrogate.problem.Model`).

    Parameters
    ----------
    modes
        Outputs of a unit amplitude of each mode, shape (n_modes, n_outputs).
    rest
        Root mean square of what the modes leave of each output, shape (n_outputs,).
    amplitudes
        The surrogate of the amplitudes.
    deviation
        Calibrated factor of each output's standard deviation, shape (n_outputs,).
    """

    modes: Array
    rest: Array
    amplitudes: Part
    deviation: Array

    @property
    def has_std(self) -> bool:
        """Whether the surrogate of the amplitudes knows how far it can be trusted."""
        return self.amplitudes.model.has_std

    def predict(self, Z: Array) -> Array:
        """Return the outputs."""
        return np.asarray(self.amplitudes.predict(Z) @ self.modes)

    def std(self, Z: Array) -> Array:
        """Return calibrated standard deviations: of independent amplitudes, and of what the modes leave."""
        return self.deviation * _spread(self, Z)

    def gradient(self, Z: Array) -> Array:
        """Return the derivatives of the outputs."""
        return np.asarray(self.modes.T @ self.amplitudes.gradient(Z))

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays, settings = self.amplitudes.state("amplitudes")
        arrays |= {"modes": self.modes, "rest": self.rest, "deviation": self.deviation}
        return arrays, {"amplitudes": settings}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        part = Part.from_state(arrays, settings["amplitudes"], "amplitudes")
        return cls(arrays["modes"], arrays["rest"], part, arrays["deviation"])


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    tolerance: float = 1e-6,
    max_modes: int = 60,
    amplitudes: str = "pce",
    options: Mapping[str, Any] | None = None,
) -> Field:
    """Find the modes, and train a surrogate of their amplitudes.

    Parameters
    ----------
    problem
        The standardised runs.
    rng
        Source of all that is random.
    tolerance
        What the modes may leave of the outputs: root mean square over all runs and outputs, each output
        relative to the one of its unit that varies most.
    max_modes
        Limit to their number.
    amplitudes, options
        Kind and options of the surrogate of the amplitudes.

    Returns
    -------
    Field
        Modes and amplitudes; its standard deviations calibrated on runs that a like one has not seen.

    Raises
    ------
    StudyError
        If the tolerance or the number of modes is not positive.
    """
    if not 0 < tolerance < 1:
        raise StudyError.at("field: tolerance", tolerance, "a number between 0 and 1")
    if max_modes < 1:
        raise StudyError.at("field: max_modes", max_modes, "1 or more")
    if amplitudes in {"field", "piecewise", "auto"}:
        raise StudyError.at("field: amplitudes", amplitudes, "another kind")
    modes = _modes(problem, tolerance, max_modes)

    def fitted(problem: Problem, rng: np.random.Generator) -> Field:
        return _with_modes(problem, modes, amplitudes, options or {}, rng)

    def predictor(problem: Problem, rng: np.random.Generator) -> Predictor:
        field = fitted(problem, rng)
        return lambda Z: (field.predict(Z), _spread(field, Z))

    field = fitted(problem, rng)
    if field.has_std and len(problem.Z) >= FEWEST_RUNS:
        field = replace(field, deviation=cross_calibrated(problem, predictor, rng))
    return field


def _modes(problem: Problem, tolerance: float, max_modes: int) -> tuple[Array, Array]:
    """Return the modes, and what yields the amplitudes of an output: shapes (m, k) and (k, m).

    The outputs of a unit are weighted by their sizes: one that hardly varies is solver noise, and, were it
    blown up to the size of the others, would take modes of its own.
    """
    weight = np.where(np.ptp(problem.T, axis=0) > 0, problem.scaling.output_scale, 0.0)
    units = np.array(problem.output_units or [""] * len(weight))
    for unit in np.unique(units):
        largest = weight[units == unit].max()
        weight[units == unit] /= largest if largest > 0 else 1.0
    R = np.linalg.qr(problem.T * weight, mode="r")
    _, size, V = np.linalg.svd(R, full_matrices=False)
    left = np.sqrt(np.append(np.cumsum(size[::-1] ** 2)[::-1], 0.0))
    n_modes = min(max(1, int(np.argmax(left <= tolerance * left[0]))), max_modes, len(size))
    V = V[:n_modes]
    with np.errstate(divide="ignore", invalid="ignore"):
        modes = np.where(weight > 0, V / weight, 0.0)
    return np.ascontiguousarray(modes), np.ascontiguousarray((V * weight).T)


def _with_modes(
    problem: Problem,
    modes: tuple[Array, Array],
    kind: str,
    options: Mapping[str, Any],
    rng: np.random.Generator,
) -> Field:
    """Return the field of given modes, its standard deviations not yet calibrated."""
    shapes, amplitudes = modes
    A = problem.T @ amplitudes
    dA = None if problem.dT is None else np.asarray(amplitudes.T @ problem.dT)
    part = train_part(kind, replace(problem, T=A, dT=dA), rng, options, common_scale=True)
    rest = np.sqrt(np.mean((problem.T - A @ shapes) ** 2, axis=0))
    return Field(shapes, rest, part, np.ones(len(rest)))


def _spread(field: Field, Z: Array) -> Array:
    """Return standard deviations that are not calibrated."""
    variance = field.amplitudes.std(Z) ** 2 @ field.modes**2 + field.rest**2
    return np.asarray(np.sqrt(variance + np.finfo(float).tiny))
