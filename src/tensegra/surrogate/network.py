"""Neural networks: tanh layers, evaluated and differentiated with NumPy alone, in double or single precision.

`tensegra.surrogate.training` finds the weights (with JAX); what is kept, saved and evaluated is here.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.errors import StudyError
from tensegra.surrogate.coordinates import Coordinates
from tensegra.surrogate.problem import Problem, Scaling
from tensegra.surrogate.threads import one_thread
from tensegra.surrogate.validation import HALF_WIDTH_90

__all__ = ["Layers", "Network", "train"]

Array: TypeAlias = NDArray[np.float64]
Floats: TypeAlias = NDArray[np.floating[Any]]
Layers: TypeAlias = tuple[tuple[Array, Array], ...]  # weights (n_in, n_out) and offsets (n_out,) per layer

BLOCK = 1024  # points at once: a block of a 50-wide layer stays in the level-2 cache

# Of the runs; fewer, and chance moves the interval's 90 % by more than ±2 (one sigma, with 1,000 runs).
CALIBRATION_SHARE, CALIBRATION_POINTS = 0.25, 1_000
FEWEST_RUNS = 10

# `two_stage` is the source paper's recipe: 2 × 50 neurons, Adam for 5,000 iterations, then L-BFGS.
TRAININGS = ("levenberg_marquardt", "two_stage")
HIDDEN = {"levenberg_marquardt": (30, 30), "two_stage": (50, 50)}


@dataclass(frozen=True, eq=False)
class Network:
    """The mean of one or several networks (`tensegra.surrogate.problem.Model`).

    Parameters
    ----------
    members
        The layers of each network.
    deviation
        Calibrated amplitude of each output's standard deviation, shape (n_outputs,); empty for one network.
    floor
        Least disagreement assumed of the members, shape (n_outputs,); empty for one network.
    coordinates
        What the first layer sees of the inputs.
    """

    members: tuple[Layers, ...]
    deviation: Array
    floor: Array
    coordinates: Coordinates

    @property
    def has_std(self) -> bool:
        """True for an ensemble."""
        return len(self.members) > 1

    def predict(self, Z: Array) -> Array:
        """Return the mean of the members' outputs."""
        return np.asarray(self.each(Z).mean(axis=0)) if self.has_std else self.each(Z)[0]

    def predict_fast(self, X: Array, scaling: Scaling) -> Array:
        """Return the outputs in their own units, computed in single precision."""
        if self.coordinates.all_raw:
            shift, scale = scaling.input_shift, scaling.input_scale
        else:
            X = self.coordinates.forward(scaling.inputs(X))
            shift, scale = np.zeros_like(scaling.input_shift), np.ones_like(scaling.input_scale)
        single = [_single(layers, scale, scaling.output_scale / len(self.members)) for layers in self.members]
        states = [_states(layers) for layers in single]
        Y = np.empty((len(X), scaling.output_shift.size))
        with one_thread():
            for start in range(0, len(X), BLOCK):
                # Shifted in double precision, which inputs far from zero would lose digits without.
                A = (X[start : start + BLOCK] - shift).astype(np.float32)
                answers = [_forward(layers, A, state) for layers, state in zip(single, states, strict=True)]
                np.add(sum(answers[1:], answers[0]), scaling.output_shift, out=Y[start : start + BLOCK])
        return Y

    def std(self, Z: Array) -> Array:
        """Return calibrated standard deviations from the members' disagreement."""
        return disagreement(self.each(Z), self.floor) * self.deviation

    def gradient(self, Z: Array) -> Array:
        """Return the mean of the members' derivatives."""
        W = self.coordinates.forward(Z)
        mean = np.asarray(np.mean([slope(layers, W) for layers in self.members], axis=0))
        return self.coordinates.gradient(Z, mean)

    def each(self, Z: Array) -> Array:
        """Return the outputs of each member, shape (n_members, n_points, n_outputs)."""
        W = self.coordinates.forward(Z)
        return np.stack([evaluate(layers, W) for layers in self.members])

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays, settings = self.coordinates.state()
        arrays |= {"deviation": self.deviation, "floor": self.floor}
        for m, layers in enumerate(self.members):
            for i, (W, b) in enumerate(layers):
                arrays |= {f"weights_{m}_{i}": W, f"offsets_{m}_{i}": b}
        return arrays, settings | {"layers": [len(layers) for layers in self.members]}

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        members = tuple(
            tuple((arrays[f"weights_{m}_{i}"], arrays[f"offsets_{m}_{i}"]) for i in range(n_layers))
            for m, n_layers in enumerate(settings["layers"])
        )
        return cls(members, arrays["deviation"], arrays["floor"], Coordinates.from_state(arrays, settings))


