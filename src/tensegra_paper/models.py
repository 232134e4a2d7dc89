"""What the chapters ask: the beam as a model, the runs that surrogates learn from, and the surrogates."""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tensegra.analysis import TrueModel
from tensegra.mechanics import PathSettings
from tensegra.report import key_of
from tensegra.study import TrainingData, parse_study
from tensegra.surrogate import RegimeData, one_thread
from tensegra_paper.beam_model import TIP, BeamRuns
from tensegra_paper.five_inputs import ACTUATIONS, TEMPERATURES, product_design
from tensegra_paper.published import published
from tensegra_paper.setting import Setting

if TYPE_CHECKING:
    from tensegra.surrogate import Surrogate

__all__ = [
    "LIFT_INPUTS",
    "NETWORK",
    "NODE",
    "FiveInputs",
    "beam_model",
    "cable_model",
    "five_inputs",
    "lift_data",
    "lift_runs",
    "lift_surrogate",
    "trained",
]

Array: TypeAlias = NDArray[np.float64]

LIFT_INPUTS = ("A1", "A23", "A4")
"""Variables of the publication's optimisation: the two top cables apart, the bottom ones together."""

NETWORK: dict[str, Any] = {"training": "two_stage", "hidden": (50, 50), "adam_iterations": 5_000}
"""The publication's network, at any scale: 2 × 50 neurons, 5,000 iterations of Adam, then L-BFGS."""

OUTPUTS: dict[str, dict[str, Any]] = {
    "u": {"displacement": "x", "nodes": list(TIP)},
    "v": {"displacement": "y", "nodes": list(TIP)},
    "w": {"displacement": "z", "nodes": list(TIP)},
}

NODE = "23"
"""Whose displacements the publication shows in Figs. 9 to 12 and 19 and Table 2; the optimum has the mean."""

MANY_RUNS = 20_000
"""Below, threads of the linear algebra may wait for each other longer than they work."""

LEAST_LIFT_RUNS, MOST_HELD_OUT = 4096, 8192
"""With fewer runs of three inputs the borders between the regimes are learned too coarsely to search on."""


def beam_model(setting: Setting) -> TrueModel:
    """Return the beam with gravity, five inputs uniform on the publication's box, and v and w of node 23."""
    actuation, temperature = (published("doe", f"{name}_range") for name in ("actuation", "temperature"))
    variables = {name: _variable("actuator", name, actuation) for name in ACTUATIONS}
    variables |= {
        name: _variable("temperature", name.removeprefix("T_"), temperature) for name in TEMPERATURES
    }
    return _model(setting, variables, {}, {name: OUTPUTS[name] | {"nodes": [NODE]} for name in ("v", "w")})


def cable_model(setting: Setting, names: Sequence[str], outputs: Sequence[str] = ("v", "w")) -> TrueModel:
    """Return the beam without gravity, some actuators uniform on [0, 30] %, and some of u, v and w."""
    box = published("optimisation", "bounds")
    variables = {name: _variable("actuator", name, box) for name in names}
    return _model(setting, variables, {"gravity": [0, 0, 0]}, {name: OUTPUTS[name] for name in outputs})


def _variable(quantity: str, target: str, box: Sequence[float]) -> dict[str, Any]:
    return {quantity: target, "distribution": {"uniform": list(map(float, box))}}


def _model(
    setting: Setting, variables: dict[str, Any], changes: dict[str, Any], outputs: dict[str, Any]
) -> TrueModel:
    study = parse_study(
        {
            "name": "FEM",
            "structure": f"library:{setting.structure_name}",
            "changes": changes,
            "variables": variables,
            "outputs": outputs,
            "design": {"sampler": "sobol", "sizes": 2},
        }
    )
    return TrueModel(study, name="FEM", solver=study.solver.solver(setting.threads))


@dataclass(frozen=True, eq=False)
class FiveInputs:
    """The publication's data: 100 actuations times 125 temperatures, 2,500 of the 12,500 runs held out.

    Attributes
    ----------
    runs
        As they were solved.
    training, held_out
        Training runs in random order, so that any number of them can be taken from the front, and the others.
    """

    runs: BeamRuns
    training: TrainingData
    held_out: TrainingData


