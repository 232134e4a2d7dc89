"""Mechanics: how a structure balances, along a path, with proof."""

from tensegra.mechanics.follow import PathSettings
from tensegra.mechanics.path import solve_path
from tensegra.mechanics.results import (
    CriticalPoint,
    Equilibrium,
    EquilibriumPath,
    PathPoint,
    SlackEvent,
    Status,
)

__all__ = [
    "CriticalPoint",
    "Equilibrium",
    "EquilibriumPath",
    "PathPoint",
    "PathSettings",
    "SlackEvent",
    "Status",
    "solve_path",
]