def train(
    problem: Problem,
    rng: np.random.Generator,
    *,
    training: str = "levenberg_marquardt",
    hidden: Sequence[int] | None = None,
    iterations: int | None = None,
    adam_iterations: int = 5_000,
    learning_rate: float = 1e-3,
    adam_batch: int | None = None,
    derivatives: bool = True,
    ensemble: int = 1,
) -> Network:
    """Train one network for all outputs, or an ensemble of them.

    Parameters
    ----------
    problem
        The standardised runs. Inputs with heavy tails are learnt in their logarithm
        (`tensegra.surrogate.coordinates`).
    rng
        Source of the first weights and, for an ensemble, of the runs it is calibrated on.
    training
        ``"levenberg_marquardt"`` (the most accurate) or ``"two_stage"``, the source paper's recipe: Adam,
        then L-BFGS, on the mean square error.
    hidden
        Number of neurons of each hidden layer; left out, (30, 30) for Levenberg–Marquardt and (50, 50) for
        the two stages.
    iterations
        Limit of Levenberg–Marquardt (80 where left out) or of L-BFGS (2,000).
    adam_iterations, learning_rate
        Of the first of the two stages.
    adam_batch
        Runs of an iteration of that stage; all of them where left out, which takes long with many runs.
    derivatives
        Use the runs' derivatives if they have any.
    ensemble
        Number of networks, from different first weights. Two or more know a standard deviation, calibrated on
        a quarter of the runs (1,000 at most) that none of them is trained on.

    Returns
    -------
    Network
        The network or the ensemble.

    Raises
    ------
    StudyError
        If there is no such training, or a number is not positive.
    """
    if training not in TRAININGS:
        raise StudyError.at("nn: training", training, f"one of {', '.join(TRAININGS)}", candidates=TRAININGS)
    widths = tuple(HIDDEN[training] if hidden is None else hidden)
    if not widths or min(widths) < 1:
        raise StudyError.at("nn: hidden", hidden, "a number of neurons for each hidden layer")
    if adam_batch is not None and adam_batch < 1:
        raise StudyError.at("nn: adam_batch", adam_batch, "1 or more runs")
    if ensemble < 1:
        raise StudyError.at("nn: ensemble", ensemble, "1 or more networks")

    from tensegra.surrogate.training import levenberg_marquardt, two_stage

    def one(problem: Problem, rng: np.random.Generator) -> Layers:
        Z, T, dT = problem.Z, problem.T, problem.dT if derivatives else None
        first = initial_layers((Z.shape[1], *widths, T.shape[1]), rng)
        if training == "two_stage":
            limit = 2_000 if iterations is None else iterations
            return two_stage(first, Z, T, dT, adam_iterations, learning_rate, limit, adam_batch)
        return levenberg_marquardt(first, Z, T, dT, 80 if iterations is None else iterations)

    coordinates = Coordinates.of(problem)
    problem = coordinates.problem(problem)
    if ensemble == 1:
        return Network((one(problem, rng),), np.zeros(0), np.zeros(0), coordinates)
    order = rng.permutation(len(problem.Z))
    n_kept = min(CALIBRATION_POINTS, round(CALIBRATION_SHARE * len(order)))
    if len(order) < FEWEST_RUNS:
        expected = f"{FEWEST_RUNS} runs or more, to calibrate its interval on"
        raise StudyError.at("nn: ensemble", f"{len(order)} runs", expected)
    kept, used = problem.rows(np.sort(order[:n_kept])), problem.rows(np.sort(order[n_kept:]))
    members = tuple(one(used, stream) for stream in rng.spawn(ensemble))
    return calibrated(members, kept.Z, kept.T, coordinates)


