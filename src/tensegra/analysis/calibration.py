"""Calibration: what measurements say about parameters that nobody could measure.

With measured values y of standard deviations σ, and a model f, the posterior of the parameters θ is

    p(θ | y) ∝ p(θ) · exp(−½ Σ ((f(θ) − y)/s)²),   s² = σ² + the surrogate's own variance,   (A1)

taken at the mode. It is drawn from by populations of particles (`tensegra.analysis.tempering`) in the normal
space of the prior (`tensegra.analysis.priors`), with the model's exact derivatives. They start about the
modes that least squares finds from several points, and all over the prior, so that several peaks and curved
ridges are found and weighted. What the posterior predicts is set beside every measurement.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegra.analysis.compiled import least_squares
from tensegra.analysis.inputs import SameAs
from tensegra.analysis.measurements import Measurements
from tensegra.analysis.model import Model, SurrogateModel, as_model, column_index
from tensegra.analysis.posterior import Calibration, Prediction, summarise_parameters
from tensegra.analysis.priors import Prior, prior_of
from tensegra.analysis.tempering import Populations, Reference, lead
from tensegra.analysis.truth import TrueModel
from tensegra.errors import StudyError

Array = NDArray[np.float64]

# Points that least squares starts from: the prior's middle and some draws of it.
N_STARTS = 12
# A mode whose density is below exp(−20) of the best holds nothing of the posterior; and more of them than
# this are the points of one ridge.
NEGLIGIBLE, MOST_MODES = 20.0, 6
# Two ends of least squares this near to each other, in standard deviations of the prior, are one mode.
SAME_MODE = 1e-3
# A posterior lies at an end of its prior where more than this share of it is in the last hundredth of the
# prior there, and outside a box where more than this share of it is, rounding apart.
END, AT_THE_END = 0.01, 0.5
OUTSIDE, BOX_SLACK = 0.01, 1e-9
# Draws of the prior and the posterior that are kept for the figures, and those that predictions are made of.
N_SHOWN, N_PREDICTED = 1000, 1000


def calibrate(
    model: object,
    measurements: Mapping[str, ArrayLike],
    *,
    inputs: Mapping[str, object] | None = None,
    chains: int = 8,
    warmup: int = 150,
    draws: int = 400,
    seed: int = 0,
    confidence: float = 0.90,
    true_model: object | None = None,
    name: str = "calibration",
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """Infer a model's inputs from measurements of its outputs.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    measurements
        A row per measured state: columns of the inputs that were known, of the outputs that were measured
        (NaN for a cell that was not) and of their standard deviations, ``<output>_std``.
        `tensegra.analysis.read_measurements` reads a CSV file.
    inputs
        By input that the measurements do not tell: its prior, a number that it is fixed at, or ``SameAs``
        another; its law in the study for the rest. What is not fixed is inferred.
    chains, draws
        Populations of particles, whose agreement is checked, and particles in each, the draws. They move
        together, as one batch of the model.
    warmup
        Most trajectories of a particle on its way to the posterior.
    seed, confidence, name
        Of all random numbers; of the intervals (equal tails); of the result.
    true_model
        Solves the measured states again at the posterior's mode.
    progress
        Called with (hundredths of the way done, 100).

    Raises
    ------
    StudyError
        If the measurements do not fit the model, nothing is left to infer, or the model fails wherever it is
        asked.

    Examples
    --------
    A spring of unknown stiffness k and length, pulled by known forces:

    >>> import numpy as np
    >>> from tensegra.analysis import FunctionModel, calibrate
    >>> spring = FunctionModel(lambda X: X[:, 1] + X[:, 2] / X[:, 0], ("k", "length", "force"), ("x",),
    ...                        np.array([[1.0, 3.0], [0.0, 2.0], [0.0, 5.0]]))
    >>> found = calibrate(spring, {"force": [1, 2, 3, 4], "x": [1.49, 2.01, 2.5, 2.98], "x_std": [0.02] * 4})
    >>> found.parameter_names, round(found.parameter("k").mean, 1), found.success
    (('k', 'length'), 2.0, True)
    """
    for place, count, least in (("chains", chains, 2), ("draws", draws, 50), ("warmup", warmup, 30)):
        if count < least:
            raise StudyError.at(f"calibration.{place}", count, f"at least {least}")
    asked = as_model(model)
    asked = replace(asked, ahead=True) if isinstance(asked, TrueModel) else asked
    data = Measurements.of(measurements, asked)
    prior = prior_of(asked, tuple(data.known), inputs or {})
    rng = np.random.default_rng(seed)
    posterior = _Posterior.of(asked, prior, data)
    modes = _modes(posterior, rng)
    best = min(modes, key=lambda mode: mode.cost)
    posterior = posterior.with_model_error(best.z)
    modes = [_descend(posterior, z) for z in _distinct(modes, best.cost + NEGLIGIBLE)]
    modes = sorted(modes, key=lambda mode: mode.cost)[:MOST_MODES]
    reference = Reference.of(
        np.array([mode.z for mode in modes]),
        np.array([mode.factor for mode in modes]),
        np.array([mode.cost for mode in modes]),
    )
    found = lead(
        posterior.log_density,
        posterior.log_value,
        reference,
        n_populations=chains,
        n_draws=draws,
        most_moves=warmup,
        rng=rng,
        progress=progress,
    )
    return _result(posterior, found, min(modes, key=lambda mode: mode.cost).z, rng, confidence).finish(
        name=name, seed=seed, true_model=None if true_model is None else as_model(true_model)
    )


@dataclass(frozen=True)
class _Mode:
    z: Array
    cost: float
    factor: Array


@dataclass(frozen=True)
class _Posterior:
    """The log density in the normal space of the prior."""

    model: Model
    prior: Prior
    data: Measurements
    columns: list[int]
    stds: Array

    @classmethod
    def of(cls, model: Model, prior: Prior, data: Measurements) -> "_Posterior":
        columns = column_index(model.output_names, data.outputs, "measurements")
        return cls(model, prior, data, columns, data.stds)

    def with_model_error(self, z: Array) -> "_Posterior":
        """Add the surrogate's own variance, as it is at `z`."""
        X, _ = self.inputs(z[None])
        own = self.model.uncertainty(X)
        return self if own is None else replace(self, stds=np.hypot(self.data.stds, own[:, self.columns]))

    def inputs(self, Z: Array) -> tuple[Array, Array]:
        """Return the inputs (n · n_states, n_inputs) of all measured states, and their derivatives by z."""
        X, slopes = self.prior.values(Z)
        n, m = len(Z), self.data.n_states
        every = np.repeat(X[:, None], m, axis=1)
        for name, column in self.data.known.items():
            every[:, :, self.model.input_names.index(name)] = column
        return every.reshape(n * m, -1), np.repeat(slopes, m, axis=0)

    def predict(self, Z: Array) -> Array:
        """Return the outputs that would be measured, (n, n_states, n_outputs)."""
        X, _ = self.inputs(Z)
        found = self.model.evaluate(X).values[:, self.columns]
        return found.reshape(len(Z), self.data.n_states, -1)

    def residuals(self, Z: Array) -> tuple[Array, Array]:
        """Return (f − y)/s of what was measured, (n, n_values), and its derivatives (n, n_values, p)."""
        X, chain = self.inputs(Z)
        n, measured = len(Z), np.isfinite(self.data.values)
        values = self.model.evaluate(X).values[:, self.columns].reshape(n, *measured.shape)
        slopes = np.einsum("nkd,ndp->nkp", self.model.gradient(X)[:, self.columns], chain)
        slopes = slopes.reshape(n, *measured.shape, -1)
        scaled = (values - self.data.values)[:, measured] / self.stds[measured]
        return scaled, slopes[:, measured] / self.stds[measured][:, None]

    def log_value(self, Z: Array) -> Array:
        """Return the log density (n,) but for a constant."""
        measured = np.isfinite(self.data.values)
        scaled = (self.predict(Z) - self.data.values)[:, measured] / self.stds[measured]
        return np.asarray(-0.5 * (scaled**2).sum(axis=1) - 0.5 * (Z**2).sum(axis=1))

    def log_density(self, Z: Array) -> tuple[Array, Array]:
        """Return the log density (n,) but for a constant, and its gradient (n, p)."""
        r, J = self.residuals(Z)
        log_p = -0.5 * (r**2).sum(axis=1) - 0.5 * (Z**2).sum(axis=1)
        return log_p, -np.einsum("nm,nmp->np", r, J) - Z


