"""What a calibration returns: the posterior, how far its draws can be trusted, and what it predicts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.diagnostics import LARGEST_RHAT, SMALLEST_ESS, bulk_ess, rhat, tail_ess
from tensegra.analysis.inputs import Draws, SameAs
from tensegra.analysis.model import column_index
from tensegra.analysis.propagation import Propagation
from tensegra.analysis.results import plain
from tensegra.presented import Tabled

Array = NDArray[np.float64]

# A model that predicts its own data as worse than all but this share of replications does not fit.
UNLIKELY = 0.01
# Draws that the stored result keeps, for figures.
N_STORED = 1000


@dataclass(frozen=True)
class Parameter:
    """The posterior of one parameter.

    Attributes
    ----------
    name
        Of the input.
    mean, std, low, median, high
        Of the posterior; `low` and `high` are the ends of its interval of equal tails.
    prior_mean, prior_std
        Of the prior.
    rhat, bulk_ess, tail_ess
        Of its populations, see `tensegra.analysis.diagnostics`.
    """

    name: str
    mean: float
    std: float
    low: float
    median: float
    high: float
    prior_mean: float
    prior_std: float
    rhat: float
    bulk_ess: float
    tail_ess: float


@dataclass(frozen=True)
class Prediction:
    """The posterior predictive beside the data; arrays are (n_states, n_outputs), NaN where not measured.

    Attributes
    ----------
    outputs, known
        Names of the measured outputs; the known inputs of each state, (n_states,).
    measured, stds
        The data.
    mean, low, high
        What the posterior predicts: its mean, and the interval of a new measurement, noise included.
    p_value
        Probability that new data would lie at least as far from the model as the given (by χ²): near 0 the
        model does not fit, near 1 the standard deviations are too large.
    true
        The true model at the posterior's mode, or None.
    """

    outputs: tuple[str, ...]
    known: Mapping[str, Array]
    measured: Array
    stds: Array
    mean: Array
    low: Array
    high: Array
    p_value: float
    true: Array | None = None


@dataclass(frozen=True, repr=False)
class Calibration(Tabled):
    """The posterior of a model's inputs, given measurements.

    Attributes
    ----------
    name, model, seed, confidence
        What was asked.
    laws, known, fixed, tied
        The priors in words; inputs known in every state; inputs fixed at a number; inputs that equal
        another one, by name.
    parameter_names, parameters
        The inferred inputs; their posteriors, in that order.
    mode
        The most probable parameters (in the normal space of the prior).
    draws, prior_draws
        Draws of the posterior (n_chains, n_draws, n_parameters), a population each, and of the prior (n,
        n_parameters).
    prediction
        What the posterior predicts for the measured states.
    acceptance, n_divergent, n_evaluations
        Of the sampler: mean acceptance, trajectories lost, model evaluations.
    units
        By name.
    notes
        What a reader must know of the posterior: parameters at the end of their prior or outside the box.
    after
        Outputs under further inputs, drawn from the prior and from the posterior, where they were asked for.
    """

    kind = "calibration"

    name: str
    model: str
    seed: int
    confidence: float
    laws: Mapping[str, str]
    known: tuple[str, ...]
    fixed: Mapping[str, float]
    tied: Mapping[str, str]
    parameter_names: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    mode: Mapping[str, float]
    draws: Array
    prior_draws: Array
    prediction: Prediction
    acceptance: float
    n_divergent: int
    n_evaluations: int
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    after: tuple[Propagation, ...] = ()

    @property
    def success(self) -> bool:
        """Whether the populations agree and their draws are enough."""
        return all(
            p.rhat <= LARGEST_RHAT and min(p.bulk_ess, p.tail_ess) >= SMALLEST_ESS for p in self.parameters
        )

    @property
    def reason(self) -> str:
        """How far the posterior can be trusted, in words."""
        worst = max(self.parameters, key=lambda p: p.rhat)
        least = min(min(p.bulk_ess, p.tail_ess) for p in self.parameters)
        told = f"largest R̂ {worst.rhat:.3f}, least effective sample size {least:.0f}"
        if not self.success:
            told += (
                f"; the populations do not agree (R̂ at most {LARGEST_RHAT}, "
                f"{SMALLEST_ESS} effective draws are wanted): draw more"
            )
        told += "".join(f"; {note}" for note in self.notes)
        if self.n_divergent:
            told += f"; {self.n_divergent} trajectories lost their energy"
        if self.prediction.p_value < UNLIKELY:
            told += (
                f"; the model does not fit the data, new data would be as far off with a probability of "
                f"{self.prediction.p_value:.2g} only"
            )
        return told

    def parameter(self, name: str) -> Parameter:
        """Return the posterior of one parameter."""
        return self.parameters[column_index(self.parameter_names, [name], "parameter")[0]]

    def inputs(self, **others: object) -> dict[str, object]:
        """Return the posterior as laws for `tensegra.propagate`; `others` are laws of further inputs.

        The parameters are drawn by rows together, so that what the data tie stays tied.
        """
        flat = self.draws.reshape(-1, len(self.parameter_names))
        source = object()
        laws: dict[str, object] = {
            name: Draws(column, source) for name, column in zip(self.parameter_names, flat.T, strict=True)
        }
        ties = {name: SameAs(other) for name, other in self.tied.items()}
        return laws | dict(self.fixed) | ties | others

    def correlation(self) -> Array:
        """Return the correlation matrix of the posterior."""
        flat = self.draws.reshape(-1, len(self.parameter_names))
        return np.atleast_2d(np.corrcoef(flat.T))

    def table(self) -> list[dict[str, Any]]:
        """Return a row per parameter."""
        return [
            {"parameter": p.name, "unit": self.units.get(p.name, "")}
            | {key: value for key, value in vars(p).items() if key != "name"}
            for p in self.parameters
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types; of the draws a thousand, the chains in turn."""
        content = vars(self) | {"kind": self.kind, "success": self.success, "reason": self.reason}
        flat = np.swapaxes(self.draws, 0, 1).reshape(-1, len(self.parameter_names))
        content["draws"] = flat[:: max(1, len(flat) // N_STORED)]
        content["n_chains"], content["n_draws"] = self.draws.shape[:2]
        content["correlation"] = self.correlation()
        content["parameters"] = [vars(p) for p in self.parameters]
        content["prediction"] = vars(self.prediction)
        return dict(plain(content))

    def __repr__(self) -> str:
        shown = ", ".join(f"{p.name} = {p.mean:.4g} ± {p.std:.2g}" for p in self.parameters)
        return f"Calibration({shown}; {self.reason})"


def summarise_parameters(
    names: tuple[str, ...], draws: Array, prior_draws: Array, confidence: float
) -> tuple[Parameter, ...]:
    """Summarise draws (n_chains, n_draws, n_parameters), beside those of the prior."""
    found = []
    for k, name in enumerate(names):
        chains, prior = draws[:, :, k], prior_draws[:, k]
        low, median, high = np.quantile(chains, (0.5 - confidence / 2, 0.5, 0.5 + confidence / 2))
        found.append(
            Parameter(
                name=name,
                mean=float(chains.mean()),
                std=float(chains.std()),
                low=float(low),
                median=float(median),
                high=float(high),
                prior_mean=float(prior.mean()),
                prior_std=float(prior.std()),
                rhat=rhat(chains),
                bulk_ess=bulk_ess(chains),
                tail_ess=tail_ess(chains),
            )
        )
    return tuple(found)