def initial_layers(sizes: Sequence[int], rng: np.random.Generator) -> Layers:
    """Return random weights after Glorot and Bengio (AISTATS 2010, Eq. 16), and offsets of zero."""
    layers = []
    for n_in, n_out in pairwise(sizes):
        limit = np.sqrt(6.0 / (n_in + n_out))
        layers.append((rng.uniform(-limit, limit, size=(n_in, n_out)), np.zeros(n_out)))
    return tuple(layers)


def evaluate(layers: Layers, Z: Array) -> Array:
    """Return the outputs of one network, shape (n_points, n_outputs).

    The blocks are so small that threads of the linear algebra would wait for each other.
    """
    Y, states = np.empty((len(Z), layers[-1][1].size)), _states(layers)
    with one_thread():
        for start in range(0, len(Z), BLOCK):
            Y[start : start + BLOCK] = _forward(layers, Z[start : start + BLOCK], states)
    return Y


def _states(layers: Layers) -> list[Array]:
    """Return room for the states of a block of points in the hidden layers."""
    return [np.empty((BLOCK, b.size), dtype=b.dtype) for _, b in layers[:-1]]


def _forward(layers: Layers, A: Floats, states: Sequence[Floats]) -> Array:
    """Return the outputs at a block of points, in the precision of the layers."""
    for (W, b), state in zip(layers[:-1], states, strict=True):
        A = np.matmul(A, W, out=state[: len(A)])
        A += b
        np.tanh(A, out=A)
    W, b = layers[-1]
    return np.asarray(A @ W + b)


def _single(layers: Layers, input_scale: Array, output_scale: Array) -> Layers:
    """Return a network in single precision: from shifted inputs to its share of the outputs without shift."""
    weights, offsets = [W for W, _ in layers], [b for _, b in layers]
    weights[0] = weights[0] / input_scale[:, None]
    weights[-1], offsets[-1] = weights[-1] * output_scale, offsets[-1] * output_scale
    return tuple((W.astype(np.float32), b.astype(np.float32)) for W, b in zip(weights, offsets, strict=True))


def slope(layers: Layers, Z: Array) -> Array:
    """Return the derivatives of one network, shape (n_points, n_outputs, n_inputs), from the outputs back."""
    states = [Z]
    for W, b in layers[:-1]:
        states.append(np.tanh(states[-1] @ W + b))
    G = np.broadcast_to(layers[-1][0].T, (len(Z), *layers[-1][0].T.shape))
    for (W, _), A in zip(layers[-2::-1], states[:0:-1], strict=True):
        G = (G * (1.0 - A**2)[:, None, :]) @ W.T
    return np.asarray(G)


def disagreement(outputs: Array, floor: Array) -> Array:
    """Return the standard deviation between members, and `floor` where they happen to agree."""
    return np.asarray(np.hypot(outputs.std(axis=0, ddof=1), floor))


def calibrated(members: tuple[Layers, ...], Z: Array, T: Array, coordinates: Coordinates) -> Network:
    """Return the ensemble whose 90 % intervals hold at 90 % of points that no member was trained on.

    The floor is half the median disagreement: that of a few members scatters, and where they happen to agree
    they must not promise to be exact.
    """
    outputs = np.stack([evaluate(layers, Z) for layers in members])
    floor = np.maximum(0.5 * np.median(outputs.std(axis=0, ddof=1), axis=0), np.finfo(float).tiny)
    residual = np.abs(outputs.mean(axis=0) - T)
    factor = np.quantile(residual / disagreement(outputs, floor), 0.9, axis=0) / HALF_WIDTH_90
    return Network(members, np.asarray(factor), floor, coordinates)