def _modes(posterior: _Posterior, rng: np.random.Generator) -> list[_Mode]:
    """Return where least squares ends from several points.

    Raises
    ------
    StudyError
        If the model fails at all of them.
    """
    p = posterior.prior.n_parameters
    starts = np.concatenate([np.zeros((1, p)), rng.standard_normal((N_STARTS - 1, p))])
    finite = np.isfinite(posterior.log_density(starts)[0])
    if not finite.any():
        raise StudyError(
            f"calibration: the model {posterior.model.name!r} failed at each of {N_STARTS} draws of the prior"
        )
    return [_descend(posterior, z) for z in starts[finite]]


def _distinct(modes: Sequence[_Mode], highest: float) -> list[Array]:
    """Return the places of the modes up to a cost, each once."""
    places: list[Array] = []
    for mode in sorted(modes, key=lambda mode: mode.cost):
        apart = [float(np.abs(mode.z - z).max()) > SAME_MODE for z in places]
        if mode.cost <= highest and all(apart):
            places.append(mode.z)
    return places


def _descend(posterior: _Posterior, z: Array) -> _Mode:
    """Return the mode that lies downhill, with a factor of the covariance of its normal approximation."""
    identity = np.eye(z.size)

    def residual(z: Array) -> Array:
        return np.concatenate([posterior.residuals(z[None])[0][0], z])

    def slope(z: Array) -> Array:
        return np.vstack([posterior.residuals(z[None])[1][0], identity])

    result = least_squares(residual, z, slope, max_nfev=100)
    jacobian = slope(result.x)
    precision = jacobian.T @ jacobian
    return _Mode(result.x, float(result.cost), np.linalg.inv(np.linalg.cholesky(precision)).T)


