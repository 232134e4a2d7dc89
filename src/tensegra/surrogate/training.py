"""The training of networks with JAX in double precision: Adam and L-BFGS, or Levenberg–Marquardt.

All arithmetic on many points is compiled once per architecture and kept; JAX's global switch for double
precision is left as the user has set it.
"""

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from jax import Array as JaxArray

__all__ = ["levenberg_marquardt", "two_stage"]

Array: TypeAlias = NDArray[np.float64]
Layers: TypeAlias = tuple[tuple[Array, Array], ...]
Sizes: TypeAlias = tuple[int, ...]

LBFGS_MEMORY = 20  # pairs: half the iterations of the usual ten on these small problems
ROWS = 4096  # rows of the Jacobian at once
FIRST_DAMPING = 1e-2
DAMPING = (1e-14, 1e10)
REJECTIONS = 10  # damped steps in a row that do not lower the error: rounding is reached
PROGRESS = 0.9  # of the root mean square error, in ...
PROGRESS_ITERATIONS = 6  # ... this number of iterations: less progress than that is not worth the time


def two_stage(
    first: Layers,
    Z: Array,
    T: Array,
    dT: Array | None,
    adam_iterations: int,
    learning_rate: float,
    lbfgs_iterations: int,
    batch: int | None = None,
) -> Layers:
    """Minimise the mean square error as the source paper does: by Adam, then by L-BFGS.

    Parameters
    ----------
    first
        Weights and offsets to start from.
    Z, T, dT
        Points (n, d), outputs (n, k) and derivatives (n, k, d) or None, standardised.
    adam_iterations, learning_rate
        Of the first stage.
    lbfgs_iterations
        Limit of the second stage, whose iterations use all points.
    batch
        Points of an iteration of the first stage, one part after the other in their order; all where left
        out.

    Returns
    -------
    Layers
        Trained weights and offsets.
    """
    import jax
    from scipy.optimize import minimize

    sizes = sizes_of(first)
    with jax.enable_x64(True):  # noqa: FBT003 - positional-only in JAX
        few = batch if batch is not None and batch < len(Z) else None
        adam, loss = _two_stage_functions(sizes, dT is not None, few)
        data = jax.device_put((Z, T, dT if dT is not None else np.zeros(0)))
        theta = np.asarray(adam(flat(first), *data, adam_iterations, learning_rate))
        # SciPy stops at a decrease that is small beside max(1, loss); the losses here end at 1e-9 or less,
        # so the loss is made relative to its value now, and that test is switched off.
        scale = 1.0 / max(float(loss(theta, *data)[0]), np.finfo(float).tiny)

        def relative(theta: Array) -> tuple[float, Array]:
            value, slope = loss(theta, *data)
            return scale * float(value), scale * np.asarray(slope)

        found = minimize(
            relative,
            theta,
            jac=True,
            method="L-BFGS-B",
            options={
                "maxiter": lbfgs_iterations,
                "maxfun": 2 * lbfgs_iterations,
                "maxcor": LBFGS_MEMORY,
                "ftol": 0.0,
                "gtol": 0.0,
            },
        )
    trained: Layers = layers_of(found.x, sizes)
    return trained


