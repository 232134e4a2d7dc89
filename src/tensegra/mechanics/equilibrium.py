"""Two ways to an equilibrium: Newton's method, and descent of the potential energy.

Newton's method is quick and finds the equilibrium that is near, stable or not; the path follower
uses it where a good guess is at hand. Descent (Newton steps shifted until the matrix is positive
definite, with a bound on every move) ends in the stable equilibrium that the structure falls into.
"""

from dataclasses import dataclass

import numpy as np

from tensegra.mechanics import kernels
from tensegra.mechanics.arrays import BoolArray, FloatArray
from tensegra.mechanics.tangent import Spectrum, Tangent

RESIDUAL_TOLERANCE = 1e-9
"""‖f − p‖∞ relative to the largest tension or load at which an equilibrium is accepted."""

LENGTH_ROUNDING = 2e-15
"""Relative error of a path length by rounding; EA times it is an error of the tension."""

POLISH_TOLERANCE = 1e-14
"""Iterations go on to this residual as long as they improve it: what rounding leaves."""

ENERGY_ROUNDING = 1e-13
"""Relative differences of the energy below this are rounding, as is what `length_rounding` tells: then the
residual decides."""

ZERO_EIGENVALUE = 1e-11
"""Eigenvalues within this share of the largest EA/l₀ of zero cannot be told from it."""

SMALLEST_SHIFT, LARGEST_SHIFT = 1e-9, 1e6
"""Range of the shift μ of a descent, as shares of the largest EA/l₀."""

FLAT_TENSION = 1e-11
"""Tensions below this share of the reference tension are none: the prestress is lost."""


@dataclass(frozen=True, eq=False)
class Load:
    """What holds still while an equilibrium is sought.

    Attributes
    ----------
    rest_length, stiffness
        Effective rest lengths and EA, shape ``(n_members,)``.
    force
        Nodal forces, weight included, shape ``(n_nodes, 3)``.
    """

    rest_length: FloatArray
    stiffness: FloatArray
    force: FloatArray


@dataclass(frozen=True, eq=False)
class Attempt:
    """Outcome of a search for an equilibrium.

    Attributes
    ----------
    nodes
        Positions reached, shape ``(n_nodes, 3)``.
    converged
        Whether the residual is within tolerance.
    residual
        ‖f − p‖∞ relative to the largest tension or load.
    iterations
        Newton solves.
    flat
        Whether descent ended where nothing carries force any more.
    neutral
        Whether it ended in an equilibrium that rounding cannot tell from a neutral one: K is
        singular, not negative.
    """

    nodes: FloatArray
    converged: bool
    residual: float
    iterations: int
    flat: bool = False
    neutral: bool = False


def unbalanced(
    tangent: Tangent, nodes: FloatArray, load: Load, taut: BoolArray | None = None
) -> tuple[FloatArray, float]:
    """Measure at `nodes`; return f − p over the free coordinates and its relative size.

    The scale is the largest tension or load; where both are so small that a residual of
    `RESIDUAL_TOLERANCE` of them lies below what rounding of the lengths leaves, it is that rounding.
    """
    force = tangent.measure(nodes, load.rest_length, load.stiffness, taut)
    out = np.empty_like(force)
    residual = kernels.out_of_balance(
        force.reshape(-1),
        load.force.reshape(-1),
        tangent.arrays.free.reshape(-1),
        tangent.tension,
        tangent.length,
        load.stiffness,
        load.rest_length,
        LENGTH_ROUNDING / RESIDUAL_TOLERANCE,
        out.reshape(-1),
    )
    return out, residual


def unbalanced_by(
    tangent: Tangent, nodes: FloatArray, load: Load, tension: FloatArray | None
) -> tuple[FloatArray, float]:
    """Measure as `unbalanced` does, with tensions that are unknowns of their own.

    Where `tension`, ``(n_members,)``, is given it decides which cables are slack, and K will be
    built with it.
    """
    if tension is None:
        return unbalanced(tangent, nodes, load)
    balance = unbalanced(tangent, nodes, load, taut=~tangent.arrays.is_cable | (tension > 0.0))
    tangent.stress = tension
    return balance


