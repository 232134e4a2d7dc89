"""The study file's entry of the solver: how the paths of its runs are followed."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, TypeAlias

from pydantic import Field

from tensegra.study.entry import Count, Entry, Examples, Number, Positive

if TYPE_CHECKING:
    from tensegra.mechanics import Batch, PathSettings

__all__ = ["Solver", "SolverEntry"]

Solver: TypeAlias = Callable[..., "Batch"]
"""Takes a structure and the inputs of `solve_batch`, and returns the runs."""

Share: TypeAlias = Annotated[Number, Field(gt=0, lt=1)]


STEP_CONTROL = {"policy", "first_step", "smallest_step", "largest_move", "contraction", "max_steps"}
"""Settings of the adaptive procedure alone."""


class SolverEntry(Entry):
    """How the paths of all runs are followed; the keys are those of `tensegra.mechanics.PathSettings`."""

    examples: ClassVar[Examples] = (
        {
            "path": "adaptive",
            "policy": "stop",
            "first_step": 0.25,
            "smallest_step": 1e-06,
            "largest_move": 0.1,
            "contraction": 0.5,
            "max_steps": 5000,
            "residual": 1e-09,
            "increment": 0.01,
        },
    )

    path: Literal["adaptive", "stepped"] = "adaptive"
    """`adaptive` steps with evidence that the branch is not left, or `stepped`: plain Newton–Raphson in steps
    of `increment`."""
    policy: Literal["settle", "stop", "trace"] = "settle"
    """What to do where the stable branch ends: `settle` into the equilibrium below, `stop`, or `trace` the
    unstable branch."""
    first_step: Annotated[Positive, Field(le=1)] = 0.5
    """First step, as a share of a stage. [1]"""
    smallest_step: Share = 2e-7
    """Step below which a stage is given up, as a share of it. [1]"""
    largest_move: Positive = 0.15
    """Largest move of a node in one step, as a share of the structure's size. [1]"""
    contraction: Share = 0.5
    """Contraction of the iteration above which a step is cut. [1]"""
    max_steps: Count = 20_000
    """Limit to the number of steps of a stage. [1]"""
    residual: Share = 1e-9
    """Residual at which an equilibrium is accepted, relative to the largest tension or load. [1]"""
    increment: Positive = 0.01
    """Largest relative change of a rest length in one step of the plain procedure. [1]"""

    @property
    def acting(self) -> dict[str, object]:
        """The settings that a result depends on: those of the procedure that is not chosen do not act."""
        idle = STEP_CONTROL if self.path == "stepped" else {"increment"}
        return {name: value for name, value in self.model_dump().items() if name not in idle}

    @property
    def settings(self) -> "PathSettings":
        """The same as `tensegra.mechanics.PathSettings`."""
        from tensegra.mechanics import PathSettings

        return PathSettings(**self.model_dump())

    def solver(self, threads: int | None = None) -> Solver:
        """Return the batch solver with these settings, on `threads` threads or one a core."""
        # Compiled kernels, imported where they are first needed.
        from tensegra.mechanics import solve_batch

        return partial(solve_batch, settings=self.settings, threads=threads)
