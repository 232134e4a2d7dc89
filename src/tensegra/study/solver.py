"""The study file's entry of the solver: how the paths of its runs are followed."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from pydantic import Field

from tensegra.study.entry import Count, Entry, Number, Positive

if TYPE_CHECKING:
    from tensegra.mechanics import Batch, PathSettings

__all__ = ["Solver", "SolverEntry"]

Solver: TypeAlias = Callable[..., "Batch"]
"""Takes a structure and the inputs of `solve_batch`, and returns the runs."""

Share: TypeAlias = Annotated[Number, Field(gt=0, lt=1)]


STEP_CONTROL = {"policy", "first_step", "smallest_step", "largest_move", "contraction", "max_steps"}
"""Settings of the adaptive procedure alone."""


class SolverEntry(Entry):
    """How the paths of all runs are followed; the keys are those of `tensegra.mechanics.PathSettings`.

    Parameters
    ----------
    path
        ``adaptive``, or ``stepped``: the paper's plain procedure, in steps of `increment`.
    policy
        Where the stable branch ends: ``settle`` into the equilibrium below, ``stop``, or ``trace`` the
        unstable branch.
    first_step, smallest_step, largest_move, contraction, max_steps
        Control of the adaptive steps.
    residual
        Relative residual at which an equilibrium is accepted.
    increment
        Largest relative change of a rest length in one step of the plain procedure.
    """

    path: Literal["adaptive", "stepped"] = "adaptive"
    policy: Literal["settle", "stop", "trace"] = "settle"
    first_step: Annotated[Positive, Field(le=1)] = 0.5
    smallest_step: Share = 2e-7
    largest_move: Positive = 0.15
    contraction: Share = 0.5
    max_steps: Count = 20_000
    residual: Share = 1e-9
    increment: Positive = 0.01

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