def five_inputs(setting: Setting) -> FiveInputs:
    """Solve the design of five inputs, whole at any scale: it takes a fraction of a second."""
    doe = published("doe")
    design = product_design(setting, doe["sobol_actuations"], doe["sobol_temperatures"])
    runs = setting.runs("five-inputs", setting.structure, design)
    model = beam_model(setting)
    data = TrainingData(
        X=runs.X,
        Y=np.column_stack([runs.displacement(axis, NODE) for axis in "yz"]),
        bounds=model.bounds,
        input_names=model.input_names,
        output_names=model.output_names,
        input_units=tuple(model.units[name] for name in model.input_names),
        output_units=tuple(model.units[name] for name in model.output_names),
    )
    order = np.random.default_rng(setting.seed_of("held out")).permutation(data.n_points)
    n_held = int(doe["validation"])
    return FiveInputs(runs, data.rows(order[n_held:]), data.rows(order[:n_held]))


def lift_runs(setting: Setting, *, held_out: bool = False, stepped: bool = False) -> BeamRuns:
    """Solve designs of the optimisation: Sobol points of (A1, A23, A4) in [0, 30] %, without gravity.

    Parameters
    ----------
    setting
        Gives the number of runs and the seed.
    held_out
        Whether to solve the designs that nothing is learned from instead.
    stepped
        Whether to solve the same designs as the publication does: increments of 1 %, plain Newton–Raphson.
    """
    from scipy.stats import qmc

    printed = int(published("optimisation", "training_samples"))
    n_runs = setting.count(printed, least=LEAST_LIFT_RUNS)
    name = "lift"
    if held_out:
        n_runs, name = min(n_runs // 8, MOST_HELD_OUT), "lift-held-out"
    sampler = qmc.Sobol(len(LIFT_INPUTS), scramble=True, rng=setting.seed_of(name))
    low, high = published("optimisation", "bounds")
    X = low + (high - low) * sampler.random_base2(int(np.ceil(np.log2(n_runs))))[:n_runs]
    inputs = dict(zip(LIFT_INPUTS, X.T, strict=True))
    if stepped:
        return setting.runs(f"{name}-stepped", setting.without_gravity, inputs, PathSettings(path="stepped"))
    return setting.runs(name, setting.without_gravity, inputs)


def lift_data(setting: Setting, runs: BeamRuns) -> RegimeData:
    """Return what is learned from `lift_runs`: v and w by regime, and the designs that do not stand."""
    model = cable_model(setting, LIFT_INPUTS)
    regimes = np.where(runs.stands, np.where(runs.n_slack > 0, "slack", "taut"), runs.status)
    return RegimeData.of(
        runs.X,
        np.column_stack([runs.v, runs.w]),
        regimes,
        bounds=model.bounds,
        input_names=model.input_names,
        output_names=model.output_names,
        output_units=tuple(model.units[name] for name in model.output_names),
    )


def lift_surrogate(setting: Setting) -> "Surrogate":
    """Return what the optimisation searches on: a piece for each regime, and their probabilities."""
    data, held_out = (lift_data(setting, lift_runs(setting, held_out=held)) for held in (False, True))
    return trained(setting, "lift", data, "piecewise", held_out)


def trained(
    setting: Setting,
    name: str,
    data: TrainingData | RegimeData,
    kind: str,
    validation: TrainingData | RegimeData | None = None,
    **options: Any,  # noqa: ANN401 - of the kind
) -> "Surrogate":
    """Return a surrogate of all rows of the data, trained now or before, in this or another chapter.

    Parameters
    ----------
    setting
        Gives the folder and the seed.
    name
        Of the surrogate, for its file.
    data, kind, validation, **options
        As for `tensegra.fit`.
    """
    from tensegra.surrogate import Surrogate, fit

    seed = setting.seed_of(f"surrogate {name}")
    rows = [] if validation is None else [_digest(validation)]
    key = key_of(kind, _digest(data), rows, {key: str(value) for key, value in options.items()}, seed)
    path = setting.folder / "surrogates" / f"{name}-{key[:16]}.tg"
    if path.is_file():
        return Surrogate.load(path)
    with one_thread(wanted=data.n_points < MANY_RUNS):
        surrogate = fit(data, kind, validation=validation, seed=seed, **options)
    path.parent.mkdir(parents=True, exist_ok=True)
    return Surrogate.load(surrogate.save(path))


def _digest(data: TrainingData | RegimeData) -> str:
    """Return the hash of what is learned from."""
    runs = data.runs if isinstance(data, RegimeData) else data
    digest = sha256(data.X.tobytes())
    digest.update(runs.Y.tobytes())
    return digest.hexdigest()
