"""Questions to a model, surrogate or truth: propagation, sensitivity and optimisation."""

from tensegra.analysis.expression import parse_constraint, parse_expression
from tensegra.analysis.inputs import SameAs
from tensegra.analysis.model import Evaluation, FunctionModel, Model, SurrogateModel
from tensegra.analysis.optimisation import optimise
from tensegra.analysis.optimum import Optimum
from tensegra.analysis.propagation import Propagation, propagate
from tensegra.analysis.results import Estimate
from tensegra.analysis.run import run_analyses
from tensegra.analysis.sensitivity import Sensitivity, sobol_indices
from tensegra.analysis.truth import TrueModel

__all__ = [
    "Estimate",
    "Evaluation",
    "FunctionModel",
    "Model",
    "Optimum",
    "Propagation",
    "SameAs",
    "Sensitivity",
    "SurrogateModel",
    "TrueModel",
    "optimise",
    "parse_constraint",
    "parse_expression",
    "propagate",
    "run_analyses",
    "sobol_indices",
]
