"""Morris screening: which of many inputs matter at all, from a dozen trajectories.

A trajectory walks through the unit cube of the inputs, one input at a time by Δ = p/(2(p − 1)) of its range
(p levels); the change of the output over Δ is the input's elementary effect there. Over all trajectories its
mean magnitude μ* ranks the inputs (Campolongo, Cariboni & Saltelli 2007,
doi:10.1016/j.envsoft.2006.10.004), its mean μ tells the direction, and its spread σ how far the effect
depends on where one stands, from curvature or from the other inputs (Morris 1991,
doi:10.1080/00401706.1991.10484804). The cost is trajectories · (inputs + 1) runs: a tenth of what Sobol
indices of fifty inputs take.

One failed run breaks its trajectory, so whole trajectories are dropped and the share is reported.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis.blockruns import CHUNK, ask_blocks, unit_cube
from tensegra.analysis.inputs import RandomInputs, random_inputs
from tensegra.analysis.model import as_model, column_index
from tensegra.analysis.results import plain
from tensegra.errors import StudyError
from tensegra.presented import Tabled

Array = NDArray[np.float64]

RESAMPLES = 200
# Fewest trajectories that a bootstrap interval means anything for.
MIN_TRAJECTORIES = 4
# Probability left out at an end where a law is infinite, so that its range is finite.
TAIL = 0.01


@dataclass(frozen=True)
class Effects:
    """Elementary effects of one output, in its unit, each over the whole range of the input.

    Attributes
    ----------
    output, unit
        The output.
    mu, mu_star, mu_star_half, sigma
        Shape (d,): mean, mean magnitude with the half-width of its interval, standard deviation; NaN
        throughout where `reason` says why there are none.
    reason
        "" or why there are none.
    """

    output: str
    unit: str
    mu: Array
    mu_star: Array
    mu_star_half: Array
    sigma: Array
    reason: str = ""


@dataclass(frozen=True, repr=False)
class Screening(Tabled):
    """Elementary effects of all outputs.

    Attributes
    ----------
    name, model, seed, confidence, levels
        What was asked.
    n_asked, n_trajectories
        Trajectories asked for, and those without a failed run.
    n_runs, n_failed, statuses
        Model evaluations, how many of them failed, and how many have each status.
    input_names, laws
        The random inputs, the order of every array; the law of each input, in words.
    effects
        By output.
    """

    kind = "morris"

    name: str
    model: str
    seed: int
    confidence: float
    levels: int
    n_asked: int
    n_trajectories: int
    n_runs: int
    n_failed: int
    statuses: Mapping[str, int]
    input_names: tuple[str, ...]
    laws: Mapping[str, str]
    effects: Mapping[str, Effects]

    @property
    def share_dropped(self) -> float:
        """Share of the trajectories lost to failed runs."""
        return 1.0 - self.n_trajectories / self.n_asked

    def ranking(self, output: str) -> tuple[str, ...]:
        """Return the inputs by their effect on an output, the strongest first."""
        column_index(tuple(self.effects), [output], "output")
        order = np.argsort(-self.effects[output].mu_star, kind="stable")
        return tuple(self.input_names[i] for i in order)

    def table(self) -> list[dict[str, Any]]:
        """Return a row per output and input."""
        return [
            {
                "output": output,
                "unit": found.unit,
                "input": name,
                "mu": float(found.mu[i]),
                "mu_star": float(found.mu_star[i]),
                "low": float(found.mu_star[i] - found.mu_star_half[i]),
                "high": float(found.mu_star[i] + found.mu_star_half[i]),
                "sigma": float(found.sigma[i]),
            }
            for output, found in self.effects.items()
            for i, name in enumerate(self.input_names)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON types."""
        content = vars(self) | {"kind": self.kind, "share_dropped": self.share_dropped}
        content["effects"] = {output: vars(found) for output, found in self.effects.items()}
        return dict(plain(content))

    def __repr__(self) -> str:
        ranked = "; ".join(f"{output}: {' > '.join(self.ranking(output))}" for output in self.effects)
        return f"Screening({self.n_trajectories} trajectories on {self.model}; {ranked})"