@dataclass(frozen=True)
class _Draft:
    """A result that lacks its labels and the true model's word."""

    posterior: _Posterior
    chains: Populations
    mode: Array
    prior_draws: Array
    theta: Array
    prediction: Prediction
    confidence: float

    def finish(self, *, name: str, seed: int, true_model: Model | None) -> Calibration:
        posterior, chains = self.posterior, self.chains
        names = posterior.prior.names
        place = [posterior.model.input_names.index(parameter) for parameter in names]
        at_mode, _ = posterior.prior.values(self.mode[None])
        prediction = self.prediction
        if true_model is not None:
            columns = column_index(true_model.output_names, posterior.data.outputs, "calibration.true_model")
            again = true_model.evaluate(posterior.inputs(self.mode[None])[0])
            prediction = replace(prediction, true=again.values[:, columns])
        return Calibration(
            name=name,
            model=posterior.model.name,
            seed=seed,
            confidence=self.confidence,
            laws={name: law for name, law in posterior.prior.laws.describe().items() if name in names},
            known=tuple(posterior.data.known),
            fixed={
                name: law
                for name, law in zip(posterior.prior.laws.names, posterior.prior.laws.laws, strict=True)
                if isinstance(law, float) and name not in posterior.data.known
            },
            tied={
                name: law.variable
                for name, law in zip(posterior.prior.laws.names, posterior.prior.laws.laws, strict=True)
                if isinstance(law, SameAs)
            },
            parameter_names=names,
            parameters=summarise_parameters(names, self.theta, self.prior_draws, self.confidence),
            mode=dict(zip(names, at_mode[0, place].tolist(), strict=True)),
            draws=self.theta,
            prior_draws=self.prior_draws,
            prediction=prediction,
            notes=_notes(posterior, self.theta, chains, self.prior_draws),
            acceptance=chains.acceptance,
            n_divergent=chains.n_divergent,
            n_evaluations=chains.n_evaluations * posterior.data.n_states,
            units=dict(posterior.model.units),
        )


def _notes(posterior: _Posterior, theta: Array, chains: Populations, prior_draws: Array) -> tuple[str, ...]:
    """Say by its name which parameter lies at the end of its prior or outside the model's box."""
    model, told = posterior.model, []
    if not chains.complete:
        told.append(
            "the draws are not yet of the posterior: the trajectories allowed (`warmup`) were too few"
        )
    box = None if isinstance(model, TrueModel) else model.bounds  # the truth extrapolates nowhere
    for k, name in enumerate(posterior.prior.names):
        draws = theta[:, :, k]
        low, high = np.quantile(prior_draws[:, k], (END, 1.0 - END))
        for side, beyond in (("lower", draws < low), ("upper", draws > high)):
            if beyond.mean() > AT_THE_END:
                told.append(f"the posterior of {name} lies at the {side} end of its prior")
        if box is not None:
            lower, upper = box[model.input_names.index(name)]
            slack = BOX_SLACK * (upper - lower)
            share = float(((draws < lower - slack) | (draws > upper + slack)).mean())
            if share > OUTSIDE:
                what = "surrogate's" if isinstance(model, SurrogateModel) else "model's"
                told.append(f"{100 * share:.0f} % of the posterior of {name} lies outside the {what} box")
    return tuple(told)


def _result(
    posterior: _Posterior, chains: Populations, mode: Array, rng: np.random.Generator, confidence: float
) -> _Draft:
    prior, p = posterior.prior, posterior.prior.n_parameters
    place = [posterior.model.input_names.index(name) for name in prior.names]
    flat = chains.draws.reshape(-1, p)
    theta = prior.values(flat)[0][:, place].reshape(chains.draws.shape)
    prior_draws = prior.values(rng.standard_normal((N_SHOWN, p)))[0][:, place]
    some = flat[rng.choice(len(flat), min(N_PREDICTED, len(flat)), replace=False)]
    return _Draft(
        posterior, chains, mode, prior_draws, theta, _prediction(posterior, some, rng, confidence), confidence
    )


def _prediction(posterior: _Posterior, Z: Array, rng: np.random.Generator, confidence: float) -> Prediction:
    """Set what the posterior predicts, its noise included, beside what was measured."""
    data, levels = posterior.data, (0.5 - confidence / 2, 0.5 + confidence / 2)
    exact = posterior.predict(Z)
    measured = np.isfinite(data.values)
    again = exact + np.where(measured, posterior.stds, 0.0) * rng.standard_normal(exact.shape)
    low, high = np.quantile(again, levels, axis=0)
    seen, replicated = (
        (((values - exact) / posterior.stds)[:, measured] ** 2).sum(axis=1) for values in (data.values, again)
    )
    return Prediction(
        outputs=data.outputs,
        known={name: np.array(column) for name, column in data.known.items()},
        measured=data.values,
        stds=data.stds,
        mean=exact.mean(axis=0),
        low=np.where(measured, low, np.nan),
        high=np.where(measured, high, np.nan),
        p_value=float((replicated >= seen).mean()),
    )
