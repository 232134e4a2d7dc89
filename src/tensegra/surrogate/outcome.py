"""The outcome of a run as a probability: a small network that ends in a softmax.

Regimes meet in smooth surfaces, and the network's are smooth too; its probabilities are calibrated on runs
that it was not trained on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.surrogate.network import Layers, evaluate, initial_layers

__all__ = ["Outcome", "train_outcome"]

Array: TypeAlias = NDArray[np.float64]

MOST_RUNS = 40_000  # to train on: more only take longer where the outcome is known in thousands of places
CALIBRATION_SHARE, CALIBRATION_POINTS = 0.15, 5_000
WEIGHT_DECAY = 1e-6  # keeps the weights finite where the regimes can be separated without an error
SHRINKAGE = 1e-5  # of the calibration, for the same reason
LBFGS_MEMORY = 20


@dataclass(frozen=True, eq=False)
class Outcome:
    """Probabilities of the regimes at standardised points.

    Parameters
    ----------
    names
        The regimes.
    layers
        The network; none where there is only one regime.
    """

    names: tuple[str, ...]
    layers: Layers

    def probabilities(self, Z: Array) -> Array:
        """Return the probability of each regime, shape (n_points, n_regimes)."""
        if not self.layers:
            return np.ones((len(Z), 1))
        return softmax(evaluate(self.layers, Z))

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Return arrays and settings; see `from_state`."""
        arrays = {f"outcome_weights_{i}": W for i, (W, _) in enumerate(self.layers)}
        arrays |= {f"outcome_offsets_{i}": b for i, (_, b) in enumerate(self.layers)}
        settings = {"names": list(self.names), "layers": len(self.layers)}
        return arrays, settings

    @classmethod
    def from_state(cls, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> Self:
        """Build the model that `state` was taken from."""
        layers = tuple(
            (arrays[f"outcome_weights_{i}"], arrays[f"outcome_offsets_{i}"])
            for i in range(settings["layers"])
        )
        return cls(tuple(settings["names"]), layers)


def train_outcome(
    Z: Array,
    labels: NDArray[np.str_],
    rng: np.random.Generator,
    hidden: Sequence[int],
    iterations: int,
) -> Outcome:
    """Train the probabilities of the regimes on what became of the runs.

    Parameters
    ----------
    Z
        Standardised points, shape (n_points, n_inputs).
    labels
        The regime of each, shape (n_points,).
    rng
        Source of the first weights and of the runs to calibrate on.
    hidden
        Neurons of each hidden layer.
    iterations
        Limit of L-BFGS.
    """
    names, y = np.unique(labels, return_inverse=True)
    if len(names) == 1:
        return Outcome((str(names[0]),), ())
    order = rng.permutation(len(Z))
    n_kept = min(CALIBRATION_POINTS, round(CALIBRATION_SHARE * len(Z)))
    kept, used = order[:n_kept], np.sort(order[n_kept : n_kept + MOST_RUNS])
    layers = _least_surprise(
        initial_layers((Z.shape[1], *hidden, len(names)), rng), Z[used], y[used], iterations
    )
    if n_kept:
        layers = _calibrated(layers, Z[kept], y[kept])
    return Outcome(tuple(map(str, names)), layers)


def softmax(scores: Array) -> Array:
    """Return probabilities in proportion to the exponentials of the scores."""
    weights = np.exp(scores - scores.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _calibrated(layers: Layers, Z: Array, y: NDArray[np.intp]) -> Layers:
    """Scale and shift the scores to the largest likelihood of runs that the network has not seen.

    This is temperature scaling (Guo et al., ICML 2017, section 4.2) with an offset for each regime, so that
    the mean probability of each is its share.
    """
    from scipy.optimize import minimize

    scores = evaluate(layers, Z)

    def surprise(parameters: Array) -> float:
        scaled = scores * np.exp(parameters[0]) + np.append(0.0, parameters[1:])
        top = scaled.max(axis=1)
        total = top + np.log(np.exp(scaled - top[:, None]).sum(axis=1))
        # Regimes without a run among these keep their offsets, and none runs away.
        return float(np.mean(total - scaled[np.arange(len(y)), y]) + SHRINKAGE * np.sum(parameters**2))

    found = minimize(surprise, np.zeros(scores.shape[1])).x
    (W, b), scale = layers[-1], np.exp(found[0])
    return (*layers[:-1], (scale * W, scale * b + np.append(0.0, found[1:])))


def _least_surprise(first: Layers, Z: Array, y: NDArray[np.intp], iterations: int) -> Layers:
    """Minimise the cross entropy, with a little weight decay, by L-BFGS."""
    import jax
    from scipy.optimize import minimize

    from tensegra.surrogate.training import flat, layers_of, sizes_of

    sizes = sizes_of(first)
    with jax.enable_x64(True):  # noqa: FBT003 - positional-only in JAX
        value_and_slope = _cross_entropy(sizes)
        data = jax.device_put((Z, y))

        def surprise(theta: Array) -> tuple[float, Array]:
            value, slope = value_and_slope(theta, *data)
            return float(value), np.asarray(slope)

        found = minimize(
            surprise,
            flat(first),
            jac=True,
            method="L-BFGS-B",
            options={
                "maxiter": iterations,
                "maxfun": 2 * iterations,
                "maxcor": LBFGS_MEMORY,
                "ftol": 0.0,
                "gtol": 1e-9,
            },
        )
    trained: Layers = layers_of(found.x, sizes)
    return trained


@lru_cache(maxsize=16)
def _cross_entropy(sizes: tuple[int, ...]) -> Any:  # noqa: ANN401 - JAX types its functions loosely
    """Return a compiled function: mean cross entropy with weight decay, and its gradient."""
    import jax
    import jax.numpy as jnp

    from tensegra.surrogate.training import layers_of

    def loss(theta: Any, Z: Any, y: Any) -> Any:  # noqa: ANN401
        layers = layers_of(theta, sizes)
        for W, b in layers[:-1]:
            Z = jnp.tanh(Z @ W + b)
        scores = jax.nn.log_softmax(Z @ layers[-1][0] + layers[-1][1])
        chosen = jnp.take_along_axis(scores, y[:, None], axis=1)
        return WEIGHT_DECAY * jnp.sum(theta**2) - jnp.mean(chosen)

    return jax.jit(jax.value_and_grad(loss))