def morris_screening(
    model: object,
    inputs: Mapping[str, object] | None = None,
    *,
    trajectories: int = 20,
    levels: int = 4,
    outputs: Sequence[str] | None = None,
    seed: int = 0,
    confidence: float = 0.95,
    name: str = "screening",
    chunk: int = CHUNK,
    progress: Callable[[int, int], None] | None = None,
) -> Screening:
    """Rank inputs by their elementary effects, Morris's method through SALib.

    Parameters
    ----------
    model
        A `Model`, a surrogate or a study (the true model).
    inputs
        By variable: a distribution, a number or ``SameAs(variable)``; what is left out has the law
        of the study, as a surrogate of it has too, or is uniform on the model's box where there is none. The
        random inputs must be independent. The range of an infinite law is that between its 1 % and 99 %
        quantiles.
    trajectories
        The model runs trajectories · (random inputs + 1) times.
    levels
        Of the grid in each input, an even number.
    outputs
        Which outputs; all unless given.
    seed, confidence, name
        Of the random numbers; of the intervals; of the result.
    chunk, progress
        Points per call of the model; called with (runs done, runs in all).

    Raises
    ------
    StudyError
        If a name, a law or a number makes no sense.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegra.analysis import FunctionModel, morris_screening
    >>> box = np.array([[0, 1]] * 3)
    >>> model = FunctionModel(lambda X: 5 * X[:, 0] + X[:, 2] ** 2, ("a", "b", "c"), ("y",), box)
    >>> found = morris_screening(model)
    >>> found.ranking("y"), found.effects["y"].mu_star[:2].round(6)
    (('a', 'c', 'b'), array([5., 0.]))
    """
    if trajectories < MIN_TRAJECTORIES:
        raise StudyError.at("morris.trajectories", trajectories, f"{MIN_TRAJECTORIES} or more")
    if levels < 2 or levels % 2:
        raise StudyError.at("morris.levels", levels, "an even number")
    asked = as_model(model)
    laws = random_inputs(asked, inputs)
    if laws.copula is not None:
        given = ", ".join(laws.copula.names)
        raise StudyError.at("morris.inputs", given, "independent inputs; give laws of their own to these")
    wanted = tuple(outputs or asked.output_names)
    columns = column_index(asked.output_names, wanted, "morris.outputs")
    U = _trajectories(laws, trajectories, levels, seed)
    runs = ask_blocks(
        asked,
        columns,
        U,
        lambda points: laws.from_unit(_range(laws, points)),
        trajectories,
        chunk=chunk,
        progress=progress,
    )
    kept = runs.kept
    rows_kept = np.repeat(kept, laws.n_dimensions + 1)
    units = asked.units
    effects = {
        output: _effects(
            laws,
            (output, units.get(output, "")),
            U[rows_kept],
            runs.values[rows_kept, k],
            levels,
            confidence,
            seed,
        )
        for k, output in enumerate(wanted)
    }
    return Screening(
        name=name,
        model=asked.name,
        seed=seed,
        confidence=confidence,
        levels=levels,
        n_asked=trajectories,
        n_trajectories=int(kept.sum()),
        n_runs=len(U),
        n_failed=runs.n_failed,
        statuses=runs.statuses,
        input_names=laws.independent,
        laws=laws.describe(),
        effects=effects,
    )


def _trajectories(laws: RandomInputs, trajectories: int, levels: int, seed: int) -> Array:
    from SALib.sample import morris

    rng = np.random.default_rng(seed)
    return np.asarray(morris.sample(unit_cube(laws), trajectories, num_levels=levels, seed=rng))


def _range(laws: RandomInputs, U: Array) -> Array:
    """Return the points with the ends of infinite laws drawn in."""
    with np.errstate(all="ignore"):
        ends = [laws.from_unit(np.full((1, laws.n_dimensions), end))[0] for end in (0.0, 1.0)]
    place = [laws.names.index(name) for name in laws.independent]
    low, high = (np.where(np.isfinite(end[place]), 0.0, TAIL) for end in ends)
    return np.asarray(low + U * (1.0 - low - high))


def _effects(
    laws: RandomInputs,
    label: tuple[str, str],
    U: Array,
    values: Array,
    levels: int,
    confidence: float,
    seed: int,
) -> Effects:
    n_kept = len(U) // (laws.n_dimensions + 1)
    if n_kept < MIN_TRAJECTORIES:
        nothing = np.full(laws.n_dimensions, np.nan)
        reason = f"only {n_kept} trajectories without a failed run, at least {MIN_TRAJECTORIES} are needed"
        return Effects(*label, nothing, nothing, nothing, nothing, reason)
    from SALib.analyze import morris

    found = morris.analyze(
        unit_cube(laws),
        U,
        values,
        num_resamples=RESAMPLES,
        conf_level=confidence,
        num_levels=levels,
        seed=seed + 1,  # SALib takes the seed 0 for none
    )
    return Effects(
        *label,
        mu=np.array(found["mu"], dtype=float),
        mu_star=np.array(found["mu_star"], dtype=float),
        mu_star_half=np.array(found["mu_star_conf"], dtype=float),
        sigma=np.array(found["sigma"], dtype=float),
    )
