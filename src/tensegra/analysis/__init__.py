"""Questions to a model, surrogate or truth: what scatters and why, what is best, what reaches a target."""

from tensegra.analysis.calibration import calibrate
from tensegra.analysis.chaosindices import chaos_indices
from tensegra.analysis.expression import parse_constraint, parse_expression
from tensegra.analysis.inputs import Draws, SameAs
from tensegra.analysis.inverse import reach
from tensegra.analysis.measurements import read_measurements
from tensegra.analysis.model import Evaluation, FunctionModel, Model, SurrogateModel
from tensegra.analysis.optimisation import optimise
from tensegra.analysis.optimum import Optimum
from tensegra.analysis.posterior import Calibration
from tensegra.analysis.propagation import Propagation, propagate
from tensegra.analysis.results import Estimate
from tensegra.analysis.robust import RobustOptimum, robust_optimise
from tensegra.analysis.run import run_analyses
from tensegra.analysis.screening import Screening, morris_screening
from tensegra.analysis.sensitivity import MIN_BLOCKS, Sensitivity, sobol_indices
from tensegra.analysis.trajectory import Trajectory
from tensegra.analysis.truth import CERTIFIED, TrueModel

__all__ = [
    "CERTIFIED",
    "MIN_BLOCKS",
    "Calibration",
    "Draws",
    "Estimate",
    "Evaluation",
    "FunctionModel",
    "Model",
    "Optimum",
    "Propagation",
    "RobustOptimum",
    "SameAs",
    "Screening",
    "Sensitivity",
    "SurrogateModel",
    "Trajectory",
    "TrueModel",
    "calibrate",
    "chaos_indices",
    "morris_screening",
    "optimise",
    "parse_constraint",
    "parse_expression",
    "propagate",
    "reach",
    "read_measurements",
    "robust_optimise",
    "run_analyses",
    "sobol_indices",
]
