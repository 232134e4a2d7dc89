"""Mechanics: how a structure balances, along a path, with proof."""

from tensegra.mechanics.batch import Batch, solve_batch
from tensegra.mechanics.path import solve_path
from tensegra.mechanics.results import Equilibrium, EquilibriumPath
from tensegra.mechanics.session import Session
from tensegra.mechanics.settings import PathSettings
from tensegra.mechanics.stability import SelfStress, prestress_stiffness, self_stress
from tensegra.mechanics.status import CriticalPoint, PathPoint, SlackEvent, Status
from tensegra.mechanics.vibration import Vibration, natural_frequencies

__all__ = [
    "Batch",
    "CriticalPoint",
    "Equilibrium",
    "EquilibriumPath",
    "PathPoint",
    "PathSettings",
    "SelfStress",
    "Session",
    "SlackEvent",
    "Status",
    "Vibration",
    "natural_frequencies",
    "prestress_stiffness",
    "self_stress",
    "solve_batch",
    "solve_path",
]
