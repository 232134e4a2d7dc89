"""tensegra: statics, uncertainty and optimisation of classical and clustered tensegrity structures.

>>> import tensegra as tg
>>> path = tg.solve_path(tg.library.paper_beam(), {"A14": 0.10, "A23": 0.10})
>>> round(path.displacement("z", nodes=[18, 23]), 2)
53.15
"""

from typing import TYPE_CHECKING, Any

from tensegra.savable import register as _register

if TYPE_CHECKING:
    from tensegra.analysis import (
        Calibration,
        FunctionModel,
        Optimum,
        Propagation,
        RobustOptimum,
        Screening,
        Sensitivity,
        Trajectory,
        calibrate,
        chaos_indices,
        morris_screening,
        optimise,
        propagate,
        reach,
        read_measurements,
        robust_optimise,
        sobol_indices,
    )
    from tensegra.errors import ModelError, SolverError, StudyError, TensegraError
    from tensegra.exchange import read_structure
    from tensegra.mechanics import (
        Batch,
        EquilibriumPath,
        PathSettings,
        Session,
        Status,
        solve_batch,
        solve_path,
    )
    from tensegra.structure import (
        Structure,
        Units,
        apply_changes,
        library,
        parse_structure,
        write_structure,
    )
    from tensegra.study import Campaign, Study, TrainingData, open_campaign, parse_study, read_study
    from tensegra.surrogate import Surrogate, fit
    from tensegra.surrogate import load as load_surrogate

    __version__: str

__all__ = [
    "Batch",
    "Calibration",
    "Campaign",
    "EquilibriumPath",
    "FunctionModel",
    "ModelError",
    "Optimum",
    "PathSettings",
    "Propagation",
    "RobustOptimum",
    "Screening",
    "Sensitivity",
    "Session",
    "SolverError",
    "Status",
    "Structure",
    "Study",
    "StudyError",
    "Surrogate",
    "TensegraError",
    "TrainingData",
    "Trajectory",
    "Units",
    "__version__",
    "apply_changes",
    "calibrate",
    "chaos_indices",
    "fit",
    "library",
    "load_surrogate",
    "morris_screening",
    "open_campaign",
    "optimise",
    "parse_structure",
    "parse_study",
    "propagate",
    "reach",
    "read_measurements",
    "read_structure",
    "read_study",
    "robust_optimise",
    "sobol_indices",
    "solve_batch",
    "solve_path",
    "write_structure",
]

_HOMES = {
    "errors": ("ModelError", "SolverError", "StudyError", "TensegraError"),
    "structure": (
        "Structure",
        "Units",
        "apply_changes",
        "library",
        "parse_structure",
        "write_structure",
    ),
    "exchange": ("read_structure",),
    "mechanics": (
        "Batch",
        "EquilibriumPath",
        "PathSettings",
        "Session",
        "Status",
        "solve_batch",
        "solve_path",
    ),
    "study": ("Campaign", "Study", "TrainingData", "open_campaign", "parse_study", "read_study"),
    "surrogate": ("Surrogate", "fit", "load_surrogate"),
    "analysis": (
        "Calibration",
        "FunctionModel",
        "Optimum",
        "Propagation",
        "RobustOptimum",
        "Screening",
        "Sensitivity",
        "Trajectory",
        "calibrate",
        "chaos_indices",
        "morris_screening",
        "optimise",
        "propagate",
        "reach",
        "read_measurements",
        "robust_optimise",
        "sobol_indices",
    ),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
_NAMES_AT_HOME = {"load_surrogate": "load"}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - any of the names above
    """Import a name where it is first asked for, so that `import tensegra` is quick."""
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("tensegra")
    elif name in _HOME_OF:
        from importlib import import_module

        value = getattr(import_module(f"tensegra.{_HOME_OF[name]}"), _NAMES_AT_HOME.get(name, name))
    else:
        raise AttributeError(f"module 'tensegra' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _save(what: Any, path: Any, format: str | None) -> None:  # noqa: A002, ANN401 - what the formats take
    from tensegra.report.export import save

    save(what, path, format)


_register(_save)
