"""tensegra: statics, uncertainty and optimisation of classical and clustered tensegrity structures.

>>> import tensegra as tg
>>> path = tg.solve_path(tg.library.paper_beam(), {"A14": 0.10, "A23": 0.10})
>>> round(path.displacement("z", nodes=[18, 23]), 2)
53.15
"""

from typing import TYPE_CHECKING

from tensegra import presented, savable, viewable

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

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
        Equilibrium,
        EquilibriumPath,
        PathSettings,
        SelfStress,
        Session,
        Status,
        Vibration,
        natural_frequencies,
        prestress_stiffness,
        self_stress,
        solve_batch,
        solve_path,
    )
    from tensegra.presented import Presenter
    from tensegra.report import check_structure, check_study, write_report
    from tensegra.structure import (
        Actuator,
        Material,
        Member,
        Stage,
        Structure,
        Units,
        apply_changes,
        library,
        parse_structure,
        write_structure,
    )
    from tensegra.study import (
        Campaign,
        Study,
        TrainingData,
        design_points,
        open_campaign,
        parse_study,
        read_study,
        select,
    )
    from tensegra.surrogate import OutsideBoxWarning, Surrogate, Validation, choose, fit, learn
    from tensegra.surrogate import load as load_surrogate

    __version__: str

__all__ = [
    "Actuator",
    "Batch",
    "Calibration",
    "Campaign",
    "Equilibrium",
    "EquilibriumPath",
    "FunctionModel",
    "Material",
    "Member",
    "ModelError",
    "Optimum",
    "OutsideBoxWarning",
    "PathSettings",
    "Propagation",
    "RobustOptimum",
    "Screening",
    "SelfStress",
    "Sensitivity",
    "Session",
    "SolverError",
    "Stage",
    "Status",
    "Structure",
    "Study",
    "StudyError",
    "Surrogate",
    "TensegraError",
    "TrainingData",
    "Trajectory",
    "Units",
    "Validation",
    "Vibration",
    "__version__",
    "apply_changes",
    "calibrate",
    "chaos_indices",
    "check_structure",
    "check_study",
    "choose",
    "design_points",
    "fit",
    "learn",
    "library",
    "load_surrogate",
    "morris_screening",
    "natural_frequencies",
    "open_campaign",
    "optimise",
    "parse_structure",
    "parse_study",
    "prestress_stiffness",
    "propagate",
    "reach",
    "read_measurements",
    "read_structure",
    "read_study",
    "robust_optimise",
    "select",
    "self_stress",
    "sobol_indices",
    "solve_batch",
    "solve_path",
    "write_report",
    "write_structure",
]

_HOMES = {
    "errors": ("ModelError", "SolverError", "StudyError", "TensegraError"),
    "structure": (
        "Actuator",
        "Material",
        "Member",
        "Stage",
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
        "Equilibrium",
        "EquilibriumPath",
        "PathSettings",
        "SelfStress",
        "Session",
        "Status",
        "Vibration",
        "natural_frequencies",
        "prestress_stiffness",
        "self_stress",
        "solve_batch",
        "solve_path",
    ),
    "study": (
        "Campaign",
        "Study",
        "TrainingData",
        "design_points",
        "open_campaign",
        "parse_study",
        "read_study",
        "select",
    ),
    "surrogate": ("OutsideBoxWarning", "Surrogate", "Validation", "choose", "fit", "learn", "load_surrogate"),
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
    "report": ("check_structure", "check_study", "write_report"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}
_NAMES_AT_HOME = {"load_surrogate": "load"}


def __getattr__(name: str) -> "Any":  # noqa: ANN401 - any of the names above
    """Import a name where it is first asked for, so that `import tensegra` is quick."""
    if name == "__version__":
        from importlib.metadata import version

        value: object = version("tensegra")
    elif name in _HOME_OF:
        from importlib import import_module

        value = getattr(import_module(f"tensegra.{_HOME_OF[name]}"), _NAMES_AT_HOME.get(name, name))
    else:
        raise AttributeError(f"module 'tensegra' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List what the package offers, not what it is made of."""
    return sorted(__all__)


def _presenter() -> "Presenter":
    """Bring who draws results; the one arrow from the floors below up to the report starts here."""
    from tensegra.report import presenting

    return presenting


presented.presenter.brought_by(_presenter)


def _saver() -> "Callable[..., Any]":
    """Bring what writes results to files."""
    from tensegra.report.export import save

    return save


savable.saver.brought_by(_saver)


def _viewer() -> "Callable[..., Any]":
    """Bring what shows results in space."""
    from tensegra.viewer.widget import view

    return view


viewable.viewer.brought_by(_viewer)