def predicted_tension(
    tangent: Tangent, load: Load, correction: FloatArray, change: FloatArray | float = 0.0
) -> FloatArray:
    """Return the tensions k (ℓ − l₀ + b·u) after a correction u of the nodes, none negative in a cable.

    Parameters
    ----------
    tangent
        Measured where the correction starts.
    load
        What acts there.
    correction
        Shape ``(n_nodes, 3)``.
    change
        Of the tensions by what else changes with the correction, shape ``(n_members,)``.
    """
    stretch = tangent.length - load.rest_length + tangent.length_rate(correction)
    tension: FloatArray = load.stiffness / load.rest_length * stretch + change
    tension[tangent.arrays.is_cable & (tension < 0.0)] = 0.0
    return tension


def newton(
    tangent: Tangent,
    nodes: FloatArray,
    load: Load,
    *,
    tension: FloatArray | None = None,
    max_iterations: int = 12,
    largest_move: float = np.inf,
    slowest_contraction: float = np.inf,
    polish: bool = True,
) -> Attempt:
    """Solve f = p by Newton's method in positions and tensions, from the positions `nodes`.

    The tensions are unknowns beside the positions, with ℓ(x) − l₀ = T/k as their equations, and
    are eliminated before each solve. What differs from Newton's method in the positions alone is
    that K is built with the tensions as the last solve predicts them, T = k (ℓ − l₀ + b·u), not
    with those of stretches that are still wrong by the square of a rotation. A stiff strut that
    turns no longer spoils K, and a cable goes slack by what it will carry (after Magisano,
    Leonetti & Garcea 2017, doi:10.1016/j.cma.2016.10.043).

    Parameters
    ----------
    tangent
        Workspace; left measured and factorised at the result.
    nodes
        First guess, held coordinates at their prescribed values, shape ``(n_nodes, 3)``.
    load
        Rest lengths, stiffness and forces.
    tension
        First guess of the tensions, shape ``(n_members,)``; those of `nodes` where left out.
    max_iterations
        Solves after which it gives up.
    largest_move
        Distance from the guess, of any coordinate, beyond which it gives up.
    slowest_contraction
        Ratio of successive corrections above which it gives up; the first is not compared, it
        takes back what the guess stretched.
    polish
        Whether to go on below the tolerance as long as it helps.
    """
    x = nodes
    last_move = np.inf
    for iteration in range(max_iterations):
        out, residual = unbalanced_by(tangent, x, load, tension)
        if residual <= RESIDUAL_TOLERANCE:
            out, residual = unbalanced(tangent, x, load)
            if residual <= RESIDUAL_TOLERANCE:
                tangent.factorise()
                if not polish:
                    return Attempt(x, converged=True, residual=residual, iterations=iteration)
                return _polished(tangent, x, load, out, residual, iteration)
        tangent.factorise()
        correction = tangent.solve(-out)
        move = float(np.abs(correction).max(initial=0.0))
        trial = x + correction
        if (
            not np.isfinite(move)
            or (iteration > 1 and move > slowest_contraction * last_move)
            or np.abs(trial - nodes).max(initial=0.0) > largest_move
        ):
            return Attempt(x, converged=False, residual=residual, iterations=iteration + 1)
        tension = predicted_tension(tangent, load, correction)
        x, last_move = trial, move
    out, residual = unbalanced(tangent, x, load)
    tangent.factorise()
    return Attempt(x, residual <= RESIDUAL_TOLERANCE, residual, max_iterations)


def _polished(
    tangent: Tangent, x: FloatArray, load: Load, out: FloatArray, residual: float, iterations: int
) -> Attempt:
    """Go on as long as the residual falls: the digits that the tolerance leaves are free."""
    while residual > POLISH_TOLERANCE and np.isfinite(residual):
        trial = x + tangent.solve(-out)
        trial_out, trial_residual = unbalanced(tangent, trial, load)
        iterations += 1
        if not trial_residual < 0.5 * residual:
            unbalanced(tangent, x, load)
            break
        x, out, residual = trial, trial_out, trial_residual
        tangent.factorise()
    return Attempt(x, converged=True, residual=residual, iterations=iterations)


def potential(tangent: Tangent, nodes: FloatArray, load: Load) -> float:
    """Potential energy Π = Σ ½ (EA/l₀) (ℓ − l₀)² − p·x at the last measure of `tangent`."""
    free = tangent.arrays.free
    return tangent.energy(load.rest_length) - float(np.sum(load.force * nodes, where=free))


def length_rounding(tangent: Tangent) -> float:
    """Return what the rounding of path lengths makes of the potential energy."""
    return LENGTH_ROUNDING * float(np.dot(np.abs(tangent.tension), tangent.length))