def levenberg_marquardt(first: Layers, Z: Array, T: Array, dT: Array | None, iterations: int) -> Layers:
    """Minimise the sum of squares by damped Gauss–Newton steps (Hagan and Menhaj, 1994).

    Each step solves (JᵀJ + μ) δ = Jᵀr with the Jacobian J of all residuals r by all weights; μ falls after a
    step that lowers the error and rises after one that does not. The training ends at the limit, or when the
    error hardly falls any more.

    Parameters
    ----------
    first, Z, T, dT
        As for `two_stage`.
    iterations
        Limit.

    Returns
    -------
    Layers
        Trained weights and offsets.
    """
    import jax

    sizes = sizes_of(first)
    with jax.enable_x64(True):  # noqa: FBT003 - positional-only in JAX
        residual, jacobian = _residual_functions(sizes, dT is not None)
        n_rows = T.shape[1] * (1 if dT is None else 1 + Z.shape[1])
        step = max(1, ROWS // n_rows)
        blocks = [
            jax.device_put(
                (Z[i : i + step], T[i : i + step], np.zeros(0) if dT is None else dT[i : i + step])
            )
            for i in range(0, len(Z), step)
        ]

        def error(theta: Array) -> float:
            return sum(float(np.sum(np.square(residual(theta, *block)))) for block in blocks)

        def normal_equations(theta: Array) -> tuple[Array, Array]:
            A, g = np.zeros((theta.size, theta.size)), np.zeros(theta.size)
            for block in blocks:
                J = np.asarray(jacobian(theta, *block)).reshape(-1, theta.size)
                A += J.T @ J
                g += np.asarray(residual(theta, *block)).ravel() @ J
            return A, g

        theta = _damped_steps(flat(first), error, normal_equations, iterations)
    trained: Layers = layers_of(theta, sizes)
    return trained


def _damped_steps(
    theta: Array,
    error: Callable[[Array], float],
    normal_equations: Callable[[Array], tuple[Array, Array]],
    iterations: int,
) -> Array:
    """Return the weights where damped Gauss–Newton steps end."""
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    damping, history = FIRST_DAMPING, [error(theta)]
    for _ in range(iterations):
        A, g = normal_equations(theta)
        for _ in range(REJECTIONS):
            damped = A.copy()
            damped[np.diag_indices_from(damped)] += damping
            try:
                trial = theta - cho_solve(cho_factor(damped, overwrite_a=True, check_finite=False), g)
                trial_error = error(trial)
            except LinAlgError:
                trial_error = np.inf
            if trial_error < history[-1]:
                theta, damping = trial, max(damping / 5, DAMPING[0])
                history.append(trial_error)
                break
            damping = min(damping * 4, DAMPING[1])
        else:
            return theta
        if (
            len(history) > PROGRESS_ITERATIONS
            and history[-1] > PROGRESS**2 * history[-1 - PROGRESS_ITERATIONS]
        ):
            return theta
    return theta


@lru_cache(maxsize=16)
def _residual_functions(
    sizes: Sizes, with_derivatives: bool
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return compiled functions: residuals (n, rows), and their Jacobian (n, rows, n_weights)."""
    import jax

    def residual(theta: "JaxArray", z: "JaxArray", t: "JaxArray", dt: "JaxArray") -> Any:  # noqa: ANN401
        return _residual(theta, z, t, dt, sizes, with_derivatives)

    each = (None, 0, 0, 0 if with_derivatives else None)
    return jax.jit(jax.vmap(residual, each)), jax.jit(jax.vmap(jax.jacrev(residual), each))


@lru_cache(maxsize=16)
def _two_stage_functions(
    sizes: Sizes, with_derivatives: bool, batch: int | None
) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return compiled functions: all of Adam's iterations, and the mean square error with its gradient."""
    import jax
    import jax.numpy as jnp
    import optax

    def loss(theta: "JaxArray", Z: "JaxArray", T: "JaxArray", dT: "JaxArray") -> "JaxArray":
        def residual(z: "JaxArray", t: "JaxArray", dt: "JaxArray") -> Any:  # noqa: ANN401
            return _residual(theta, z, t, dt, sizes, with_derivatives)

        each = (0, 0, 0 if with_derivatives else None)
        return jnp.mean(jax.vmap(residual, each)(Z, T, dT) ** 2)

    def adam(
        theta: "JaxArray", Z: "JaxArray", T: "JaxArray", dT: "JaxArray", iterations: int, learning_rate: float
    ) -> Any:  # noqa: ANN401
        optimiser = optax.adam(learning_rate)

        def part(i: int, values: "JaxArray") -> "JaxArray":
            if batch is None or not values.size:
                return values
            first = (i * batch) % (len(Z) - batch + 1)
            return jax.lax.dynamic_slice_in_dim(values, first, batch)

        def iterate(i: int, carry: tuple[Any, Any]) -> tuple[Any, Any]:
            theta, state = carry
            slope = jax.grad(loss)(theta, part(i, Z), part(i, T), part(i, dT))
            update, state = optimiser.update(slope, state)
            return optax.apply_updates(theta, update), state

        trained, _ = jax.lax.fori_loop(0, iterations, iterate, (theta, optimiser.init(theta)))
        return trained

    return jax.jit(adam), jax.jit(jax.value_and_grad(loss))


def _residual(
    theta: "JaxArray", z: "JaxArray", t: "JaxArray", dt: "JaxArray", sizes: Sizes, with_derivatives: bool
) -> Any:  # noqa: ANN401 - JAX types its functions loosely
    """Return the errors at one point: of the outputs and, if wanted, of their derivatives."""
    import jax
    import jax.numpy as jnp

    def outputs(z: "JaxArray") -> Any:  # noqa: ANN401
        layers = layers_of(theta, sizes)
        for W, b in layers[:-1]:
            z = jnp.tanh(z @ W + b)
        return z @ layers[-1][0] + layers[-1][1]

    if not with_derivatives:
        return outputs(z) - t
    return jnp.concatenate([outputs(z) - t, (jax.jacfwd(outputs)(z) - dt).ravel()])


def sizes_of(layers: Layers) -> Sizes:
    """Return the widths of all layers, from the inputs to the outputs."""
    return (layers[0][0].shape[0], *(b.size for _, b in layers))


def flat(layers: Layers) -> Array:
    """Return all weights and offsets in one vector."""
    return np.concatenate([part.ravel() for layer in layers for part in layer])


def layers_of(theta: Any, sizes: Sizes) -> Any:  # noqa: ANN401 - NumPy or JAX arrays alike
    """Return the layers that `flat` made the vector of."""
    layers, start = [], 0
    for n_in, n_out in pairwise(sizes):
        middle, end = start + n_in * n_out, start + (n_in + 1) * n_out
        layers.append((theta[start:middle].reshape(n_in, n_out), theta[middle:end]))
        start = end
    return tuple(layers)