def carried_tension(tangent: Tangent, load: Load) -> tuple[float, bool]:
    """Return the largest tension in members that can move, and whether any force acts on the free nodes."""
    carried = float(np.abs(tangent.tension[tangent.arrays.moving]).max(initial=0.0))
    return carried, bool(np.any(load.force[tangent.arrays.free] != 0.0))


def descend(
    tangent: Tangent,
    nodes: FloatArray,
    load: Load,
    *,
    reference_tension: float,
    largest_move: float,
    max_iterations: int = 2000,
) -> Attempt:
    """Fall from `nodes` to a stable equilibrium, or to where nothing carries force.

    Each step solves (K + μI) u = p − f with μ ≥ 0 such that the matrix is positive definite, the
    energy falls and no coordinate moves by more than `largest_move`: a discrete gradient flow,
    which turns into Newton's method where K is positive definite.

    Parameters
    ----------
    tangent
        Workspace; left measured at the result, and factorised unless it is flat.
    nodes
        Where the fall begins, held coordinates at their prescribed values, shape ``(n_nodes, 3)``.
    load
        Rest lengths, stiffness and forces.
    reference_tension
        What counts as much: tensions below `FLAT_TENSION` of it, without loads, are a collapse.
    largest_move
        Bound on a single move, unit of length.
    max_iterations
        Steps after which it gives up.
    """
    x = nodes
    out, residual = unbalanced(tangent, x, load)
    energy = potential(tangent, x, load)
    shift = 0.0
    for iteration in range(max_iterations):
        carried, loaded = carried_tension(tangent, load)
        if not loaded and carried <= FLAT_TENSION * reference_tension:
            return Attempt(x, converged=True, residual=residual, iterations=iteration, flat=True)
        n_negative = tangent.factorise()
        push = out
        if residual <= RESIDUAL_TOLERANCE:
            zero = ZERO_EIGENVALUE * tangent.stiffness_scale
            # The pivots of a singular K are rounding: their signs alone do not say that it stands.
            if n_negative == 0 and tangent.all_eigenvalues_exceed(zero):
                tangent.factorise()
                return _polished(tangent, x, load, out, residual, iteration)
            spectrum = tangent.spectrum(1)
            if spectrum.values[0] > -zero:
                return Attempt(x, converged=True, residual=residual, iterations=iteration, neutral=True)
            push = out + _downhill(tangent, out, spectrum)
        step, shift = _bounded_step(tangent, push, shift, largest_move)
        if step is None:
            break
        trial = x + step
        trial_out, trial_residual = unbalanced(tangent, trial, load)
        trial_energy = potential(tangent, trial, load)
        falls = trial_energy <= energy + 1e-4 * float(np.sum(push * step))
        rounding = ENERGY_ROUNDING * max(abs(energy), abs(trial_energy)) + length_rounding(tangent)
        level = trial_energy <= energy + rounding
        if falls or (level and trial_residual < residual):
            x, out, residual, energy = trial, trial_out, trial_residual, trial_energy
            shift = 0.2 * shift if shift > 1e-10 * tangent.stiffness_scale else 0.0
        else:
            out, residual = unbalanced(tangent, x, load)
            shift = max(5.0 * shift, SMALLEST_SHIFT * tangent.stiffness_scale)
            if shift > LARGEST_SHIFT * tangent.stiffness_scale:
                break
    tangent.factorise()
    return Attempt(x, residual <= RESIDUAL_TOLERANCE and tangent.n_negative == 0, residual, max_iterations)


def _bounded_step(
    tangent: Tangent, push: FloatArray, shift: float, largest_move: float
) -> tuple[FloatArray | None, float]:
    """Return the shifted Newton step and the shift that made it downhill and short enough.

    There is no step where no shift does: two nodes of a segment have met, and K is no number.
    """
    while shift <= LARGEST_SHIFT * tangent.stiffness_scale:
        if tangent.factorise(shift) == 0:
            step = tangent.solve(-push)
            if np.abs(step).max(initial=0.0) <= largest_move:
                return step, shift
        shift = max(4.0 * shift, SMALLEST_SHIFT * tangent.stiffness_scale)
    return None, shift


def _downhill(tangent: Tangent, out: FloatArray, spectrum: Spectrum) -> FloatArray:
    """Return a small force along the lowest mode, to leave a saddle on its lower side."""
    mode = spectrum.vectors[0]
    side = float(np.sign(np.sum(mode * out))) or 1.0
    amplitude = 1e-3 * abs(float(spectrum.values[0])) * tangent.arrays.size
    push: FloatArray = side * amplitude / np.abs(mode).max() * mode
    return push
